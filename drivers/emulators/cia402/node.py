"""A CANopen device with a servo in it: what it says on the bus, and what it hears there."""

import struct
from collections.abc import Callable, Mapping
from typing import Final

from canopen import ObjectDictionary
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from canopen.sdo import SdoAbortedError, SdoServer

from drivers.clock import Clock
from drivers.emulators.cia402.servo import Mechanics, Servo
from drivers.simulated.shaft import Shaft

Send = Callable[[int, bytes], None]

_I8, _I16, _I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
_U8, _U16, _U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
_TEXT: Final = datatypes.VISIBLE_STRING

_OBJECTS: Final[tuple[tuple[int, int, int, str, int | str], ...]] = (
    (0x1000, 0, _U32, "ro", 0x00020192),
    (0x1001, 0, _U8, "ro", 0),
    (0x1008, 0, _TEXT, "const", "emulated servo drive"),
    (0x1016, 0, _U8, "const", 1),
    (0x1016, 1, _U32, "rw", 0),
    (0x1017, 0, _U16, "rw", 0),
    (0x1018, 0, _U8, "const", 4),
    (0x1018, 1, _U32, "ro", 0),
    (0x1018, 2, _U32, "ro", 402),
    (0x1018, 3, _U32, "ro", 1),
    (0x1018, 4, _U32, "ro", 1),
    (0x6007, 0, _I16, "rw", 0),
    (0x603F, 0, _U16, "ro", 0),
    (0x6040, 0, _U16, "rw", 0),
    (0x6041, 0, _U16, "ro", 0),
    (0x605A, 0, _I16, "rw", 2),
    (0x605D, 0, _I16, "rw", 1),
    (0x6060, 0, _I8, "rw", 0),
    (0x6061, 0, _I8, "ro", 0),
    (0x6064, 0, _I32, "ro", 0),
    (0x6065, 0, _U32, "rw", 0),
    (0x6066, 0, _U16, "rw", 50),
    (0x6067, 0, _U32, "rw", 0),
    (0x606C, 0, _I32, "ro", 0),
    (0x607A, 0, _I32, "rw", 0),
    (0x607C, 0, _I32, "rw", 0),
    (0x607D, 0, _U8, "const", 2),
    (0x607D, 1, _I32, "rw", 0),
    (0x607D, 2, _I32, "rw", 0),
    (0x607F, 0, _U32, "rw", 0xFFFFFFFF),
    (0x6081, 0, _U32, "rw", 1000),
    (0x6083, 0, _U32, "rw", 10000),
    (0x6084, 0, _U32, "rw", 10000),
    (0x6085, 0, _U32, "rw", 50000),
    (0x6098, 0, _I8, "rw", 19),
    (0x6099, 0, _U8, "const", 2),
    (0x6099, 1, _U32, "rw", 1000),
    (0x6099, 2, _U32, "rw", 100),
    (0x6502, 0, _U32, "ro", 0x21),
)
"""Index, sub-index, type, access and value after power-up."""

_OPTIONAL: Final[Mapping[tuple[int, int], int]] = {
    (0x608F, 1): _U32,
    (0x608F, 2): _U32,
    (0x6091, 1): _U32,
    (0x6091, 2): _U32,
    (0x6092, 1): _U32,
    (0x6092, 2): _U32,
    (0x60A8, 0): _U32,
    (0x60A9, 0): _U32,
    (0x60AA, 0): _U32,
}
"""Objects that a drive has only where they are given."""

_BOOT_UP, _STOPPED, _OPERATIONAL, _PRE_OPERATIONAL = 0, 4, 5, 127
_NMT: Final = {1: _OPERATIONAL, 2: _STOPPED, 128: _PRE_OPERATIONAL}
_RESETS: Final = frozenset({129, 130})
_PDO_INVALID: Final = 1 << 31
_SECOND_LOOK: Final = 0.1
"""Seconds from the first look that finds a heartbeat missing to the one that counts."""
_HEARTBEAT_LOST: Final = 0x8130


class Node:
    """One drive on a bus. It speaks by `send`; what is on the bus is given to `receive`."""

    def __init__(
        self,
        node: int,
        shaft: Shaft,
        mechanics: Mechanics,
        clock: Clock,
        objects: Mapping[tuple[int, int], int],
    ) -> None:
        self.id = node
        self.send: Send = lambda _id, _data: None
        self.has_heartbeat = True
        """Whether the heartbeat is sent, where it is asked for."""
        self.mute = False
        """Whether it neither hears nor says anything, and goes on with what it does."""
        self.dark = False
        """Whether it has no power."""
        self._clock = clock
        self.object_dictionary = _object_dictionary(node, objects)
        self._values: dict[tuple[int, int], bytes] = {}
        self._restore()
        self.servo = Servo(shaft, mechanics, clock, self._parameter)
        self.servo.on_error = self._send_emergency
        self._sdo = SdoServer(0x600 + node, 0x580 + node, self)
        self._sdo.network = _Sender(self._say)
        self._state = _PRE_OPERATIONAL
        self._next_heartbeat = 0.0
        self._guarded_at: float | None = None
        self._missed_at: float | None = None

    def reset(self) -> None:
        """Come up anew, as after the power was off, and say so."""
        self.dark = False
        self._restore()
        self.servo.power_up()
        self._state = _PRE_OPERATIONAL
        self._guarded_at = None
        self._say(0x700 + self.id, bytes([_BOOT_UP]))

    def lose_power(self) -> None:
        """Be dark: the motor stands, and nothing is said until `reset`."""
        self.servo.power_up()
        self.dark = True

    def receive(self, can_id: int, data: bytes) -> None:
        """Hear a frame."""
        if self.mute or self.dark:
            return
        if can_id == 0 and len(data) == 2 and data[1] in {0, self.id}:
            self._obey(data[0])
        elif can_id == 0x600 + self.id and self._state != _STOPPED and len(data) == 8:
            self._sdo.on_request(can_id, bytearray(data), 0.0)
        elif can_id == 0x700 + (self._number(0x1016, 1) >> 16 & 0x7F):
            self._guarded_at = self._clock.now()
        elif self._state == _OPERATIONAL:
            if can_id == 0x080:
                self._send_pdos()
            elif can_id == self._number(0x1400, 1):
                self._take_pdo(data)

    def tick(self) -> None:
        """Go on with what takes time."""
        now = self._clock.now()
        period = self._number(0x1017, 0) / 1000
        if period and self.has_heartbeat and now >= self._next_heartbeat:
            self._next_heartbeat = now + period
            self._say(0x700 + self.id, bytes([self._state]))
        if self._hears_nobody(now):
            self._guarded_at = None
            if self._number(0x6007, 0) == 1:
                self.servo.fail(_HEARTBEAT_LOST)
        self.servo.tick()

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """Return a value as the SDO server sends it."""
        variable = self._variable(index, subindex)
        if check_readable and not variable.readable:
            raise SdoAbortedError(0x06010001)
        live = self._live(index)
        return variable.encode_raw(live) if live is not None else self._values[index, subindex]

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Take a value as the SDO server received it."""
        variable = self._variable(index, subindex)
        if check_writable and not variable.writable:
            raise SdoAbortedError(0x06010002)
        if 8 * len(data) != len(variable):
            raise SdoAbortedError(0x06070010)
        if (index, subindex) == (0x6081, 0):  # a faster one than the drive allows becomes the fastest
            data = min(variable.decode_raw(data), self._number(0x607F, 0)).to_bytes(4, "little")
        self._values[index, subindex] = bytes(data)
        if index == 0x6040:
            self.servo.command(variable.decode_raw(data))
        elif index == 0x6060:
            self.servo.enter(variable.decode_raw(data))

    def _hears_nobody(self, now: float) -> bool:
        """Return whether the heartbeat that is to be watched is gone, at the second look that finds it so.

        An emulator that was held up has its frames still to hear.
        """
        patience = (self._number(0x1016, 1) & 0xFFFF) / 1000
        if not patience or self._guarded_at is None or now - self._guarded_at <= patience:
            self._missed_at = None
        elif self._missed_at is None:
            self._missed_at = now
        return self._missed_at is not None and now - self._missed_at > _SECOND_LOOK

    def _live(self, index: int) -> int | None:
        match index:
            case 0x603F:
                return self.servo.error_code
            case 0x6041:
                return self.servo.statusword
            case 0x6061:
                return self.servo.mode
            case 0x6064:
                return self.servo.position
            case 0x606C:
                return self.servo.velocity
        return None

    def _obey(self, command: int) -> None:
        if command in _RESETS:
            self.reset()
        else:
            self._state = _NMT.get(command, self._state)

    def _send_pdos(self) -> None:
        for number in range(2):
            identifier, transmission = self._number(0x1800 + number, 1), self._number(0x1800 + number, 2)
            if not identifier & _PDO_INVALID and 1 <= transmission <= 240:
                parts = (self.get_data(*entry) for entry in self._mapped(0x1A00 + number))
                self._say(identifier & 0x7FF, b"".join(parts))

    def _take_pdo(self, data: bytes) -> None:
        for index, subindex in self._mapped(0x1600):
            size = len(self._variable(index, subindex)) // 8
            self.set_data(index, subindex, data[:size])
            data = data[size:]

    def _mapped(self, index: int) -> list[tuple[int, int]]:
        entries = (self._number(index, number) for number in range(1, self._number(index, 0) + 1))
        return [(entry >> 16, entry >> 8 & 0xFF) for entry in entries]

    def _say(self, can_id: int, data: bytes) -> None:
        if not (self.mute or self.dark):
            self.send(can_id, data)

    def _send_emergency(self, code: int) -> None:
        self._say(0x080 + self.id, struct.pack("<HB5s", code, 0x21 if code else 0, b""))

    def _restore(self) -> None:
        self._values = {
            (index, subindex): variable.encode_raw(variable.default)
            for index, item in self.object_dictionary.items()
            for subindex, variable in _members(item)
        }

    def _parameter(self, index: int, subindex: int) -> int:
        return self._number(index, subindex)

    def _number(self, index: int, subindex: int) -> int:
        return int(self._variable(index, subindex).decode_raw(self._values[index, subindex]))

    def _variable(self, index: int, subindex: int) -> ODVariable:
        if index not in self.object_dictionary:
            raise SdoAbortedError(0x06020000)
        for number, variable in _members(self.object_dictionary[index]):
            if number == subindex:
                return variable
        raise SdoAbortedError(0x06090011)


class _Sender:
    """What `canopen`'s SDO server wants of a network."""

    def __init__(self, send: Send) -> None:
        self._send = send

    def send_message(self, can_id: int, data: bytes) -> None:
        self._send(can_id, bytes(data))


def _members(item: ODVariable | ODRecord) -> list[tuple[int, ODVariable]]:
    return [(0, item)] if isinstance(item, ODVariable) else list(item.subindices.items())


def _object_dictionary(node: int, given: Mapping[tuple[int, int], int]) -> ObjectDictionary:
    dictionary = ObjectDictionary()
    defaults = {(index, subindex): value for index, subindex, _, _, value in _OBJECTS} | dict(given)
    for index, subindex, data_type, access, _ in _OBJECTS:
        _add(dictionary, index, subindex, data_type, access, defaults[index, subindex])
    for (index, subindex), data_type in _OPTIONAL.items():
        if (index, subindex) in given:
            _add(dictionary, index, subindex, data_type, "rw", given[index, subindex])
    for communication, mapping, base in (
        (0x1400, 0x1600, 0x200),
        (0x1800, 0x1A00, 0x180),
        (0x1801, 0x1A01, 0x280),
    ):
        _add(dictionary, communication, 0, _U8, "const", 2)
        _add(dictionary, communication, 1, _U32, "rw", (base + node) | _PDO_INVALID)
        _add(dictionary, communication, 2, _U8, "rw", 255)
        _add(dictionary, mapping, 0, _U8, "rw", 0)
        for subindex in range(1, 9):
            _add(dictionary, mapping, subindex, _U32, "rw", 0)
    return dictionary


def _add(
    dictionary: ObjectDictionary, index: int, subindex: int, data_type: int, access: str, value: int | str
) -> None:
    variable = ODVariable(f"{index:04X}.{subindex}", index, subindex)
    variable.data_type, variable.access_type, variable.default = data_type, access, value
    if index in {0x1000, 0x1001, 0x1008, 0x1017} or (index >= 0x6000 and index not in _RECORDS):
        dictionary.add_object(variable)
        return
    if index not in dictionary:
        dictionary.add_object(ODRecord(f"{index:04X}", index))
    dictionary[index].add_member(variable)


_RECORDS: Final = frozenset({0x607D, 0x608F, 0x6091, 0x6092, 0x6099})
