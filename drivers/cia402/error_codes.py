"""Why a drive stopped: the codes of emergency frames and of object 0x603F, in words."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_CODES: Final[Mapping[int, str]] = MappingProxyType(
    {
        0x2310: "continuous over-current",
        0x2320: "short circuit or earth leakage at the motor",
        0x2330: "earth leakage at the motor",
        0x2340: "short circuit at the motor",
        0x3110: "mains over-voltage",
        0x3120: "mains under-voltage",
        0x3210: "DC link over-voltage",
        0x3220: "DC link under-voltage",
        0x4210: "the drive is too hot",
        0x4310: "the motor or its output stage is too hot",
        0x5112: "the 24 V supply is too low",
        0x5441: "an enable or emergency-stop contact is open",
        0x6010: "the drive's watchdog expired",
        0x6320: "a parameter is wrong",
        0x7121: "the motor is blocked",
        0x7122: "the motor does not commutate",
        0x7305: "the encoder fails",
        0x7320: "the position sensor fails",
        0x8110: "CAN frames were lost in the drive",
        0x8120: "the drive's CAN controller is error-passive",
        0x8130: "the drive heard no heartbeat of activecam",
        0x8140: "the drive came back from bus-off",
        0x8611: "following error: the axis does not follow its set-points, since it is blocked or overloaded",
        0x8612: "a limit of the axis was reached",
        0x8613: "homing failed",
    }
)
_FAMILIES: Final = (
    (0xF000, 0x2000, "current"),
    (0xF000, 0x3000, "voltage"),
    (0xF000, 0x4000, "temperature"),
    (0xF000, 0x5000, "the drive's hardware"),
    (0xF000, 0x6000, "the drive's software"),
    (0xF000, 0x7000, "a module such as an encoder or a brake"),
    (0xFF00, 0x8100, "communication"),
    (0xF000, 0x8000, "monitoring"),
    (0xF000, 0x9000, "an external error"),
    (0xFF00, 0xFF00, "the maker's own error"),
)


def in_words(code: int) -> str:
    """Return what an error code means, and the code itself to look up in the drive's manual."""
    if code == 0:
        return "the drive gives no reason"
    families = (word for mask, value, word in _FAMILIES if code & mask == value)
    return f"{_CODES.get(code) or next(families, 'an error')} (0x{code:04X})"
