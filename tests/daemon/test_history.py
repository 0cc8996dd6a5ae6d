"""What the readings were between two of them: within the bounds that are stated, and never across a gap."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest

from daemon.errors import TimeNotCoveredError
from daemon.rig.history import KEPT, MOST, ReadingHistory
from daemon.rig.snapshot import AxisSnapshot
from daemon.rig.utc import UtcClock
from drivers.axis import AxisSpec
from drivers.clock import SystemClock
from drivers.simulated.motion import Motion, trapezoid

SLIDE = AxisSpec("slide", "prismatic", "mm", (0, 1000), velocity=100, acceleration=400, tolerance=0.05)
PAN = AxisSpec("pan", "revolute", "deg", (-90, 90), velocity=40, acceleration=200, tolerance=0.05)
BEGAN, LONGEST_GAP = 100.0, 2.0


@pytest.fixture
def history() -> ReadingHistory:
    return ReadingHistory([SLIDE, PAN], UtcClock(SystemClock(), 1.0), 1.0, LONGEST_GAP)


def reading(spec: AxisSpec, at: float, position: float = 0.0, **more: object) -> AxisSnapshot:
    state = AxisSnapshot(spec, "controller", position=position, timestamp=at, homed=True)
    return replace(state, **more)  # type: ignore[arg-type]


def follow(history: ReadingHistory, motions: list[Motion], seed: int) -> None:
    """Note what two axes report on their motions, each at times of its own, about every 20 ms."""
    rng = np.random.default_rng(seed)
    for step in np.arange(BEGAN - 0.1, max(motion.ends for motion in motions) + 0.1, 0.02):
        times = step + rng.uniform(-0.008, 0.008, 2)
        history.note(
            [
                reading(spec, t, motion.position(t), moving=bool(motion.began <= t < motion.ends))
                for spec, motion, t in zip((SLIDE, PAN), motions, times.tolist(), strict=True)
            ]
        )


@pytest.mark.parametrize("seed", range(5))
def test_a_motion_is_followed_within_the_bounds(history: ReadingHistory, seed: int) -> None:
    motions = [
        trapezoid(10.0, 60.0, BEGAN, SLIDE.velocity, SLIDE.acceleration),
        trapezoid(20.0, -5.0, BEGAN + 0.01, PAN.velocity, PAN.acceleration),
    ]
    follow(history, motions, seed)
    stamps = np.random.default_rng(seed).uniform(BEGAN, BEGAN + 0.7, 500)
    past = history.at(stamps.tolist())
    true = np.array([[motion.position(t) for motion in motions] for t in stamps])
    miss = np.abs(past.values - true)
    assert (miss <= past.bounds + 1e-9).all()
    # A bound that nothing comes near would say nothing.
    assert (np.max(miss / np.maximum(past.bounds, 1e-6), axis=0) > 0.9).all()
    assert past.bounds.max() < 0.5 * SLIDE.acceleration * 0.036**2 / 4
    for row, stamp in zip(past.between, stamps, strict=True):
        when = history._utc.at(stamp)
        assert all(first <= when <= last for first, last in row)


def test_what_stands_is_known_exactly_whatever_the_spacing(history: ReadingHistory) -> None:
    for at in (0.0, 1.9):
        history.note([reading(SLIDE, at, 5.0, approached=1), reading(PAN, at, -3.0)])
    past = history.at([0.0, 0.7, 1.9])
    assert past.values.tolist() == [[5.0, -3.0]] * 3
    assert past.approached.tolist() == [[1, 0]] * 3
    assert not past.bounds.any()
    assert not past.moving.any()


def test_what_was_moved_by_hand_is_not_taken_to_stand(history: ReadingHistory) -> None:
    for at, position in ((0.0, 5.0), (0.1, 6.0)):
        history.note([reading(SLIDE, at, position), reading(PAN, at)])
    past = history.at([0.05])
    assert past.values[0, 0] == pytest.approx(5.5)
    assert past.bounds[0].tolist() == pytest.approx([0.5 * SLIDE.acceleration * 0.05**2, 0])


def test_a_side_that_changes_is_not_known_between(history: ReadingHistory) -> None:
    for at, side in ((0.0, 1), (0.1, 1), (0.2, -1)):
        history.note([reading(SLIDE, at, approached=side), reading(PAN, at)])
    assert history.at([0.05, 0.1, 0.15, 0.2]).approached[:, 0].tolist() == [1, 1, 0, -1]


def test_more_that_is_known_of_the_newest_reading_is_kept(history: ReadingHistory) -> None:
    for moving in (False, True):  # a motion begins after the reading
        history.note([reading(SLIDE, 0.0, moving=moving), reading(PAN, 0.0)])
    history.note([reading(SLIDE, 0.02, moving=True), reading(PAN, 0.02)])
    past = history.at([0.01])
    assert past.moving.all()
    assert past.bounds[0, 0] > 0


@pytest.mark.parametrize("gap", [{"lost": "unplugged"}, {"homed": False}, {"position": None}])
def test_nothing_is_known_in_a_gap(history: ReadingHistory, gap: dict[str, object]) -> None:
    for at in (0.0, 0.1):
        history.note([reading(SLIDE, at), reading(PAN, at)])
    history.note([reading(SLIDE, 0.2), reading(PAN, 0.1 if "lost" in gap else 0.2, **gap)])
    for at in (0.3, 0.4):
        history.note([reading(SLIDE, at), reading(PAN, at)])
    assert len(history.at([0.05, 0.1, 0.3, 0.35]).values) == 4
    for at in (0.11, 0.2, 0.29):
        with pytest.raises(TimeNotCoveredError, match="axis 'pan' has no readings around"):
            history.at([0.05, at])


def test_nothing_is_known_before_after_and_without_readings(history: ReadingHistory) -> None:
    with pytest.raises(TimeNotCoveredError, match="axis 'slide'"):
        history.at([0.0])
    for at in (1.0, 2.0):
        history.note([reading(SLIDE, at), reading(PAN, at)])
    for at in (0.99, 2.01):
        with pytest.raises(TimeNotCoveredError):
            history.at([at])


def test_readings_too_far_apart_are_a_gap(history: ReadingHistory) -> None:
    for at in (0.0, LONGEST_GAP + 0.1):
        history.note([reading(SLIDE, at), reading(PAN, at)])
    with pytest.raises(TimeNotCoveredError):
        history.at([1.0])


def test_readings_are_kept_for_their_time_and_never_more_than_stated(history: ReadingHistory) -> None:
    def kept() -> Iterator[int]:
        return (len(axis._readings) for axis in history._axes)

    for at in np.arange(0, 2 * KEPT, 0.5).tolist():
        history.note([reading(SLIDE, at), reading(PAN, at)])
    assert all(count == 2 * KEPT + 1 for count in kept())
    for at in (2 * KEPT + np.arange(2 * MOST) * 1e-4).tolist():
        history.note([reading(SLIDE, at), reading(PAN, at)])
    assert all(count == MOST for count in kept())


def test_instants_may_come_in_any_order(history: ReadingHistory) -> None:
    motion = trapezoid(0.0, 50.0, BEGAN, SLIDE.velocity, SLIDE.acceleration)
    follow(history, [motion, motion], seed=0)
    stamps = [BEGAN + 0.5, BEGAN + 0.1, BEGAN + 0.3]
    together = history.at(stamps).values
    assert np.array_equal(together, np.concatenate([history.at([stamp]).values for stamp in stamps]))
    assert [bool(a > b) for a, b in pairwise(together[:, 0])] == [True, False]


def test_a_sentence_names_the_time(history: ReadingHistory) -> None:
    day = f"{datetime.now(UTC):%Y-%m-%d}"
    with pytest.raises(TimeNotCoveredError, match=rf"{day}T.*Z: they are kept for 60 s"):
        history.at([SystemClock().now()])
