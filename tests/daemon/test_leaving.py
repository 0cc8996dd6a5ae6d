"""Who goes away from the page's socket leaves nothing in motion."""

import asyncio
import json
from pathlib import Path

import pytest
from websockets.asyncio.client import connect

from daemon.profile import Profile
from daemon.service import Service
from tests.daemon.rigs import small_rig


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    """A rig whose slide takes long: 2 mm in each second of life."""
    return small_rig(tmp_path, velocity=2.0, time_scale=1.0)


async def test_a_lease_ends_with_its_socket_and_so_do_its_motions(service: Service, address: str) -> None:
    async with asyncio.timeout(60):
        async with connect(f"{address.replace('http', 'ws')}/api/v1/live") as socket:
            for command in ({"do": "lease", "owner": "anna"}, {"do": "jog", "axis": "slide", "distance": 90}):
                await socket.send(json.dumps({"id": 1} | command))
                while json.loads(await socket.recv())["type"] != "answer":
                    pass
            assert service.rig.axis("slide").moving
        while service.leases.current is not None or service.rig.axis("slide").moving:
            await service.rig.changed.wait()
    assert "cancelled before its target" in str(service.rig.axis("slide").last_error)
