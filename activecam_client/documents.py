"""The daemon's answers. Metres, radians and pixels; what concerns an axis is in its own reading unit.

A transform `target_from_source` takes points of the source frame to the target frame. What a newer daemon says beside
this is left out.
"""

from datetime import datetime
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, PlainValidator


def _array(value: Any) -> NDArray[np.float64]:
    return np.array(value, dtype=float)


Array = Annotated[NDArray[np.float64], PlainValidator(_array)]


class Document(BaseModel):
    """An answer as it was given."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Axis(Document):
    """One axis; `position` is None while it does not know where it is."""

    name: str
    kind: str
    unit: str
    position: float | None
    homed: bool
    moving: bool
    limits: tuple[float, float]
    tolerance: float
    fault: str | None
    lost: str | None
    last_error: str | None


class Stop(Document):
    """Whether a stop is latched, so that nothing moves before it is acknowledged."""

    latched: bool
    reason: str | None
    since: datetime | None


class Rig(Document):
    """The axes in chain order, the order of `readings` everywhere, and what goes on."""

    name: str
    axes: list[Axis]
    moving: bool
    stop: Stop
    run: str | None
    calibration_id: str | None


class PoseAtReadings(Document):
    """The camera's pose at given readings.

    `world_from_camera` and `base_from_camera` (4, 4), `position` (3,) in m, `quaternion` (4,) as x, y, z, w, and
    `covariance` (6, 6) of rotation then position in the camera's frame (rad, m), None where it is not known.
    `out_of_range` names the joints whose reading lies beyond those of the calibration.
    """

    readings: list[float]
    approached: list[int]
    world_from_camera: Array
    base_from_camera: Array
    position: Array
    quaternion: Array
    covariance: Array | None
    out_of_range: list[str]


class Pose(PoseAtReadings):
    """The pose at the latest readings, which were taken at `timestamp`, `age_s` seconds ago."""

    timestamp: datetime
    age_s: float
    moving: bool
    calibration_id: str
    camera: str


class StreamedPose(Pose):
    """A pose of a stream, with how many readings were left out before it."""

    dropped: int


class PastPose(PoseAtReadings):
    """The pose at a past time; `reading_bounds` is how far each interpolated reading may be off."""

    timestamp: datetime
    between: list[tuple[datetime, datetime]]
    reading_bounds: list[float]
    moving: bool


class Rays(Document):
    """Of n readings and k pixels: the camera's centres (n, 3) and unit directions (n, k, 3), nan where none."""

    origins: Array
    directions: Array


class RunRecord(Document):
    """A calibration run as the daemon keeps it."""

    id: str
    state: str
    owner: str
    note: str
    error: str | None
    calibration_id: str | None


class Check(Document):
    """Something to look at before a run; `ok` is None where that is not known, or the run sees to it itself."""

    name: str
    title: str
    ok: bool | None
    message: str


class CalibrationEntry(Document):
    """A stored calibration: whether poses are computed from it, and what it is worth."""

    id: str
    created_at: datetime
    active: bool
    run_id: str | None
    judgement: str | None
    verdict: str | None


class Comparison(Document):
    """Whether two calibrations say the same, in a sentence, and once more apart from where the target stood.

    None where they do not say how sure they are.
    """

    sentence: str
    agree: bool | None
    agree_apart_from_world: bool | None


class View(Document):
    """A view of a run.

    `residual_px` (rms) is by how much its `points` miss where the calibration predicts them, `held_out_px` where the
    fit of all other views does; None where that is not known.
    """

    number: int
    joint: str | None
    use: str
    readings: list[float]
    taken_at: datetime | None
    points: int | None
    residual_px: float | None
    held_out_px: float | None
    set_aside: bool
    left_out: bool


class Event(BaseModel):
    """Something that happened in a run; `type` says what, and which other fields there are."""

    model_config = ConfigDict(frozen=True, extra="allow")

    sequence: int
    time: datetime
    type: str

    def __getattr__(self, name: str) -> Any:
        """Return a field of this type of event."""
        return super().__getattr__(name)  # type: ignore[misc]  # pydantic has it, hidden from type checkers
