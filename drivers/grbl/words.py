"""Grbl's numbers in words."""

from collections.abc import Mapping
from typing import Final

ALARMS: Final[Mapping[int, str]] = {
    1: "a limit switch tripped, and the motors were stopped so hard that steps may be lost",
    2: "a target lay outside the travel that its settings allow",
    3: "it was reset while moving, and steps may be lost",
    4: "a probe was not in the state that its cycle begins with",
    5: "a probe did not touch the workpiece",
    6: "homing was ended by a reset",
    7: "homing was ended by the safety door",
    8: "homing could not leave the limit switch: check the switch, and that the pull-off ($27) is long enough",
    9: "homing did not find the limit switch: check the switch, its direction ($23) and that the motor turns",
    10: "its emergency stop is pressed",
    11: "it has to be homed before anything else",
    14: "the spindle does not come to speed",
    17: "a motor's driver reports a fault",
}
"""`ALARM:` of Grbl 1.1 (1 to 9) and grblHAL."""

ERRORS: Final[Mapping[int, str]] = {
    1: "a word has no letter",
    2: "a number is missing or badly written",
    3: "the $ command is not known",
    4: "a value is negative",
    5: "homing is switched off ($22=0): set $22=1, which needs limit switches",
    6: "the step pulse is too short",
    7: "its memory could not be read, and its settings are the defaults",
    8: "it has to be idle for that",
    9: "it is locked, in alarm or jogging",
    10: "soft limits need homing ($22=1)",
    11: "the line is too long",
    13: "the safety door is open",
    14: "the line is too long for its memory",
    15: "the target lies outside its travel ($130 to $135)",
    16: "the jog has no = or a word that it may not have",
    20: "the command is not supported",
    22: "there is no feed rate",
    79: "its emergency stop is pressed",
}
"""`error:` as far as what the driver sends can meet with it."""

STATES: Final[Mapping[str, str]] = {
    "Hold": "it is held: release its feed hold",
    "Door": "its safety door is open",
    "Check": "it is in its check mode: leave it by $C",
    "Sleep": "it sleeps: restart it",
    "Tool": "it waits for a tool change",
}
"""States in which it stands and takes no motion."""


def alarm(number: int | None) -> str:
    """Return what an alarm means."""
    if number is None:
        return "the controller is in alarm, for a reason that was not heard"
    return f"the controller is in alarm {number}: {ALARMS.get(number, 'see its manual')}"


def refusal(number: int) -> str:
    """Return what an error means."""
    return f"error {number}: {ERRORS.get(number, 'see its manual')}"
