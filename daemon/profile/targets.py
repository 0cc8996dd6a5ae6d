"""The profile's `[target]`: the session's targets (`calib.targets`), with lengths as quantities."""

import json
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from calib import targets as calib
from drivers.quantities import LENGTH, Length, PositiveLength, format_quantity

_CONFIG = ConfigDict(extra="forbid", frozen=True, strict=True)
PitchStd = Annotated[Length, Field(ge=0)]


class CircleGridTable(calib.CircleGrid):
    """Disks in rows and columns."""

    model_config = _CONFIG

    kind: Literal["circle_grid"]
    pitch: PositiveLength
    disk_diameter: PositiveLength
    pitch_std: PitchStd | None = None


class AsymmetricCircleGridTable(calib.AsymmetricCircleGrid):
    """Disks in rows of which every second one is shifted by half a pitch."""

    model_config = _CONFIG

    kind: Literal["asymmetric_circle_grid"]
    pitch: PositiveLength
    disk_diameter: PositiveLength
    pitch_std: PitchStd | None = None


class ChessboardTable(calib.Chessboard):
    """A chessboard; rows and columns count its inner corners."""

    model_config = _CONFIG

    kind: Literal["chessboard"]
    pitch: PositiveLength
    pitch_std: PitchStd | None = None


class CharucoTable(calib.Charuco):
    """A chessboard with markers; rows and columns count its squares."""

    model_config = _CONFIG

    kind: Literal["charuco"]
    pitch: PositiveLength
    marker: PositiveLength
    pitch_std: PitchStd | None = None


class AprilGridTable(calib.AprilGrid):
    """Tags in rows and columns, `spacing` apart."""

    model_config = _CONFIG

    kind: Literal["aprilgrid"]
    tag: PositiveLength
    spacing: PositiveLength
    pitch_std: PitchStd | None = None


TargetTable = Annotated[
    CircleGridTable | AsymmetricCircleGridTable | ChessboardTable | CharucoTable | AprilGridTable,
    Field(discriminator="kind"),
]


class TargetAlone(BaseModel):
    """A file of which nothing but the `[target]` counts."""

    target: TargetTable


def resolve_target(table: TargetTable) -> calib.Target:
    """Return the target as a session has it, lengths in metres."""
    target: calib.Target = TypeAdapter(calib.Target).validate_python(table.model_dump(exclude_none=True))
    return target


def target_entries(target: calib.Target) -> dict[str, int | str]:
    """Return what a profile's `[target]` says of a target: lengths in millimetres, the kind first."""
    known = {"kind": target.kind} | {name: value for name, value in target if value is not None}
    if "pitch_std" in known:
        known["pitch_std"] = known.pop("pitch_std")  # last
    return {
        name: format_quantity(value, LENGTH, "mm") if isinstance(value, float) else value
        for name, value in known.items()
    }


def target_table(target: calib.Target) -> str:
    """Return a profile's `[target]`, in TOML."""
    lines = [f"{name} = {json.dumps(value)}" for name, value in target_entries(target).items()]
    return "\n".join(["[target]", *lines]) + "\n"
