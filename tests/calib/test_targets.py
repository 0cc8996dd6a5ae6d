"""The geometry of the prints, and their symmetries judged by turning what is printed."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    NoTarget,
    Target,
    target_points,
    target_symmetries,
)

ANY_TARGET: TypeAdapter[Target] = TypeAdapter(Target)
CIRCLE_GRID = {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018}

counts = st.integers(3, 7)
targets_with_symmetries = st.builds(
    lambda make, rows, columns: make(rows, columns),
    st.sampled_from(
        [
            lambda rows, columns: CircleGrid(rows=rows, columns=columns, pitch=0.03, disk_diameter=0.01),
            lambda rows, columns: AsymmetricCircleGrid(
                rows=rows + 1, columns=columns, pitch=0.03, disk_diameter=0.01
            ),
            lambda rows, columns: Chessboard(rows=rows, columns=columns, pitch=0.03),
        ]
    ),
    counts,
    counts,
)


def drawn(target: CircleGrid | AsymmetricCircleGrid | Chessboard) -> np.ndarray:
    """Everything that is printed, coarsely: one cell a disk's place or a square, 1 where there is ink."""
    if isinstance(target, Chessboard):
        return 1 - np.indices((target.rows + 1, target.columns + 1)).sum(axis=0) % 2
    cells = np.rint(target_points(target)[:, :2] / (target.pitch / 2)).astype(int)
    picture = np.zeros(cells.max(axis=0)[::-1] + 1, dtype=int)
    picture[cells[:, 1], cells[:, 0]] = 1
    return picture


@given(targets_with_symmetries)
def test_the_symmetries_are_exactly_the_turns_that_leave_the_drawing_as_it_was(target):
    picture = drawn(target)
    expected = [turns for turns in (1, 2, 3) if np.array_equal(np.rot90(picture, turns), picture)]
    found = []
    for symmetry in target_symmetries(target):
        cosine, sine = symmetry.turned_from_world[0, :2]
        found.append(round(np.arctan2(sine, cosine) / (np.pi / 2)) % 4)
    assert found == expected


@given(targets_with_symmetries)
def test_a_symmetry_maps_points_to_points_both_ways(target):
    points = target_points(target)
    for symmetry in target_symmetries(target):
        turned_from_world, permutation = symmetry.turned_from_world, symmetry.permutation
        moved = points @ turned_from_world[:3, :3].T + turned_from_world[:3, 3]
        np.testing.assert_allclose(moved[permutation], points, atol=1e-12)
        np.testing.assert_allclose(moved, points[np.argsort(permutation)], atol=1e-12)


@given(targets_with_symmetries)
def test_a_symmetry_is_a_rotation_about_z_and_undone_by_another(target):
    symmetries = target_symmetries(target)
    for symmetry in symmetries:
        rotation = symmetry.turned_from_world[:3, :3]
        np.testing.assert_array_equal(rotation @ rotation.T, np.eye(3))
        assert np.linalg.det(rotation) == 1
        assert rotation[2, 2] == 1
        undone = [
            np.allclose(other.turned_from_world @ symmetry.turned_from_world, np.eye(4), atol=1e-12)
            and np.array_equal(symmetry.permutation[other.permutation], np.arange(len(other.permutation)))
            for other in symmetries
        ]
        assert sum(undone) == 1


def test_a_turned_reading_gives_the_turned_camera_pose():
    target = CircleGrid(rows=4, columns=4, pitch=0.03, disk_diameter=0.018)
    points = target_points(target)
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = cv2.Rodrigues(np.array([0.2, -0.3, 1.0]))[0]
    camera_from_world[:3, 3] = [0.01, 0.02, 0.5]
    seen = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    quarter = target_symmetries(target)[0]

    read_turned = seen[quarter.permutation]

    camera_from_turned = camera_from_world @ np.linalg.inv(quarter.turned_from_world)
    np.testing.assert_allclose(
        points @ camera_from_turned[:3, :3].T + camera_from_turned[:3, 3], read_turned, atol=1e-12
    )


def test_prints_with_ids_have_no_symmetry():
    assert target_symmetries(NoTarget()) == ()
    assert target_symmetries(AprilGrid(rows=3, columns=3, tag=0.03, spacing=0.01)) == ()
    charuco = Charuco(rows=5, columns=5, pitch=0.03, marker=0.02, dictionary="DICT_5X5_100")
    assert target_symmetries(charuco) == ()


def test_points_run_along_columns_then_rows():
    points = target_points(CircleGrid(rows=2, columns=3, pitch=0.5, disk_diameter=0.1))
    expected = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 0.5, 0], [0.5, 0.5, 0], [1, 0.5, 0]]
    np.testing.assert_array_equal(points, expected)


def test_every_second_row_of_an_asymmetric_grid_is_shifted_by_half_a_pitch():
    grid = AsymmetricCircleGrid(rows=4, columns=2, pitch=2.0, disk_diameter=0.5)
    expected = [[0, 0, 0], [2, 0, 0], [1, 1, 0], [3, 1, 0], [0, 2, 0], [2, 2, 0], [1, 3, 0], [3, 3, 0]]
    np.testing.assert_array_equal(target_points(grid), expected)
    assert grid.spacing == pytest.approx(np.linalg.norm([1, 1]))


@pytest.mark.parametrize(("rows", "columns"), [(5, 7), (6, 4)])
def test_charuco_points_are_opencvs_from_its_first_corner(rows, columns):
    target = Charuco(rows=rows, columns=columns, pitch=0.03, marker=0.02, dictionary="DICT_5X5_100")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((columns, rows), 0.03, 0.02, dictionary)
    corners = np.asarray(board.getChessboardCorners())
    np.testing.assert_allclose(target_points(target), corners - corners[0], atol=1e-7)


def test_tag_corners_are_opencvs():
    target = AprilGrid(rows=2, columns=3, tag=0.04, spacing=0.01)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    board = cv2.aruco.GridBoard((3, 2), 0.04, 0.01, dictionary)
    corners = np.concatenate([np.asarray(tag) for tag in board.getObjPoints()])
    np.testing.assert_allclose(target_points(target), corners, atol=1e-7)
    assert target.pitch == pytest.approx(0.05)


def test_no_target_has_no_points():
    assert target_points(NoTarget()).shape == (0, 3)


@pytest.mark.parametrize(
    "fields",
    [
        {"kind": "none"},
        CIRCLE_GRID,
        CIRCLE_GRID | {"kind": "asymmetric_circle_grid", "pitch_std": 1e-5},
        {"kind": "chessboard", "rows": 8, "columns": 11, "pitch": 0.015},
        {
            "kind": "charuco",
            "rows": 5,
            "columns": 7,
            "pitch": 0.03,
            "marker": 0.02,
            "dictionary": "DICT_5X5_100",
        },
        {"kind": "aprilgrid", "rows": 6, "columns": 6, "tag": 0.088, "spacing": 0.0264},
    ],
)
def test_a_target_survives_its_file_and_keeps_unknown_keys(fields):
    target = ANY_TARGET.validate_python(fields | {"printed_by": "the workshop"})
    again = ANY_TARGET.validate_json(target.model_dump_json())
    assert again == target
    assert again.model_dump()["printed_by"] == "the workshop"
    assert fields.items() <= again.model_dump().items()


def test_a_whole_number_is_a_length():
    assert (
        ANY_TARGET.validate_json('{"kind": "chessboard", "rows": 8, "columns": 11, "pitch": 1}').pitch == 1.0
    )


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"kind": "dots"}, "'dots'"),
        ({"rows": 1}, "greater than or equal to 2"),
        ({"rows": 10**9}, "less than or equal to 1000"),
        ({"columns": 2.5}, "columns"),
        ({"columns": "7"}, "valid integer"),
        ({"pitch": 0}, "greater than 0"),
        ({"pitch": float("nan")}, "pitch"),
        ({"pitch": float("inf")}, "finite"),
        ({"pitch_std": -1e-6}, "greater than or equal to 0"),
        ({"disk_diameter": 0.03}, r"disk_diameter \(0.03 m\) must be smaller than pitch \(0.03 m\)"),
        ({"kind": "asymmetric_circle_grid", "disk_diameter": 0.022}, "diagonal spacing"),
        ({"kind": "asymmetric_circle_grid", "rows": 3}, "greater than or equal to 4"),
        ({"kind": "chessboard", "rows": 2}, "greater than or equal to 3"),
        ({"kind": "charuco", "marker": 0.03, "dictionary": "DICT_5X5_100"}, "marker .* smaller than pitch"),
        (
            {"kind": "charuco", "marker": 0.02, "dictionary": "ArucoDetector"},
            "not a marker dictionary of OpenCV",
        ),
        (
            {"kind": "charuco", "marker": 0.02, "dictionary": "DICT_4X4_50", "rows": 11, "columns": 10},
            "needs 55",
        ),
        ({"kind": "aprilgrid", "tag": 0.02, "spacing": 0}, "greater than 0"),
        (
            {"kind": "aprilgrid", "tag": 0.02, "spacing": 0.01, "dictionary": "DICT_9X9"},
            "not a marker dictionary",
        ),
        (
            {"kind": "aprilgrid", "tag": 0.02, "spacing": 0.01, "rows": 100},
            "587 markers and the target needs 700",
        ),
    ],
)
def test_a_wrong_value_is_refused_by_name(change, complaint):
    with pytest.raises(ValidationError, match=complaint):
        ANY_TARGET.validate_python(CIRCLE_GRID | change)


def test_a_target_never_changes():
    target = ANY_TARGET.validate_python(CIRCLE_GRID)
    with pytest.raises(ValidationError, match="frozen"):
        target.rows = 7
