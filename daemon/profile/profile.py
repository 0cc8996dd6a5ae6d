"""A rig as its profile describes it, checked: what the daemon is built from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from calib.session import SESSION_FORMAT, Session
from calib.targets import Target
from daemon.profile.axes import AxisProfile
from daemon.profile.devices import CameraProfile, ControllerProfile
from daemon.profile.procedure import Procedure
from drivers.simulated.options import SimulationOptions

NOWHERE_ELSE: Final[Mapping[str, Sequence[float]]] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Profile:
    """Axes, camera and target of one rig, and the procedure that calibrates it.

    Whatever concerns an axis is in its reading unit; everything else is in SI, pixels for pictures.
    """

    format: str
    name: str
    description: str
    axes: tuple[AxisProfile, ...]
    """In chain order, the base first."""
    controllers: Mapping[str, ControllerProfile]
    camera: CameraProfile
    target: Target
    procedure: Procedure
    simulation: SimulationOptions | None
    """What is true of a simulated rig, for its drivers only; None where the devices are real."""
    source: Path | None
    """The file that it was read from."""

    def empty_session(self, starts: Mapping[str, Sequence[float]] = NOWHERE_ELSE) -> Session:
        """Return the session of a run that has not taken a picture yet, with `starts` as for `Procedure.starting`.

        Its key `complete` is false, and becomes true when a run has ended as planned.
        """
        return Session.model_validate(
            {
                "format": SESSION_FORMAT,
                "complete": False,
                "profile": self.name,
                "joints": [_joint(axis) for axis in self.axes],
                "cameras": [_camera(self.camera)],
                "target": self.target.model_dump(exclude_unset=True),
                "views": [],
            }
            | ({"starts": starts} if starts else {})
        )


def _joint(axis: AxisProfile) -> dict[str, Any]:
    joint = {
        "name": axis.spec.name,
        "kind": axis.spec.kind,
        "reading_unit": axis.spec.unit,
        "unit_trusted": axis.unit_trusted,
    }
    known = {"scale_std": axis.scale_std, "reading_std": axis.reading_std}
    return joint | {key: value for key, value in known.items() if value is not None}


def _camera(camera: CameraProfile) -> dict[str, Any]:
    known: dict[str, Any] = {
        "name": camera.spec.name,
        "width": camera.spec.width,
        "height": camera.spec.height,
    }
    if camera.link is not None:
        known["link"] = camera.link
    if camera.intrinsics is not None:
        known["intrinsics"] = camera.intrinsics.model_dump(exclude_unset=True)
    if camera.intrinsics_std is not None:
        known["intrinsics_std"] = camera.intrinsics_std.model_dump(exclude_unset=True)
    return known
