"""What is kept can be put into one file, and back: whole, or not at all."""

import asyncio
import hashlib
import json
import random
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import pytest

from calib import load_session
from daemon.backup import make_backup, restore_backup
from daemon.cli.main import main
from daemon.errors import BackupError, StoreError
from daemon.profile import Profile
from daemon.service import running_service
from daemon.store import RunState, Store
from tests.daemon.snapshots import VERSIONS, dump, restore_snapshot


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with a database and two sessions, one of them being written."""
    folder = tmp_path / "data"
    for name in ("monday", "tuesday"):
        (folder / "sessions" / name / "frames").mkdir(parents=True)
        (folder / "sessions" / name / "session.json").write_text(f'{{"of": "{name}"}}')
        (folder / "sessions" / name / "frames" / "0000.png").write_bytes(name.encode() * 500)
    (folder / "sessions" / "tuesday" / "frames" / ".0001.png.tmp").write_bytes(b"half a pic")
    restore_snapshot(VERSIONS[-1], folder)
    return folder


def content(data: Path) -> dict[str, bytes | str]:
    files = {str(path.relative_to(data)): path for path in (data / "sessions").rglob("*") if path.is_file()}
    kept = {name: path.read_bytes() for name, path in files.items() if not name.endswith(".tmp")}
    return {"database": dump(data), **kept}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


async def test_what_was_in_it_comes_back(data: Path, tmp_path: Path) -> None:
    store = await Store.open(data)  # as a daemon has it
    file = tmp_path / "monday.zip"
    assert await asyncio.to_thread(make_backup, data, file) == 5
    await store.close()
    assert restore_backup(file, tmp_path / "new" / "data") is None
    assert content(tmp_path / "new" / "data") == content(data)
    assert names(tmp_path) == ["data", "monday.zip", "new"]


async def test_a_backup_in_the_middle_of_a_run_has_every_picture_of_its_views(
    profile: Profile, tmp_path: Path
) -> None:
    file = tmp_path / "backup.zip"
    async with running_service(profile, tmp_path / "data") as service:
        run = await service.runs.start()
        async for event in service.runs.events(run.id):
            if event.type == "view" and event.view == 2:
                await asyncio.to_thread(make_backup, tmp_path / "data", file)
                break
        await service.runs.cancel(run.id)
    restore_backup(file, tmp_path / "restored")
    session = load_session(tmp_path / "restored" / run.session)
    assert len(session.views) >= 3
    assert all((session.folder / name).is_file() for view in session.views for name in view.frames)
    store = await Store.open(tmp_path / "restored")
    assert [found.id for found in await store.interrupt_unfinished()] == [run.id]
    assert (await store.run(run.id)).state is RunState.INTERRUPTED
    await store.close()


def test_what_is_there_is_not_written_over(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    make_backup(data, file)
    (data / "sessions" / "monday" / "session.json").write_text("changed since")
    now = content(data)
    with pytest.raises(BackupError, match=r"there is activecam\.db in it already: choose an empty --data"):
        restore_backup(file, data)
    assert content(data) == now
    aside = restore_backup(file, data, move_aside=True)
    assert aside is not None
    assert content(aside) == now
    assert content(data) != now


async def test_a_folder_in_use_is_left_alone(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    make_backup(data, file)
    store = await Store.open(data)
    with pytest.raises(StoreError, match="another activecam uses this data folder"):
        restore_backup(file, data, move_aside=True)
    await store.close()


def test_a_damaged_backup_restores_what_was_in_it_or_nothing(data: Path, tmp_path: Path) -> None:
    file, damaged = tmp_path / "backup.zip", tmp_path / "damaged.zip"
    make_backup(data, file)
    whole, before = file.read_bytes(), content(data)
    rng = random.Random(6)
    refused: list[Path] = []
    for number in range(60):
        place = rng.randrange(len(whole))
        flipped = bytes([whole[place] ^ (1 << rng.randrange(8))])
        cut = number % 4 == 0
        damaged.write_bytes(whole[:place] if cut else whole[:place] + flipped + whole[place + 1 :])
        into = tmp_path / f"data-{number}"
        try:
            restore_backup(damaged, into)
        except BackupError:
            refused.append(into)
        else:  # a time stamp, which nobody needs
            assert content(into) == before
    assert len(refused) > 50
    for into in refused:
        assert {path.name for path in into.glob("*")} <= {"activecam.lock"}


def pack(file: Path, entries: dict[str, bytes], *, compression: int = ZIP_STORED, **changes: Any) -> None:
    """Write a backup as somebody might who means no good."""
    sums = {name: hashlib.sha256(data).hexdigest() for name, data in entries.items()}
    manifest = {
        "format": "activecam.backup/1",
        "version": "0",
        "made_at": datetime.now(UTC).isoformat(),
        "files": sums,
    }
    with ZipFile(file, "w", compression) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
        archive.writestr("manifest.json", json.dumps(manifest | changes))


@pytest.mark.parametrize(
    "path",
    [
        "../outside",
        "/outside",
        "sessions/../../outside",
        "sessions/./a",
        "sessions//a",
        "sessions",
        "sessions/",
        "sessions\\..\\..\\outside",
        "activecam.lock",
        "anything else",
    ],
)
def test_a_path_that_leads_elsewhere_is_refused(tmp_path: Path, path: str) -> None:
    file = tmp_path / "inner" / "backup.zip"
    file.parent.mkdir()
    pack(file, {"activecam.db": b"", path: b"not to be written"})
    with pytest.raises(BackupError, match="is not a path of a data folder"):
        restore_backup(file, tmp_path / "inner" / "data")
    assert not [found for found in tmp_path.rglob("*") if found.name == "outside"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"format": "activecam.backup/9"}, "format: input should be 'activecam.backup/1'"),
        ({"files": {}}, "its files are not those that it lists"),
        ({"files": {"activecam.db": "0" * 64}}, "activecam.db is not what was put in"),
        ({}, "its database is damaged"),
    ],
)
def test_what_does_not_fit_together_is_refused(tmp_path: Path, change: dict[str, Any], reason: str) -> None:
    pack(tmp_path / "backup.zip", {"activecam.db": b"this is no database" * 100}, **change)
    with pytest.raises(BackupError, match=reason):
        restore_backup(tmp_path / "backup.zip", tmp_path / "data")
    assert [path.name for path in (tmp_path / "data").glob("*")] in ([], ["activecam.lock"])


def test_a_backup_that_would_grow_is_refused(tmp_path: Path) -> None:
    pack(tmp_path / "backup.zip", {"activecam.db": bytes(10**6)}, compression=ZIP_DEFLATED)
    with pytest.raises(BackupError, match="packed otherwise"):
        restore_backup(tmp_path / "backup.zip", tmp_path / "data")


def test_a_backup_by_a_newer_activecam_is_refused(data: Path, tmp_path: Path) -> None:
    with closing(sqlite3.connect(data / "activecam.db")) as database:
        database.execute("PRAGMA user_version = 99")
    make_backup(data, tmp_path / "backup.zip")
    with pytest.raises(BackupError, match="newer activecam"):
        restore_backup(tmp_path / "backup.zip", tmp_path / "restored")


def test_a_backup_that_does_not_come_out_right_takes_no_ones_place(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "backup.zip"
    make_backup(data, file)
    before = file.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("daemon.backup.making.put_in_place", full)
    with pytest.raises(BackupError, match=r"could not be written: No space left on device"):
        make_backup(data, file)
    assert file.read_bytes() == before
    assert names(tmp_path) == ["backup.zip", "data"]


def test_the_commands(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "backup.zip"
    for arguments, status, said in (
        (["backup", str(file), "--data", str(tmp_path)], 1, "there is no activecam.db in it"),
        (["backup", str(file), "--data", str(data)], 0, "5 files of"),
        (["restore", str(file), "--data", str(data)], 1, "give --force"),
        (["restore", str(file), "--data", str(data), "--force"], 0, "before-"),
        (["restore", str(tmp_path / "none.zip")], 1, "there is no such file"),
        (["restore", str(data / "activecam.db")], 1, "the backup is damaged, or none"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        told = capsys.readouterr()
        assert ended.value.code == status
        assert said in (told.err if status else told.out)
