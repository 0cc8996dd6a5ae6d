"""Databases as each version of activecam left them, as SQL texts: `data/schema-N.sql`.

`python -m tests.daemon.snapshots` brings the newest to today's schema, and keeps that beside the others. What is in
tables that came later, if anything, is then written into the text by hand.
"""

import asyncio
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

from daemon.store import Store
from daemon.store.migrations import schema_version

FOLDER = Path(__file__).parent / "data"
VERSIONS = sorted(int(path.stem.removeprefix("schema-")) for path in FOLDER.glob("schema-*.sql"))


def restore_snapshot(version: int, folder: Path) -> None:
    """Make the database in `folder` as activecam of schema `version` left it."""
    with closing(sqlite3.connect(folder / "activecam.db")) as database:
        database.executescript((FOLDER / f"schema-{version}.sql").read_text(encoding="utf-8"))


def dump(folder: Path) -> str:
    """Return the database in `folder` as an SQL text."""
    with closing(sqlite3.connect(folder / "activecam.db")) as database:
        (version,) = database.execute("PRAGMA user_version").fetchone()
        return "\n".join([*database.iterdump(), f"PRAGMA user_version = {version};", ""])


async def _keep() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        restore_snapshot(VERSIONS[-1], folder)
        await (await Store.open(folder)).close()
        path = FOLDER / f"schema-{schema_version()}.sql"
        path.write_text(dump(folder), encoding="utf-8")


if __name__ == "__main__":
    asyncio.run(_keep())
