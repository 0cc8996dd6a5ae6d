"""The URDF in another program's hands: its camera stands where `activecam pose` says that it does."""

import json
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yourdfpy

from calib import Calibration, load_calibration, save_calibration
from calib.errors import CalibError
from calib.transforms import pose_error
from daemon.cli.main import main
from daemon.export.subject import axes_of
from daemon.export.urdf import NAMESPACE, urdf, urdf_notes
from tests.calib.rigs import random_rig
from tests.daemon.export.subjects import calibration_of, profile_document, random_readings

RIGS = ["paper-table", "pan-tilt", "turntable", "six-axis-arm"]
READING = f"{{{NAMESPACE}}}reading"


def robot_of(document: bytes) -> Any:
    """Return the URDF as yourdfpy reads it."""
    return yourdfpy.URDF.load(BytesIO(document), load_meshes=False, build_scene_graph=True)


def values_of(document: bytes, readings: np.ndarray) -> dict[str, float]:
    """Return the joints' values at readings in chain order, by what the file says of its scales."""
    scales = {
        joint.attrib["name"]: float(reading.attrib["scale"])
        for joint in ET.fromstring(document).findall("joint")
        if (reading := joint.find(READING)) is not None
    }
    return {
        name: scale * reading
        for (name, scale), reading in zip(scales.items(), readings.tolist(), strict=True)
    }


def pose_by_command(file: Path, readings: np.ndarray, capsys: pytest.CaptureFixture[str]) -> np.ndarray:
    wanted = file.with_name("readings.json")
    wanted.write_text(json.dumps(readings.tolist()))
    with pytest.raises(SystemExit) as ended:
        main(["pose", str(file), "--readings-file", str(wanted)])
    assert ended.value.code == 0
    return np.array([pose["world_from_camera"] for pose in json.loads(capsys.readouterr().out)["poses"]])


@pytest.mark.parametrize("name", RIGS)
def test_the_camera_of_a_shipped_rig_stands_where_the_command_says(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "calibration.json", tmp_path / "out"
    save_calibration(calibration_of(name), file)
    with pytest.raises(SystemExit) as ended:
        main(["export", str(file), "rig.urdf", "-o", str(out), "--profile", name])
    assert ended.value.code == 0
    capsys.readouterr()
    document = (out / "rig.urdf").read_bytes()
    robot = robot_of(document)
    calibration = load_calibration(file)
    readings = random_readings(calibration, 20)
    optical = f"{calibration.cameras[0].name}_optical_frame"
    for at, pose in zip(readings, pose_by_command(file, readings, capsys), strict=True):
        robot.update_cfg(values_of(document, at))
        np.testing.assert_allclose(robot.get_transform(optical, "world"), pose, atol=1e-9)
        base = calibration.base_from_world() @ pose
        np.testing.assert_allclose(robot.get_transform(optical, "base"), base, atol=1e-9)


@pytest.mark.parametrize("arrangement", ["skew", "parallel", "coaxial", "intersecting"])
def test_any_chain_can_be_said_also_where_dh_cannot(arrangement: str) -> None:
    rng = np.random.default_rng(5)
    kinds = ["revolute", "prismatic", "revolute", "revolute"]
    rig = random_rig(rng, kinds, [arrangement] * 3)
    rig.axes[3] += 1e-7  # all but parallel to what it may be parallel to: D-H runs off to infinity
    rig.axes[3] /= np.linalg.norm(rig.axes[3])
    calibration = calibration_from(rig)
    document = urdf(calibration, None, {})
    robot = robot_of(document)
    for at in rng.uniform(-1, 1, (10, 4)) / rig.scales:
        robot.update_cfg(values_of(document, at))
        np.testing.assert_allclose(
            robot.get_transform("main_optical_frame", "world"), calibration.world_from_camera(at), atol=1e-9
        )


def test_a_coupled_joint_moves_along_with_the_other() -> None:
    coupling = {"joint": "tilt", "by": "pan", "factor": 0.03}
    calibration = calibration_of("pan-tilt", corrections={"coupling": [coupling]})
    document = urdf(calibration, None, {})
    robot = robot_of(document)
    assert urdf_notes(calibration) == []
    for at in random_readings(calibration, 10):
        robot.update_cfg(values_of(document, at))
        pose = calibration.world_from_camera(at)
        np.testing.assert_allclose(robot.get_transform("eye_optical_frame", "world"), pose, atol=1e-9)


def test_what_a_urdf_cannot_say_is_said_in_it_and_is_as_large_as_that() -> None:
    corrections = {
        "backlash": [{"joint": "slide", "half_gap": 0.04}],
        "once_per_turn": [{"joint": "pan", "turn": 360.0, "cosine": 0.3, "sine": 0.4}],
    }
    calibration = calibration_of("paper-table", corrections=corrections)
    document = urdf(calibration, None, {})
    backlash, wave = urdf_notes(calibration)
    assert "backlash: 'slide' stands amid its play here, and up to 0.04 mm beside it" in backlash
    assert "every turn: 'pan' is up to 0.8 deg" in wave
    assert {backlash, wave} <= {text.strip() for text in comments_of(document)}
    robot = robot_of(document)
    seen = []
    for pan in np.linspace(0, 360, 73):
        at = np.array([0.0, pan])
        robot.update_cfg(values_of(document, at))
        said = robot.get_transform("main_optical_frame", "world")
        seen.append(np.degrees(pose_error(said[None], calibration.world_from_camera(at)[None])[1][0]))
    assert max(seen) == pytest.approx(0.8, abs=0.01)


def comments_of(document: bytes) -> list[str]:
    tree = ET.fromstring(document, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    return [str(element.text) for element in tree if element.tag is ET.Comment]


def test_limits_are_the_profiles_or_else_the_calibrated_range() -> None:
    calibration = calibration_of("paper-table")
    slide, _ = calibration.joints
    profile = profile_document("paper-table")
    [axis] = [axis for axis in profile["axes"] if axis["name"] == "slide"]
    limit = robot_of(urdf(calibration, None, axes_of(profile))).joint_map["slide"].limit
    assert (limit.lower, limit.upper) == tuple(slide.scale * end for end in axis["limits"])
    assert limit.velocity == slide.scale * axis["velocity"]
    without = urdf(calibration, None, {})
    limit = robot_of(without).joint_map["slide"].limit
    assert (limit.lower, limit.upper) == tuple(slide.scale * end for end in calibration.range[0])
    assert limit.velocity == 0
    said = [element.attrib["by"] for element in ET.fromstring(without).iter(f"{{{NAMESPACE}}}limits")]
    assert said == ["calibration", "calibration"]


def test_a_profile_that_counts_otherwise_tells_no_limits() -> None:
    profile = profile_document("paper-table")
    profile["axes"][0]["unit"] = "counts"
    assert urdf(calibration_of("paper-table"), None, axes_of(profile)).count(b'by="calibration"') == 1


def test_names_that_xml_and_others_use_do_no_harm() -> None:
    renamed = calibration_of("turntable").model_dump_json(exclude_unset=True)
    calibration = Calibration.model_validate_json(renamed.replace('"table"', '"main_camera_mount"'))
    document = urdf(calibration, 'a <rig> & "more" -- of them', {})
    robot = robot_of(document)
    assert len({joint.name for joint in robot.robot.joints}) == len(robot.robot.joints) == 4
    assert robot.robot.name == 'a <rig> & "more" -- of them'
    robot.update_cfg(values_of(document, np.array([10.0])))
    pose = calibration.world_from_camera([10.0])
    np.testing.assert_allclose(robot.get_transform("main_optical_frame", "world"), pose, atol=1e-9)


def test_a_lens_alone_makes_no_rig() -> None:
    lens = calibration_of("turntable").model_dump(mode="json", exclude_unset=True)
    lens |= {
        "joints": [],
        "dh": [],
        "range": [],
        "cameras": [{"name": "main", "link": None, "link_from_camera": None}],
    }
    lens["cameras"][0]["intrinsics"] = None
    with pytest.raises(CalibError, match="of a lens alone"):
        urdf(Calibration.model_validate(lens), None, {})


def calibration_from(rig: Any) -> Calibration:
    """Return the calibration that says of `rig` what is true."""
    count = len(rig.kinds)
    return Calibration.model_validate(
        {
            "format": "activecam.calibration/1",
            "method": "closed_form",
            "joints": [
                {
                    "name": f"j{i}",
                    "kind": kind,
                    "reading_unit": "counts",
                    "scale": rig.scales[i],
                    "axis": rig.axes[i].tolist(),
                    "point": rig.points[i].tolist(),
                }
                for i, kind in enumerate(rig.kinds)
            ],
            "dh": [
                {"a_prev": 0, "alpha_prev": 0, "d_offset": 0, "theta_offset": 0, "scale": 1}
                for _ in range(count)
            ],
            "world_from_base": np.eye(4).tolist(),
            "cameras": [
                {
                    "name": "main",
                    "link": f"j{count - 1}",
                    "link_from_camera": np.eye(4).tolist(),
                    "intrinsics": None,
                    "world_from_camera": rig.mount.tolist(),
                }
            ],
            "range": [[-1, 1]] * count,
            "quality": {},
        }
    )
