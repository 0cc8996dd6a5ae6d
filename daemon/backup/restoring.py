"""From a backup to a data folder that has nothing in it, or whose content is moved aside."""

import shutil
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from calib.durable_files import flush, make_folder_durably
from daemon.backup.archive import Backup, open_backup
from daemon.backup.manifest import SESSIONS
from daemon.errors import BackupError
from daemon.store.database import DATABASE
from daemon.store.folder_lock import lock_folder
from daemon.store.migrations import schema_version

TEMPORARY = ".restored.tmp"


def restore_backup(file: Path, data: Path, *, move_aside: bool = False) -> Path | None:
    """Put what is in the backup `file` into the folder `data`, all of it or nothing.

    With `move_aside`, what there is goes into a folder of its own in `data`, which is returned.

    Raises BackupError where the backup is damaged or unsafe, of a newer activecam, or `data` has something in it, and
    StoreError while a daemon uses it.
    """
    with open_backup(file) as backup, lock_folder(data):
        try:
            # Beside a database in use lie its log and an index of that, which go with it.
            there = sorted(
                path for path in data.iterdir() if path.name == SESSIONS or path.name.startswith(DATABASE)
            )
            if there and not move_aside:
                raise BackupError(
                    f"{data}: there is {there[0].name} in it already: choose an empty --data, "
                    "or give --force to have what there is moved aside"
                )
            temporary = data / TEMPORARY
            shutil.rmtree(temporary, ignore_errors=True)
            try:
                _extract(backup, temporary)
                _require_usable(file, temporary / DATABASE)
                aside = _move_aside(data, there) if there else None
                # The database last: without it, nobody takes the sessions for all there is.
                for name in (SESSIONS, DATABASE):
                    if (temporary / name).exists():
                        (temporary / name).rename(data / name)
                        flush(data)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
        except OSError as error:
            raise BackupError(f"{data}: the backup could not be restored: {error.strerror}") from error
    return aside


def _extract(backup: Backup, folder: Path) -> None:
    for path in backup.manifest.files:
        target = folder / path
        make_folder_durably(target.parent)
        backup.extract(path, target)
        flush(target)
    for inner in [folder, *(path for path in folder.rglob("*") if path.is_dir())]:
        flush(inner)


def _require_usable(file: Path, database: Path) -> None:
    """Raise BackupError unless the database is in order, and of a schema that this activecam knows."""
    try:
        with closing(sqlite3.connect(database)) as connection:
            (state,) = connection.execute("PRAGMA integrity_check").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        state, version = str(error), 0
    if state != "ok":
        raise BackupError(f"{file}: its database is damaged: {state}")
    if version > schema_version():
        raise BackupError(f"{file}: made by a newer activecam (schema {version}): install that version")


def _move_aside(data: Path, there: list[Path]) -> Path:
    aside = data / f"before-{datetime.now(UTC):%Y%m%d-%H%M%S}"
    make_folder_durably(aside)
    for path in there:
        path.rename(aside / path.name)
    flush(aside)
    flush(data)
    return aside
