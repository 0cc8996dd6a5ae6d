"""One drive on the bus: its objects, its controlword, and whether it lives."""

import logging
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import canopen
from canopen.emcy import EmcyError
from canopen.sdo import SdoAbortedError, SdoCommunicationError
from canopen.sdo.constants import ABORT_NO_SUBINDEX, ABORT_NOT_IN_OD

from drivers.cia402 import objects, statusword
from drivers.cia402.error_codes import in_words
from drivers.cia402.link import Link, Network
from drivers.cia402.objects import Entry
from drivers.cia402.sampling import Sample, Sampler
from drivers.cia402.units import DriveUnits
from drivers.clock import Clock
from drivers.errors import DeviceFaultError, DeviceLostError, MotionStoppedError, OptionsError

_CIA_402: Final = 402
_SYNCHRONOUS: Final = 1
_EVENT_DRIVEN: Final = 255
_BOOT_UP: Final = 0
_OPERATIONAL: Final = 5
_GO_INTO_FAULT: Final = 1
_CONTROLWORD: Final = struct.Struct("<H")

logger = logging.getLogger(__name__)


class Drive:
    """A node of the bus. Its controlword is sent by PDO and no answer is awaited: the statusword is read back.

    A motion's controlwords carry the permit that the motion began with; a stop revokes it, so that none of them
    reaches the drive after the stop did.
    """

    def __init__(self, axis: str, node: int, link: Link, sampler: Sampler, clock: Clock) -> None:
        self.node = node
        self.name = f"axis '{axis}': the drive at node {node} of {link.name}"
        self._link = link
        self._sampler = sampler
        self._clock = clock
        self._remote: canopen.RemoteNode | None = None
        self._commanding = threading.Lock()
        self._permit = 0
        self._commanded = statusword.DISABLE_VOLTAGE
        self.guarded = False
        """Whether the drive stops by itself when it hears nothing of activecam any longer."""
        self._emergency: EmcyError | None = None
        self._lost: str | None = None
        self._started = False
        self._operational = False
        self._heard_at = 0.0

    def connect(self, network: Network) -> None:
        """See that a drive is there and set its communication up; moves nothing."""
        self._lost, self._emergency = None, None
        self._started = self._operational = False
        self._commanded = statusword.DISABLE_VOLTAGE
        remote = canopen.RemoteNode(self.node, objects.object_dictionary())
        # Before anything is said: a boot-up that comes at once must not be missed.
        remote.nmt.add_heartbeat_callback(self._hear_heartbeat)
        remote.emcy.add_callback(self._hear_emergency)
        remote.sdo.RESPONSE_TIMEOUT, remote.sdo.MAX_RETRIES = network.silence / 2, 2
        network.add_node(remote)
        self._remote = remote
        remote.nmt.state = "PRE-OPERATIONAL"
        device = self.read(objects.DEVICE_TYPE)
        if device & 0xFFFF != _CIA_402:
            raise OptionsError(f"{self.name} is no CiA 402 drive: its device type is 0x{device:08X}")
        with self._answering("to have its PDOs mapped"):
            self._map_pdos(remote)

    def start(self, own_node: int, heartbeat: float, silence: float) -> None:
        """Let the drive work, and have it notice when activecam is gone."""
        assert self._remote is not None
        self.write(objects.PRODUCER_HEARTBEAT, round(1000 * heartbeat))
        self.guarded = self._write_if_there(
            objects.CONSUMER_HEARTBEAT, own_node << 16 | round(1000 * silence)
        ) and self._write_if_there(objects.ABORT_CONNECTION, _GO_INTO_FAULT)
        self._remote.nmt.state = "OPERATIONAL"
        self._heard_at, self._started = self._clock.now(), True

    def release(self, network: Network) -> None:
        """Switch the motor off and stop minding whether activecam is there. Raises DeviceLostError."""
        self.require_alive()
        self._send(network, statusword.SHUT_DOWN, self._permit)
        self._write_if_there(objects.CONSUMER_HEARTBEAT, 0)

    async def sample(self) -> Sample:
        """Ask where the drive is. Raises DeviceLostError."""
        _ = self._link.network
        self.require_alive()
        sample = await self._sampler.sample(self.node)
        self.require_alive()
        if sample is None:
            raise DeviceLostError(f"{self.name} does not answer: check its power and its cable")
        return sample

    async def sample_singly(self) -> Sample | None:
        """Ask this drive alone, by SDO; None where it is known to be lost."""
        if self._why_lost() is not None:
            return None
        asked_at = self._clock.now()
        return await self._link.ask(
            lambda _: Sample(
                asked_at,
                self.read(objects.STATUSWORD),
                self.read(objects.POSITION),
                self.read(objects.VELOCITY),
            )
        )

    def require_alive(self) -> None:
        """Raise DeviceLostError unless the drive says that it is there, and has been since it was opened."""
        why = self._why_lost()
        if why is not None:
            raise DeviceLostError(f"{self.name} {why}")

    @property
    def operational(self) -> bool:
        """Whether the drive has said that it works."""
        return self._operational

    def begin(self) -> int:
        """Return the permit of a new motion."""
        return self._permit

    def require_permit(self, permit: int) -> None:
        """Raise MotionStoppedError where a stop came since `permit` was given."""
        if permit != self._permit:
            raise MotionStoppedError(f"{self.name} was stopped before its motion began")

    async def command(self, controlword: int, permit: int) -> None:
        """Send a controlword. Raises MotionStoppedError where a stop came since `permit` was given."""
        await self._link.ask(lambda network: self._send(network, controlword, permit))

    async def halt(self) -> None:
        """Stop what moves, past everything, and revoke the permit of the motion under way."""
        await self._link.urge(self._halt)

    async def force(self, controlword: int) -> None:
        """Send a controlword past everything, and revoke the permit of the motion under way."""
        await self._link.urge(lambda network: self._force(network, controlword))

    async def get(self, entry: Entry) -> int:
        """Return a value of the drive. Raises DeviceLostError."""
        return await self._link.ask(lambda _: self.read(entry))

    async def set(self, entry: Entry, value: int) -> None:
        """Write a value. Raises DeviceLostError, and DeviceFaultError where the drive refuses it."""
        await self._link.ask(lambda _: self.write(entry, value))

    async def reason(self) -> str:
        """Return why the drive is in fault."""
        return await self._link.ask(lambda _: self._reason())

    def units(self) -> DriveUnits:
        """Return what the drive tells of its units."""
        return DriveUnits(
            self.read_if_there(objects.POSITION_UNIT),
            self.read_if_there(objects.VELOCITY_UNIT),
            self.read_if_there(objects.ACCELERATION_UNIT),
            self._turn(),
        )

    def read(self, entry: Entry) -> int:
        """Read a value, in the link's thread. Raises DeviceLostError, DeviceFaultError."""
        with self._answering(f"to tell its object {entry}"):
            return int(self._variable(entry).raw)

    def read_if_there(self, entry: Entry) -> int | None:
        """Read a value that a drive may do without."""
        with self._answering(f"to tell its object {entry}"):
            try:
                return int(self._variable(entry).raw)
            except SdoAbortedError as error:
                if error.code in {ABORT_NOT_IN_OD, ABORT_NO_SUBINDEX}:
                    return None
                raise

    def write(self, entry: Entry, value: int) -> None:
        """Write a value, in the link's thread. Raises DeviceLostError; DeviceFaultError where it is refused."""
        with self._answering(f"{value} for its object {entry}"):
            self._variable(entry).raw = value

    def write_and_check(self, entry: Entry, value: int) -> None:
        """Write a value and read it back. Raises OptionsError where the drive made another one of it."""
        self.write(entry, value)
        kept = self.read(entry)
        if kept != value:
            raise OptionsError(
                f"{self.name} keeps {kept} in its object {entry} where {value} was written: "
                "the profile asks for more than its own limits allow"
            )

    def _write_if_there(self, entry: Entry, value: int) -> bool:
        if self.read_if_there(entry) is None:
            return False
        self.write(entry, value)
        return True

    @contextmanager
    def _answering(self, what: str) -> Iterator[None]:
        try:
            yield
        except SdoAbortedError as error:
            raise DeviceFaultError(f"{self.name} refuses {what}: {error}") from error
        except SdoCommunicationError as error:
            raise DeviceLostError(
                f"{self.name} does not answer: check its power, its cable, its node number and the bit rate"
            ) from error

    def _variable(self, entry: Entry) -> Any:
        if self._remote is None:
            raise DeviceLostError(f"{self.name} is not open: open it first")
        item = self._remote.sdo[entry.index]
        return item[entry.subindex] if entry.subindex else item

    def _turn(self) -> float | None:
        feed, turns = self.read_if_there(objects.FEED), self.read_if_there(objects.FEED_TURNS)
        if feed and turns:
            return feed / turns
        increments = self.read_if_there(objects.ENCODER_INCREMENTS)
        turns = self.read_if_there(objects.ENCODER_TURNS)
        if not (increments and turns):
            return None
        motor = self.read_if_there(objects.GEAR_MOTOR_TURNS)
        shaft = self.read_if_there(objects.GEAR_SHAFT_TURNS)
        gear = motor / shaft if motor and shaft else 1.0
        return increments / turns * gear

    def _map_pdos(self, remote: canopen.RemoteNode) -> None:
        for number, entries in (1, (objects.STATUSWORD, objects.POSITION)), (2, (objects.VELOCITY,)):
            self._map(remote.tpdo[number], entries, _SYNCHRONOUS)
            remote.tpdo[number].add_callback(
                lambda pdo, number=number: self._sampler.hear(self.node, number, bytes(pdo.data))
            )
        self._map(remote.rpdo[1], (objects.CONTROLWORD,), _EVENT_DRIVEN)

    def _map(self, pdo: canopen.pdo.PdoMap, entries: tuple[Entry, ...], transmission: int) -> None:
        pdo.cob_id, pdo.enabled, pdo.trans_type = pdo.predefined_cob_id, True, transmission
        pdo.clear()
        for entry in entries:
            pdo.add_variable(entry.index)
        pdo.save()

    def _reason(self) -> str:
        code = self.read(objects.ERROR_CODE)
        if code == 0 and self._emergency is not None:
            code = self._emergency.code
        return f"the drive is in fault: {in_words(code)}"

    def _halt(self, network: Network) -> None:
        # Halt enables a drive that was about to be: one that was never enabled is told to quick-stop.
        enabled = self._commanded & statusword.ENABLE == statusword.ENABLE
        self._force(network, statusword.HALT if enabled else statusword.QUICK_STOP)

    def _force(self, network: Network, controlword: int) -> None:
        with self._commanding:
            self._permit += 1
            self._transmit(network, controlword)

    def _send(self, network: Network, controlword: int, permit: int) -> None:
        with self._commanding:
            self.require_permit(permit)
            self._transmit(network, controlword)

    def _transmit(self, network: Network, controlword: int) -> None:
        assert self._remote is not None
        self._commanded = controlword
        network.send_message(self._remote.rpdo[1].cob_id, _CONTROLWORD.pack(controlword))

    def _why_lost(self) -> str | None:
        if self._lost is not None:
            return self._lost
        silent = self._clock.now() - self._heard_at
        if self._operational and silent > self._link.options.silence:
            return f"has sent no heartbeat for {silent:.1f} s: check its power and its cable"
        return None

    def _hear_heartbeat(self, state: int) -> None:
        self._heard_at = self._clock.now()
        if state == _BOOT_UP:
            self._lost = "was switched on or reset, and no longer knows where it is: home it again"
        elif state == _OPERATIONAL:
            self._operational = self._started
        elif self._operational and self._lost is None:
            self._lost = f"has left the operational state (it is in NMT state {state}): open it again"

    def _hear_emergency(self, emergency: EmcyError) -> None:
        if emergency.code & 0xFF00:
            self._emergency = emergency
            logger.warning("%s sends an emergency: %s", self.name, in_words(emergency.code))
