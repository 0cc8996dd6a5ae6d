"""Runs on a disk that fills at a random moment: `python -m tests.daemon.full_disks COUNT`.

The disk is a little tmpfs in a namespace of its own, filled by a file from the moment of an event on. Nothing but the
view in flight may be lost, the pose is served on, and with room again the run is resumed to its end.
"""

import asyncio
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

from calib import load_session
from daemon.procedure import RunEvent
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from tests.daemon.rigs import small_rig
from tests.daemon.runs import of
from tests.daemon.snapshots import restore_snapshot

ROOM = 8 * 2**20
EVENTS = 35
"""About how many a run of the small rig has."""


def in_namespace(folder: Path, count: int, seed: int) -> "subprocess.CompletedProcess[str]":
    """Run this module in a namespace in which `folder` is a little disk."""
    mount = f'mount -t tmpfs -o size={ROOM} none "$1" && shift && exec "$@"'
    module = [sys.executable, "-m", "tests.daemon.full_disks", str(count), str(seed), str(folder)]
    return subprocess.run(
        ["unshare", "-Urm", "sh", "-c", mount, "sh", str(folder), *module],
        capture_output=True,
        text=True,
        check=False,
    )


def fill(ballast: Path, left: int) -> None:
    """Take all room of the disk but `left` bytes."""
    with ballast.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            file.truncate(max(0, file.tell() - left))


async def one(folder: Path, rng: random.Random) -> str:
    """Let the disk fill at a random moment of a run, and return what was found then."""
    data, ballast = folder / "data", folder / "ballast"
    data.mkdir()
    restore_snapshot(1, data)
    moment, left = rng.randrange(EVENTS), rng.choice([0, 0, 4096, 65536, 200_000])
    async with running_service(small_rig(folder), data) as service:
        active = service.poses.calibration_id
        run = await service.runs.start()
        told: list[RunEvent] = []
        async for event in service.runs.events(run.id):
            told.append(event)
            if len(told) == moment + 1:
                await asyncio.to_thread(fill, ballast, left)
        run = await service.runs.get(run.id)
        views = check(service, run, told)
        if run.state is RunState.SUCCEEDED:
            return f"event {moment}, {left} bytes left: the run had what it needed"
        assert "the disk is full" in (run.error or ""), run.error
        assert "make room" in (run.error or ""), run.error
        assert service.poses.calibration_id == active
        service.poses.at([[20.0, 1.0]])
        found = f"event {moment}, {left} bytes left: {views} views; {run.error}"
        ballast.unlink()
        await service.runs.resume(run.id)
        again = [event async for event in service.runs.events(run.id)]
        run = await service.runs.get(run.id)
        assert run.state is RunState.SUCCEEDED, run.error
        assert again[: len(told)] == told
        check(service, run, again)
    async with running_service(small_rig(folder), data) as service:
        assert (await service.runs.get(run.id)).state is RunState.SUCCEEDED
        assert service.poses.calibration_id == run.calibration_id
        assert [event async for event in service.runs.events(run.id)] == again
    return found


def check(service: Service, run: RunRecord, told: list[RunEvent]) -> int:
    """Return how many views are on disk, which must be those that were told of, each with its picture."""
    folder = service.store.session_folder(run)
    if not (folder / "session.json").exists():
        assert not of(told, "view")
        return 0
    session = load_session(folder)
    views = [*session.views, *session.set_aside]
    assert {event.image for event in of(told, "view")} <= {view.image for view in views}
    assert all(cv2.imread(str(folder / name)) is not None for view in views for name in view.frames)
    return len(views)


def main(count: int, seed: int, folder: Path) -> None:
    """Print what was found each time."""
    for number in range(seed, seed + count):
        inner = folder / str(number)
        inner.mkdir()
        print(f"{number}: {asyncio.run(one(inner, random.Random(number)))}", flush=True)  # noqa: T201
        shutil.rmtree(inner)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
    else:
        with tempfile.TemporaryDirectory() as name:
            found = in_namespace(Path(name), int(sys.argv[1]), 0)
        print(found.stdout, found.stderr if found.returncode else "")  # noqa: T201
        sys.exit(found.returncode)
