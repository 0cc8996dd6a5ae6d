"""A drive's state as its statusword tells it, and the controlwords that lead from state to state."""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final


class State(Enum):
    """States of the CiA 402 state machine; the values are how they are called in messages."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch-on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "a state that CiA 402 does not know"


_WITHOUT_QUICK_STOP_BIT: Final = 0x4F
_WITH_QUICK_STOP_BIT: Final = 0x6F
_PATTERNS: Final = (
    (_WITHOUT_QUICK_STOP_BIT, 0x00, State.NOT_READY),
    (_WITHOUT_QUICK_STOP_BIT, 0x40, State.SWITCH_ON_DISABLED),
    (_WITH_QUICK_STOP_BIT, 0x21, State.READY),
    (_WITH_QUICK_STOP_BIT, 0x23, State.SWITCHED_ON),
    (_WITH_QUICK_STOP_BIT, 0x27, State.ENABLED),
    (_WITH_QUICK_STOP_BIT, 0x07, State.QUICK_STOP),
    (_WITHOUT_QUICK_STOP_BIT, 0x0F, State.FAULT_REACTION),
    (_WITHOUT_QUICK_STOP_BIT, 0x08, State.FAULT),
)

TARGET_REACHED: Final = 1 << 10
"""While halt is commanded it means that the axis stands."""
LIMIT_ACTIVE: Final = 1 << 11
ACKNOWLEDGED: Final = 1 << 12
"""In profile position: the set-point was taken. In homing: home was found."""
MODE_ERROR: Final = 1 << 13
"""In profile position: following error. In homing: homing failed."""

DISABLE_VOLTAGE: Final = 0x0000
QUICK_STOP: Final = 0x0002
SHUT_DOWN: Final = 0x0006
SWITCH_ON: Final = 0x0007
ENABLE: Final = 0x000F
NEW_SET_POINT: Final = 1 << 4
"""In homing mode: start homing."""
IMMEDIATELY: Final = 1 << 5
RESET_FAULT: Final = 1 << 7
HALT: Final = ENABLE | 1 << 8

TOWARDS_ENABLED: Final[Mapping[State, int]] = MappingProxyType(
    {
        State.SWITCH_ON_DISABLED: SHUT_DOWN,
        State.READY: SWITCH_ON,
        State.SWITCHED_ON: ENABLE,
        State.QUICK_STOP: DISABLE_VOLTAGE,
    }
)
"""What to command in each state to come nearer to `ENABLED`; in the others a drive is waited for."""

PROFILE_POSITION: Final = 1
HOMING: Final = 6


def state_of(statusword: int) -> State:
    """Return the state that a statusword stands for."""
    return next((state for mask, value, state in _PATTERNS if statusword & mask == value), State.UNKNOWN)
