"""The live picture over its socket: what is asked for, made once for all, with the target in it."""

import asyncio
import json
import struct
from typing import Any

import cv2
import numpy as np
import pytest
from websockets.asyncio.client import ClientConnection, connect

from daemon import live_view
from daemon.live_detection import LiveDetection
from daemon.rig import Devices
from daemon.service import Service
from drivers.simulated import SimulatedCamera


@pytest.fixture
def camera(address: str) -> str:
    """The socket's address."""
    return f"{address.replace('http', 'ws')}/api/v1/camera/live"


async def next_picture(socket: ClientConnection) -> tuple[dict[str, Any], bytes]:
    await socket.send("next")
    return await received(socket)


async def received(socket: ClientConnection) -> tuple[dict[str, Any], bytes]:
    message = await socket.recv()
    assert isinstance(message, bytes)
    (length,) = struct.unpack(">I", message[:4])
    return json.loads(message[4 : 4 + length]), message[4 + length :]


async def test_a_picture_comes_with_what_is_seen_in_it(camera: str) -> None:
    async with connect(f"{camera}?detect=true") as socket:
        head, jpeg = await next_picture(socket)
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture.shape == (head["height"], head["width"]) == (360, 480)
    seen = head["detection"]
    assert (seen["sequence"], seen["found"], len(seen["ids"])) == (head["sequence"], True, 20)
    # Where a disk is said to be, the picture is dark.
    darkest = [picture[round(y), round(x)] for x, y in seen["pixels"]]
    assert max(darkest) < picture.max() / 2


async def test_none_is_looked_for_unasked_and_none_is_sent_unasked(camera: str, service: Service) -> None:
    async with connect(camera) as socket:
        first, _ = await next_picture(socket)
        assert first["detection"] is None
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.3):
                await socket.recv()
        second, _ = await next_picture(socket)
        assert second["sequence"] > first["sequence"]


async def test_all_who_look_share_one_look(
    camera: str, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, newest = 0, LiveDetection.newest

    async def counted(self: LiveDetection) -> Any:
        nonlocal looks
        looks += 1
        return await newest(self)

    monkeypatch.setattr(LiveDetection, "newest", counted)
    monkeypatch.setattr(live_view, "PERIOD", 3600.0)  # none of them comes too late for the look
    views = [service.view.after(None, detect=True) for _ in range(4)]
    seen = await asyncio.gather(*views)
    assert len({look.picture.sequence for look in seen}) == looks == 1


async def test_a_camera_that_is_lost_is_told_once_and_its_pictures_come_again(
    camera: str, devices: Devices
) -> None:
    assert isinstance(devices.camera, SimulatedCamera)
    async with connect(camera) as socket:
        await next_picture(socket)
        devices.camera.inject("lost")
        head: dict[str, Any] = {}
        while "code" not in head:
            head, jpeg = await next_picture(socket)
        assert (head["code"], jpeg) == ("device_lost", b"")
        devices.camera.repair()
        again, jpeg = await received(socket)
        assert "code" not in again
        assert jpeg.startswith(b"\xff\xd8")
