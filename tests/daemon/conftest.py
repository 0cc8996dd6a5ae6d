"""A small simulated rig in operation, in process, for each test that asks."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

import calib
from daemon.api import create_app
from daemon.profile import Profile
from daemon.rig import Devices, Rig, make_devices
from daemon.service import Service, running_service
from tests.daemon.rigs import small_rig
from tests.daemon.sockets import on_a_socket


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    return small_rig(tmp_path)


@pytest.fixture
def devices(profile: Profile) -> Devices:
    return make_devices(profile)


@pytest.fixture
async def rig(profile: Profile, devices: Devices) -> AsyncIterator[Rig]:
    rig = await Rig.open(profile, devices)
    yield rig
    await rig.close()
    assert_nothing_left()


@pytest.fixture
async def service(profile: Profile, devices: Devices, tmp_path: Path) -> AsyncIterator[Service]:
    async with running_service(profile, tmp_path / "data", devices) as service:
        yield service
    assert_nothing_left()


@pytest.fixture
async def client(service: Service) -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(create_app(service))
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
        yield client


@pytest.fixture
async def address(service: Service) -> AsyncIterator[str]:
    """Where the service is served on a real socket."""
    async with on_a_socket(service) as address:
        yield address


@pytest.fixture
async def http(address: str) -> AsyncIterator[httpx.AsyncClient]:
    """A client over that socket, which shows no key of its own accord."""
    async with httpx.AsyncClient(base_url=f"{address}/api/v1", timeout=30) as client:
        yield client


@pytest.fixture
def solver(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """While it is not set, whoever solves says that they look, and goes no further."""
    free, solve = threading.Event(), calib.solve
    free.set()

    def held(*given: Any, progress: Callable[[str], None], **more: Any) -> Any:
        if not free.is_set():
            progress("looking")
        free.wait()
        return solve(*given, progress=progress, **more)

    monkeypatch.setattr(calib, "solve", held)
    yield free
    free.set()


def assert_nothing_left() -> None:
    """No task of the daemon's outlives it."""
    left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
    assert not [task for task in left if "owner of" in task.get_name() or "run " in task.get_name()], left
