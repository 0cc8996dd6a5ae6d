"""One drive on the bus: how it is set up, commanded and asked."""

import logging
import struct
import threading
from typing import Final

import canopen
from canopen.emcy import EmcyError

from drivers.cia402 import objects, statusword
from drivers.cia402.error_codes import in_words
from drivers.cia402.link import Link, Network
from drivers.cia402.objects import Entry
from drivers.cia402.pulse import Pulse
from drivers.cia402.sampling import Sample, Sampler
from drivers.cia402.values import Values
from drivers.clock import Clock
from drivers.errors import DeviceLostError, MotionStoppedError, OptionsError

_CIA_402: Final = 402
_SYNCHRONOUS: Final = 1
_EVENT_DRIVEN: Final = 255
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
        self.pulse = Pulse(clock, link.options.silence)
        self.guarded = False
        """Whether the drive stops by itself when it hears nothing of activecam any longer."""
        self._link = link
        self._sampler = sampler
        self._clock = clock
        self._remote: canopen.RemoteNode | None = None
        self._commanding = threading.Lock()
        self._permit = 0
        self._commanded = statusword.DISABLE_VOLTAGE
        self._emergency: EmcyError | None = None

    @property
    def values(self) -> Values:
        """What the drive keeps, to be asked for in the link's thread."""
        if self._remote is None:
            raise DeviceLostError(f"{self.name} is not open: open it first")
        return Values(self.name, self._remote)

    def connect(self, network: Network) -> None:
        """See that a drive is there and set its communication up, in the link's thread; moves nothing."""
        self.pulse = Pulse(self._clock, network.silence)
        self._emergency = None
        self._commanded = statusword.DISABLE_VOLTAGE
        remote = canopen.RemoteNode(self.node, objects.object_dictionary())
        # Before anything is said: a boot-up that comes at once must not be missed.
        remote.nmt.add_heartbeat_callback(self.pulse.hear)
        remote.emcy.add_callback(self._hear_emergency)
        remote.sdo.RESPONSE_TIMEOUT, remote.sdo.MAX_RETRIES = network.silence / 2, 2
        network.add_node(remote)
        self._remote = remote
        remote.nmt.state = "PRE-OPERATIONAL"
        device = self.values.read(objects.DEVICE_TYPE)
        if device & 0xFFFF != _CIA_402:
            raise OptionsError(f"{self.name} is no CiA 402 drive: its device type is 0x{device:08X}")
        with self.values.answering("to have its PDOs mapped"):
            self._map_pdos(remote)

    def start(self, own_node: int, heartbeat: float) -> None:
        """Let the drive work, and have it notice when activecam is gone."""
        assert self._remote is not None
        values, silence = self.values, round(1000 * self._link.options.silence)
        values.write(objects.PRODUCER_HEARTBEAT, round(1000 * heartbeat))
        self.guarded = values.write_if_there(
            objects.CONSUMER_HEARTBEAT, own_node << 16 | silence
        ) and values.write_if_there(objects.ABORT_CONNECTION, _GO_INTO_FAULT)
        self._remote.nmt.state = "OPERATIONAL"
        self.pulse.start()

    def release(self, network: Network) -> None:
        """Switch the motor off and stop minding whether activecam is there. Raises DeviceLostError."""
        self.require_alive()
        self._send(network, statusword.SHUT_DOWN, self._permit)
        self.values.write_if_there(objects.CONSUMER_HEARTBEAT, 0)

    def require_alive(self) -> None:
        """Raise DeviceLostError unless the drive says that it is there, and has been since it was opened."""
        why = self.pulse.lost
        if why is not None:
            raise DeviceLostError(f"{self.name} {why}")

    async def sample(self) -> Sample:
        """Ask where the drive is. Raises DeviceLostError."""
        self._link.require_open()
        self.require_alive()
        sample = await self._sampler.sample(self.node)
        self.require_alive()
        if sample is None:
            raise DeviceLostError(f"{self.name} does not answer: check its power and its cable")
        return sample

    async def sample_singly(self) -> Sample | None:
        """Ask this drive alone, by SDO; None where it is known to be lost."""
        if self.pulse.lost is not None:
            return None
        asked_at = self._clock.now()
        return await self._link.ask(
            lambda _: Sample(
                asked_at, *map(self.values.read, (objects.STATUSWORD, objects.POSITION, objects.VELOCITY))
            )
        )

    async def get(self, entry: Entry) -> int:
        """Return a value of the drive. Raises DeviceLostError."""
        return await self._link.ask(lambda _: self.values.read(entry))

    async def set(self, entry: Entry, value: int) -> None:
        """Write a value. Raises DeviceLostError, and DeviceFaultError where the drive refuses it."""
        await self._link.ask(lambda _: self.values.write(entry, value))

    async def reason(self) -> str:
        """Return why the drive is in fault."""
        code = await self.get(objects.ERROR_CODE)
        if code == 0 and self._emergency is not None:
            code = self._emergency.code
        return f"the drive is in fault: {in_words(code)}"

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

    def _map_pdos(self, remote: canopen.RemoteNode) -> None:
        for number, entries in (1, (objects.STATUSWORD, objects.POSITION)), (2, (objects.VELOCITY,)):
            _map(remote.tpdo[number], entries, _SYNCHRONOUS)
            remote.tpdo[number].add_callback(
                lambda pdo, number=number: self._sampler.hear(self.node, number, bytes(pdo.data))
            )
        _map(remote.rpdo[1], (objects.CONTROLWORD,), _EVENT_DRIVEN)

    def _hear_emergency(self, emergency: EmcyError) -> None:
        if emergency.code & 0xFF00:
            self._emergency = emergency
            logger.warning("%s sends an emergency: %s", self.name, in_words(emergency.code))


def _map(pdo: canopen.pdo.PdoMap, entries: tuple[Entry, ...], transmission: int) -> None:
    pdo.cob_id, pdo.enabled, pdo.trans_type = pdo.predefined_cob_id, True, transmission
    pdo.clear()
    for entry in entries:
        pdo.add_variable(entry.index)
    pdo.save()
