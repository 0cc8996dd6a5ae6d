"""A copy of the database as it is at one moment, whoever else uses it."""

import sqlite3
from contextlib import closing
from pathlib import Path

from calib.durable_files import put_in_place
from daemon.errors import StoreError


def copy_database(path: Path, copy: Path) -> None:
    """Put a copy of the database `path` on disk as the single file `copy`; raises StoreError."""
    temporary = copy.with_name(f".{copy.name}.tmp")
    try:
        temporary.unlink(missing_ok=True)
        with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(temporary)) as target:
            source.backup(target)
            target.execute("PRAGMA journal_mode = DELETE")  # or the copy would be of three files
        put_in_place(temporary, copy)
    except (sqlite3.Error, OSError) as error:
        temporary.unlink(missing_ok=True)
        reason = error.strerror if isinstance(error, OSError) else error
        raise StoreError(f"{path}: the database could not be copied to {copy}: {reason}") from error
