"""Files that survive a crash of the machine: written beside their place, flushed, renamed, and their folder flushed."""

import os
from pathlib import Path


def write_durably(path: Path, data: bytes) -> None:
    """Write `data` so that after a crash `path` holds either all of it or what it held before.

    Raises OSError when the disk does not take it; nothing is left of it then.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_bytes(data)
        put_in_place(temporary, path)
    except BaseException as error:
        # What is left of it would only keep a full disk full.
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(
                error.errno, error.strerror, str(path)
            ) from error  # which file, a write does not say
        raise


def put_in_place(written: Path, path: Path) -> None:
    """Flush the file `written`, which is on the same file system, and let it take the place of `path`."""
    flush(written)
    written.replace(path)
    flush(path.parent)


def make_folder_durably(folder: Path) -> None:
    """Make `folder` and those above it that are missing, so that files in them are found after a crash."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(missing):
        path.mkdir(exist_ok=True)
        flush(path.parent)


def flush(path: Path) -> None:
    """Return when the file or folder `path` is on disk as it is."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
