"""From another machine, here a network namespace: with a viewer's key the pose is read, and nothing else done."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from daemon.access.roles import Role
from tests.daemon.access.commands import ALL, command
from tests.daemon.access.keys import bearer
from tests.daemon.processes import daemon_process
from tests.daemon.rigs import write_profile
from tests.daemon.snapshots import restore_snapshot


def run(*words: str) -> str:
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return done.stdout


@pytest.fixture
def other() -> Iterator[tuple[str, str]]:
    """The name of a namespace with a cable to this one, and this one's address at the cable."""
    name, near, far = (f"{letter}{os.getpid()}" for letter in ("activecam", "vethn", "vethf"))
    net = f"198.18.{os.getpid() % 250}"  # a range for tests, which is nobody's
    inside = ("ip", "netns", "exec", name, "ip")
    with ExitStack() as stack:
        try:
            run("ip", "netns", "add", name)
            stack.callback(run, "ip", "netns", "del", name)
            run("ip", "link", "add", near, "type", "veth", "peer", "name", far, "netns", name)
            run("ip", "addr", "add", f"{net}.1/30", "dev", near)
            run("ip", "link", "set", near, "up")
            run(*inside, "addr", "add", f"{net}.2/30", "dev", far)
            run(*inside, "link", "set", far, "up")
        except FileNotFoundError:
            pytest.skip("there is no command 'ip' to make a network namespace with")
        except subprocess.CalledProcessError as error:
            pytest.skip(f"a network namespace cannot be made here: {error.stderr.strip()}")
        yield name, f"{net}.1"


@pytest.fixture
def keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> dict[Role, str]:
    """A key of each role to a folder with a calibration of the small rig."""
    (tmp_path / "data").mkdir()
    restore_snapshot(1, tmp_path / "data")
    made = {}
    for role in (Role.VIEWER, Role.ADMIN):
        assert command("key", "add", role, "--role", role, "--data", tmp_path / "data") == 0
        made[role] = capsys.readouterr().out.strip()
    return made


@pytest.fixture
def served(tmp_path: Path, other: tuple[str, str], keys: dict[Role, str]) -> Iterator[str]:
    """The address of a daemon that serves the other machine."""
    profile = write_profile(tmp_path, max_reading_age="1000 s")
    with daemon_process(profile, tmp_path / "data", "--host", other[1]) as daemon:
        yield daemon.address
    assert "CAN READ THE KEYS" in daemon.log
    assert not any(key in daemon.log for key in keys.values())


def test_a_viewer_elsewhere_reads_the_pose_and_does_nothing_else(
    served: str, other: tuple[str, str], keys: dict[Role, str]
) -> None:
    elsewhere = ["ip", "netns", "exec", other[0], sys.executable, "-m", "tests.daemon.access.asking"]
    with httpx.Client(base_url=f"{served}/api/v1", headers=bearer(keys[Role.ADMIN]), timeout=30) as chief:
        lease = {"X-Lease": chief.post("/lease", json={"owner": "chief"}).json()["token"]}
        for axis in ("slide", "pan"):
            assert chief.post(f"/axes/{axis}/home?wait=true", headers=lease).status_code == 200
        assert chief.delete("/lease", headers=lease).status_code == 204
        before = [chief.get(path).json() for path in ("/audit", "/runs", "/calibrations/current", "/pose")]

        answers, strangers = json.loads(run(*elsewhere, served, keys[Role.VIEWER], *ALL))
        assert answers["GET /api/v1/pose"] == [200, None]
        assert answers["WS /api/v1/pose/stream"] == [101, None]
        refused = {route for route, (_, code) in answers.items() if code == "role_required"}
        assert refused == {route for route, role in ALL.items() if role in {Role.OPERATOR, Role.ADMIN}}

        after = [chief.get(path).json() for path in ("/audit", "/runs", "/calibrations/current", "/pose")]
        assert after[:3] == before[:3]
        assert after[3]["position"] == before[3]["position"]
        rig = chief.get("/rig").json()
        assert (rig["lease"], rig["moving"], rig["stop"]["latched"]) == (None, False, False)

        let_in = {route for route, answer in strangers.items() if answer != [401, "key_required"]}
        assert let_in == {route for route, role in ALL.items() if role is None}
        here = httpx.get(f"{served}/api/v1/pose")
        assert (here.status_code, here.json()["code"]) == (401, "key_required")
