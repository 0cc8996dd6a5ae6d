"""The lock that keeps a second activecam out of a data folder."""

import fcntl
from pathlib import Path
from typing import IO

from calib.durable_files import make_folder_durably
from daemon.errors import FolderInUseError, StoreError


def lock_folder(folder: Path) -> IO[str]:
    """Make `folder` if need be and lock it until what is returned is closed.

    Raises StoreError when it cannot be used, and FolderInUseError when another activecam uses it.
    """
    try:
        make_folder_durably(folder)
        lock = (folder / "activecam.lock").open("w")
    except OSError as error:
        raise StoreError(f"{folder}: the data folder cannot be used: {error.strerror}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise FolderInUseError(
            f"{folder}: another activecam uses this data folder: stop it, or choose another --data"
        ) from None
    return lock
