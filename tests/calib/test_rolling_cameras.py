"""Cameras that roll while they look at a symmetric target: it is taken the same way round, or doubt is said.

Detection reads each picture by itself, with point 0 nearest to the picture's top left corner, so that a rolling camera
sees another corner there with every quarter or half turn.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from benchmarks.true_rig import Rig, unit
from calib import Calibration, solve
from calib.detection.labelling import upright
from calib.errors import UnsolvableError
from calib.observations import observe
from calib.prediction import predicted_by_views
from calib.session import SESSION_FORMAT, Session
from calib.targets import Target, target_points, target_symmetries
from calib.transforms import pose_error
from calib.twists import exp_twist
from tests.calib.scenes import FOCAL, HEIGHT, WIDTH, look_at, project

DISKS = {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018}
SQUARE = {**DISKS, "columns": 6}
SQUARE_BOARD = {"kind": "chessboard", "rows": 6, "columns": 6, "pitch": 0.03}
ODD_BOARD = {"kind": "chessboard", "rows": 5, "columns": 7, "pitch": 0.03}
EVEN_BOARD = {"kind": "chessboard", "rows": 6, "columns": 8, "pitch": 0.03}
SHIFTED = {"kind": "asymmetric_circle_grid", "rows": 8, "columns": 4, "pitch": 0.05, "disk_diameter": 0.02}
LENS = {
    "model": "opencv",
    "fx": FOCAL,
    "fy": FOCAL,
    "cx": WIDTH / 2,
    "cy": HEIGHT / 2,
    "distortion": [0.0] * 5,
}


def parsed(target: dict[str, Any]) -> Target:
    return TypeAdapter[Target](Target).validate_python(target)


def rolling_rig(target: dict[str, Any]) -> Rig:
    """Return a slide that carries a roll about the line of sight, from above onto the middle of the target."""
    middle = target_points(parsed(target)).mean(axis=0)
    mount = look_at(middle + np.array([0.0, -0.5, -0.9]), middle)
    axes = np.array([unit(mount[:3, 0] + 0.3 * mount[:3, 2]), mount[:3, 2]])
    return Rig(
        ["prismatic", "revolute"],
        axes,
        np.array([np.zeros(3), mount[:3, 3]]),
        np.array([1e-3, 0.0175]),
        mount,
    )


def turntable(target: dict[str, Any]) -> Rig:
    """Return a table that turns about the target's own axis of symmetry: its turns look like the target's."""
    rig, middle = rolling_rig(target), target_points(parsed(target)).mean(axis=0)
    return Rig(["revolute"], np.array([[0.0, 0.0, 1.0]]), middle[None], rig.scales[1:], rig.mount)


def rolled(rig: Rig, angle: float) -> Rig:
    """Return the rig with its camera rolled in its holder (degrees)."""
    return Rig(
        rig.kinds, rig.axes, rig.points, rig.scales, rig.mount @ exp_twist(np.radians([0, 0, angle, 0, 0, 0]))
    )


def slide(roll: float = 0.0) -> list[dict[str, Any]]:
    return [{"joint": "slide", "readings": [at, roll]} for at in np.linspace(-60, 60, 5)]


def rolls(first: float, last: float, count: int, at: float = 0.0) -> list[dict[str, Any]]:
    return [{"joint": "roll", "readings": [at, roll]} for roll in np.linspace(first, last, count)]


def turns(*readings: float) -> list[dict[str, Any]]:
    return [{"joint": "roll", "readings": [reading]} for reading in readings]


def session(
    rigs: Mapping[str, Rig],
    target: dict[str, Any],
    views: list[dict[str, Any]],
    unit: str = "counts",
    names: Sequence[str] = ("slide", "roll"),
) -> Session:
    """Return the session of cameras, each with its rig, that see all points of the target, each picture read alone."""
    kind, seen = parsed(target), []
    for view in views:
        rig = rigs[view.get("camera", "main")]
        pixels = project(target_points(kind), rig.pose(view["readings"]))
        assert (pixels > 0).all()
        assert (pixels < [WIDTH, HEIGHT]).all()
        read = pixels[upright(kind, pixels)].tolist()
        seen.append({**view, "points": {"ids": list(range(len(pixels))), "pixels": read}})
    kinds = next(iter(rigs.values())).kinds
    units = {"prismatic": "mm", "revolute": unit}
    return Session.model_validate(
        {
            "format": SESSION_FORMAT,
            "joints": [
                {"name": name, "kind": kind, "reading_unit": units[kind]}
                for name, kind in zip(names[-len(kinds) :], kinds, strict=True)
            ],
            "cameras": [
                {"name": name, "width": WIDTH, "height": HEIGHT, "intrinsics": LENS} for name in rigs
            ],
            "target": target,
            "views": seen,
        }
    )


def doubts(calibration: Calibration) -> list[str]:
    return [warning for warning in calibration.quality.warnings if "which way round" in warning]


def assert_true(session: Session, rigs: Mapping[str, Rig]) -> None:
    """The closed form has every view right, the target turned as a whole or not, and has no doubt."""
    calibration, readings = solve(session, "closed_form"), session.readings()
    assert doubts(calibration) == []
    worst = []
    for turn in [np.eye(4), *(symmetry.turned_from_world for symmetry in target_symmetries(session.target))]:
        angles = [
            pose_error(turn @ calibration.world_from_camera(readings, camera), rig.poses(readings))[1].max()
            for camera, rig in rigs.items()
        ]
        worst.append(max(angles))
    assert min(worst) < 1e-3


@pytest.mark.parametrize("target", [DISKS, SQUARE, SQUARE_BOARD, ODD_BOARD, EVEN_BOARD, SHIFTED])
@pytest.mark.parametrize(("step", "count"), [(10, 36), (25, 15), (40, 10)])
def test_a_camera_that_rolls_all_round(target: dict[str, Any], step: int, count: int) -> None:
    rigs = {"main": rolling_rig(target)}
    assert_true(session(rigs, target, slide() + rolls(0, step * (count - 1), count)), rigs)


@pytest.mark.parametrize("step", [60, 80, 100, 120])
def test_steps_of_more_than_a_quarter_turn(step: int) -> None:
    """The smaller turn of the camera is not the true one, and only one chain explains all of them."""
    rigs = {"main": rolling_rig(DISKS)}
    assert_true(session(rigs, DISKS, slide() + rolls(0, 3 * step, 4)), rigs)


def test_many_such_steps_are_refused_in_words() -> None:
    rigs = {"main": rolling_rig(SQUARE)}
    with pytest.raises(
        UnsolvableError, match="same after every turn by 90 degrees, so that views less than 45"
    ):
        solve(session(rigs, SQUARE, slide() + rolls(0, 400, 6)), "closed_form")


@pytest.mark.parametrize("target", [DISKS, SQUARE, SQUARE_BOARD])
@pytest.mark.parametrize("gap", [45, 80, 90, 100, 135, 150])
def test_two_sweeps_far_from_each_other(target: dict[str, Any], gap: int) -> None:
    rigs = {"main": rolling_rig(target)}
    near, far = rolls(0, 40, 5), rolls(40 + gap, 80 + gap, 5)
    assert_true(session(rigs, target, slide() + near + far), rigs)
    assert_true(session(rigs, target, near + slide(40 + gap)), rigs)


@pytest.mark.parametrize("target", [DISKS, SQUARE])
@pytest.mark.parametrize("first", [True, False])
def test_free_views_far_from_each_other(target: dict[str, Any], first: bool) -> None:
    rigs = {"main": rolling_rig(target)}
    places = [(20, 100), (-30, 170), (10, 250), (50, -120), (-50, 190)]
    free = [{"joint": None, "readings": [float(at), float(roll)]} for at, roll in places]
    sweeps = slide() + rolls(0, 40, 5)
    assert_true(session(rigs, target, free + sweeps if first else sweeps + free), rigs)


@pytest.mark.parametrize("target", [DISKS, SQUARE])
@pytest.mark.parametrize("angle", [0, 60, 90, 135, 180, 270])
def test_cameras_rolled_against_each_other(target: dict[str, Any], angle: float) -> None:
    rig = rolling_rig(target)
    rigs = {"main": rig, "second": rolled(rig, angle)}
    views = [{**view, "camera": camera} for camera in rigs for view in slide() + rolls(-20, 20, 5)]
    assert_true(session(rigs, target, views), rigs)


def test_cameras_that_do_not_turn_at_all() -> None:
    """Of a slide alone, only the directions in which the cameras went tell."""
    rig = rolling_rig(DISKS)
    rig = Rig(rig.kinds[:1], rig.axes[:1], rig.points[:1], rig.scales[:1], rig.mount)
    rigs = {"main": rig, "second": rolled(rig, 180)}
    views = [{"joint": "slide", "readings": view["readings"][:1]} for view in slide()]
    both = [{**view, "camera": camera} for camera in rigs for view in views]
    assert_true(session(rigs, DISKS, both, names=["slide"]), rigs)


def test_a_turntable_with_its_axis_through_the_middle_of_the_target() -> None:
    rigs = {"main": turntable(DISKS)}
    assert_true(session(rigs, DISKS, turns(*range(0, 351, 10))), rigs)
    assert_true(session(rigs, DISKS, turns(0, 10, 20, 30, 150, 160, 170)), rigs)


@pytest.mark.parametrize(("readings", "views"), [((0, 100), "view 1"), ((0, 100, 200, 300), "views 1, 3")])
def test_what_readings_cannot_decide_is_said(readings: tuple[float, ...], views: str) -> None:
    """A turn by 100 counts is one by 100 degrees, or one by -80 of a target that is read the other way round."""
    rigs = {"main": turntable(DISKS)}
    (doubt,) = doubts(solve(session(rigs, DISKS, turns(*readings)), "closed_form"))
    assert doubt.startswith(f"which way round the circle grid is seen in {views} cannot be told: ")
    # A unit that is an angle decides.
    assert_true(session(rigs, DISKS, turns(*readings), unit="deg"), rigs)


def test_a_second_camera_that_may_see_it_either_way_round_is_named() -> None:
    """Turned about the target's axis of symmetry, a camera does the same on the opposite side."""
    rigs = {"main": turntable(DISKS), "second": rolled(turntable(DISKS), 10)}
    views = [{**view, "camera": camera} for camera in rigs for view in turns(*range(0, 110, 10))]
    (doubt,) = doubts(solve(session(rigs, DISKS, views), "closed_form"))
    assert "in views 11, 12, 13, 14, 15, 16, 17, 18 and 3 more cannot be told" in doubt


def drawn() -> tuple[Session, Rig]:
    """Return views all round, none of a joint alone, with the drawing of the rig: a tilt that carries the roll."""
    rolling, middle = rolling_rig(DISKS), target_points(parsed(DISKS)).mean(axis=0)
    axes = np.array([unit([1.0, 0.3, 0.0]), rolling.axes[1]])
    scales = np.array([0.0175, 0.0175])
    rig = Rig(["revolute", "revolute"], axes, np.array([middle, middle]), scales, rolling.mount)
    readings = np.column_stack([np.random.default_rng(4).uniform(-15, 15, 14), np.linspace(-60, 260, 14)])
    views = [{"joint": None, "readings": at} for at in readings.tolist()]
    rows = [(0.0, scales[0]), (float(np.arccos(axes[0] @ axes[1])), scales[1])]
    nominal = {
        "convention": "modified_dh",
        "dh": [{"a": 0.0, "alpha": bend, "d": 0.0, "theta": 0.0, "scale": scale} for bend, scale in rows],
        "std": {"length": 0.001, "angle": 0.001, "scale": 0.001},
    }
    taken = session({"main": rig}, DISKS, views, names=["tilt", "roll"])
    document = taken.model_dump(mode="json", exclude_unset=True) | {"nominal": nominal}
    return Session.model_validate(document), rig


def test_a_drawing_decides_without_sweeps() -> None:
    session, _ = drawn()
    calibration, readings = solve(session), session.readings()
    assert doubts(calibration) == []
    assert calibration.quality.rms_px is not None
    assert calibration.quality.rms_px < 0.01
    # The world stays the way round that was chosen once, whichever view comes first.
    later = session.model_copy(update={"origin": calibration.origin}).with_views(session.views[5:])
    again = solve(later).world_from_camera(readings)
    assert np.allclose(again, calibration.world_from_camera(readings), atol=1e-3)


def test_a_drawing_predicts_without_sweeps() -> None:
    session, rig = drawn()
    points, observations = target_points(session.target), observe(session).observations
    for view in (0, 6, 13):
        readings = session.views[view].readings
        others = [observation for observation in observations if observation.view != view]
        predicted = predicted_by_views(session, others, readings)
        seen = project(points, rig.pose(readings))[predicted.ids]
        turned = seen[::-1]  # all points are in the picture, and a half turn reverses their order
        away = [np.linalg.norm(way - predicted.pixels, axis=1).max() for way in (seen, turned)]
        assert len(predicted.ids) == len(points)
        assert min(away) < 0.1
