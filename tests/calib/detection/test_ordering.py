"""Blobs in order: any lattice seen in perspective, whatever else lies about, and no part of a larger one."""

import numpy as np
import pytest
from drawn_targets import project
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.detection.ordering import patterns


def rectangle(rows: int, columns: int) -> np.ndarray:
    row, column = np.indices((rows, columns))
    return np.column_stack([column.ravel(), row.ravel()])


def seen(plane: np.ndarray, tilt: tuple[float, float] = (0, 0), roll: float = 0.0) -> np.ndarray:
    """Return places (n, 2) of a plane in steps as a camera sees them (px)."""
    x, y, z = np.radians([*tilt, roll])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    turn = about_x @ about_y @ about_z
    middle = plane.mean(axis=0)
    distance = 2.5 * np.ptp(plane, axis=0).max()
    H = np.column_stack([turn[:, :2], [0, 0, distance] - turn[:, :2] @ middle])
    return project(np.diag([1000.0, 1000.0, 1.0]) @ H, plane)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(3, 9),
    columns=st.integers(3, 9),
    tilt=st.tuples(st.floats(-40, 40), st.floats(-40, 40)),
    roll=st.floats(-180, 180),
    diamonds=st.booleans(),
    seed=st.integers(0, 99),
)
def test_a_pattern_is_found_in_any_perspective(rows, columns, tilt, roll, diamonds, seed):
    plane = rectangle(rows, columns)
    pattern = plane
    if diamonds:
        # Every second row shifted by half a step: a lattice of diagonals.
        across = 2 * plane[:, 0] + plane[:, 1] % 2
        plane = np.column_stack([across, plane[:, 1]])
        pattern = np.column_stack([(across - plane[:, 1]) // 2, (across + plane[:, 1]) // 2])
    places = seen(plane.astype(float), tilt, roll)
    shuffled = np.random.default_rng(seed).permutation(len(places))
    found = [shuffled[reading].tolist() for reading in patterns(places[shuffled], pattern)]
    assert list(range(len(places))) in found
    assert all(sorted(reading) == list(range(len(places))) for reading in found)


def test_places_off_the_lattice_do_not_matter():
    pattern = rectangle(5, 6)
    places = seen(pattern.astype(float), (30, 20), 10)
    dirt = places[[0, 7, 12]] + np.ptp(places, axis=0) * [0.08, 0.09]
    found = patterns(np.concatenate([dirt, places]), pattern)
    assert {tuple(sorted(reading.tolist())) for reading in found} == {tuple(range(3, 33))}


def test_of_a_larger_lattice_all_parts_are_given():
    places = seen(rectangle(5, 6).astype(float), (20, 10))
    found = patterns(places, rectangle(5, 5))
    assert len({frozenset(reading.tolist()) for reading in found}) == 2
    assert patterns(seen(rectangle(20, 20).astype(float)), rectangle(5, 5)) == []


@pytest.mark.parametrize(
    "places",
    [
        np.zeros((0, 2)),
        np.zeros((12, 2)),
        np.column_stack([np.arange(12.0), np.zeros(12)]),
        np.random.default_rng(0).random((20, 2)) * 100,
    ],
    ids=["nothing", "one place", "a line", "anywhere"],
)
def test_what_is_no_lattice_holds_no_pattern(places):
    assert patterns(places, rectangle(3, 4)) == []
