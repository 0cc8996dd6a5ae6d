"""The `activecam` command: errors become one sentence on stderr and an exit status of 1 or 2."""

import gc
import sys
from collections.abc import Callable, Sequence
from importlib import import_module, metadata
from typing import Annotated, Any, Final

import typer

from calib.errors import CalibError, ReadingsError
from daemon.errors import DaemonError
from daemon.profile import ProfileError
from drivers.errors import DriverError

COULD_NOT, WRONG_CALL, INTERRUPTED = 1, 2, 130

# Newer typers carry a click of their own under a private name: these are its classes, whichever it is.
UsageError: type[Exception] = typer.BadParameter.__mro__[1]
ClickError: type[Exception] = typer.BadParameter.__mro__[2]

MODULES: Final = {
    "demo": "demo",
    "serve": "serve",
    "audit": "audit",
    "simulate": "simulate",
    "doctor": "doctor",
    "detect": "detect",
    "solve": "solve",
    "pose": "pose",
    "verify": "verify",
    "truth": "truth",
    "export": "export",
    "target": "target",
    "backup": "backup",
    "restore": "backup",
    "profile": "profile",
    "key": "key",
}
"""Where each command is, in the order of the help."""


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"activecam {metadata.version('activecam')}")
        raise typer.Exit


def _activecam(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Calibrate a camera on motorised axes with the camera itself, and serve its pose."""


def command_line(asked: str | None = None) -> typer.Typer:
    """Return the command that is `asked`, or all where it is none of them.

    Only its module is imported: a daemon shall not wait for what solves, draws and prints.
    """
    app = typer.Typer(
        name="activecam",
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(_activecam)
    for module in [MODULES[asked]] if asked in MODULES else dict.fromkeys(MODULES.values()):
        _load(module).register(app)
    return app


def _load(module: str) -> Any:
    # What is loaded stays: the collector would look at it again and again while more is.
    gc.disable()
    try:
        return import_module(f"daemon.cli.{module}")
    finally:
        gc.freeze()
        gc.enable()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with 0, 1 (could not), 2 (wrong call) or 130 (interrupted)."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    sys.exit(_run(spread_numbers(given or ["--help"])))


def _run(arguments: list[str]) -> int:
    try:
        # Without click's own handling a command's return value comes back instead of an exit.
        status = command_line(arguments[0])(arguments, standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        return _fail("interrupted", INTERRUPTED)
    except BrokenPipeError:
        return COULD_NOT
    except Exception as error:
        for kind, status, sentence in FAILURES:
            if isinstance(error, kind):
                return _fail(sentence(error), status)
        raise
    if status == INTERRUPTED:
        return _fail("interrupted", INTERRUPTED)
    return status if isinstance(status, int) else 0


def _fail(sentence: str, status: int) -> int:
    from daemon.cli.console import errors  # rich takes its time to load, and what works needs none of it

    errors.print(f"activecam: {sentence}", markup=False, highlight=False, soft_wrap=True)
    return status


def _wrong_call(error: Exception) -> str:
    context = getattr(error, "ctx", None)
    where = "activecam" if context is None else context.command_path
    return f"{_sentence(error)}; see '{where} --help'"


def _sentence(error: Exception) -> str:
    """Return click's message for people, which is not its str()."""
    message: str = error.format_message().replace("Value error, ", "")  # type: ignore[attr-defined]
    return (message[:1].lower() + message[1:]).rstrip(".")


def _system(error: Exception) -> str:
    """Return what the operating system said, and of which file."""
    assert isinstance(error, OSError)
    return f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror or error)


FAILURES: tuple[tuple[type[Exception], int, Callable[[Exception], str]], ...] = (
    (UsageError, WRONG_CALL, _wrong_call),
    (ClickError, COULD_NOT, _sentence),
    (ReadingsError, WRONG_CALL, str),
    (CalibError, COULD_NOT, str),
    (DriverError, COULD_NOT, str),
    (DaemonError, COULD_NOT, str),
    (ProfileError, COULD_NOT, str),
    (OSError, COULD_NOT, _system),
)
"""What each kind of error ends a command with; the first that fits."""


def spread_numbers(arguments: list[str]) -> list[str]:
    """Return the arguments with `--readings 12.5 -30` as `--readings=12.5 --readings=-30`; so too `--approached`.

    Click has no options with any number of values, and would take a negative reading for an option.
    """
    spread: list[str] = []
    option = None
    for argument in arguments:
        if argument in ("--readings", "--approached"):
            option = argument
        elif option is not None and _is_number(argument):
            spread.append(f"{option}={argument}")
        else:
            option = None
            spread.append(argument)
    return spread


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
