"""The Grbl controller of a profile, emulated, and what can go wrong with it."""

import asyncio
import math
import random
from collections.abc import Callable, Mapping
from typing import Any, Final, Self

from drivers.axis import AxisSpec
from drivers.driver import DriverContext
from drivers.emulators.emulator import Fault
from drivers.emulators.grbl.firmware import Firmware
from drivers.emulators.grbl.motor import Motor
from drivers.emulators.grbl.settings import LETTERS, Settings
from drivers.emulators.pty_port import PtyPort
from drivers.errors import OptionsError
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from drivers.simulated.shaft import Gear, Shaft

PORT: Final = "usb-Emulated_Grbl-if00"
BOOT_TIME: Final = 0.3
"""Seconds that an Arduino's boot loader keeps the line for itself after the port was opened."""
DROPPED: Final = 9
"""One byte in so many is lost on a bad line."""
MEAN_GEAR: Final = Gear(1.0, 0.0, 0.0, 0.0, 0.0, None, None)


class GrblEmulator:
    """An Arduino with Grbl 1.1h: it restarts when its port is opened, and has its power from the port.

    `changes` are settings ($N) other than those that fit the profile; without `restarts` it is a board whose
    own USB does not restart it, and which goes on with what it does.
    """

    def __init__(
        self,
        specs: Mapping[str, AxisSpec],
        axis_options: Mapping[str, GrblAxisOptions],
        context: DriverContext,
        *,
        changes: Mapping[int, float] | None = None,
        restarts: bool = True,
        single_axis_homing: bool = False,
    ) -> None:
        if context.world is None:
            raise OptionsError("an emulator needs a world: add a [simulation] table to the profile")
        clock, world = context.clock, context.world
        self._letters = {name: axis_options[name].letter for name in specs}
        count = max(3, *(1 + LETTERS.index(letter) for letter in self._letters.values()))
        letters = LETTERS[:count]
        settings: dict[int, float] = {}
        motors = {letter: Motor(Shaft(MEAN_GEAR), 1.0, clock.now) for letter in letters}
        for name, spec in specs.items():
            options = axis_options[name]
            zero, (low, high) = options.zero(spec), spec.limits
            if high > zero:
                raise OptionsError(
                    f"axis '{name}' goes up to {high:g} {spec.unit} and its machine zero is at {zero:g} {spec.unit}: "
                    "Grbl travels below its zero"
                )
            index = letters.index(options.letter)
            settings |= {
                100 + index: options.steps or 250.0,
                110 + index: spec.velocity * 60,
                120 + index: spec.acceleration,
                130 + index: zero - low,
            }
            shaft = world.shaft(name)[1]
            shaft.place((low + high) / 2, -math.inf)
            motors[options.letter] = Motor(shaft, zero, clock.now)
        fastest = max(spec.velocity for spec in specs.values()) * 60
        # Pulled off its switch an axis stands within its limits.
        pull_off = max(0.5, *(axis_options[name].zero(spec) - spec.limits[1] for name, spec in specs.items()))
        settings |= {25: fastest, 24: fastest / 10, 27: pull_off}
        self.settings = Settings(letters, settings | dict(changes or {}))
        self.motors: Mapping[str, Motor] = {name: motors[letter] for name, letter in self._letters.items()}
        self.firmware = Firmware(
            motors, self.settings, clock, self._send, single_axis_homing=single_axis_homing
        )
        self.port = PtyPort(PORT, self._receive, self._opened)
        self._restarts = restarts
        self._booting: asyncio.TimerHandle | None = None
        self._mute = False
        self._delay = 0.0
        self._garbled = False
        self._dropping = False
        self._noise = random.Random(0)  # noqa: S311  noise on a line, no secret
        self._late: set[asyncio.TimerHandle] = set()

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: GrblOptions,  # noqa: ARG003  a controller does not know what its driver is told
        axis_options: Mapping[str, Any],
        context: DriverContext,
    ) -> Self:
        """Make the controller of a profile. Raises OptionsError where it cannot be as the profile says."""
        return cls(specs, axis_options, context)

    @property
    def faults(self) -> Mapping[str, Fault]:
        """What it can be told to do wrong."""
        return {
            "mute": Fault("it answers nothing, and obeys", self.mute),
            "late": Fault("its answers come so many seconds late", self.late, "SECONDS"),
            "garbage": Fault("what it says is noise", self.garble),
            "drop": Fault("bytes are lost, both ways", self.drop),
            "reset": Fault("it restarts, as after a dip of its supply", self.reset),
            "alarm": Fault("it goes into the alarm of that number", self.alarm, "NUMBER"),
            "limit": Fault("a limit switch trips: hard stop, alarm 1", self.limit),
            "stall": Fault("the motor turns no more, and nobody notices", self.stall, "AXIS"),
            "slip": Fault("steps are lost, and nobody notices", self.slip, "AXIS DISTANCE"),
            "unplug": Fault("the cable is out, and with it its power", self.unplug),
            "replug": Fault("it is back, under another name", self.replug),
            "repair": Fault("line and motors are well again", self.repair),
        }

    async def start(self) -> Mapping[str, object]:
        """Be plugged in, powered."""
        self.replug()
        # A machine that renders pictures on the side lets an answer wait as no microcontroller does.
        return {"port": str(self.port.path), "answer_timeout": "5 s"}

    async def close(self) -> None:
        """Be gone."""
        self.unplug()
        self.port.close()
        await asyncio.sleep(0)  # its tasks end

    def mute(self) -> None:
        """Answer nothing any more."""
        self._mute = True

    def late(self, seconds: float | str) -> None:
        """Answer so much later."""
        self._delay = float(seconds)

    def garble(self) -> None:
        """Say nothing but noise."""
        self._garbled = True

    def drop(self) -> None:
        """Lose a byte now and then, in both directions."""
        self._dropping = True

    def reset(self) -> None:
        """Restart and forget where the axes are."""
        self.firmware.power_up()

    def alarm(self, number: int | str) -> None:
        """Go into alarm."""
        self.firmware.alarm(int(number))

    def limit(self) -> None:
        """Trip a limit switch."""
        self.firmware.alarm(1)

    def stall(self, axis: str) -> None:
        """Block an axis's motor."""
        self._motor(axis).stall()

    def slip(self, axis: str, distance: float | str) -> None:
        """Let an axis lose steps on its next motion."""
        self._motor(axis).slip(float(distance))

    def unplug(self) -> None:
        """Pull the cable."""
        self._cancel_boot()
        self._forget_late()
        self.port.unplug()
        self.firmware.power_down()

    def replug(self) -> None:
        """Plug it in again."""
        self.port.plug()
        self.firmware.power_up()

    def repair(self) -> None:
        """Undo what is wrong with the line and the motors."""
        self._mute = self._garbled = self._dropping = False
        self._delay = 0.0
        self._forget_late()
        for motor in self.motors.values():
            motor.stalled = False

    def _motor(self, axis: str) -> Motor:
        if axis not in self.motors:
            raise ValueError(f"it has no axis '{axis}': axes are {', '.join(self.motors)}")
        return self.motors[axis]

    def _opened(self) -> None:
        if not self._restarts:
            return
        self._cancel_boot()
        self.firmware.power_down()
        self._booting = asyncio.get_running_loop().call_later(BOOT_TIME, self.firmware.power_up)

    def _cancel_boot(self) -> None:
        if self._booting is not None:
            self._booting.cancel()

    def _receive(self, data: bytes) -> None:
        self.firmware.receive(self._through_the_line(data))

    def _send(self, data: bytes) -> None:
        if self._mute:
            return
        if self._garbled:
            data = self._noise.randbytes(len(data)).replace(b"\n", b"\xff").replace(b"\r", b"\xfe")
        data = self._through_the_line(data)
        if self._delay:
            self._later(lambda: self.port.send(data))
        else:
            self.port.send(data)

    def _forget_late(self) -> None:
        for handle in self._late:
            handle.cancel()
        self._late.clear()

    def _later(self, act: Callable[[], None]) -> None:
        def due() -> None:
            self._late.discard(handle)
            act()

        handle = asyncio.get_running_loop().call_later(self._delay, due)
        self._late.add(handle)

    def _through_the_line(self, data: bytes) -> bytes:
        if not self._dropping:
            return data
        return bytes(byte for byte in data if self._noise.randrange(DROPPED))
