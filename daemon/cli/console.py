"""Where the command line writes: results to stdout, errors and progress to stderr."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

FILE_WIDTH = 120
"""Columns of a table that goes into a file or a pipe."""

output = Console(highlight=False, width=None if Console().is_terminal else FILE_WIDTH)
errors = Console(stderr=True, highlight=False)


def warn(sentence: str) -> None:
    """Print a warning, which changes no result."""
    errors.print(f"warning: {sentence}", style="yellow", markup=False, soft_wrap=True)


@contextmanager
def progress_line() -> Iterator[Callable[[str], None]]:
    """Give a function that says what is being done; on a terminal only."""
    with _progress() as progress:
        task = progress.add_task("", total=None)
        yield lambda sentence: progress.update(task, description=sentence)


@contextmanager
def progress_bar(total: int | None = None) -> Iterator[Callable[[str, int | None, int | None], None]]:
    """Give a function `(sentence, done, total)` that moves a bar; on a terminal only."""
    with _progress(BarColumn()) as progress:
        task = progress.add_task("", total=total)

        def advance(sentence: str, done: int | None = None, total: int | None = None) -> None:
            progress.update(task, description=sentence, completed=done, total=total)

        yield advance


def _progress(*columns: BarColumn) -> Progress:
    return Progress(
        SpinnerColumn(),
        *columns,
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
    )
