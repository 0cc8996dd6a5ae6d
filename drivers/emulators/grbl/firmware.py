"""Grbl 1.1h as it answers on its serial line, byte for byte as the real firmware was seen to."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from drivers.clock import Clock
from drivers.emulators.grbl.gcode import CodeError, Line, parse
from drivers.emulators.grbl.machine import Block, HomingError, Machine
from drivers.emulators.grbl.motor import Motor
from drivers.emulators.grbl.settings import Settings

RX_BUFFER: Final = 128
LINE_LENGTH: Final = 80
LINE_TIME: Final = 0.003
"""Seconds from the end of a line to its execution, in which a report still shows the state before it."""
EEPROM_TIME: Final = 0.02
"""Seconds that a setting takes to be written, in which nothing is received."""
WCO_IDLE: Final = 10
WCO_BUSY: Final = 30
RESTARTING: Final = frozenset({3, 6, 7, 8, 9})
"""Alarms with which it begins anew."""
BANNER: Final = "\r\nGrbl 1.1h ['$' for help]\r\n"


class Firmware:
    """One controller. `send` is called with what it says, `receive` with what it is told."""

    def __init__(
        self,
        motors: Mapping[str, Motor],
        settings: Settings,
        clock: Clock,
        send: Callable[[bytes], None],
        *,
        single_axis_homing: bool = False,
    ) -> None:
        self.machine = Machine(motors, settings, clock)
        self.settings = settings
        self.letters = "".join(motors)
        self.offsets = (0.0,) * len(motors)
        """The work coordinates' (G54)."""
        self._send = send
        self._single = single_axis_homing
        self._rx = bytearray()
        self._arrived = asyncio.Event()
        self._alarm = False
        self._stuck: int | None = None
        """The alarm that has made it deaf."""
        self._writing = False
        self._report_owed = False
        self._ok_owed = False
        self._reports_to_wco = 0
        self._overrides_due = False
        self._absolute, self._inches = True, False
        self._tasks: list[asyncio.Task[None]] = []

    def power_up(self) -> None:
        """Start, knowing nothing of where the axes are."""
        self.power_down()
        for motor in self.machine.motors.values():
            motor.count_from(0.0)
        self._alarm = bool(self.settings[22])
        self._start()

    def power_down(self) -> None:
        """Stop dead."""
        self.machine.cut()
        self._stuck = None
        self._ok_owed = False
        self._stop()

    def receive(self, data: bytes) -> None:
        """Take bytes as they come in: real-time commands at once, the others into the buffer as far as it goes."""
        if self._writing or not self._tasks:
            return
        for byte in data:
            if byte == 0x18:
                self._reset()
            elif self._stuck is not None:
                continue
            elif byte == ord("?"):
                self._report()
            elif byte == ord("!"):
                self._feed_hold()
            elif byte == ord("~"):
                self.machine.resume()
            elif byte == 0x85:
                if self.machine.block is not None and self.machine.block.jog:
                    self.machine.feed_hold()
            elif byte < 0x80 and len(self._rx) < RX_BUFFER:
                self._rx.append(byte)
        self._arrived.set()

    def alarm(self, number: int) -> None:
        """Go into alarm by itself, as at a limit switch; 1 and 2 make it deaf, and most others restart it."""
        self.machine.cut()
        self._alarm = True
        self._say(f"ALARM:{number}")
        if number in {1, 2}:
            self._stuck = number
            self._say("[MSG:Reset to continue]")
            self._ok_owed = number == 2
            for task in self._tasks:
                task.cancel()  # whatever line is being carried out, it goes no further
        elif number in RESTARTING:
            self._restart(number in {6, 8, 9})

    @property
    def state(self) -> str:
        """The first word of a status report."""
        if self.machine.homing:
            return "Home"
        if self._alarm:
            return "Alarm"
        if self.machine.hold is not None and not (self.machine.block is not None and self.machine.block.jog):
            return "Hold:1" if self.machine.hold == "slowing" else "Hold:0"
        if self.machine.block is not None:
            return "Jog" if self.machine.block.jog else "Run"
        return "Idle"

    def _start(self) -> None:
        self._rx.clear()
        self._reports_to_wco, self._overrides_due = 0, False
        self._report_owed = False
        self._absolute, self._inches = True, False
        self._send(BANNER.encode())
        if self._alarm:
            self._say("[MSG:'$H'|'$X' to unlock]")
        self._tasks = [asyncio.ensure_future(self._obey()), asyncio.ensure_future(self.machine.step())]

    def _stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        self._tasks = []
        self._writing = False

    def _reset(self) -> None:
        homing, owed = self.machine.homing, self._ok_owed
        if self.machine.cut():
            self._alarm = True
            self._say(f"ALARM:{6 if homing else 3}")
            owed = owed or homing
        self._restart(owed)

    def _restart(self, owed: bool) -> None:
        """Begin anew; `owed` says whether a line was cut short, whose ok comes before the banner."""
        self._stuck, self._ok_owed = None, False
        self._stop()
        if owed:
            self._say("ok")
        self._start()

    def _feed_hold(self) -> None:
        if not self._alarm and not self.machine.homing:
            self.machine.feed_hold()

    async def _obey(self) -> None:
        """Execute line after line; whatever it waits for, the lines behind it wait too."""
        while True:
            line = await self._line()
            await asyncio.sleep(LINE_TIME)
            await self.machine.released()
            try:
                await self._execute(line)
            except CodeError as error:
                self._say(f"error:{error.number}")
            else:
                self._say("ok")

    async def _line(self) -> str:
        line = bytearray()
        while True:
            while self._rx:
                byte = self._rx.pop(0)
                if byte in b"\r\n":
                    return line.decode("ascii", "replace")
                line.append(byte)
            self._arrived.clear()
            await self._arrived.wait()

    async def _execute(self, line: str) -> None:
        if len(line) >= LINE_LENGTH:
            raise CodeError(11)
        if line.startswith("$"):
            await self._system(line[1:].upper().strip())
        elif line.strip():
            await self._code(line)

    async def _system(self, command: str) -> None:
        if command.startswith("J="):
            await self._jog(command[2:])
        elif command in {"$", "I"}:
            self._require_rest(alarm_too=True)
            for text in self.settings.lines() if command == "$" else self._build_info():
                self._say(text)
        elif command == "X":
            self._require_rest(alarm_too=True)
            if self._alarm:
                self._alarm = False
                self._say("[MSG:Caution: Unlocked]")
        elif command.startswith("H"):
            await self._home(command[1:])
        elif command and command[0].isdigit():
            await self._set(command)
        else:
            raise CodeError(3)

    def _require_rest(self, *, alarm_too: bool) -> None:
        if self.state != "Idle" and not (alarm_too and self.state == "Alarm"):
            raise CodeError(8)

    def _build_info(self) -> list[str]:
        return ["[VER:1.1h.20190830:]", f"[OPT:V{'H' if self._single else ''},15,128]"]

    async def _set(self, command: str) -> None:
        self._require_rest(alarm_too=True)
        number, _, value = command.partition("=")
        try:
            key, setting = int(number), float(value)
        except ValueError:
            raise CodeError(2) from None
        if key not in self.settings:
            raise CodeError(3)
        self._writing = True
        await asyncio.sleep(EEPROM_TIME)
        self._writing = False
        self.settings[key] = setting

    async def _home(self, which: str) -> None:
        if not self.settings[22]:
            raise CodeError(5)
        if which and not (self._single and which in self.letters and len(which) == 1):
            raise CodeError(3)
        self._require_rest(alarm_too=True)
        self._alarm = False
        try:
            await self.machine.home([which] if which else list(self.letters))
        except HomingError as error:
            self.machine.cut()
            self._alarm = True
            self._say(f"ALARM:{error.alarm}")
            asyncio.get_running_loop().call_soon(self._restart, True)
            await asyncio.Event().wait()  # until that
        if self._report_owed:
            self._report_owed = False
            self._report()

    async def _jog(self, text: str) -> None:
        if self.state not in {"Idle", "Jog"}:
            raise CodeError(8)
        line = parse(text, self.letters, inches=self._inches)
        if line.feed is None or line.feed <= 0:
            raise CodeError(22)
        if not line.axes or line.codes & {0, 1, 4}:
            raise CodeError(16)
        target = self._target(line, absolute=91 not in line.codes and (self._absolute or 90 in line.codes))
        if self._beyond(target):
            raise CodeError(15)
        await self.machine.plan(Block(target, line.feed, jog=True))

    async def _code(self, text: str) -> None:
        if self.state in {"Alarm", "Jog"}:
            raise CodeError(9)
        line = parse(text, self.letters, inches=self._inches)
        self._absolute = (self._absolute or 90 in line.codes) and 91 not in line.codes
        self._inches = (self._inches or 20 in line.codes) and 21 not in line.codes
        if 4 in line.codes:
            if line.dwell is None:
                raise CodeError(28)
            await self.machine.synchronise()
            await asyncio.sleep(line.dwell)
        elif line.axes:
            await self._run(line)

    async def _run(self, line: Line) -> None:
        if 0 not in line.codes and line.feed is None:
            raise CodeError(22)
        target = self._target(line, absolute=self._absolute)
        if self._beyond(target):
            self.machine.feed_hold()
            await self.machine.stand()
            self.alarm(2)
            await asyncio.Event().wait()  # until the reset
        feed = line.feed if line.feed is not None and 0 not in line.codes else 1e9
        await self.machine.plan(Block(target, feed, jog=False))

    def _target(self, line: Line, *, absolute: bool) -> tuple[float, ...]:
        start = self.machine.planned
        offsets = (0.0,) * len(start) if 53 in line.codes else self.offsets
        target = []
        for letter, begin, offset in zip(self.letters, start, offsets, strict=True):
            value = line.axes.get(letter)
            if value is None:
                target.append(begin)
            else:
                target.append(value + offset if absolute else begin + value)
        return tuple(target)

    def _beyond(self, target: tuple[float, ...]) -> bool:
        travels = [self.settings[130 + i] for i in range(len(target))]
        within = all(
            -travel <= value <= 0 or value == now
            for value, now, travel in zip(target, self.machine.planned, travels, strict=True)
        )
        return bool(self.settings[20]) and not within

    def _report(self) -> None:
        if self.machine.homing:
            self._report_owed = True
            return
        machine = self.machine.position
        if int(self.settings[10]) & 1:
            where = f"MPos:{_csv(machine)}"
        else:
            where = f"WPos:{_csv(tuple(m - o for m, o in zip(machine, self.offsets, strict=True)))}"
        feed = 0 if self.machine.block is None else self.machine.block.feed
        fields = [self.state, where, f"FS:{feed:.0f},0"]
        if self._reports_to_wco == 0:
            fields.append(f"WCO:{_csv(self.offsets)}")
            self._reports_to_wco = WCO_BUSY if self.machine.busy else WCO_IDLE
        elif self._overrides_due:
            fields.append("Ov:100,100,100")
        self._overrides_due = fields[-1].startswith("WCO")
        self._reports_to_wco -= 1
        self._say(f"<{'|'.join(fields)}>")

    def _say(self, text: str) -> None:
        self._send(f"{text}\r\n".encode())


def _csv(values: tuple[float, ...]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
