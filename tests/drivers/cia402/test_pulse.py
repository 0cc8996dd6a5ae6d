import pytest

from drivers.cia402.pulse import Pulse
from drivers.clock import SystemClock

BOOT_UP, OPERATIONAL, PRE_OPERATIONAL = 0, 5, 127


class ManualClock(SystemClock):
    time = 50.0

    def now(self) -> float:
        return self.time


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def pulse(clock: ManualClock) -> Pulse:
    """Of a node that was started and has said so."""
    pulse = Pulse(clock, silence=1.0)
    pulse.start()
    pulse.hear(OPERATIONAL)
    return pulse


def test_a_node_that_beats_is_there(pulse: Pulse, clock: ManualClock) -> None:
    for _ in range(5):
        clock.time += 0.9
        assert pulse.lost is None
        pulse.hear(OPERATIONAL)


def test_a_node_that_is_silent_is_lost_at_the_second_look(pulse: Pulse, clock: ManualClock) -> None:
    clock.time += 1.1
    assert pulse.lost is None
    clock.time += 0.1
    assert pulse.lost == "has sent no heartbeat for 1.2 s: check its power and its cable"


def test_a_program_that_was_held_up_does_not_lay_it_to_the_node(pulse: Pulse, clock: ManualClock) -> None:
    clock.time += 30.0
    assert pulse.lost is None
    pulse.hear(OPERATIONAL)  # it had been waiting to be heard
    clock.time += 0.5
    assert pulse.lost is None


def test_what_a_node_said_before_it_was_started_says_nothing(clock: ManualClock) -> None:
    pulse = Pulse(clock, silence=1.0)
    pulse.hear(OPERATIONAL)
    assert not pulse.beats
    pulse.start()
    pulse.hear(PRE_OPERATIONAL)
    assert not pulse.beats
    assert pulse.lost is None
    pulse.hear(OPERATIONAL)
    assert pulse.beats


@pytest.mark.parametrize(
    ("state", "sentence"),
    [(BOOT_UP, "was switched on or reset"), (PRE_OPERATIONAL, "has left the operational")],
)
def test_a_node_that_was_away_stays_lost(pulse: Pulse, state: int, sentence: str) -> None:
    pulse.hear(state)
    pulse.hear(OPERATIONAL)
    assert pulse.lost is not None
    assert pulse.lost.startswith(sentence)
