"""A file that grows line by line, in which a full disk leaves no half lines and no gaps."""

import contextlib
import logging
import os
from pathlib import Path

logger = logging.getLogger(__name__)


class EventFile:
    """Lines at the end of the file `path`; those that the disk does not take are kept until it does."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._waiting = b""

    def append(self, line: str) -> None:
        """Write one more line, after those that wait; never fails."""
        told = bool(self._waiting)
        self._waiting += line.encode() + b"\n"
        end = None
        try:
            with self._path.open("ab") as file:
                end = file.tell()
                file.write(self._waiting)
        except OSError as error:
            if end is not None:
                with contextlib.suppress(OSError):
                    os.truncate(self._path, end)
            if not told:
                # The session and the store are what counts; a run does not end for want of its diary.
                logger.warning("%s: events cannot be written: %s", self._path, error.strerror)
        else:
            self._waiting = b""
