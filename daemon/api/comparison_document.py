"""Two calibrations side by side, as OpenAPI describes them."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BaseModel, Field

if TYPE_CHECKING:
    from calib.comparison import Comparison


class PoseDifferenceDocument(BaseModel):
    """How far the camera's poses are apart."""

    position_mean_m: float
    position_max_m: float
    rotation_mean_rad: float
    rotation_max_rad: float
    stds: float | None = Field(
        description="At most, in standard deviations of the difference, as if both had errors of their own; null where "
        "these are not known."
    )


class ParameterDifferenceDocument(BaseModel):
    """A parameter in both calibrations."""

    name: str = Field(examples=["pan.scale"])
    unit: str = Field(examples=["rad/deg"])
    frame: Literal["none", "world"] = Field(
        description="`world` for what changes when the target is moved, though the rig has not changed."
    )
    first: float
    second: float
    difference: float = Field(description="The second less the first.")
    std: float | None = Field(description="The difference's standard deviation; null where it is not known.")
    stds: float | None = Field(description="How many of these the difference is.")


class ComparisonDocument(BaseModel):
    """Two calibrations of one rig."""

    first: str = Field(description="The one's id.")
    second: str = Field(description="The other's.")
    sentence: str = Field(description="Whether they say the same, and what not.")
    agree: bool | None = Field(
        description="Whether the poses are within three standard deviations; null where these are not known."
    )
    agree_apart_from_world: bool | None = Field(
        description="The same once it is taken into account that the target, and so the world, may have been moved."
    )
    range: list[Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        description="For each joint the lowest and highest reading that both have."
    )
    poses: PoseDifferenceDocument = Field(description="In the world, over that range.")
    poses_apart_from_world: PoseDifferenceDocument = Field(
        description="Once the one's world is moved onto the other's as well as can be."
    )
    moved_m: float = Field(description="By how much, at the target's origin.")
    moved_rad: float
    parameters: list[ParameterDifferenceDocument]

    @classmethod
    def of(cls, first: str, second: str, found: "Comparison") -> Self:
        """Describe a comparison."""
        return cls(first=first, second=second, **asdict(found))
