"""A backup, read: nothing of it is believed that its manifest does not tell and its sums do not prove."""

import contextlib
import hashlib
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final
from zipfile import ZIP_STORED, BadZipFile, ZipFile

from pydantic import ValidationError

from calib.documents import first_problem
from daemon.backup.manifest import NAME, Manifest
from daemon.errors import BackupError

CHUNK: Final = 2**20


class Backup:
    """An open backup. See `open_backup`."""

    def __init__(self, file: Path, archive: ZipFile) -> None:
        self._file = file
        self._archive = archive
        entries = archive.infolist()
        if any(entry.compress_type != ZIP_STORED for entry in entries):
            raise self._damaged("it is packed otherwise than activecam packs")
        try:
            self.manifest = Manifest.model_validate_json(archive.read(NAME))
        except KeyError:
            raise self._damaged(f"it has no {NAME}") from None
        except ValidationError as error:
            raise self._damaged(first_problem(error)) from None
        if sorted(entry.filename for entry in entries) != sorted([NAME, *self.manifest.files]):
            raise self._damaged("its files are not those that it lists")

    def check(self) -> None:
        """Read every file; raises BackupError where one is not what was put in."""
        for path in self.manifest.files:
            self._read(path, None)

    def extract(self, path: str, target: Path) -> None:
        """Write a file of the manifest to `target`; raises BackupError where it is not what was put in, and OSError."""
        with target.open("xb") as file:
            self._read(path, file)

    def _read(self, path: str, target: IO[bytes] | None) -> None:
        digest = hashlib.sha256()
        with _damage_said(self._file), self._archive.open(path) as source:
            while chunk := source.read(CHUNK):
                digest.update(chunk)
                if target is not None:
                    target.write(chunk)
        if digest.hexdigest() != self.manifest.files[path]:
            raise self._damaged(f"{path} is not what was put in")

    def _damaged(self, reason: str) -> BackupError:
        return BackupError(f"{self._file}: the backup is damaged, or none: {reason}")


@contextlib.contextmanager
def open_backup(file: Path) -> Iterator[Backup]:
    """Open a backup; raises BackupError where it is none, or damaged, or its paths lead elsewhere."""
    with contextlib.ExitStack() as stack:
        with _damage_said(file):
            backup = Backup(file, stack.enter_context(ZipFile(file)))
        yield backup


@contextlib.contextmanager
def _damage_said(file: Path) -> Iterator[None]:
    """Tell what the module zipfile finds wrong as a BackupError."""
    try:
        yield
    except FileNotFoundError:
        raise BackupError(f"{file}: there is no such file") from None
    except (BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError, zlib.error) as error:
        raise BackupError(f"{file}: the backup is damaged, or none: {error}") from error
