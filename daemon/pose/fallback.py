"""What becomes of an active calibration that cannot be used."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Fallback:
    """The active calibration could not be used when the daemon started, and an earlier one took its place."""

    reasons: Mapping[str, str]
    """Why not, by the calibration's id: the active one's, then those of the ones before it that were tried."""
    used: str | None
    """The calibration that poses are computed from instead, None where none before it can be used either."""

    @property
    def sentence(self) -> str:
        """What happened and what to do."""
        why = next(iter(self.reasons.values()))
        instead = (
            "none before it can be used, so that there is no pose"
            if self.used is None
            else f"poses are computed from '{self.used}', made before it"
        )
        return f"the active calibration cannot be used ({why}): {instead}, until one is activated or a run succeeds"
