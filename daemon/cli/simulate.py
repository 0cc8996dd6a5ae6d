"""`activecam simulate`: a profile's devices, emulated by a process of their own."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer

from daemon.cli.console import output
from daemon.emulation import EmulatedRig, emulated
from daemon.profile import Profile, load_profile
from daemon.profile.source import read_profile
from drivers.emulators.control import obey

CHUNK: Final = 4096
"""Bytes read from stdin at once."""


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam simulate grbl-table -o simulated.toml")(simulate)


def simulate(
    profile: Annotated[
        str, typer.Argument(help="A profile with [simulation]: a file, or a shipped one's name.")
    ],
    result: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the profile to serve here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the ports as JSON.")] = False,
) -> None:
    """Emulate a profile's devices until interrupted; lines on stdin, such as 'help', let them go wrong."""
    asyncio.run(_simulate(load_profile(profile), read_profile(profile).text, result, as_json))


async def _simulate(profile: Profile, text: str, result: Path | None, as_json: bool) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    async with emulated(profile) as rig:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, ended.set)
        if result is not None:
            _write(result, rig.profile_to_serve(text))
        _announce(profile, rig, result, as_json)
        with _lines_of_stdin(lambda line: typer.echo(obey(rig.emulators, line), err=True)):
            await ended.wait()


def _write(result: Path, text: str) -> None:
    result.write_text(text, encoding="utf-8")


def _announce(profile: Profile, rig: EmulatedRig, result: Path | None, as_json: bool) -> None:
    if as_json:
        places = {"controllers": rig.controllers, "camera": rig.camera}
        typer.echo(json.dumps(places | {"profile": None if result is None else str(result)}))
        return
    output.print(f"Emulating '{profile.name}'")
    for name, keys in [*rig.controllers.items(), ("camera", rig.camera)]:
        output.print(f"  {name}: {_in_words(keys)}", soft_wrap=True, markup=False)
    if result is not None:
        output.print(f"Serve it:  activecam serve --profile {result}", soft_wrap=True)
    output.print("Ctrl-C ends it; 'help' and return says what can go wrong")


def _in_words(keys: object) -> str:
    return json.dumps(keys) if keys else "as the profile says"


@contextmanager
def _lines_of_stdin(obeyed: Callable[[str], None]) -> Iterator[None]:
    """Hand each line of stdin to `obeyed`, from the event loop; a stdin at its end has nothing to say."""
    loop, unfinished = asyncio.get_running_loop(), bytearray()

    def take() -> None:
        received = os.read(stdin, CHUNK)
        unfinished.extend(received)
        *lines, rest = unfinished.split(b"\n")
        unfinished[:] = rest
        for line in lines:
            obeyed(line.decode(errors="replace"))
        if not received:
            loop.remove_reader(stdin)

    stdin = sys.stdin.fileno()
    try:
        loop.add_reader(stdin, take)
    except PermissionError:  # a file or /dev/null, which cannot be waited for
        take()
    try:
        yield
    finally:
        loop.remove_reader(stdin)
