import pytest

from drivers.cia402.error_codes import in_words
from drivers.cia402.statusword import State, state_of


@pytest.mark.parametrize(
    ("statusword", "state"),
    [
        (0x0000, State.NOT_READY),
        (0x0240, State.SWITCH_ON_DISABLED),
        (0x0260, State.SWITCH_ON_DISABLED),  # bit 5 has no meaning there
        (0x0631, State.READY),
        (0x0233, State.SWITCHED_ON),
        (0x1637, State.ENABLED),
        (0x0617, State.QUICK_STOP),
        (0x021F, State.FAULT_REACTION),
        (0x023F, State.FAULT_REACTION),
        (0x0218, State.FAULT),
        (0x0238, State.FAULT),
        (0x0001, State.UNKNOWN),
    ],
)
def test_a_state_is_read_from_its_bits_alone(statusword: int, state: State) -> None:
    assert state_of(statusword) is state


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x3210, "DC link over-voltage (0x3210)"),
        (
            0x8611,
            "following error: the axis does not follow its set-points, since it is blocked or overloaded (0x8611)",
        ),
        (0x2312, "current (0x2312)"),
        (0x81FF, "communication (0x81FF)"),
        (0xFF07, "the maker's own error (0xFF07)"),
        (0x0001, "an error (0x0001)"),
        (0x0000, "the drive gives no reason"),
    ],
)
def test_error_codes_are_said_in_words(code: int, words: str) -> None:
    assert in_words(code) == words
