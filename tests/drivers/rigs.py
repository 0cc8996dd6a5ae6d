"""Simulated rigs for the tests: a slide that carries a pan that carries a camera, before a plate."""

import math
from collections.abc import Mapping
from typing import Any

from drivers.axis import AxisSpec
from drivers.camera import CameraSpec
from drivers.clock import Clock
from drivers.simulated.camera import SimulatedCamera, SimulatedCameraOptions
from drivers.simulated.controller import (
    SimulatedAxisOptions,
    SimulatedController,
    SimulatedControllerOptions,
)
from drivers.simulated.options import SimulationOptions
from drivers.simulated.world import SimulatedWorld
from tests.drivers.clocks import VirtualClock

TARGETS: dict[str, dict[str, Any]] = {
    "circle_grid": {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018},
    "asymmetric_circle_grid": {
        "kind": "asymmetric_circle_grid",
        "rows": 11,
        "columns": 4,
        "pitch": 0.04,
        "disk_diameter": 0.015,
    },
    "chessboard": {"kind": "chessboard", "rows": 6, "columns": 9, "pitch": 0.025},
    "charuco": {
        "kind": "charuco",
        "rows": 7,
        "columns": 10,
        "pitch": 0.025,
        "marker": 0.018,
        "dictionary": "DICT_5X5_100",
    },
    "aprilgrid": {"kind": "aprilgrid", "rows": 5, "columns": 6, "tag": 0.028, "spacing": 0.009},
}

SLIDE = AxisSpec("slide", "prismatic", "mm", (-100.0, 100.0), 50.0, 200.0, 0.01)
PAN = AxisSpec("pan", "revolute", "deg", (-20.0, 20.0), 10.0, 40.0, 0.01)

LENS = {"fx": "1400 px", "fy": "1405 px", "cx": "633 px", "cy": "487 px"}
DISTORTION = [-0.2, 0.08, 0.001, -0.0005, 0.01]
WIDTH, HEIGHT = 1280, 960


def mm(*values: float) -> list[str]:
    return [f"{value!r} mm" for value in values]


def camera_truth(**changes: Any) -> dict[str, Any]:
    return {
        "position": mm(90, 75, -450),
        "look_at": mm(90, 75, 0),
        "lens": {**LENS, "distortion": DISTORTION},
    } | changes


def joint_truths(slide: Mapping[str, Any] | None = None, pan: Mapping[str, Any] | None = None) -> list[Any]:
    return [
        {"axis": [1, 0, 0], "scale": 0.001} | dict(slide or {}),
        {"axis": [0, 2, 0], "point": mm(90, 0, -500), "scale": math.radians(1)} | dict(pan or {}),
    ]


def still_world(
    kind: str = "circle_grid", plate: Mapping[str, Any] | None = None, **camera: Any
) -> SimulatedWorld:
    """A camera on a stand: no axes."""
    options = SimulationOptions.model_validate({"camera": camera_truth(**camera), "plate": plate or {}})
    return SimulatedWorld(options, [], TARGETS[kind], VirtualClock())


def world(
    clock: Clock,
    *,
    slide: Mapping[str, Any] | None = None,
    pan: Mapping[str, Any] | None = None,
    **camera: Any,
) -> SimulatedWorld:
    options = SimulationOptions.model_validate(
        {"camera": camera_truth(**camera), "joints": joint_truths(slide, pan)}
    )
    return SimulatedWorld(options, [SLIDE, PAN], TARGETS["circle_grid"], clock)


def controller(world: SimulatedWorld, **options: Any) -> SimulatedController:
    specs = {"slide": SLIDE, "pan": PAN}
    axes = {name: SimulatedAxisOptions() for name in specs}
    return SimulatedController(
        specs, SimulatedControllerOptions.model_validate(options), axes, world, world.clock
    )


def camera(
    world: SimulatedWorld, width: int = WIDTH, height: int = HEIGHT, **options: Any
) -> SimulatedCamera:
    spec = CameraSpec("main", width, height)
    return SimulatedCamera(spec, SimulatedCameraOptions.model_validate(options), world, world.clock)
