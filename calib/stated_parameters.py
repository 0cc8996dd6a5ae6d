"""A calibration's parameters one by one, as a person asks for them, each with its standard deviation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.calibration import Calibration

Unit = str
"""Such as m, rad, px, or rad/deg; empty for a number without one."""

Frame = Literal["none", "world"]


@dataclass(frozen=True)
class StatedParameter:
    """A parameter called `name`, such as `pan.scale`; `std` is None where it is not known.

    One in the `world` changes when the target is moved, even though the rig has not changed.
    """

    name: str
    value: float
    std: float | None
    unit: Unit
    frame: Frame


def stated_parameters(calibration: Calibration) -> list[StatedParameter]:
    """Return all parameters: joints, then their D-H rows, then cameras, then what imperfect joints and targets add."""
    stds = _stds(calibration)
    return [
        *_of_joints(calibration, stds),
        *_of_dh(calibration),
        *_of_cameras(calibration, stds),
        *_of_corrections(calibration),
    ]


def _stds(calibration: Calibration) -> dict[str, float]:
    """Return the standard deviation of each of the document's own numbers, by dotted path."""
    stated = calibration.covariance
    if stated is None:
        return {}
    variances = np.diag(np.array(stated.matrix)).clip(0)
    return dict(zip(stated.parameters, np.sqrt(variances).tolist(), strict=True))


def _of_joints(calibration: Calibration, stds: dict[str, float]) -> list[StatedParameter]:
    rows = []
    for index, joint in enumerate(calibration.joints):
        path, per = f"joints.{index}", f"{_si(joint.kind)}/{joint.reading_unit}"
        rows.append(StatedParameter(f"{joint.name}.scale", joint.scale, joint.scale_std, per, "none"))
        for place, letter in enumerate("xyz"):
            std = stds.get(f"{path}.axis.{place}")
            rows.append(StatedParameter(f"{joint.name}.axis.{letter}", joint.axis[place], std, "", "world"))
        if joint.kind == "revolute":  # where a straight axis lies, nothing tells
            for place, letter in enumerate("xyz"):
                std = stds.get(f"{path}.point.{place}")
                rows.append(
                    StatedParameter(f"{joint.name}.point.{letter}", joint.point[place], std, "m", "world")
                )
    return rows


def _of_dh(calibration: Calibration) -> list[StatedParameter]:
    """Return the D-H rows but the first, which says where the base is, and the scales, which the joints have."""
    units = {"a_prev": "m", "alpha_prev": "rad", "d_offset": "m", "theta_offset": "rad"}
    rows = []
    for joint, row in list(zip(calibration.joints, calibration.dh, strict=True))[1:]:
        for entry, unit in units.items():
            std = None if row.std is None else getattr(row.std, entry)
            rows.append(StatedParameter(f"{joint.name}.{entry}", getattr(row, entry), std, unit, "none"))
    return rows


def _of_cameras(calibration: Calibration, stds: dict[str, float]) -> list[StatedParameter]:
    rows = []
    for index, camera in enumerate(calibration.cameras):
        pose = camera.world_from_camera
        if pose is not None:
            for place, letter in enumerate("xyz"):
                std = stds.get(f"cameras.{index}.world_from_camera.{place}.3")
                name = f"{camera.name}.position.{letter}"
                rows.append(StatedParameter(name, pose[place][3], std, "m", "world"))
        if camera.intrinsics is not None:
            for place, (name, value) in enumerate(camera.intrinsics.numbers().items()):
                entry, unit = (name, "px") if place < 4 else (f"distortion.{place - 4}", "")
                std = stds.get(f"cameras.{index}.intrinsics.{entry}")
                rows.append(StatedParameter(f"{camera.name}.{name}", value, std, unit, "none"))
    return rows


def _of_corrections(calibration: Calibration) -> list[StatedParameter]:
    stated, units = calibration.corrections, {joint.name: joint.reading_unit for joint in calibration.joints}
    rows: list[tuple[str, float, float | None, Unit]] = [
        (f"{gap.joint}.half_gap", gap.half_gap, gap.half_gap_std, units[gap.joint]) for gap in stated.backlash
    ]
    for wave in stated.once_per_turn:
        name, unit = f"{wave.joint}.once_per_turn", units[wave.joint]
        rows.append((f"{name}.cosine", wave.cosine, wave.cosine_std, unit))
        rows.append((f"{name}.sine", wave.sine, wave.sine_std, unit))
    for share in stated.coupling:
        per = f"{units[share.joint]}/{units[share.by]}"
        rows.append((f"{share.joint}.coupling.{share.by}", share.factor, share.factor_std, per))
    if stated.target_warp is not None:
        warp = stated.target_warp
        stds: Sequence[float | None] = warp.heights_std or len(warp.shapes) * [None]
        rows += [
            (f"target.warp.{shape}", height, std, "m")
            for shape, height, std in zip(warp.shapes, warp.heights, stds, strict=True)
        ]
    rows += [(f"{one.camera}.aspect", one.aspect, one.aspect_std, "") for one in stated.aspect]
    return [StatedParameter(*row, "none") for row in rows]


def _si(kind: str) -> str:
    return "m" if kind == "prismatic" else "rad"
