import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import OptionsError
from drivers.simulated.motion import trapezoid
from drivers.simulated.options import JointOptions
from drivers.simulated.shaft import Gear, Shaft
from tests.drivers.rigs import PAN, SLIDE


def shaft(**imperfections: Any) -> Shaft:
    options = JointOptions.model_validate({"axis": [1, 0, 0], "scale": 0.5} | imperfections)
    return Shaft(Gear.from_options(options, SLIDE))


def drive(shaft: Shaft, target: float, t: float) -> float:
    """Drive to `target` from time t on, and return when that is over."""
    motion = trapezoid(shaft.motor(t), target, t, velocity=10.0, acceleration=100.0)
    shaft.drive(motion)
    return motion.ends


def test_a_perfect_shaft_follows_its_motor() -> None:
    perfect = shaft(zero="2 mm")
    ends = drive(perfect, 8.0, 1.0)
    for t in (0.0, 1.2, ends, ends + 1):
        assert perfect.load(t) == perfect.motor(t)
    assert perfect.displacement(ends) == pytest.approx(0.5 * (8.0 + 2.0))


def test_the_past_can_be_asked_for() -> None:
    perfect = shaft()
    first = drive(perfect, 8.0, 1.0)
    during = perfect.motor(1.4)
    drive(perfect, 2.0, first + 1.0)
    assert perfect.motor(1.4) == during
    assert perfect.motor(first + 0.5) == 8.0


def test_play_lags_behind_by_half_its_width_on_either_side() -> None:
    loose = shaft(backlash="0.4 mm")
    t = drive(loose, 8.0, 0.0)
    assert loose.load(t) == pytest.approx(7.8)
    t = drive(loose, 4.0, t)
    assert loose.load(t) == pytest.approx(4.2)


def test_a_reversal_within_the_play_does_not_move_the_load() -> None:
    loose = shaft(backlash="0.4 mm")
    t = drive(loose, 8.0, 0.0)
    t = drive(loose, 7.7, t)
    assert loose.load(t) == pytest.approx(7.8)


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=8), st.floats(0.01, 5))
def test_the_load_never_leaves_the_play(targets: list[float], width: float) -> None:
    loose = shaft(backlash=f"{width!r} mm")
    t = 0.0
    for target in targets:
        began, t = t, drive(loose, target, t)
        for share in (0.0, 0.3, 0.8, 1.0):
            instant = began + share * (t - began)
            assert abs(loose.load(instant) - loose.motor(instant)) <= width / 2 + 1e-9


def test_the_swing_begins_at_the_end_of_a_motion_and_fades() -> None:
    soft = shaft(settling={"amplitude": "0.1 mm", "frequency": "10 Hz", "damping": 0.1})
    ends = drive(soft, 8.0, 0.0)
    assert soft.load(ends) == pytest.approx(8.0)
    first = soft.load(ends + 0.025) - 8.0  # a quarter of a period: the first peak, onwards
    assert first == pytest.approx(0.1 * math.exp(-0.1 * 2 * math.pi * 10 * 0.025))
    assert soft.load(ends + 0.075) < 8.0
    assert abs(soft.load(ends + 3.0) - 8.0) < 1e-9
    assert soft.motor(ends + 0.025) == 8.0  # the encoder sees nothing of it


def test_a_motion_that_was_stopped_swings_once() -> None:
    soft = shaft(settling={"amplitude": "0.1 mm", "frequency": "10 Hz", "damping": 0.1})
    whole = trapezoid(0.0, 80.0, 0.0, velocity=10.0, acceleration=100.0)
    soft.drive(whole)
    soft.drive(whole.stopped(1.0, 100.0))
    rest = soft.motor(9.0)
    assert abs(soft.load(whole.ends + 0.025) - rest) < 1e-6


def test_the_gear_errs_once_per_turn_and_not_at_zero() -> None:
    options = JointOptions.model_validate(
        {
            "axis": [0, 0, 1],
            "point": ["0 mm", "0 mm", "0 mm"],
            "scale": math.radians(1),
            "eccentricity": {"amplitude": "2 mrad", "phase": "30 deg"},
        }
    )
    gear = Gear.from_options(options, PAN)
    assert gear.displacement(0.0) == 0.0
    assert gear.displacement(360.0) == pytest.approx(2 * math.pi)
    assert gear.displacement(60.0) == pytest.approx(math.radians(60) + 0.002 * (1.0 - 0.5))


def test_imperfections_in_another_unit_are_refused() -> None:
    with pytest.raises(OptionsError, match=r"axis 'slide'.*'0.1 deg'"):
        shaft(backlash="0.1 deg")
    with pytest.raises(OptionsError, match=r"'eccentricity' is for revolute joints"):
        shaft(eccentricity={"amplitude": "1 mrad"})


def test_imperfections_are_resolved_to_the_reading_unit() -> None:
    assert shaft(backlash="20 um").gear.backlash == pytest.approx(0.02)
