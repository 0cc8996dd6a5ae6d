"""Checks that a profile's `[simulation]` is there when a device needs it, and fits the rig."""

from typing import Any, Final

from calib.targets import Target
from daemon.profile.axes import AxisProfile
from daemon.profile.problems import Problems
from daemon.profile.tables import ProfileTable
from drivers.clock import SystemClock
from drivers.emulators.registry import has_emulator
from drivers.errors import OptionsError

SIMULATED: Final = "simulated"
"""The name of the drivers that act in the simulated world."""


def check_simulation(
    table: ProfileTable, axes: list[AxisProfile], target: Target, problems: Problems
) -> None:
    """Note what is wrong between `[simulation]` and the rest of the profile."""
    named: list[tuple[tuple[str, ...], str]] = [
        (("controllers", name, "driver"), controller.driver) for name, controller in table.controllers.items()
    ]
    named.append((("camera", "driver"), table.camera.driver))
    simulated = [path for path, driver in named if driver == SIMULATED]
    emulated = [path for path, driver in named if has_emulator(path[0], driver)]
    if table.simulation is None:
        for path in simulated[:1]:
            problems.add(path, "a simulated device needs the table [simulation]")
        return
    if not simulated and not emulated:
        problems.add(
            ("simulation",),
            "no device is simulated, or has an emulator: remove the table, or use driver = 'simulated'",
        )
        return
    if len(simulated) < len(named) and table.simulation.time_scale != 1:
        problems.add(
            ("simulation", "time_scale"),
            "real drivers keep the pace of life, and so do emulators: remove it",
        )
    joints = len(table.simulation.joints)
    if joints != len(table.axes):
        problems.add(
            ("simulation", "joints"),
            f"describes {joints} joint{'s' if joints != 1 else ''} and the profile has {len(table.axes)} "
            f"ax{'e' if len(table.axes) != 1 else 'i'}s: give one for each axis, in the same order",
        )
        return
    from drivers.simulated.world import SimulatedWorld  # only a simulated rig pays for importing it

    printed: dict[str, Any] = target.model_dump()
    try:
        SimulatedWorld(table.simulation, [axis.spec for axis in axes], printed, SystemClock())
    except OptionsError as error:
        problems.add(("simulation",), str(error))
