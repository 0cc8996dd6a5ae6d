"""What a profile may say of a CAN bus and of the drives on it."""

from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, model_validator

from drivers.options import DriverOptions
from drivers.quantities import PositiveDuration, written

NodeId = Annotated[int, Field(ge=1, le=127)]


class Cia402Options(DriverOptions):
    """Keys of `[controllers.NAME]` with `driver = "cia402"`: a CAN bus."""

    interface: Literal["socketcan", "slcan", "udp_multicast", "virtual"] = "socketcan"
    channel: Annotated[str, Field(min_length=1)]
    """`can0`, a serial adapter's `/dev/serial/by-id/...`, a multicast address, or any word."""
    bitrate: Annotated[int, Field(gt=0)] | None = None
    """Bits a second, with `slcan` only: that of `socketcan` is set with the interface, by `ip link`."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """UDP port, with `udp_multicast` only."""
    adapter_delay: PositiveDuration = written("2 s")
    """With `slcan`: how long the adapter needs after its port was opened."""
    own_node: NodeId = 127
    """The node that activecam's own heartbeat comes from."""
    heartbeat: PositiveDuration = written("100 ms")
    """How often drives and activecam say that they are there."""
    silence: PositiveDuration = written("1 s")
    """How long either may keep silent, or owe an answer, before it counts as lost."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.bitrate is not None and self.interface != "slcan":
            raise ValueError("'bitrate' is for 'slcan': set that of other interfaces outside of activecam")
        if self.port is not None and self.interface != "udp_multicast":
            raise ValueError("'port' is for 'udp_multicast': leave it out")
        if self.silence < 3 * self.heartbeat:
            raise ValueError("'silence' must be at least three times 'heartbeat', or a late one is a loss")
        return self


class Cia402AxisOptions(DriverOptions):
    """Keys of an axis's `options`: a drive."""

    node: NodeId
    counts_per_unit: FiniteFloat | None = None
    """The drive's position units for one reading unit, negative where it counts the other way."""
    velocity_per_unit: Annotated[float, Field(gt=0)] | None = None
    """The drive's velocity units for one reading unit a second."""
    acceleration_per_unit: Annotated[float, Field(gt=0)] | None = None
    """The drive's acceleration units for one reading unit a second squared."""
    absolute: bool = False
    """Whether its encoder knows the position from power-up on, so that homing has nothing to find."""
    homing_method: Annotated[int, Field(ge=-128, le=127)] | None = None
    """Object 0x6098; as the drive has it where not given."""
    homing_time: PositiveDuration = written("60 s")
    """How long homing may take."""
    acknowledges: bool = True
    """Whether the drive sets bit 12 for a set-point that it has taken."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.counts_per_unit == 0:
            raise ValueError("'counts_per_unit' must not be 0: the axis would never move")
        return self
