"""An emulated CAN bus with CiA 402 drives on it, which move axes of the simulated world."""

import asyncio
import contextlib
import math
import random
import socket
from collections import deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Self

from drivers.axis import AxisSpec
from drivers.cia402.options import Cia402AxisOptions, Cia402Options
from drivers.driver import DriverContext
from drivers.emulators.cia402.node import Node
from drivers.emulators.cia402.servo import Mechanics
from drivers.emulators.cia402.wire import AdapterWire, BusWire, Wire
from drivers.emulators.emulator import Fault
from drivers.errors import OptionsError
from drivers.quantities import ANGLE, LENGTH

_TICK: Final = 0.005
"""Seconds between two looks at what goes on by itself."""
_GROUP: Final = "239.74.163.2"
"""The multicast group of python-can's own examples."""
_MOTOR: Final = {(0x608F, 1): 4096, (0x608F, 2): 1, (0x6091, 1): 100, (0x6091, 2): 1}
"""An encoder of 4096 increments behind a gear of 100 to 1."""
_MICROMETRES: Final = {(0x60A8, 0): 0xFA010000}


class Cia402Emulator:
    """One bus and its drives, by the names of their axes; see `drivers.emulators.emulator.Emulator`."""

    def __init__(self, nodes: Mapping[str, Node], wire: Wire) -> None:
        self.nodes = nodes
        self._wire = wire
        self._ticking: asyncio.Task[None] | None = None
        self._bus_off = False
        self._delay = 0.0
        self._late: deque[asyncio.TimerHandle] = deque(maxlen=10000)
        """Frames that are held back."""
        self._share_lost = 0.0
        self._chance = random.Random(402)  # noqa: S311  no secret, and the same at every run
        for node in nodes.values():
            node.send = self._send

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: Cia402Options,
        axis_options: Mapping[str, Cia402AxisOptions],
        context: DriverContext,
    ) -> Self:
        """Make drives for these axes, on a bus of the profile's kind, or on `udp_multicast` for `socketcan`.

        Raises OptionsError where there is no simulated world.
        """
        if context.world is None:
            raise OptionsError(
                "emulated drives move a simulated world: add a [simulation] table to the profile"
            )
        nodes = {}
        for name, spec in specs.items():
            _, shaft = context.world.shaft(name)
            low, high = spec.limits
            shaft.place((low + high) / 2, -math.inf)
            mechanics, objects = _build(spec, axis_options[name])
            nodes[name] = Node(axis_options[name].node, shaft, mechanics, context.clock, objects)
        return cls(nodes, _wire(options))

    @property
    def faults(self) -> Mapping[str, Fault]:
        """What it can be told to do wrong, by name."""
        return MappingProxyType(
            {
                "mute": Fault("the drive hears and says nothing", self.mute, "AXIS"),
                "late": Fault("every frame of the drives comes late", self.late, "SECONDS"),
                "lossy": Fault("this share of the drives' frames is lost", self.lossy, "SHARE"),
                "heartbeat-gone": Fault("the drive sends no heartbeat", self.stop_heartbeat, "AXIS"),
                "fail": Fault("the drive sends an emergency and goes into fault", self.fail, "AXIS CODE"),
                "stall": Fault("the axis's motion, or its next one, gets stuck half way", self.stall, "AXIS"),
                "disable": Fault("the drive's enable input opens", self.disable, "AXIS"),
                "reset": Fault("the drive's power goes off and on", self.reset, "AXIS"),
                "gone": Fault("the drive has no power", self.take_away, "AXIS"),
                "bus-off": Fault("the computer's controller goes off the bus", self.go_off),
                "unplug": Fault("the adapter is unplugged, or the bus cut", self.unplug),
                "repair": Fault("all is well again; drives that had no power boot", self.repair),
            }
        )

    async def start(self) -> Mapping[str, object]:
        """Be on the bus, and boot."""
        keys = self._wire.open(self._receive)
        for node in self.nodes.values():
            node.reset()
        self._ticking = asyncio.create_task(self._tick())
        return keys

    async def close(self) -> None:
        """Leave the bus."""
        if self._ticking is not None:
            self._ticking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._ticking
            self._ticking = None
        self._drop_late()
        self._wire.close()

    def mute(self, axis: str) -> None:
        """Let a drive go on with what it does, and neither hear nor say anything."""
        self._node(axis).mute = True

    def late(self, seconds: str) -> None:
        """Hold every frame of the drives back."""
        self._delay = float(seconds)

    def lossy(self, share: str) -> None:
        """Lose a share of the drives' frames, as a computer does that is too slow to read them."""
        self._share_lost = float(share)

    def stop_heartbeat(self, axis: str) -> None:
        """Let a drive work without its heartbeat."""
        self._node(axis).has_heartbeat = False

    def fail(self, axis: str, code: str) -> None:
        """Let a drive go into fault for a reason such as "0x3210"."""
        self._node(axis).servo.fail(int(code, 0))

    def stall(self, axis: str) -> None:
        """Let the motion under way, or the next one, get stuck."""
        self._node(axis).servo.stall()

    def disable(self, axis: str) -> None:
        """Open a drive's enable input."""
        self._node(axis).servo.open_enable_input()

    def reset(self, axis: str) -> None:
        """Take a drive's power away for a moment."""
        self._node(axis).reset()

    def take_away(self, axis: str) -> None:
        """Take a drive's power away."""
        self._node(axis).lose_power()

    def go_off(self) -> None:
        """Take the computer's controller off the bus, which the drives do not notice."""
        self._wire.send_bus_off()
        self._bus_off = True

    def unplug(self) -> None:
        """Cut the computer off from the bus, so that its adapter is gone where it has one."""
        self._bus_off = True
        self._wire.unplug()

    def repair(self) -> None:
        """Undo what was done; drives that had no power boot."""
        if self._bus_off:
            self._bus_off = False
            self._wire.plug()
        self._delay = self._share_lost = 0.0
        self._drop_late()
        for node in self.nodes.values():
            node.has_heartbeat = True
            if node.dark:
                node.reset()
            node.mute = False

    def _drop_late(self) -> None:
        for frame in self._late:
            frame.cancel()
        self._late.clear()

    def _node(self, axis: str) -> Node:
        if axis not in self.nodes:
            raise ValueError(f"there is no axis '{axis}' on this bus: choose one of {', '.join(self.nodes)}")
        return self.nodes[axis]

    def _receive(self, can_id: int, data: bytes) -> None:
        if not self._bus_off:
            for node in self.nodes.values():
                node.receive(can_id, data)

    def _send(self, can_id: int, data: bytes) -> None:
        if self._bus_off or self._chance.random() < self._share_lost:
            return
        if self._delay:
            self._late.append(
                asyncio.get_running_loop().call_later(self._delay, self._wire.send, can_id, data)
            )
        else:
            self._wire.send(can_id, data)

    async def _tick(self) -> None:
        while True:
            for node in self.nodes.values():
                node.tick()
            await asyncio.sleep(_TICK)


def _build(spec: AxisSpec, options: Cia402AxisOptions) -> tuple[Mechanics, dict[tuple[int, int], int]]:
    """Return how a drive sits in an axis, and its objects: what the profile says, or what a maker would."""
    objects: dict[tuple[int, int], int] = {}
    counts = options.counts_per_unit
    if counts is None and spec.unit in ANGLE.units:
        objects |= _MOTOR
        counts = 4096 * 100 * float(ANGLE.units[spec.unit]) / (2 * math.pi)
    elif counts is None and spec.unit in LENGTH.units:
        objects |= _MICROMETRES
        counts = float(LENGTH.units[spec.unit]) * 1e6
    elif counts is None:
        counts = 1.0
    velocity = options.velocity_per_unit or abs(counts)
    acceleration = options.acceleration_per_unit or abs(counts)
    low, high = spec.limits
    home = min(max(0.0, low), high)
    objects |= {
        (0x6065, 0): max(1, round(20 * spec.tolerance * abs(counts))),
        (0x607C, 0): round(home * counts),
        (0x6085, 0): round(5 * spec.acceleration * acceleration),
        (0x6099, 1): max(1, round(spec.velocity / 2 * velocity)),
    }
    return Mechanics(counts, velocity, acceleration, home, options.absolute), objects


def _wire(options: Cia402Options) -> Wire:
    match options.interface:
        case "slcan":
            return AdapterWire()
        case "virtual":
            return BusWire("virtual", options.channel)
        case "udp_multicast" if options.port is not None:
            return BusWire("udp_multicast", options.channel, port=options.port)
    return BusWire("udp_multicast", _GROUP, port=_free_port())


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port: int = probe.getsockname()[1]
        return port
