"""The objects of a drive that are used here (CiA 301 and 402), by index and sub-index."""

from dataclasses import dataclass
from typing import Final

from canopen import ObjectDictionary
from canopen.objectdictionary import ODRecord, ODVariable, datatypes


@dataclass(frozen=True, slots=True)
class Entry:
    """One value in a drive's object dictionary."""

    index: int
    subindex: int
    type: int
    """A data type of `canopen`."""

    def __str__(self) -> str:
        return f"0x{self.index:04X}" + (f":{self.subindex}" if self.subindex else "")


_I8, _I32 = datatypes.INTEGER8, datatypes.INTEGER32
_U8, _U16, _U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32

DEVICE_TYPE: Final = Entry(0x1000, 0, _U32)
CONSUMER_HEARTBEAT: Final = Entry(0x1016, 1, _U32)
PRODUCER_HEARTBEAT: Final = Entry(0x1017, 0, _U16)
ABORT_CONNECTION: Final = Entry(0x6007, 0, datatypes.INTEGER16)
"""What the drive does when the heartbeat that it consumes is gone."""
ERROR_CODE: Final = Entry(0x603F, 0, _U16)
CONTROLWORD: Final = Entry(0x6040, 0, _U16)
STATUSWORD: Final = Entry(0x6041, 0, _U16)
MODE: Final = Entry(0x6060, 0, _I8)
MODE_DISPLAY: Final = Entry(0x6061, 0, _I8)
POSITION: Final = Entry(0x6064, 0, _I32)
VELOCITY: Final = Entry(0x606C, 0, _I32)
TARGET: Final = Entry(0x607A, 0, _I32)
LOWEST: Final = Entry(0x607D, 1, _I32)
HIGHEST: Final = Entry(0x607D, 2, _I32)
PROFILE_VELOCITY: Final = Entry(0x6081, 0, _U32)
PROFILE_ACCELERATION: Final = Entry(0x6083, 0, _U32)
PROFILE_DECELERATION: Final = Entry(0x6084, 0, _U32)
ENCODER_INCREMENTS: Final = Entry(0x608F, 1, _U32)
ENCODER_TURNS: Final = Entry(0x608F, 2, _U32)
GEAR_MOTOR_TURNS: Final = Entry(0x6091, 1, _U32)
GEAR_SHAFT_TURNS: Final = Entry(0x6091, 2, _U32)
FEED: Final = Entry(0x6092, 1, _U32)
FEED_TURNS: Final = Entry(0x6092, 2, _U32)
HOMING_METHOD: Final = Entry(0x6098, 0, _I8)
POSITION_UNIT: Final = Entry(0x60A8, 0, _U32)
VELOCITY_UNIT: Final = Entry(0x60A9, 0, _U32)
ACCELERATION_UNIT: Final = Entry(0x60AA, 0, _U32)

_ENTRIES: Final = tuple(entry for entry in list(globals().values()) if isinstance(entry, Entry))
_COMMUNICATION: Final = (0x1400, 0x1800, 0x1801)
_MAPPING: Final = (0x1600, 0x1A00, 0x1A01)


def object_dictionary() -> ObjectDictionary:
    """Return the dictionary by which `canopen` encodes these objects and sets the PDOs up."""
    dictionary = ObjectDictionary()
    for entry in _ENTRIES:
        if entry.subindex:
            if entry.index not in dictionary:
                dictionary.add_object(ODRecord(f"record {entry.index:04X}", entry.index))
            dictionary[entry.index].add_member(_variable(entry))
        else:
            dictionary.add_object(_variable(entry))
    for index in _COMMUNICATION:
        _add_record(dictionary, index, {0: _U8, 1: _U32, 2: _U8})
    for index in _MAPPING:
        _add_record(dictionary, index, {0: _U8} | dict.fromkeys(range(1, 9), _U32))
    return dictionary


def _add_record(dictionary: ObjectDictionary, index: int, types: dict[int, int]) -> None:
    record = ODRecord(f"record {index:04X}", index)
    for subindex, data_type in types.items():
        record.add_member(_variable(Entry(index, subindex, data_type)))
    dictionary.add_object(record)


def _variable(entry: Entry) -> ODVariable:
    variable = ODVariable(str(entry), entry.index, entry.subindex)
    variable.data_type = entry.type
    return variable
