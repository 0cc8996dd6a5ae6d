"""The profile's `[simulation]` table: what the simulated world is truly like. No other room may know."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, model_validator

from drivers.options import DriverOptions
from drivers.quantities import (
    LENGTH,
    NUMBER,
    PIXELS,
    Angle,
    Length,
    Pixels,
    PositiveDuration,
    PositiveFrequency,
    PositivePixels,
    QuantityType,
    written,
)

Direction = Annotated[tuple[FiniteFloat, FiniteFloat, FiniteFloat], Field(strict=False)]
"""A direction in the world; its length does not matter."""
Point = Annotated[tuple[Length, Length, Length], Field(strict=False)]
"""A point in the world (m)."""
RotationVector = Annotated[tuple[Angle, Angle, Angle], Field(strict=False)]
"""Axis times angle (rad)."""
ReadingText = Annotated[str, Field(pattern=rf"^\s*{NUMBER}\s*[A-Za-z]+\s*$", examples=["0.02 mm"])]
"""A quantity in the units of an axis's reading, resolved when the axis is known."""
Fraction = Annotated[float, Field(ge=0, lt=1)]
Grey = Annotated[float, Field(ge=0, le=255)]


class SettlingOptions(DriverOptions):
    """The swing when a motion has ended: amplitude x exp(-damping w t) x sin(w t), w = 2 pi frequency."""

    amplitude: ReadingText
    frequency: PositiveFrequency = written("8 Hz")
    damping: Annotated[float, Field(gt=0, lt=1)] = 0.1


class EccentricityOptions(DriverOptions):
    """A once-per-turn error: the angle u becomes u + amplitude x (sin(u + phase) - sin(phase))."""

    amplitude: Angle
    phase: Angle = written("0 deg")


class JointOptions(DriverOptions):
    """One joint's true geometry and imperfections. Axis, point and the camera's pose hold at displacement 0.

    The true displacement is `scale` x (reading + `zero`), so at reading 0 unless `zero` is given. An
    imperfection that is not given is absent.
    """

    axis: Direction
    """In the world; the displacement grows along it (a revolute one by the right-hand rule)."""
    point: Point | None = None
    """A point of the axis, required of a revolute joint."""
    scale: FiniteFloat
    """Radians or metres per reading unit."""
    zero: ReadingText | None = None
    backlash: ReadingText | None = None
    """Width of the play between the motor, where the encoder sits, and the load."""
    encoder_resolution: ReadingText | None = None
    reading_noise: ReadingText | None = None
    """Standard deviation of one reading."""
    settling: SettlingOptions | None = None
    eccentricity: EccentricityOptions | None = None
    coupling: Mapping[str, FiniteFloat] = Field(default_factory=dict)
    """Of other axes, by name: what part of their own displacements is added to this one's (rad or m each)."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not any(self.axis):
            raise ValueError("'axis' must be a direction: [0, 0, 0] has none")
        if self.scale == 0:
            raise ValueError("'scale' must not be 0: the joint would not move the camera")
        return self


class LensOptions(DriverOptions):
    """The true lens: OpenCV's model with k1 k2 p1 p2 k3, or the division model x_u = x_d / (1 + k1 r_d²)."""

    model: Literal["opencv", "division"] = "opencv"
    fx: PositivePixels
    fy: PositivePixels
    cx: Pixels
    cy: Pixels
    distortion: Annotated[tuple[FiniteFloat, ...], Field(strict=False, max_length=5)] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.model == "division" and len(self.distortion) > 1:
            raise ValueError("'distortion' of the division model is [k1] alone")
        return self


class PictureOptions(DriverOptions):
    """How a picture is formed behind the lens. Grey levels are of 8 bits."""

    exposure: PositiveDuration = written("10 ms")
    frame_rate: PositiveFrequency = written("30 Hz")
    brightness: Annotated[float, Field(gt=0)] = 1.0
    """Factor on every grey level; what exceeds 255 is saturated."""
    noise: Annotated[float, Field(ge=0)] = 1.0
    """Standard deviation (grey levels)."""
    defocus: Annotated[float, QuantityType(PIXELS, at_least=0)] = written("0.5 px")
    """Standard deviation of a Gaussian blur."""
    vignetting: Fraction = 0.0
    """Share of the light that is missing in the picture's corners."""
    light_gradient: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    """Relative change of the light from the picture's centre to its right edge."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.exposure * self.frame_rate > 1:
            raise ValueError(
                "'exposure' is longer than the time between frames: shorten it or lower 'frame_rate'"
            )
        return self


class CameraTruth(DriverOptions):
    """The true camera: its pose at all displacements 0, given by `look_at` or by `rotation`, and its lens."""

    position: Point
    look_at: Point | None = None
    """A point on the optical axis."""
    up: Direction = (0.0, -1.0, 0.0)
    """With `look_at`: what is upwards in the picture. The target's rows run along +Y, downwards."""
    rotation: RotationVector | None = None
    """Rotation vector of world_from_camera, for an exact orientation."""
    link: str | None = None
    """The axis that carries the camera; the last one where none is named."""
    lens: LensOptions
    picture: PictureOptions = PictureOptions()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.look_at is None) == (self.rotation is None):
            raise ValueError("give either 'look_at' or 'rotation', to say where the camera looks")
        return self


class PlateOptions(DriverOptions):
    """The sheet that the target is printed on."""

    margin: Annotated[float, QuantityType(LENGTH, at_least=0)] = written("20 mm")
    """White paper around the pattern."""
    ink: Grey = 25.0
    paper: Grey = 215.0
    background: Grey = 110.0
    """Mean grey level of what is behind the plate."""
    print_scale: Annotated[float, Field(gt=0)] = 1.0
    """True size over nominal size: what a printer makes of the drawing."""
    bulge: Length = written("0 mm")
    """How far the middle of the sheet stands out towards the camera; its edges stay in the plane."""


class SimulationOptions(DriverOptions):
    """The whole `[simulation]` table."""

    time_scale: Annotated[float, Field(gt=0)] = 1.0
    """How much faster than life the rig's clock runs."""
    seed: Annotated[int, Field(ge=0)] = 0
    joints: Annotated[tuple[JointOptions, ...], Field(strict=False)] = ()
    """One for each axis, in the profile's order."""
    camera: CameraTruth
    plate: PlateOptions = PlateOptions()
