"""How good a calibration is, as it states it: by view, by joint, and in a verdict."""

from typing import Literal

from pydantic import Field

from calib.documents import Document, Number


class ViewQuality(Document):
    """How well one view agrees with the calibration; null for what the view has no measure of."""

    view: int
    joint: str | None
    use: Literal["fit", "verify", "none"]
    rms_px: Number | None = None
    position_m: Number | None = None
    rotation_rad: Number | None = None
    held_out_px: Number | None = None
    """Its rms error against the fit of all other views."""
    held_out_position_m: Number | None = None
    held_out_rotation_rad: Number | None = None
    set_aside: bool = False
    """Whether it was left out of the fit because it does not agree with the others."""
    approached: list[Literal[-1, 0, 1]] | None = None
    """From which side each joint came to its reading, where the fit found out what the session does not say."""


class Slip(Document):
    """A joint lost steps on its way to a view: from there on it stood `size` beyond its readings, in their unit."""

    joint: str
    view: int
    size: Number
    std: Number


class JointQuality(Document):
    """How well the views agree in which one joint moved alone, or with a null name those outside of any such plan.

    Pixels are rms over points, positions and rotations mean over views.
    """

    joint: str | None
    views: int
    rms_px: Number | None = None
    position_m: Number | None = None
    rotation_rad: Number | None = None
    held_out_px: Number | None = None
    held_out_position_m: Number | None = None
    held_out_rotation_rad: Number | None = None


class CameraCoverage(Document):
    """How well the views of the fit cover one camera's picture; see `calib.coverage`."""

    camera: str
    views: int
    x: Number
    y: Number
    size: Number
    skew: Number
    lean: Number
    covered: Number
    cells: list[list[int]]
    missing: list[str] = Field(default_factory=list)
    """A sentence for each thing that the views leave out."""


class MeanAndMax(Document):
    """The mean and the largest of some numbers."""

    mean: Number
    max: Number


class Quality(Document):
    """Residuals of fit and held-out views (px, rms over points), view by view, and warnings in words.

    The held-out figures are what the verdict goes by: mean position (m) and rotation (rad) where the views carry
    given poses.
    """

    judgement: Literal["good", "usable", "poor", "unknown"] | None = None
    verdict: str | None = None
    """The judgement and what it rests on, in a sentence."""
    rms_px: Number | None = None
    held_out_rms_px: Number | None = None
    held_out_position_m: Number | None = None
    held_out_rotation_rad: Number | None = None
    held_out_by: Literal["verify", "leave_one_view_out"] | None = None
    """By which views: those marked `verify`, or each by the fit of all others."""
    corrections: list[str] = Field(default_factory=list)
    """A sentence for each of the calibration's corrections."""
    noise_px: Number | None = None
    """How much single points scatter (rms) where their view's pose is free: no prediction can be better."""
    predicted_px: Number | None = None
    """How far predictions should miss (rms): by that, by the readings' noise, and by what the fit is not sure of."""
    position_std_m: MeanAndMax | None = None
    rotation_std_rad: MeanAndMax | None = None
    """How sure the camera's pose is at the fit's readings, the three directions together."""
    coverage: list[CameraCoverage] = Field(default_factory=list)
    joints: list[JointQuality] = Field(default_factory=list)
    views: list[ViewQuality] = Field(default_factory=list)
    slips: list[Slip] = Field(default_factory=list)
    """Of the session's joints, in the order of its views; every figure is of the readings without them."""
    warnings: list[str] = Field(default_factory=list)
