"""The profile's `[target]`: the session's targets (`calib.targets`), with lengths as quantities."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter

from calib import targets as calib
from drivers.quantities import Length, PositiveLength

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


def resolve_target(table: TargetTable) -> calib.Target:
    """Return the target as a session has it, lengths in metres."""
    target: calib.Target = TypeAdapter(calib.Target).validate_python(table.model_dump(exclude_none=True))
    return target
