"""A small rig that asks for keys, and a key of each role."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from daemon.access.keys import make_key
from daemon.access.roles import Role
from daemon.profile import Profile
from daemon.rig import Devices
from daemon.service import Service, running_service
from daemon.store import Store
from tests.daemon.sockets import on_a_socket


@pytest.fixture
async def secrets(tmp_path: Path) -> dict[Role, str]:
    """The keys themselves, by role; each is named as its role is."""
    made = {role: make_key(role.value, role) for role in Role}
    store = await Store.open(tmp_path / "data")
    for _, key in made.values():
        await store.keys.add(key)
    await store.close()
    return {role: secret for role, (secret, _) in made.items()}


@pytest.fixture
async def guarded(
    profile: Profile, devices: Devices, tmp_path: Path, secrets: dict[Role, str]
) -> AsyncIterator[Service]:
    async with running_service(profile, tmp_path / "data", devices, keys_asked=True) as service:
        yield service


@pytest.fixture
async def address(guarded: Service) -> AsyncIterator[str]:
    """Where it is served on a real socket."""
    async with on_a_socket(guarded) as address:
        yield address


@pytest.fixture
def flowing(guarded: Service, address: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """Where it is served, with something to send at each new reading."""
    monkeypatch.setattr(guarded.poses, "now", lambda camera: b"{}")
    return address
