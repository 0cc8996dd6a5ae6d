"""A session's folder as one ZIP file, written as it is read: an hour's pictures fit in no memory."""

from collections.abc import Iterator
from io import RawIOBase
from pathlib import Path
from typing import Final
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from daemon.session_files import session_files

CHUNK: Final = 2**18
"""Bytes that are in memory at once."""
FASTEST: Final = 1
"""Pictures are packed already. What is not packed at all, many a program cannot unpack from a stream."""


def archive_of(folder: Path) -> Iterator[bytes]:
    """Give the ZIP file of a session in pieces; in it is a folder of the same name.

    Raises OSError for a file that cannot be read.
    """
    written = _Pieces()
    with ZipFile(written, "w", ZIP_DEFLATED, compresslevel=FASTEST) as archive:
        for path in session_files(folder):
            name = f"{folder.name}/{path.relative_to(folder).as_posix()}"
            entry = ZipInfo.from_file(path, name, strict_timestamps=False)
            entry.compress_type = ZIP_DEFLATED
            with path.open("rb") as source, archive.open(entry, "w") as target:
                while chunk := source.read(CHUNK):
                    target.write(chunk)
                    yield written.taken()
    yield written.taken()


class _Pieces(RawIOBase):
    """A file that can be written to only, and forgets what is taken of it."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """Say that it can be written to."""
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]  # ZipFile has nothing else
        """Keep a piece."""
        self._pieces.append(bytes(data))
        return len(data)

    def taken(self) -> bytes:
        """Return what was written since it was last asked."""
        pieces, self._pieces = self._pieces, []
        return b"".join(pieces)
