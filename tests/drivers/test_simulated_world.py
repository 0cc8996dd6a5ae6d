import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.linalg import expm

from drivers.axis import AxisSpec
from drivers.errors import OptionsError
from drivers.simulated.motion import trapezoid
from drivers.simulated.options import SimulationOptions
from drivers.simulated.world import SimulatedWorld
from tests.drivers import rigs
from tests.drivers.clocks import VirtualClock

CLOCK = VirtualClock()


def make(joints: list[Any], axes: list[AxisSpec], **camera: Any) -> SimulatedWorld:
    options = SimulationOptions.model_validate({"camera": rigs.camera_truth(**camera), "joints": joints})
    return SimulatedWorld(options, axes, rigs.TARGETS["circle_grid"], CLOCK)


def test_at_zero_the_camera_is_where_the_profile_says() -> None:
    pose = rigs.world(CLOCK).world_from_camera([0.0, 0.0])
    # It looks along +Z with the target's rows running downwards: the world's axes are its own.
    assert np.allclose(pose, [[1, 0, 0, 0.09], [0, 1, 0, 0.075], [0, 0, 1, -0.45], [0, 0, 0, 1]], atol=1e-15)


def test_a_hand_computed_pose() -> None:
    pose = rigs.world(CLOCK).world_from_camera([50.0, 90.0])
    # The camera is 50 mm in front of the pan's axis, and +90 degrees about +Y turn +Z into +X.
    assert np.allclose(pose[:3, 3], [0.09 + 0.05 + 0.05, 0.075, -0.5], atol=1e-15)
    assert np.allclose(pose[:3, 2], [1, 0, 0], atol=1e-15)
    assert np.allclose(pose[:3, 0], [0, 0, -1], atol=1e-15)


def test_zero_is_added_to_the_reading() -> None:
    shifted = rigs.world(CLOCK, slide={"zero": "20 mm"})
    assert np.allclose(
        shifted.world_from_camera([30.0, 7.0]), rigs.world(CLOCK).world_from_camera([50.0, 7.0])
    )


def test_a_coupled_joint_moves_along() -> None:
    coupled = rigs.world(CLOCK, pan={"coupling": {"slide": 0.5}})
    # Half a radian of pan for each metre of the slide.
    turned = rigs.world(CLOCK).world_from_camera([30.0, 7.0 + math.degrees(0.5 * 0.03)])
    assert np.allclose(coupled.world_from_camera([30.0, 7.0]), turned, atol=1e-12)
    assert np.array_equal(
        coupled.world_from_camera([0.0, 7.0]), rigs.world(CLOCK).world_from_camera([0.0, 7.0])
    )


@pytest.mark.parametrize("other", ["pan", "tilt"])
def test_a_joint_is_coupled_to_another_one_of_the_rig(other: str) -> None:
    with pytest.raises(
        OptionsError, match=f"axis 'pan' is coupled to '{other}': choose another one of slide, pan"
    ):
        rigs.world(CLOCK, pan={"coupling": {other: 0.5}})


def test_a_camera_on_an_earlier_link_ignores_what_it_does_not_ride_on() -> None:
    world = rigs.world(CLOCK, link="slide")
    assert np.array_equal(world.world_from_camera([30.0, 0.0]), world.world_from_camera([30.0, 15.0]))
    assert not np.array_equal(world.world_from_camera([30.0, 0.0]), world.world_from_camera([31.0, 0.0]))


def test_an_orientation_can_be_given_exactly() -> None:
    rotation = ["10 deg", "-20 deg", "170 deg"]
    world = make([], [], look_at=None, rotation=rotation)
    expected = cv2.Rodrigues(np.radians([10.0, -20.0, 170.0]))[0]
    assert np.allclose(world.world_from_camera([])[:3, :3], expected, atol=1e-14)


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["revolute", "prismatic"]),
            st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
            st.tuples(*[st.floats(-500, 500)] * 3),
            st.floats(0.001, 0.1),
            st.floats(-100, 100),
        ),
        max_size=6,
    )
)
def test_poses_are_those_of_matrix_exponentials(chain: list[Any]) -> None:
    expected = np.eye(4)
    for kind, axis, point, scale, reading in chain:
        unit, at = np.array(axis) / np.linalg.norm(axis), np.array(point) / 1000
        twist = np.zeros((4, 4))
        if kind == "revolute":
            twist[:3, :3] = [[0, -unit[2], unit[1]], [unit[2], 0, -unit[0]], [-unit[1], unit[0], 0]]
            twist[:3, 3] = np.cross(at, unit)
        else:
            twist[:3, 3] = unit
        expected = expected @ expm(twist * scale * reading)
    expected = expected @ make([], []).world_from_camera([])
    joints = [{"axis": axis, "point": rigs.mm(*point), "scale": scale} for _, axis, point, scale, _ in chain]
    axes = [AxisSpec(f"j{i}", link[0], "counts", (-100, 100), 1, 1, 1) for i, link in enumerate(chain)]
    readings = [link[4] for link in chain]
    assert np.allclose(make(joints, axes).world_from_camera(readings), expected, atol=1e-10)


def test_the_live_pose_follows_the_shafts() -> None:
    world = rigs.world(CLOCK)
    _, slide = world.shaft("slide")
    slide.place(0.0, -math.inf)
    motion = trapezoid(0.0, 40.0, 1.0, velocity=10.0, acceleration=20.0)
    slide.drive(motion)
    during = 1.0 + 0.4 * (motion.ends - 1.0)
    assert np.allclose(
        world.world_from_camera_at(during),
        world.world_from_camera([motion.position(during), 0.0]),
        atol=1e-15,
    )
    assert world.true_displacements(motion.ends)[0] == pytest.approx(0.04)


def test_projection_is_opencvs() -> None:
    world = rigs.world(CLOCK)
    readings = [20.0, 5.0]
    camera_from_world = np.linalg.inv(world.world_from_camera(readings))
    K = np.array([[1400, 0, 633], [0, 1405, 487], [0, 0, 1.0]])
    expected, _ = cv2.projectPoints(
        world.target_points(), cv2.Rodrigues(camera_from_world[:3, :3])[0], camera_from_world[:3, 3], K,
        np.array(rigs.DISTORTION),
    )  # fmt: skip
    assert np.abs(world.project(world.target_points(), readings) - expected[:, 0]).max() < 1e-9


def test_what_is_behind_the_camera_has_no_picture() -> None:
    assert np.isnan(rigs.world(CLOCK).project([[0.09, 0.075, -0.6]], [0.0, 0.0])).all()


@pytest.mark.parametrize("kind", rigs.TARGETS)
def test_points_of_every_target_begin_at_the_origin(kind: str) -> None:
    points = rigs.still_world(kind).target_points()
    assert np.array_equal(points[0], [0, 0, 0])
    assert points[1, 0] > 0
    assert points[1, 1] == 0
    assert points[-1, 1] > 0


def test_the_print_may_be_too_large_and_bulge_towards_the_camera() -> None:
    flat = rigs.still_world().target_points()
    warped = rigs.still_world(plate={"print_scale": 1.01, "bulge": "2 mm"}).target_points()
    assert np.allclose(warped[:, :2], flat[:, :2] * 1.01)
    assert -0.002 <= warped[:, 2].min() < -0.0018
    assert warped[:, 2].max() < 0


def test_options_that_do_not_fit_are_refused_with_the_reason() -> None:
    joints = rigs.joint_truths()
    with pytest.raises(OptionsError, match=r"describes 1 joints and the rig has 2 axes"):
        make(joints[:1], [rigs.SLIDE, rigs.PAN])
    with pytest.raises(OptionsError, match=r"axis 'pan' is revolute and .* has no 'point'"):
        make([joints[0], {"axis": [0, 1, 0], "scale": 0.01}], [rigs.SLIDE, rigs.PAN])
    with pytest.raises(OptionsError, match=r"'link' is 'tilt': choose one of the axes slide, pan"):
        make(joints, [rigs.SLIDE, rigs.PAN], link="tilt")
    with pytest.raises(OptionsError, match=r"cannot look along its own 'up'"):
        make([], [], up=[0, 0, 1])
    with pytest.raises(ValidationError, match="give either 'look_at' or 'rotation'"):
        make([], [], look_at=None)
    with pytest.raises(ValueError, match=r"one finite number for each axis: slide \(mm\), pan \(deg\)"):
        rigs.world(CLOCK).world_from_camera([1.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "hexagons"}, "'kind'"),
        ({"pitch": -0.01}, "'pitch'"),
        ({"rows": 2.5}, "'rows'"),
        ({"kind": "charuco", "marker": 0.01, "dictionary": "DICT_9X9"}, "knows such as 'DICT_5X5_100'"),
        (
            {"kind": "charuco", "marker": 0.01, "dictionary": "DICT_4X4_50", "rows": 40},
            "needs 140 different markers",
        ),
    ],
)
def test_a_target_that_cannot_be_printed_is_refused(change: dict[str, Any], message: str) -> None:
    options = SimulationOptions.model_validate({"camera": rigs.camera_truth()})
    with pytest.raises(OptionsError, match=message):
        SimulatedWorld(options, [], rigs.TARGETS["circle_grid"] | change, CLOCK)
