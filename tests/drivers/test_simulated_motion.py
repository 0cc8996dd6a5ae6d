import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.simulated.motion import Motion, rest, trapezoid

positions = st.floats(-1e3, 1e3)
times = st.floats(0, 1e4)
speeds = st.floats(0.1, 500)
accelerations = st.floats(0.1, 2000)
shares = st.floats(0, 1)


@st.composite
def motions(draw: st.DrawFn) -> tuple[Motion, float, float]:
    start, target = draw(positions), draw(positions)
    velocity, acceleration = draw(speeds), draw(accelerations)
    return trapezoid(start, target, draw(times), velocity, acceleration), velocity, acceleration


def test_a_long_motion_has_a_plateau() -> None:
    motion = trapezoid(10.0, 30.0, 5.0, velocity=4.0, acceleration=8.0)
    # 0.5 s up over 1, 18 at 4, 0.5 s down over 1.
    assert motion.ends == pytest.approx(5.0 + 0.5 + 4.5 + 0.5)
    assert motion.position(5.5) == pytest.approx(11.0)
    assert motion.velocity(7.0) == 4.0
    assert motion.position(10.0) == pytest.approx(29.0)


def test_a_short_motion_is_a_triangle() -> None:
    motion = trapezoid(0.0, -2.0, 0.0, velocity=100.0, acceleration=2.0)
    assert motion.ends == pytest.approx(2.0)
    assert motion.velocity(1.0) == pytest.approx(-2.0)
    assert motion.position(1.0) == pytest.approx(-1.0)


@given(motions())
def test_it_begins_and_ends_at_rest_where_it_should(case: tuple[Motion, float, float]) -> None:
    motion, _, _ = case
    assert motion.position(motion.began) == motion.start
    assert motion.position(motion.began - 1) == motion.start
    assert motion.velocity(motion.began - 1) == 0.0
    assert motion.position(motion.ends) == motion.target
    assert motion.velocity(motion.ends) == 0.0
    assert motion.position(math.nextafter(motion.ends, 0)) == pytest.approx(motion.target, abs=1e-6)


@given(motions(), shares, shares)
def test_it_keeps_to_its_velocity_and_acceleration(
    case: tuple[Motion, float, float], a: float, b: float
) -> None:
    motion, velocity, acceleration = case
    s, t = sorted(motion.began + share * (motion.ends - motion.began) for share in (a, b))
    moved = motion.position(t) - motion.position(s)
    # Position is continuous: it changes no faster than the velocity allows, and always in one direction.
    assert abs(moved) <= velocity * (t - s) + 1e-6
    assert moved * motion.direction >= -1e-6
    assert abs(motion.velocity(t)) <= velocity * (1 + 1e-9)
    assert abs(motion.velocity(t) - motion.velocity(s)) <= acceleration * (t - s) + 1e-6


@given(motions(), shares)
def test_a_stop_brakes_to_a_standstill_without_a_jump(
    case: tuple[Motion, float, float], share: float
) -> None:
    motion, _, acceleration = case
    at = motion.began + share * (motion.ends - motion.began)
    stopped = motion.stopped(at, acceleration)
    assert stopped.position(at) == pytest.approx(motion.position(at), abs=1e-9)
    assert stopped.velocity(at) == pytest.approx(motion.velocity(at), abs=1e-6)
    assert stopped.velocity(stopped.ends) == 0.0
    assert stopped.position(math.nextafter(stopped.ends, 0)) == pytest.approx(stopped.target, abs=1e-6)
    # It never comes to rest beyond the target: at its fastest it is braked as the motion itself would be.
    assert (motion.target - stopped.target) * motion.direction >= -1e-6


def test_a_rest_is_everywhere_at_its_place() -> None:
    still = rest(3.0, 1.0)
    assert (still.position(0.0), still.position(9.0), still.velocity(1.0), still.direction) == (
        3.0,
        3.0,
        0.0,
        0.0,
    )
    assert still.stopped(2.0, 1.0).target == 3.0
