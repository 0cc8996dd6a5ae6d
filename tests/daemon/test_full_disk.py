"""A full disk ends a run cleanly: what was measured stays, the pose is served, and with room the run goes on."""

import contextlib
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from calib import load_session
from daemon.errors import StoreError
from daemon.procedure.event_file import EventFile
from daemon.procedure.event_log import read_events
from daemon.profile import Profile
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState, Store
from tests.daemon.full_disks import in_namespace
from tests.daemon.runs import finish, of
from tests.daemon.snapshots import restore_snapshot

FULL = Path("/dev/full")
"""Takes no byte, in the words of a full disk."""


@pytest.mark.parametrize(
    ("name", "views"),
    [("frames/.0002.png", 2), (".calibration.json", 10)],
)
async def test_a_file_that_the_disk_does_not_take_ends_the_run_and_no_more(
    service: Service, name: str, views: int
) -> None:
    run = await service.runs.start()
    folder = service.store.session_folder(run)
    (folder / "frames").mkdir(parents=True)
    (folder / f"{name}.tmp").symlink_to(FULL)
    run, events = await finish(service, run)
    assert run.state is RunState.FAILED
    assert run.error is not None
    file = name.replace(".", "", 1)
    assert f"the disk is full: {folder / file} could not be written: make room, then resume" in run.error
    assert run == await service.store.run(run.id)
    assert len(of(events, "view")) == views
    assert len(load_session(folder).views) == views

    if views == 10:
        run, again = await finish(service, await service.runs.resume(run.id))
        assert run.state is RunState.SUCCEEDED
        assert again[: len(events)] == events


def test_lines_that_the_disk_did_not_take_come_first_when_it_does(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "events.jsonl"
    file = EventFile(path)
    file.append("one")
    path.rename(tmp_path / "kept")
    path.symlink_to(FULL)
    file.append("two")
    file.append("three")
    (tmp_path / "kept").replace(path)
    file.append("four")
    assert path.read_text() == "one\ntwo\nthree\nfour\n"
    assert caplog.messages == [f"{path}: events cannot be written: No space left on device"]


async def test_a_run_goes_on_while_its_events_cannot_be_written(service: Service) -> None:
    run = await service.runs.start()
    folder = service.store.session_folder(run)
    (folder / "frames").mkdir(parents=True)
    (folder / "events.jsonl").symlink_to(FULL)
    async for event in service.runs.events(run.id):
        if event.type == "view" and event.view == 0:
            (folder / "events.jsonl").unlink()
        if event.type == "view" and event.view == 1:
            await service.runs.cancel(run.id)
    run, events = await finish(service, run)
    assert len(of(events, "view")) >= 2
    assert read_events(folder) == events


async def test_an_end_that_the_store_did_not_take_is_stored_before_the_next_run(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def full(*_: object, **__: object) -> None:
        raise StoreError("the database is full")

    run = await service.runs.start()
    with monkeypatch.context() as patch:
        patch.setattr(service.store, "change_run", full)
        cancelled = await service.runs.cancel(run.id)
        assert cancelled.state is RunState.CANCELLED
        assert (await service.store.run(run.id)).state is RunState.RUNNING
        with pytest.raises(StoreError):
            await service.runs.start()
        assert service.leases.current is None
    second = await service.runs.start()
    assert (await service.store.run(run.id)).error == cancelled.error
    assert (await service.store.run(run.id)).state is RunState.CANCELLED
    await service.runs.cancel(second.id)


async def test_a_daemon_that_starts_on_a_full_disk_serves_the_pose(
    profile: Profile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def full(_: object) -> None:
        raise StoreError("the disk is full: make room")

    restore_snapshot(1, tmp_path)
    (unfinished,) = (run for run in await _runs(tmp_path) if not run.state.over)
    room = Store.interrupt_unfinished
    monkeypatch.setattr(Store, "interrupt_unfinished", full)
    async with running_service(profile, tmp_path) as service:
        assert service.poses.calibration_id is not None
        assert "are not marked so: the disk is full: make room" in caplog.text
        with pytest.raises(StoreError):
            await service.runs.start()
        monkeypatch.setattr(Store, "interrupt_unfinished", room)
        await service.runs.cancel((await service.runs.start()).id)
        assert (await service.runs.get(unfinished.id)).state is RunState.INTERRUPTED


async def _runs(data: Path) -> Sequence[RunRecord]:
    store = await Store.open(data)
    try:
        return await store.runs()
    finally:
        await store.close()


@pytest.fixture
def little_disk(tmp_path: Path) -> Path:
    """A folder on which a namespace of one's own may mount a disk."""
    folder = tmp_path / "disk"
    folder.mkdir()
    with contextlib.suppress(FileNotFoundError):
        tried = ["unshare", "-Urm", "mount", "-t", "tmpfs", "none", str(folder)]
        if subprocess.run(tried, capture_output=True, check=False).returncode == 0:
            return folder
    pytest.skip("no disk can be mounted here, not even in a namespace")


def test_a_disk_that_fills_at_a_random_moment_loses_nothing(little_disk: Path) -> None:
    found = in_namespace(little_disk, count=1, seed=1)
    assert found.returncode == 0, found.stderr
    assert "the disk is full" in found.stdout
