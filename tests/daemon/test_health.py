"""Whether the daemon works at all, and whether it can be used: for whoever keeps it running."""

import asyncio
import sqlite3
import threading
from contextlib import closing
from pathlib import Path
from typing import cast

import httpx
import pytest

from daemon.operation import store_check
from daemon.rig import Devices, device_owner
from daemon.service import Service
from drivers.axis import AxisState
from drivers.errors import DeviceTimeoutError
from drivers.simulated import SimulatedCamera, SimulatedController
from tests.daemon.motions import until


async def ready(client: httpx.AsyncClient) -> tuple[int, list[str]]:
    answer = await client.get("/health/ready")
    document = answer.json()
    assert document["ready"] == (answer.status_code == 200)
    return answer.status_code, document["problems"]


async def test_it_lives_and_is_ready(client: httpx.AsyncClient) -> None:
    live = await client.get("/health/live")
    assert (live.status_code, live.json()) == (200, {"live": True})
    assert await ready(client) == (200, [])


async def test_a_lost_device_is_in_the_way_of_use_not_of_life(
    service: Service, devices: Devices, client: httpx.AsyncClient
) -> None:
    cast(SimulatedController, devices.controllers["head"]).inject("lost")
    await until(service.rig, lambda rig: rig.problems != [])
    status, [sentence] = await ready(client)
    assert (status, "controller 'head' is lost" in sentence) == (503, True)
    assert (await client.get("/health/live")).status_code == 200


async def test_a_store_that_takes_nothing_is_in_the_way(
    client: httpx.AsyncClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_check, "PATIENCE", 0.05)
    monkeypatch.setattr(store_check, "KEPT", 0.0)
    with closing(sqlite3.connect(tmp_path / "data" / "activecam.db")) as other:
        other.execute("BEGIN IMMEDIATE")
        status, [sentence] = await ready(client)
        assert (status, "has taken nothing for 0.05 s" in sentence) == (503, True)
    monkeypatch.setattr(store_check, "PATIENCE", 30.0)
    assert await ready(client) == (200, [])


async def test_whoever_asks_how_often_the_store_is_written_to_once(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = 0
    write = service.store.check_writable

    async def counted() -> None:
        nonlocal written
        written += 1
        await write()

    monkeypatch.setattr(service.store, "check_writable", counted)
    monkeypatch.setattr(store_check, "KEPT", 3600.0)
    assert await asyncio.gather(*(ready(client) for _ in range(20))) == [(200, [])] * 20
    assert await ready(client) == (200, [])
    assert written == 1
    monkeypatch.setattr(store_check, "KEPT", 0.0)
    assert await ready(client) == (200, [])
    assert written == 2


async def test_a_store_that_fails_is_in_the_way(service: Service, client: httpx.AsyncClient) -> None:
    await service.store._database.transact(
        lambda connection: connection.exec_driver_sql("PRAGMA query_only = ON")
    )
    status, [sentence] = await ready(client)
    assert (status, "readonly database" in sentence) == (503, True)


async def test_a_driver_that_hangs_is_noticed(
    service: Service, devices: Devices, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    released = threading.Event()

    async def hang() -> AxisState:
        await asyncio.to_thread(released.wait)  # as a driver's thread in a call that does not return
        raise DeviceTimeoutError("it took too long")

    monkeypatch.setattr(device_owner, "LONGEST_WORK", 0.05)
    monkeypatch.setattr(devices.controllers["head"].axes["pan"], "read", hang)
    while not service.rig.hung:
        await service.rig.changed.wait()
    live = await client.get("/health/live")
    assert (live.status_code, live.json()) == (503, {"live": False})
    assert any("the driver of controller 'head' has hung for" in sentence for sentence in service.rig.hung)
    monkeypatch.undo()
    released.set()
    while service.rig.hung:
        await service.rig.changed.wait()
    assert (await client.get("/health/live")).status_code == 200


async def test_a_device_that_cannot_be_let_go_needs_a_restart(
    service: Service, devices: Devices, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = cast(SimulatedCamera, devices.camera)

    async def stuck() -> None:
        raise DeviceTimeoutError("camera 'main' has not let go for 20 s: unplug it, or restart the program")

    with monkeypatch.context() as patch:
        patch.setattr(camera, "close", stuck)
        camera.inject("lost")
        with pytest.raises(Exception, match="gone"):
            await service.rig.frame()
        while not service.rig.hung:
            await service.rig.changed.wait()
    assert service.rig.hung == ["camera 'main' has not let go for 20 s: unplug it, or restart the program"]
    camera.repair()
    while service.rig.hung:
        await service.rig.changed.wait()
