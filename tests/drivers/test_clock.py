import asyncio
import time

import pytest

from drivers.clock import ScaledClock, SystemClock
from tests.drivers.clocks import PatientClock


@pytest.mark.parametrize("clock", [SystemClock(), ScaledClock(1000)])
async def test_a_sleep_lasts_at_least_as_long_as_asked(clock: SystemClock | ScaledClock) -> None:
    began = clock.now()
    await clock.sleep(0.02)
    assert clock.now() - began >= 0.0199  # the event loop may wake a clock tick early


async def test_a_scaled_clock_runs_faster_than_life() -> None:
    life, fast = SystemClock(), ScaledClock(50)
    began = life.now(), fast.now()
    await asyncio.sleep(0.01)
    passed = fast.now() - began[1]
    assert passed >= 50 * 0.0099
    assert passed <= 50 * (life.now() - began[0])


@pytest.mark.parametrize("scale", [0, -1, float("nan")])
def test_a_clock_that_stands_is_refused(scale: float) -> None:
    with pytest.raises(ValueError, match="scale must be positive"):
        ScaledClock(scale)


async def test_a_patient_clock_leaves_out_what_held_the_event_loop_up() -> None:
    clock = PatientClock()
    before = clock.now()
    time.sleep(0.2)  # noqa: ASYNC251  which holds it up
    assert clock.now() - before <= 0.02
    before = clock.now()
    await clock.sleep(0.1)
    assert clock.now() - before >= 0.1
