"""The rig as a URDF: links and joints in metres and radians, each camera and its optical frame.

    world ── slide ── slide_link ── pan ── pan_link ── main_camera ── main_optical_frame
      └── base

Each link's frame stands on its joint's axis with the world's directions where all readings are 0: a chain of screws,
exact also where D-H frames run off to infinity. `world` is the target's frame, `base` the calibration's. A camera's
body has x forwards and z up (REP 103), its optical frame is the one that poses are of.

A joint's value is its scale times its reading, in rad or m. Each joint says so in an `activecam:reading`, which
readers of URDF pass over. Backlash and once-per-turn errors cannot be said in a URDF; a coupling is a further joint on
the same axis that mimics the one by which it moves.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, hypot
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from calib import Calibration
from calib.calibration import JointScrew
from calib.errors import CalibError
from calib.stated_corrections import StatedCoupling
from calib.transforms import inverse, transform
from daemon.export.subject import AxisTravel

Array = NDArray[np.float64]

NAMESPACE: Final = "urn:activecam:urdf"
WORLD, BASE = "world", "base"
BODY_FROM_OPTICAL: Final = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
"""Forwards is the optical frame's z, left its -x, up its -y."""
HEAD: Final = """
    A joint's value is scale x reading, in rad or m: the activecam:reading of each joint says the scale and the unit.
    All readings are 0 where all values are. world is the frame of the calibration's target, base that of its chain.
    Poses are those of the optical frames. Efforts are not known, and stand at 0.
"""


@dataclass(frozen=True)
class Limits:
    """How far a joint goes, in its reading unit, how fast (a second; None if not known), and who says so."""

    low: float
    high: float
    velocity: float | None
    by: str


def urdf(calibration: Calibration, rig: str | None, axes: Mapping[str, AxisTravel]) -> bytes:
    """Return the rig as a URDF; limits and velocities are those of `axes`, else the range of the calibration.

    Raises CalibError for a calibration of a lens alone.
    """
    if not calibration.joints:
        raise CalibError("this calibration is of a lens alone: it knows no joints, and no place of a camera")
    robot = ET.Element("robot", {"name": rig or "activecam", "xmlns:activecam": NAMESPACE})
    robot.append(ET.Comment(HEAD))
    for note in urdf_notes(calibration):
        robot.append(ET.Comment(f" {note.replace('--', '- -')} "))
    tree = _Tree(robot, calibration)
    tree.fixed(WORLD, BASE, np.array(calibration.world_from_base))
    limits = {joint.name: _limits(calibration, i, axes) for i, joint in enumerate(calibration.joints)}
    place, parent = np.zeros(3), WORLD
    links: dict[str | None, tuple[str, Array]] = {}
    for joint in calibration.joints:
        point = np.array(joint.point)
        for coupling in calibration.corrections.coupling:
            if coupling.joint == joint.name:
                parent = tree.coupled(parent, joint, coupling, point - place, limits[coupling.by])
                place = point
        parent = tree.moving(parent, joint, point - place, limits[joint.name])
        place = point
        links[joint.name] = links[None] = parent, place
    for camera in calibration.cameras:
        if camera.link_from_camera is not None:
            link, place = links[camera.link]
            mount = calibration.world_from_camera(np.zeros(len(calibration.joints)), camera.name)
            body = mount @ inverse(BODY_FROM_OPTICAL)
            tree.fixed(link, f"{camera.name}_camera", transform(np.eye(3), -place) @ body)
            tree.fixed(f"{camera.name}_camera", f"{camera.name}_optical_frame", BODY_FROM_OPTICAL)
    ET.indent(robot)
    return bytes(ET.tostring(robot, encoding="utf-8", xml_declaration=True)) + b"\n"


def urdf_notes(calibration: Calibration) -> list[str]:
    """Return sentences on what of the calibration a URDF cannot say."""
    joints, notes = {joint.name: joint for joint in calibration.joints}, []
    for gap in calibration.corrections.backlash:
        size = _size(joints[gap.joint], abs(gap.half_gap))
        notes.append(
            f"a URDF knows no backlash: '{gap.joint}' stands amid its play here, and up to {size} beside it in truth"
        )
    for wave in calibration.corrections.once_per_turn:
        # The wave is 0 at reading 0, and goes as far as its height beyond its middle.
        size = _size(joints[wave.joint], abs(wave.cosine) + hypot(wave.cosine, wave.sine))
        notes.append(
            f"a URDF knows no errors that return every turn: '{wave.joint}' is up to {size} from where it is said to be"
        )
    return notes


def _size(joint: JointScrew, readings: float) -> str:
    size = joint.scale * readings
    return f"{degrees(size):.2g} deg" if joint.kind == "revolute" else f"{1e3 * size:.2g} mm"


def _limits(calibration: Calibration, index: int, axes: Mapping[str, AxisTravel]) -> Limits:
    joint = calibration.joints[index]
    axis = axes.get(joint.name)
    if axis is not None and axis.unit == joint.reading_unit:
        return Limits(axis.low, axis.high, axis.velocity, by="profile")
    low, high = calibration.range[index]
    return Limits(low, high, None, by="calibration")


class _Tree:
    """The links and joints of a robot, added one by one."""

    def __init__(self, robot: ET.Element, calibration: Calibration) -> None:
        self._robot = robot
        self._joints = {joint.name: joint for joint in calibration.joints}
        self._names = set(self._joints)
        ET.SubElement(robot, "link", name=WORLD)

    def moving(self, parent: str, joint: JointScrew, offset: Array, limits: Limits) -> str:
        """Add a joint of the rig with its link, whose frame stands `offset` (m) from the parent's; return the link."""
        link = f"{joint.name}_link"
        element = self._joint(joint.name, joint.kind, parent, link, offset)
        _axis(element, joint, limits, joint.scale)
        _sub(
            element,
            "activecam:reading",
            unit=joint.reading_unit,
            scale=joint.scale,
            scale_std=joint.scale_std,
        )
        _sub(element, "activecam:limits", low=limits.low, high=limits.high, by=limits.by)
        return link

    def coupled(
        self, parent: str, joint: JointScrew, coupling: StatedCoupling, offset: Array, by: Limits
    ) -> str:
        """Add what another joint moves `joint` by, as a joint on the same axis that mimics it; return its link."""
        name = self._free(f"{joint.name}_by_{coupling.by}")
        element = self._joint(name, joint.kind, parent, f"{name}_link", offset)
        _axis(element, joint, by, joint.scale * coupling.factor)
        factor = joint.scale * coupling.factor / self._joints[coupling.by].scale
        _sub(element, "mimic", joint=coupling.by, multiplier=factor, offset=0.0)
        return f"{name}_link"

    def fixed(self, parent: str, child: str, parent_from_child: Array) -> None:
        """Add a link that stands still on another one."""
        name = self._free(f"{child}_mount")
        self._joint(
            name, "fixed", parent, child, parent_from_child[:3, 3], _roll_pitch_yaw(parent_from_child)
        )

    def _joint(
        self, name: str, kind: str, parent: str, child: str, xyz: Array, rpy: Array | None = None
    ) -> ET.Element:
        ET.SubElement(self._robot, "link", name=child)
        element = ET.SubElement(self._robot, "joint", name=name, type=kind)
        _sub(element, "parent", link=parent)
        _sub(element, "child", link=child)
        _sub(element, "origin", xyz=xyz, rpy=np.zeros(3) if rpy is None else rpy)
        return element

    def _free(self, name: str) -> str:
        while name in self._names:
            name += "_"
        self._names.add(name)
        return name


def _axis(element: ET.Element, joint: JointScrew, limits: Limits, scale: float) -> None:
    low, high = sorted((scale * limits.low, scale * limits.high))
    _sub(element, "axis", xyz=np.array(joint.axis) / np.linalg.norm(joint.axis))
    _sub(element, "limit", lower=low, upper=high, effort=0.0, velocity=abs(scale) * (limits.velocity or 0.0))


def _sub(parent: ET.Element, tag: str, **attributes: str | float | Array | None) -> None:
    """Add an element; numbers with all their digits, and nothing where there is None."""
    texts = {
        name: value
        if isinstance(value, str)
        else " ".join(repr(number) for number in np.ravel(value).tolist())
        for name, value in attributes.items()
        if value is not None
    }
    ET.SubElement(parent, tag, texts)


def _roll_pitch_yaw(matrix: Array) -> Array:
    """Return the angles (3,) about fixed x, y, z of a rotation, exact also where it looks along z."""
    yaw = np.arctan2(matrix[1, 0], matrix[0, 0])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-matrix[2, 0], cosine * matrix[0, 0] + sine * matrix[1, 0])
    roll = np.arctan2(
        sine * matrix[0, 2] - cosine * matrix[1, 2], cosine * matrix[1, 1] - sine * matrix[0, 1]
    )
    return np.array([roll, pitch, yaw])
