"""A run's events as a moving bar, or line by line where there is no terminal."""

from collections.abc import Callable

from daemon.cli.console import errors
from daemon.procedure.events import Homing, JointStarted, Moving, Planned, RunEvent, Solving, ViewTaken

Advance = Callable[[str, int | None, int | None], None]


class RunProgress:
    """Follows one run; what it shows goes to stderr."""

    def __init__(self, advance: Advance) -> None:
        self._advance = advance
        self._total: int | None = None
        self._doing = ""

    def show(self, event: RunEvent) -> None:
        """Show one event."""
        match event:
            case Planned(views=views):
                self._total = views
            case Homing(axis=axis):
                self._say(f"homing '{axis}'", 0)
            case JointStarted(joint=joint, views=views, use=use):
                what = "free views" if joint is None else f"joint '{joint}'"
                held_out = " to verify" if use == "verify" else ""
                self._doing = f"{what}: {views} positions{held_out}"
                self._say(self._doing, None)
            case Moving(position=position):
                self._advance(self._doing, position - 1, self._total)
            case ViewTaken(position=position):
                self._advance(self._doing, position, self._total)
            case Solving(message=message):
                self._advance(message, self._total, self._total)
            case _:
                pass

    def _say(self, sentence: str, done: int | None) -> None:
        self._advance(sentence, done, self._total)
        if not errors.is_terminal:
            errors.print(sentence, markup=False)
