"""The profile as it is written: the TOML file's tables and their keys, not yet checked against each other."""

import re
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, WithJsonSchema, model_validator

from calib.session import Intrinsics, IntrinsicsStd
from daemon.profile.targets import TargetTable
from drivers.axis import JointKind
from drivers.quantities import NUMBER, Duration, PositiveDuration, written
from drivers.simulated.options import SimulationOptions

PROFILE_FORMAT = "activecam.profile/1"
_NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"


def _name(text: str) -> str:
    if not re.fullmatch(_NAME, text):
        raise ValueError(f"'{text}' must begin with a letter and go on with letters, digits, '_' and '-'")
    return text


def _unit(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z]+", text):
        raise ValueError(f"'{text}' must be one word of letters, such as mm, deg or counts")
    return text


def _reading(suffix: str) -> WithJsonSchema:
    # In the program any value is let through, since only the axis's unit tells what may be written.
    pattern = rf"^\s*{NUMBER}\s*[A-Za-z]+{suffix}\s*$"
    return WithJsonSchema({"type": "string", "pattern": pattern})


Name = Annotated[str, AfterValidator(_name), WithJsonSchema({"type": "string", "pattern": _NAME})]
"""Stands in addresses and keys, so that it needs no quotes in either."""
Unit = Annotated[str, AfterValidator(_unit), WithJsonSchema({"type": "string", "pattern": "^[A-Za-z]+$"})]
Reading = Annotated[object, _reading("")]
"""A quantity in a unit that fits the axis's reading unit, such as "30 mm"."""
Velocity = Annotated[object, _reading("/s")]
Acceleration = Annotated[object, _reading("/s(2|²|\\^2)")]
Use = Literal["fit", "verify"]
Options = dict[str, Any]
"""Keys that a driver defines."""


class Table(BaseModel):
    """A table of the file: an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


class AxisTable(Table):
    """A motorised axis: one joint of the chain."""

    name: Name
    kind: JointKind
    reading_unit: Annotated[Unit, Field(examples=["mm", "deg", "counts"])]
    unit_trusted: bool = Field(False, description="Whether the encoder's unit is believed as a measure.")
    scale_std: Annotated[
        float | None, Field(gt=0, description="How well the unit says the scale, relative to it.")
    ] = None
    limits: Annotated[tuple[Reading, Reading], Field(strict=False)]
    velocity: Velocity
    acceleration: Acceleration
    tolerance: Reading = Field(description="How far from its target the axis may stand after a move.")
    reading_std: Annotated[Reading | None, Field(description="Standard deviation of a reading.")] = None
    controller: str = Field(description="The key of its table under [controllers].")
    options: Options = Field({}, description="The driver's own keys for this axis.")


class ControllerTable(BaseModel):
    """A device that drives axes. Its further keys are its driver's, which checks them."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True, defer_build=True)

    driver: str


class IntrinsicsTable(Intrinsics):
    """A known lens, in pixels."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class IntrinsicsStdTable(IntrinsicsStd):
    """How well a known lens is known: standard deviations; what is not named is known exactly."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class CameraTable(Table):
    """The camera."""

    name: Name
    driver: str
    width: Annotated[int, Field(gt=0, description="Pixels.")]
    height: Annotated[int, Field(gt=0, description="Pixels.")]
    link: Annotated[str | None, Field(description="The axis that it rides on; the last one by default.")] = (
        None
    )
    options: Options = Field({}, description="The driver's own keys.")
    intrinsics: IntrinsicsTable | None = None
    intrinsics_std: IntrinsicsStdTable | None = None


class SweepTable(Table):
    """One joint exercised alone: at `positions` evenly spaced places `from` .. `to`, or at `readings`."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["from", "to", "positions"]}, {"required": ["readings"]}]}
    )

    joint: str
    start: dict[str, Reading] = Field({}, description="Where the other axes stand; at their 0 by default.")
    first: Annotated[Reading | None, Field(alias="from")] = None
    last: Annotated[Reading | None, Field(alias="to")] = None
    positions: Annotated[int | None, Field(ge=2, le=10_000)] = None
    readings: Annotated[list[Reading] | None, Field(min_length=2, max_length=10_000)] = None
    both_ways: Annotated[
        bool, Field(description="Take the positions once more on the way back: that shows backlash.")
    ] = False
    use: Use = "fit"

    @model_validator(mode="after")
    def _spaced_or_listed(self) -> Self:
        spaced = {"first", "last", "positions"} & self.model_fields_set
        listed = "readings" in self.model_fields_set
        if len(spaced) != (0 if listed else 3):
            raise ValueError("give either 'from', 'to' and 'positions', or 'readings'")
        return self


class ViewTable(Table):
    """A picture taken outside the joint-by-joint plan."""

    readings: dict[str, Reading]
    use: Use = "fit"


class ProcedureTable(Table):
    """The pictures that a calibration takes."""

    settle: Annotated[Duration, Field(ge=0, description="Wait after standstill, before an exposure.")]
    max_reading_age: Annotated[PositiveDuration, Field(description="Older readings give no pose.")] = written(
        "1 s"
    )
    frame_timeout: PositiveDuration = written("5 s")
    frames: Annotated[int, Field(ge=1, le=64, description="How many are averaged at each position.")] = 1
    sweeps: list[SweepTable] = []
    views: list[ViewTable] = []

    @model_validator(mode="after")
    def _takes_pictures(self) -> Self:
        if not self.sweeps and not self.views:
            raise ValueError("takes no picture: add [[procedure.sweeps]], one for each axis")
        return self


class ProfileTable(Table):
    """A rig: its axes, camera and target, and the procedure that calibrates it."""

    format: Literal["activecam.profile/1"]
    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    axes: Annotated[list[AxisTable], Field(min_length=1, description="In chain order, the base first.")]
    controllers: dict[Name, ControllerTable]
    camera: CameraTable
    target: TargetTable
    procedure: ProcedureTable
    simulation: Annotated[SimulationOptions | None, Field(description="The truth of a simulated rig.")] = None
