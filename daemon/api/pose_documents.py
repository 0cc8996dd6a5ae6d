"""The answers about the camera's pose, as OpenAPI describes them; they are written without these models."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, Field

Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Matrix = Annotated[list[Row], Field(min_length=4, max_length=4)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]


class PoseAtReadings(BaseModel):
    """The camera's pose at given readings."""

    readings: list[float] = Field(description="Raw joint readings in chain order, each in its own unit.")
    approached: list[Literal[-1, 0, 1]] = Field(
        description="From which side each joint came to it: 1 from below, -1 from above, 0 where not known."
    )
    world_from_camera: Matrix = Field(
        description="The camera's pose: p_world = world_from_camera @ p_camera; row-major, metres."
    )
    base_from_camera: Matrix = Field(description="The same in the frame of the chain's base.")
    position: Vector = Field(description="The camera's centre in the world (m).")
    quaternion: Annotated[list[float], Field(min_length=4, max_length=4)] = Field(
        description="Its orientation in the world: x, y, z, w."
    )
    covariance: list[list[float]] | None = Field(
        description="6 x 6, rotation then position, in the camera's frame (rad, m); null where unknown."
    )
    out_of_range: list[str] = Field(
        description="Joints whose reading lies beyond those seen in the calibration."
    )


class Pose(PoseAtReadings):
    """The camera's pose at the latest readings."""

    timestamp: datetime = Field(description="When the oldest of the readings was taken.")
    moving: bool = Field(description="Whether an axis was moving then.")
    calibration_id: str
    camera: str
    age_s: float = Field(description="How long ago that was (s).")


class PoseAtPastTime(PoseAtReadings):
    """The camera's pose at a past time, at readings interpolated between the two around it."""

    timestamp: datetime = Field(description="The time that was asked for.")
    between: list[Annotated[list[datetime], Field(min_length=2, max_length=2)]] = Field(
        description="For each axis, when the two readings were taken; twice the same for one taken just then."
    )
    reading_bounds: list[float] = Field(
        description="How far each reading may be off by interpolation, in its own unit; in the covariance."
    )
    moving: bool = Field(description="Whether an axis was moving then.")


class PoseAtTime(PoseAtPastTime):
    """One of them, with what it is of."""

    calibration_id: str
    camera: str


class PosesAtTimes(BaseModel):
    """One pose for each time, in the order of the request."""

    calibration_id: str
    camera: str
    poses: list[PoseAtPastTime]


class PosesAtReadings(BaseModel):
    """One pose for each vector of readings, in the order of the request."""

    calibration_id: str
    camera: str
    poses: list[PoseAtReadings]


class Pixels(BaseModel):
    """Where points are seen."""

    calibration_id: str
    camera: str
    readings: list[list[float]]
    pixels: list[list[Annotated[list[float], Field(min_length=2, max_length=2)] | None]] = Field(
        description="For each vector of readings, each point's x, y (px); null where the lens cannot see it. "
        "May lie outside the picture."
    )


class RayBundle(BaseModel):
    """The rays from one camera position."""

    origin: Vector = Field(description="The camera's centre in the world (m).")
    directions: list[Vector | None] = Field(
        description="Each pixel's unit vector in the world; null where no ray ends there."
    )


class Rays(BaseModel):
    """Along which lines pixels look."""

    calibration_id: str
    camera: str
    readings: list[list[float]]
    rays: list[RayBundle] = Field(description="One for each vector of readings.")
