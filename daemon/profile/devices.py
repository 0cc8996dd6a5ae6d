"""The devices that a profile names: their drivers, and the options that these check themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from calib.session import Intrinsics, IntrinsicsStd, problem_of_std
from daemon.profile.problems import Problems
from daemon.profile.tables import AxisTable, CameraTable, ControllerTable
from drivers import registry
from drivers.camera import CameraSpec
from drivers.errors import OptionsError


@dataclass(frozen=True, slots=True)
class ControllerProfile:
    """A device that drives axes."""

    driver: str
    options: BaseModel
    """An instance of the driver's `Options`."""


@dataclass(frozen=True, slots=True)
class CameraProfile:
    """The rig's camera."""

    spec: CameraSpec
    driver: str
    options: BaseModel
    """An instance of the driver's `Options`."""
    link: str | None
    """The axis that it rides on; None for the last one."""
    intrinsics: Intrinsics | None
    """Its lens, where it is known beforehand."""
    intrinsics_std: IntrinsicsStd | None
    """How well; exactly where that is not said."""


def resolve_controllers(
    tables: Mapping[str, ControllerTable], axes: list[AxisTable], problems: Problems
) -> dict[str, ControllerProfile]:
    """Return the controllers whose driver and options are right, noting what is wrong with the others."""
    used = {axis.controller for axis in axes}
    controllers = {}
    for name, table in tables.items():
        path = ("controllers", name)
        if name not in used:
            problems.add(path, f"no axis uses it: give an axis controller = '{name}', or remove it")
        try:
            driver = registry.controller_driver(table.driver)
        except OptionsError as error:
            problems.add((*path, "driver"), str(error))
            continue
        options = problems.validate(driver.Options, table.model_extra or {}, path)
        if options is not None:
            controllers[name] = ControllerProfile(table.driver, options)
    return controllers


def resolve_axis_options(
    index: int, axis: AxisTable, controllers: Mapping[str, ControllerTable], problems: Problems
) -> BaseModel | None:
    """Return an axis's options as its controller's driver wants them, or None after noting a problem."""
    path = ("axes", index)
    if axis.controller not in controllers:
        defined = ", ".join(controllers) or "none"
        problems.add(
            (*path, "controller"),
            f"there is no [controllers.{axis.controller}]; controllers are {defined}",
        )
        return None
    try:
        driver = registry.controller_driver(controllers[axis.controller].driver)
    except OptionsError:
        return None  # noted where the controller names it
    return problems.validate(driver.AxisOptions, axis.options, (*path, "options"))


def resolve_camera(table: CameraTable, axes: list[AxisTable], problems: Problems) -> CameraProfile | None:
    """Return the camera, or None after noting what is wrong with its driver or options."""
    names = [axis.name for axis in axes]
    if table.link is not None and table.link not in names:
        problems.add(("camera", "link"), f"'{table.link}' is not an axis; axes are {', '.join(names)}")
    _check_intrinsics(table, problems)
    try:
        driver = registry.camera_driver(table.driver)
    except OptionsError as error:
        problems.add(("camera", "driver"), str(error))
        return None
    options = problems.validate(driver.Options, table.options, ("camera", "options"))
    if options is None:
        return None
    spec = CameraSpec(table.name, table.width, table.height)
    intrinsics = table.intrinsics and Intrinsics.model_validate(
        table.intrinsics.model_dump(exclude_unset=True)
    )
    std = table.intrinsics_std and IntrinsicsStd.model_validate(
        table.intrinsics_std.model_dump(exclude_unset=True)
    )
    return CameraProfile(spec, table.driver, options, table.link, intrinsics, std)


def _check_intrinsics(table: CameraTable, problems: Problems) -> None:
    if problem := problem_of_std(table.intrinsics, table.intrinsics_std):
        problems.add(("camera", "intrinsics_std"), problem)
    known: dict[str, Any] = table.intrinsics.model_dump(exclude_none=True) if table.intrinsics else {}
    for key in ("width", "height"):
        size = getattr(table, key)
        if known.get(key, size) != size:
            problems.add(
                ("camera", "intrinsics", key),
                f"is {known[key]} and the camera's pictures have {size}: "
                "give the lens as calibrated at the camera's own size",
            )
