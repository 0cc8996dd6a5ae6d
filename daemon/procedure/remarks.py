"""What a run tells of views that are left out, or are worse than they should be."""

from dataclasses import dataclass

from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Use, Warned
from daemon.procedure.observation import Observation


@dataclass(frozen=True, slots=True)
class Spot:
    """A position of the plan, which counts them from 1, and what its view is for."""

    position: int
    joint: str | None
    use: Use


class Remarks:
    """Warnings in the log of a run of that many positions."""

    def __init__(self, log: EventLog, positions: int) -> None:
        self._log = log
        self._positions = positions
        self._told: set[str] = set()

    def begin_sweep(self) -> None:
        """Tell of each kind of fault once more."""
        self._told.clear()

    def leave_out(self, spot: Spot, problem: str) -> None:
        """Tell why there is no view of a position."""
        self._warn(f"{self._where(spot)} is left out: {problem}")

    def warn(self, observation: Observation, spot: Spot) -> None:
        """Tell of pictures that are worse than they should be, of each kind of fault once a sweep."""
        found: dict[str, str] = {fault.kind: fault.message for fault in observation.faults if fault.spoils}
        if observation.seen.warning is not None:
            found["frames"] = observation.seen.warning
        for kind, message in found.items():
            if kind not in self._told:
                self._told.add(kind)
                self.tell(spot, message)

    def tell(self, spot: Spot, message: str) -> None:
        """Tell what is wrong with a view that is kept."""
        self._warn(f"{self._where(spot)} is measured all the same: {message}")

    def _warn(self, message: str) -> None:
        self._log.add(Warned(message=message))

    def _where(self, spot: Spot) -> str:
        return f"position {spot.position} of {self._positions}"
