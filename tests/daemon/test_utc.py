"""The rig's time stamps in UTC, and back."""

from datetime import UTC, datetime, timedelta

import pytest

from daemon.errors import TimeNotCoveredError
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

    def live(self, clock: UtcClock, seconds: int) -> None:
        """Let seconds pass, in which `clock` is looked at ten times each."""
        for _ in range(10 * seconds):
            self.monotonic += 0.1
            self.wall += timedelta(seconds=0.1)
            clock.check()


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    monkeypatch.setattr(utc, "datetime", machine)
    return machine


@pytest.fixture
def clock(machine: Machine) -> UtcClock:
    return UtcClock(machine, pace=1.0)  # type: ignore[arg-type]


def test_a_stamp_keeps_its_time_whatever_the_clocks_jitter(machine: Machine) -> None:
    clock = UtcClock(machine, pace=20.0)  # type: ignore[arg-type]
    assert clock.at(1000.0) == NOON
    machine.wall += timedelta(milliseconds=4)
    assert clock.at(1000.0) == NOON
    assert clock.at(980.0) == NOON - timedelta(seconds=1)


def test_a_clock_that_was_set_is_followed(machine: Machine, clock: UtcClock) -> None:
    machine.monotonic += 10
    machine.wall += timedelta(hours=1)
    assert clock.at(1010.0) == NOON + timedelta(hours=1)
    assert clock.at(1009.0) == NOON + timedelta(hours=1, seconds=-1)


@pytest.mark.parametrize("pace", [1.0, 20.0])
def test_times_are_stamps_again(machine: Machine, pace: float) -> None:
    clock = UtcClock(machine, pace)  # type: ignore[arg-type]
    machine.monotonic += 10 * pace
    machine.wall += timedelta(seconds=10)
    for stamp in (1000.0, 1000 + 3.21 * pace, 1000 + 10 * pace):
        assert clock.stamp(clock.at(stamp)) == pytest.approx(stamp, abs=1e-6 * pace)


@pytest.mark.parametrize("step", [-3600, -0.2, 0.02, 0.2, 3600])
def test_a_setting_of_the_clock_changes_no_earlier_time(
    machine: Machine, clock: UtcClock, step: float
) -> None:
    machine.live(clock, 10)
    machine.wall += timedelta(seconds=step)
    machine.live(clock, 10)
    before, after = clock.at(1005.0), clock.at(1015.0)
    assert before == NOON + timedelta(seconds=5)
    assert (after - before).total_seconds() == pytest.approx(10 + step)
    assert clock.stamp(before) == pytest.approx(1005.0, abs=1e-5)
    assert clock.stamp(after) == pytest.approx(1015.0, abs=1e-5)


def test_a_time_that_was_left_out_or_came_twice_is_no_time(machine: Machine, clock: UtcClock) -> None:
    machine.live(clock, 10)
    machine.wall += timedelta(seconds=60)
    machine.live(clock, 10)
    with pytest.raises(TimeNotCoveredError, match="clock was set about then"):
        clock.stamp(NOON + timedelta(seconds=30))
    machine.wall -= timedelta(seconds=5)
    machine.live(clock, 10)
    with pytest.raises(TimeNotCoveredError, match="came twice"):
        clock.stamp(NOON + timedelta(seconds=78))


def test_a_time_to_come_and_one_before_the_beginning_are_none(machine: Machine, clock: UtcClock) -> None:
    machine.live(clock, 1)
    with pytest.raises(TimeNotCoveredError, match="it is 2 s ahead of this machine's clock"):
        clock.stamp(NOON + timedelta(seconds=3))
    with pytest.raises(TimeNotCoveredError, match="no axis had been read"):
        clock.stamp(NOON - timedelta(seconds=3))
    assert clock.stamp(NOON + timedelta(seconds=1)) == pytest.approx(1001.0)


def test_clocks_that_could_not_be_read_at_once_are_not_compared(
    machine: Machine, clock: UtcClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow() -> float:
        machine.monotonic += 0.5
        return machine.monotonic

    monkeypatch.setattr(machine, "now", lambda zone=None: slow() if zone is None else machine.wall)
    assert clock.at(1000.0) == NOON


def test_a_time_that_has_passed_is_known_on_a_busy_machine(
    machine: Machine, clock: UtcClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.live(clock, 1)
    machine.monotonic += 2
    machine.wall += timedelta(seconds=2)
    slow = [0.0, 0.3, 0.0, 0.3, 0.0, 0.0]  # two looks are interrupted

    def now(zone: object = None) -> object:
        if zone is not None:
            return machine.wall
        late = slow.pop(0) if slow else 0.0
        machine.monotonic += late
        machine.wall += timedelta(seconds=late)
        return machine.monotonic

    monkeypatch.setattr(machine, "now", now)
    assert clock.stamp(NOON + timedelta(seconds=3)) == pytest.approx(1003.0)
