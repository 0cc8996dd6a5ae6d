"""What commands share that look into a data folder, while a daemon uses it or not."""

import asyncio
import os
import pwd
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.errors import StoreError
from daemon.store import Store
from daemon.store.database import DATABASE

Result = TypeVar("Result")

Data = Annotated[Path, typer.Option(help="The data folder of the daemon, which may be using it.")]
DEFAULT_DATA = Path("activecam-data")


def look_into(data: Path, work: Callable[[Store], Awaitable[Result]], *, create: bool = False) -> Result:
    """Return what `work` finds, or changes, in a data folder; raises StoreError.

    With `create` the folder may be a new one; otherwise it would be a slip of the pen.
    """
    if not create and not (data / DATABASE).exists():
        raise StoreError(f"{data}: no daemon has kept anything in this folder: choose another --data")

    async def use() -> Result:
        store = await Store.open(data, beside_daemon=True)
        try:
            return await work(store)
        finally:
            await store.close()

    return asyncio.run(use())


async def note_command(store: Store, words: str) -> None:
    """Write a command that changes keys into the audit log; raises StoreError."""
    entry = AuditEntry(
        time=datetime.now(UTC),
        who=_user(),
        role=Role.ADMIN,
        address="this machine",
        method="COMMAND",
        path=f"activecam {words}",
        status=0,
    )
    await store.audit.write([entry])


def _user() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:  # as in a container
        return f"user {os.getuid()}"
