"""What is taken away: a calibration, and what is known of how it came about."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib import Calibration
from daemon.errors import ExportUnavailableError

if TYPE_CHECKING:
    from calib.residual_map import ViewMisses


@dataclass(frozen=True)
class AxisTravel:
    """How far an axis goes, in its reading `unit`, and how fast (a second)."""

    unit: str
    low: float
    high: float
    velocity: float


@dataclass(frozen=True)
class Subject:
    """A calibration, and of its run what is known; None, or empty, for what is not."""

    calibration: Calibration
    document: bytes
    """`calibration.json`, as it was stored."""
    folder: Path | None = None
    """Where the session that it was solved from should be."""
    verification: str | None = None
    """What its run's held-out views said of it, as JSON."""
    misses: "Sequence[ViewMisses] | None" = None
    """What every point of the session is off by, where somebody has looked already."""
    id: str | None = None
    made_at: datetime | None = None
    rig: str | None = None
    owner: str = ""
    note: str = ""
    axes: Mapping[str, AxisTravel] = field(default_factory=dict)
    """By name, as the profile describes them."""

    def session_folder(self) -> Path:
        """Return where the session is; raises ExportUnavailableError where there is none."""
        if self.folder is None:
            raise ExportUnavailableError("it is not known which session this calibration was solved from")
        if not (self.folder / "session.json").is_file():
            raise ExportUnavailableError(
                f"there is no session.json in '{self.folder.name}', where the session should be "
                "that this calibration was solved from"
            )
        return self.folder


def axes_of(profile: Mapping[str, Any]) -> dict[str, AxisTravel]:
    """Return how far the axes of a profile's document go, by name."""
    return {
        axis["name"]: AxisTravel(axis["unit"], axis["limits"][0], axis["limits"][1], axis["velocity"])
        for axis in profile["axes"]
    }
