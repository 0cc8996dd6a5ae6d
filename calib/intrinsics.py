"""A camera's lens as files state it, and how well it is known."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from calib.documents import Document, NotNegative, Number, Positive
from calib.parameters import LENS_NAMES


class Intrinsics(Document):
    """A camera's lens: `opencv` (k1 k2 p1 p2 k3) or `division` ([k1] on normalised coordinates)."""

    model: Literal["opencv", "division"]
    width: Annotated[int, Field(gt=0)] | None = None
    height: Annotated[int, Field(gt=0)] | None = None
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    distortion: list[Number]

    @model_validator(mode="after")
    def _distortion_fits_model(self) -> Self:
        wanted = len(LENS_NAMES[self.model]) - 4
        if len(self.distortion) != wanted:
            raise ValueError(
                f"distortion of the model '{self.model}' has {wanted} numbers, not {len(self.distortion)}"
            )
        return self

    def numbers(self) -> dict[str, float]:
        """Return the lens's numbers by name."""
        values = [self.fx, self.fy, self.cx, self.cy, *self.distortion]
        return dict(zip(LENS_NAMES[self.model], values, strict=True))


class IntrinsicsStd(Document):
    """How well a lens's numbers are known: standard deviations, 0 for what is known exactly."""

    fx: NotNegative = 0.0
    fy: NotNegative = 0.0
    cx: NotNegative = 0.0
    cy: NotNegative = 0.0
    k1: NotNegative = 0.0
    k2: NotNegative = 0.0
    p1: NotNegative = 0.0
    p2: NotNegative = 0.0
    k3: NotNegative = 0.0


def problem_of_std(known: Intrinsics | None, std: IntrinsicsStd | None) -> str | None:
    """Return why `std` cannot be how well the lens `known` is known, or None."""
    if std is None:
        return None
    if known is None:
        return "says how well intrinsics are known, and there are none"
    lacking = [
        name for name in IntrinsicsStd.model_fields if name not in known.numbers() and getattr(std, name) > 0
    ]
    return f"the model '{known.model}' has no {lacking[0]}" if lacking else None
