"""`activecam audit`: who did what, as the daemon has written it down."""

import json
from collections.abc import Sequence
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from daemon.access.entries import AuditEntry
from daemon.cli.console import output
from daemon.cli.data_folder import DEFAULT_DATA, Data, look_into
from daemon.store import Store


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam audit --last 20")(audit)


def audit(
    data: Data = DEFAULT_DATA,
    last: Annotated[int, typer.Option(min=1, help="How many entries at most.")] = 50,
    as_json: Annotated[bool, typer.Option("--json", help="Print them as JSON, one a line.")] = False,
) -> None:
    """Print who moved, created, steered or activated something, the latest last."""

    async def work(store: Store) -> Sequence[AuditEntry]:
        return await store.audit.read(None, last)

    entries = look_into(data, work)[::-1]
    if as_json:
        for entry in entries:
            typer.echo(json.dumps(_document(entry)))
        return
    table = Table("time (UTC)", "who", "from", "what", "asked", "outcome")
    for entry in entries:
        cells = (
            f"{entry.time:%Y-%m-%d %H:%M:%S}",
            entry.who or "anybody",
            entry.address,
            f"{entry.method} {entry.path}",
            entry.asked,
            _outcome(entry),
        )
        table.add_row(*(Text(_printable(cell)) for cell in cells))
    output.print(table)


def _document(entry: AuditEntry) -> dict[str, object]:
    fields = {name: getattr(entry, name) for name in AuditEntry.__dataclass_fields__}
    return fields | {"time": entry.time.isoformat()}


def _printable(text: str) -> str:
    """Return a text that a terminal takes for nothing but a text."""
    return "".join(
        character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in text
    )


def _outcome(entry: AuditEntry) -> str:
    if entry.status is None:
        return "unknown"
    return entry.code or ("done" if entry.status < 400 else str(entry.status))
