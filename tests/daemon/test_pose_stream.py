"""The pose stream: a message for every reading, the newest for a slow reader, each problem once, never an old pose."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any, cast

import numpy as np
import pytest
from websockets.asyncio.client import ClientConnection, connect

from daemon.api import pose_stream
from daemon.rig import Devices, controller_owner
from daemon.rig.utc import rfc3339
from daemon.service import Service
from drivers.simulated import SimulatedController
from tests.daemon.calibrations import calibrate
from tests.daemon.motions import home_all, until
from tests.daemon.sockets import on_a_socket


@pytest.fixture
async def stream(service: Service) -> str:
    """The address of the stream of a calibrated rig, once it is served."""
    await home_all(service.rig)
    calibrate(service)
    return "/api/v1/pose/stream"


@pytest.fixture
async def address(service: Service) -> AsyncIterator[str]:
    async with on_a_socket(service) as address:
        yield address.replace("http", "ws")


async def receive(socket: ClientConnection) -> dict[str, Any]:
    message: dict[str, Any] = json.loads(await socket.recv())
    return message


async def test_every_reading_is_a_message(
    service: Service, address: str, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = service.rig
    monkeypatch.setattr(
        controller_owner, "POLL_PERIOD", 3600.0
    )  # the axes are read when this test asks for it
    await rig.fresh_snapshot(rig.clock.now())
    async with connect(address + stream) as socket:
        poses = [await receive(socket)]
        for _ in range(20):
            timestamp = (await rig.fresh_snapshot(rig.clock.now())).timestamp
            assert timestamp is not None
            while poses[-1]["timestamp"] < rfc3339(rig.utc.at(timestamp)):
                poses.append(await receive(socket))
    assert [pose["dropped"] for pose in poses] == [0] * len(poses)
    assert len(poses) > 20
    assert all(pose["covariance"] is not None for pose in poses)


async def test_a_slow_reader_gets_the_newest_and_is_told_what_it_missed(
    service: Service, stream: str
) -> None:
    rig, messages = service.rig, aiter(pose_stream.messages(service, None, stream, 0.0))
    assert json.loads(await anext(messages))["dropped"] == 0
    before = [axis.number for axis in rig.snapshot.axes]
    await until(rig, lambda snapshot: snapshot.axes[0].number >= before[0] + 7)
    pose = json.loads(await anext(messages))
    now = [axis.number for axis in rig.snapshot.axes]
    assert pose["dropped"] == max(np.subtract(now, before)) - 1 >= 6
    assert rig.snapshot.timestamp is not None
    assert pose["timestamp"] == rfc3339(rig.utc.at(rig.snapshot.timestamp))


async def test_who_asks_for_each_pose_gets_none_that_is_older_than_the_asking(
    service: Service, address: str, stream: str
) -> None:
    rig = service.rig
    async with connect(f"{address}{stream}?ask=true") as socket:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(socket.recv(), 0.1)
        await socket.send("next")
        until_then = rig.snapshot.axes[0].number + 100
        await until(rig, lambda snapshot: snapshot.axes[0].number >= until_then)
        assert (await receive(socket))["dropped"] == 0  # asked for before the client stood still
        for _ in range(3):
            assert rig.snapshot.timestamp is not None
            asked_at = rfc3339(rig.utc.at(rig.snapshot.timestamp))
            await socket.send("next")
            pose = await receive(socket)
            assert pose["timestamp"] >= asked_at
            assert "position" in pose


async def test_a_rate_leaves_readings_out(service: Service, address: str, stream: str) -> None:
    begin = asyncio.get_running_loop().time()
    async with connect(f"{address}{stream}?rate=10") as socket:
        poses = [await receive(socket) for _ in range(5)]
        taken = asyncio.get_running_loop().time() - begin
    assert taken > 0.39
    assert (
        sum(pose["dropped"] for pose in poses) > 0
    )  # a busy machine may read no more than that now and then


@pytest.mark.parametrize("rate", ["0", "-1", "often", "nan"])
async def test_a_rate_that_is_none_is_refused(service: Service, address: str, rate: str) -> None:
    with pytest.raises(Exception, match="422"):
        await connect(f"{address}/api/v1/pose/stream?rate={rate}")


async def test_a_loss_is_told_once_and_then_what_is_in_the_way(
    service: Service, devices: Devices, address: str, stream: str
) -> None:
    stage = cast(SimulatedController, devices.controllers["stage"])
    async with connect(address + stream) as socket:
        assert "position" in await receive(socket)
        stage.inject("lost")
        codes = []
        while "device_lost" not in codes:
            codes.append((await receive(socket)).get("code"))
        pan = service.rig.axis("pan").number
        await until(service.rig, lambda snapshot: snapshot.axis("pan").number > pan + 5)
        stage.repair()
        codes = [(await receive(socket)).get("code")]
        await service.rig.home("slide")
        pose = await receive(socket)
    assert codes == ["not_homed"]
    assert pose["dropped"] == 0


async def test_axes_that_fall_silent_are_told_of(
    service: Service, stream: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = aiter(pose_stream.messages(service, None, stream, 0.0))
    assert "position" in json.loads(await anext(messages))
    monkeypatch.setattr(service.rig, "age", lambda _: 2.5)
    assert json.loads(await anext(messages))["code"] == "reading_stale"
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(anext(messages), 0.1)


async def test_a_client_that_leaves_is_noticed_while_there_is_nothing_to_send(
    service: Service, address: str
) -> None:
    async with connect(f"{address}/api/v1/pose/stream") as socket:
        assert (await receive(socket))["code"] == "not_calibrated"
        assert service.streams.open == 1
    while service.streams.open:
        await service.rig.changed.wait()
