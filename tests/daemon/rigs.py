"""A small simulated rig: a slide that carries a pan, a 3 x 4 circle grid, little pictures, a fast clock."""

from pathlib import Path

from daemon.profile import Profile, load_profile

SMALL_RIG = """
format = "activecam.profile/1"
name = "small-rig"

[[axes]]
name = "slide"
kind = "prismatic"
reading_unit = "mm"
unit_trusted = true
limits = ["0 mm", "100 mm"]
velocity = "{velocity} mm/s"
acceleration = "400 mm/s2"
tolerance = "0.05 mm"
controller = "stage"
options = {{ power_up_position = "3 mm" }}

[[axes]]
name = "pan"
kind = "revolute"
reading_unit = "deg"
limits = ["-20 deg", "20 deg"]
velocity = "40 deg/s"
acceleration = "200 deg/s2"
tolerance = "0.05 deg"
controller = "head"
options = {{ power_up_position = "1 deg" }}

[controllers.stage]
driver = "simulated"

[controllers.head]
driver = "simulated"

[camera]
name = "main"
driver = "simulated"
width = 480
height = 360

[target]
kind = "circle_grid"
rows = 4
columns = 5
pitch = "30 mm"
disk_diameter = "18 mm"

[procedure]
settle = "100 ms"
max_reading_age = "{max_reading_age}"

[[procedure.sweeps]]
joint = "slide"
from = "0 mm"
to = "100 mm"
positions = {positions}

[[procedure.sweeps]]
joint = "pan"
from = "-{reach:g} deg"
to = "{reach:g} deg"
positions = {positions}
start = {{ slide = "50 mm" }}

[[procedure.views]]
readings = {{ slide = "20 mm", pan = "5 deg" }}
use = "verify"

[[procedure.views]]
readings = {{ slide = "80 mm", pan = "-6 deg" }}
use = "verify"

[simulation]
time_scale = {time_scale}
seed = 3

[[simulation.joints]]
axis = [1.0, 0.05, 0.02]
scale = 0.001

[[simulation.joints]]
axis = [0.02, -1.0, 0.05]
point = ["20 mm", "0 mm", "-520 mm"]
scale = 0.0174

[simulation.camera]
position = ["10 mm", "45 mm", "-480 mm"]
look_at = {look_at}

[simulation.camera.lens]
fx = "560 px"
fy = "560 px"
cx = "240 px"
cy = "178 px"

[simulation.camera.picture]
frame_rate = "{frame_rate}"
defocus = "{defocus}"
"""

LOOKING_AT_THE_TARGET = '["14 mm", "52 mm", "0 mm"]'
LOOKING_AWAY = '["60 mm", "45 mm", "-2000 mm"]'


def write_profile(
    folder: Path,
    *,
    time_scale: float = 50.0,
    positions: int = 4,
    look_at: str = LOOKING_AT_THE_TARGET,
    velocity: float = 100.0,
    max_reading_age: str = "2 s",
    defocus: str = "0.5 px",
    reach: float = 12.0,
    frame_rate: str = "60 Hz",
) -> Path:
    """Write the small rig's profile into `folder` and return the file."""
    path = folder / "small-rig.toml"
    path.write_text(
        SMALL_RIG.format(
            time_scale=time_scale,
            positions=positions,
            look_at=look_at,
            velocity=velocity,
            max_reading_age=max_reading_age,
            defocus=defocus,
            reach=reach,
            frame_rate=frame_rate,
        ),
        encoding="utf-8",
    )
    return path


def small_rig(folder: Path, **changes: object) -> Profile:
    """Return the small rig's profile; `changes` as in `write_profile`."""
    return load_profile(write_profile(folder, **changes))  # type: ignore[arg-type]
