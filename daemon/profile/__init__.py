"""The rig's profile: one TOML file that names its axes, camera, target and procedure, checked strictly.

A text goes through these in order: `source` (where it comes from), `lines` (where its keys stand), `tables`
(its keys), `axes`, `devices`, `procedure` and `simulation` (how they fit each other), `profile` (the result).
"""

from daemon.profile.axes import AxisProfile
from daemon.profile.devices import CameraProfile, ControllerProfile
from daemon.profile.errors import ProfileError
from daemon.profile.load import load_profile, load_target
from daemon.profile.procedure import FreeView, PlannedView, Procedure, Sweep
from daemon.profile.profile import Profile
from daemon.profile.source import shipped_profiles

__all__ = [
    "AxisProfile",
    "CameraProfile",
    "ControllerProfile",
    "FreeView",
    "PlannedView",
    "Procedure",
    "Profile",
    "ProfileError",
    "Sweep",
    "load_profile",
    "load_target",
    "shipped_profiles",
]
