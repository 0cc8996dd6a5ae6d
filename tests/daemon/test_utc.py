"""The rig's time stamps in UTC."""

from datetime import UTC, datetime, timedelta

import pytest

from daemon.rig import utc
from daemon.rig.utc import UtcClock

NOON = datetime(2026, 3, 14, 12, tzinfo=UTC)


class Machine:
    """Both clocks of a machine, to be set by hand."""

    def __init__(self) -> None:
        self.monotonic = 1000.0
        self.wall = NOON

    def now(self, zone: object = None) -> object:
        return self.monotonic if zone is None else self.wall

    async def sleep(self, seconds: float) -> None:
        raise NotImplementedError


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    monkeypatch.setattr(utc, "datetime", machine)
    return machine


def test_a_stamp_keeps_its_time_whatever_the_clocks_jitter(machine: Machine) -> None:
    clock = UtcClock(machine, pace=20.0)  # type: ignore[arg-type]
    assert clock.at(1000.0) == NOON
    machine.wall += timedelta(milliseconds=60)
    assert clock.at(1000.0) == NOON
    assert clock.at(980.0) == NOON - timedelta(seconds=1)


def test_a_clock_that_was_set_is_followed(machine: Machine) -> None:
    clock = UtcClock(machine, pace=1.0)  # type: ignore[arg-type]
    machine.monotonic += 10
    machine.wall += timedelta(hours=1)
    assert clock.at(1010.0) == NOON + timedelta(hours=1)
    assert clock.at(1009.0) == NOON + timedelta(hours=1, seconds=-1)
