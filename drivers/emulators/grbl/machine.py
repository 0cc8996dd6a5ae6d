"""The part of Grbl that turns blocks of motion into steps: planner, hold, jog cancel, homing."""

import asyncio
import contextlib
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from drivers.clock import Clock
from drivers.emulators.grbl.motor import Motor
from drivers.emulators.grbl.settings import Settings

PLANNER: Final = 15
"""Blocks that the planner holds."""
SEARCH: Final = 1.5
"""How much farther than the travel the switch is looked for."""

Hold = Literal["slowing", "still"]
_Vector = tuple[float, ...]


class HomingError(Exception):
    """The switch was not found, or not left. `alarm` is its number."""

    def __init__(self, alarm: int) -> None:
        super().__init__(f"ALARM:{alarm}")
        self.alarm = alarm


@dataclass(frozen=True, slots=True)
class Block:
    """A straight line to `target` (machine coordinates) at `feed` (mm/min)."""

    target: _Vector
    feed: float
    jog: bool


class Machine:
    """Executes blocks one after the other. A coroutine of the firmware's runs `step` all the time."""

    def __init__(self, motors: Mapping[str, Motor], settings: Settings, clock: Clock) -> None:
        self.motors = motors
        self.hold: Hold | None = None
        self.homing = False
        self._block: Block | None = None
        """The block under way."""
        self._settings = settings
        self._clock = clock
        self._blocks: deque[Block] = deque()
        self._changed = asyncio.Event()

    @property
    def position(self) -> _Vector:
        """Where the firmware takes the axes to be."""
        return tuple(motor.position for motor in self.motors.values())

    @property
    def planned(self) -> _Vector:
        """Where the last block ends."""
        blocks = [block for block in (self._block, *self._blocks) if block is not None]
        return blocks[-1].target if blocks else self.position

    @property
    def block(self) -> Block | None:
        """The block under way, or the next one."""
        return self._blocks[0] if self._block is None and self._blocks else self._block

    @property
    def busy(self) -> bool:
        """Whether there is a block under way, or waiting."""
        return self.block is not None

    async def plan(self, block: Block) -> None:
        """Take a block, waiting while the planner is full."""
        while len(self._blocks) >= PLANNER:
            await self._change()
        self._blocks.append(block)
        self._note()

    async def synchronise(self) -> None:
        """Return when every block is done."""
        while self.busy:
            await self._change()

    async def released(self) -> None:
        """Return when there is no hold, or not any more."""
        while self.hold is not None:
            await self._change()

    async def step(self) -> None:
        """Execute blocks for ever."""
        while True:
            while not self._blocks or self.hold is not None:
                await self._change()
            self._block = self._blocks.popleft()
            self._go(self._block)
            await self.stand()
            self._come_to_rest(self._block)
            self._block = None
            self._note()

    def _come_to_rest(self, block: Block) -> None:
        if self.hold is None:
            return
        if block.jog:
            self.hold = None
            self._blocks.clear()
        else:
            self.hold = "still"
            self._blocks.appendleft(block)  # what is left of it, for later

    def feed_hold(self) -> None:
        """Slow down to a hold; a jog ends with it."""
        if self.hold is not None:
            return
        self.hold = "still" if self._block is None else "slowing"
        for letter, motor in self.motors.items():
            motor.brake(self._setting(120, letter))
        self._note()

    def resume(self) -> None:
        """Go on after a hold that has come to a stand."""
        if self.hold == "still":
            self.hold = None
            self._note()

    def cut(self) -> bool:
        """Stop all pulses and forget all blocks; return whether that was in motion, so that steps may be lost."""
        moving = self.homing or self._clock.now() < self._ends()
        for motor in self.motors.values():
            motor.cut()
        self._blocks.clear()
        self._block = self.hold = None
        self.homing = False
        self._note()
        return moving

    async def home(self, letters: list[str]) -> None:
        """Find the switches of axes, all at once: quickly, back, slowly, and back. Raises HomingError."""
        self.homing = True
        quick, slow, back = self._settings[25] / 60, self._settings[24] / 60, self._settings[27]
        for velocity, leave in ((quick, quick), (slow, slow)):
            self._seek(letters, velocity)
            await self.stand()
            if any(abs(self.motors[letter].to_switch()) > 1e-6 for letter in letters):
                raise HomingError(9)
            for letter in letters:
                motor = self.motors[letter]
                self._move(letter, motor.position - self._side(letter) * back, leave)
            await self.stand()
        for letter in letters:
            travel = self._setting(130, letter)
            at_switch = 0.0 if self._side(letter) > 0 else -travel
            self.motors[letter].count_from(at_switch - self._side(letter) * back)
        self.homing = False

    def _seek(self, letters: list[str], velocity: float) -> None:
        for letter in letters:
            motor = self.motors[letter]
            distance = motor.to_switch()
            if motor.stalled or distance * self._side(letter) < 0:
                distance = self._side(letter) * SEARCH * self._setting(130, letter)
            self._move(letter, motor.position + distance, velocity)

    async def stand(self) -> None:
        """Return when every axis stands."""
        while (left := self._ends() - self._clock.now()) > 0:
            await self._change(left)

    def _go(self, block: Block) -> None:
        way = [end - start for end, start in zip(block.target, self.position, strict=True)]
        length = math.hypot(*way)
        if length == 0:
            return
        parts = {letter: abs(part) / length for letter, part in zip(self.motors, way, strict=True)}
        rates = [
            self._setting(110, letter) / 60 / part if part else math.inf for letter, part in parts.items()
        ]
        ramps = [self._setting(120, letter) / part if part else math.inf for letter, part in parts.items()]
        velocity, acceleration = min(block.feed / 60, *rates), min(ramps)
        for (letter, part), target in zip(parts.items(), block.target, strict=True):
            if part:
                self.motors[letter].go(target, velocity * part, acceleration * part)

    def _move(self, letter: str, target: float, velocity: float) -> None:
        self.motors[letter].go(target, velocity, self._setting(120, letter))

    def _ends(self) -> float:
        return max(motor.ends for motor in self.motors.values())

    def _side(self, letter: str) -> float:
        """Return on which side the switch is: +1 unless $23 says otherwise."""
        return -1.0 if int(self._settings[23]) >> list(self.motors).index(letter) & 1 else 1.0

    def _setting(self, base: int, letter: str) -> float:
        return self._settings[base + list(self.motors).index(letter)]

    def _note(self) -> None:
        self._changed.set()

    async def _change(self, seconds: float | None = None) -> None:
        """Wait until something changes, at most for `seconds`: the world's clock keeps the pace of life."""
        self._changed.clear()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._changed.wait()
