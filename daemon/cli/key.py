"""`activecam key`: who may use a daemon, by keys of which each is shown once."""

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

import typer
from rich.table import Table

from daemon.access.keys import ApiKey, make_key
from daemon.access.roles import Role
from daemon.cli.console import errors, output
from daemon.cli.data_folder import DEFAULT_DATA, Data, look_into, note_command
from daemon.store import Store

app = typer.Typer(help="Make the API keys that a daemon asks for, list them, or remove them.")

Name = Annotated[str, typer.Argument(help="The key's name: who, or what, shows it.")]


def register(parent: typer.Typer) -> None:
    """Add the commands to `parent`."""
    parent.add_typer(app, name="key")


@app.command(epilog="Example: activecam key add anna --role operator")
def add(
    name: Name,
    role: Annotated[
        Role, typer.Option(help="What it allows: to read, to move as well, or to see who did too.")
    ],
    data: Data = DEFAULT_DATA,
) -> None:
    """Make a key and print it, once and for all; what is kept is a hash. A running daemon knows it in a second."""
    secret, key = make_key(name, role)

    async def work(store: Store) -> None:
        await store.keys.add(key)
        await note_command(store, f"key add {name} --role {role}")

    look_into(data, work, create=True)
    typer.echo(secret)
    errors.print(f"Keep it: this {role}'s key is not shown again", markup=False)


@app.command("list", epilog="Example: activecam key list")
def list_keys(
    data: Data = DEFAULT_DATA,
    as_json: Annotated[bool, typer.Option("--json", help="Print them as JSON.")] = False,
) -> None:
    """List the keys by name, with their roles and when they were used; never the keys themselves."""

    async def work(store: Store) -> Sequence[ApiKey]:
        return await store.keys.all()

    keys = look_into(data, work)
    if as_json:
        typer.echo(json.dumps([_document(key) for key in keys]))
        return
    table = Table("name", "role", "made", "last used")
    for key in keys:
        table.add_row(key.name, key.role, _to_the_minute(key.created_at), _to_the_minute(key.last_used_at))
    output.print(table)


@app.command(epilog="Example: activecam key remove anna")
def remove(name: Name, data: Data = DEFAULT_DATA) -> None:
    """Remove a key: within a second, who shows it is let in no more, and streams to them end."""

    async def work(store: Store) -> None:
        await store.keys.remove(name)
        await note_command(store, f"key remove {name}")

    look_into(data, work)


def _document(key: ApiKey) -> dict[str, str | None]:
    used = None if key.last_used_at is None else key.last_used_at.isoformat()
    return {
        "name": key.name,
        "role": key.role,
        "created_at": key.created_at.isoformat(),
        "last_used_at": used,
    }


def _to_the_minute(time: datetime | None) -> str:
    return "never" if time is None else f"{time:%Y-%m-%d %H:%M} UTC"
