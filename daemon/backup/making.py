"""From a data folder to a backup, while a daemon may be using it."""

import hashlib
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from zipfile import ZIP_STORED, ZipFile, ZipInfo

from calib.durable_files import put_in_place
from daemon.backup.archive import CHUNK, open_backup
from daemon.backup.manifest import NAME, SESSIONS, Manifest
from daemon.errors import BackupError
from daemon.session_files import session_files
from daemon.store.copies import copy_database
from daemon.store.database import DATABASE


def make_backup(data: Path, file: Path) -> int:
    """Write what is in the data folder into `file`, read it again, and return how many files are in it.

    `file` is there when all of it has been found in order, and is on disk then. The database comes first, so that every
    session that it knows of follows; of a session its list of views, so that their pictures do.

    Raises BackupError and StoreError; what `file` held before stays.
    """
    if not (data / DATABASE).is_file():
        raise BackupError(f"{data}: there is no {DATABASE} in it: give the --data of the daemon")
    try:
        with tempfile.TemporaryDirectory(prefix=".activecam-backup-", dir=file.parent) as name:
            written = Path(name) / "backup.zip"
            copy_database(data / DATABASE, Path(name) / DATABASE)
            with ZipFile(written, "w", ZIP_STORED) as archive:
                files = {DATABASE: _put(archive, Path(name) / DATABASE, DATABASE)}
                for path in _session_files(data):
                    inside = path.relative_to(data).as_posix()
                    files[inside] = _put(archive, path, inside)
                manifest = Manifest(version=version("activecam"), made_at=datetime.now(UTC), files=files)
                archive.writestr(NAME, manifest.model_dump_json(indent=1))
            with open_backup(written) as backup:
                backup.check()
            put_in_place(written, file)
    except OSError as error:
        raise BackupError(f"{file}: the backup could not be written: {error.strerror}") from error
    return len(files)


def _session_files(data: Path) -> Iterator[Path]:
    for session in sorted((data / SESSIONS).glob("*")):
        yield from session_files(session)


def _put(archive: ZipFile, path: Path, inside: str) -> str:
    """Copy a file into `archive` and return the SHA-256 of what was copied."""
    digest = hashlib.sha256()
    with (
        path.open("rb") as source,
        archive.open(
            ZipInfo.from_file(path, inside, strict_timestamps=False), "w", force_zip64=True
        ) as target,
    ):
        while chunk := source.read(CHUNK):
            digest.update(chunk)
            target.write(chunk)
    return digest.hexdigest()
