"""The devices that a profile names."""

from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel

from daemon.profile import Profile
from drivers.cia402.options import Cia402Options
from drivers.grbl.options import GrblOptions
from drivers.video.options import V4l2Options


@dataclass(frozen=True, slots=True)
class Expected:
    """A device of this machine that a profile wants to use."""

    device: str
    """What the profile calls it, such as "controller 'stage'"."""
    kind: Literal["serial port", "CAN interface", "camera"]
    address: str
    """A path, or the name of an interface."""


def expected(profile: Profile) -> list[Expected]:
    """Return what the built-in drivers of a profile will look for on this machine."""
    tables = [(f"controller '{name}'", table.options) for name, table in profile.controllers.items()]
    tables.append((f"camera '{profile.camera.spec.name}'", profile.camera.options))
    return [found for device, options in tables if (found := _expected(device, options)) is not None]


def _expected(device: str, options: BaseModel) -> Expected | None:
    match options:
        case GrblOptions(port=port):
            return Expected(device, "serial port", port)
        case Cia402Options(interface="slcan", channel=channel):
            return Expected(device, "serial port", channel)
        case Cia402Options(interface="socketcan", channel=channel):
            return Expected(device, "CAN interface", channel)
        case V4l2Options(device=path):
            return Expected(device, "camera", path)
    return None
