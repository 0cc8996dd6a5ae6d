"""The rig as the API shows it."""

from datetime import datetime
from typing import Literal, Self

from pydantic import BaseModel, Field

from daemon.lease import Lease
from daemon.profile_document import Limits
from daemon.rig import AxisSnapshot, DeviceSnapshot
from daemon.rig.stop_latch import StopLatch
from daemon.service import Service


class AxisDocument(BaseModel):
    """One axis. Position, limits and tolerance are in `unit`, the axis's own reading unit."""

    name: str = Field(examples=["pan"])
    kind: Literal["revolute", "prismatic"]
    unit: str = Field(examples=["deg"])
    position: float | None = Field(
        description="null while the axis does not know where it is.", examples=[12.5]
    )
    homed: bool
    moving: bool
    limits: Limits = Field(examples=[[-20.0, 20.0]])
    tolerance: float = Field(
        description="How far from its target it may stand after a move.", examples=[0.05]
    )
    fault: str | None = Field(description="What the device reports as its fault.")
    lost: str | None = Field(description="Why the device does not answer; the rest is then its last word.")
    last_error: str | None = Field(description="Why its latest motion ended before the target.")

    @classmethod
    def of(cls, axis: AxisSnapshot) -> Self:
        """Describe an axis."""
        return cls(
            name=axis.spec.name,
            kind=axis.spec.kind,
            unit=axis.spec.unit,
            position=axis.position,
            homed=axis.homed,
            moving=axis.moving,
            limits=list(axis.spec.limits),
            tolerance=axis.spec.tolerance,
            fault=axis.fault,
            lost=axis.lost,
            last_error=axis.last_error,
        )


class DeviceDocument(BaseModel):
    """A controller or camera."""

    name: str
    kind: Literal["controller", "camera"]
    connected: bool
    lost: str | None
    reconnects: int
    warnings: list[str] = Field(
        description="What is not as the profile asks, or as a calibration needs it.",
        examples=[["camera 'main' gives 15 frames a second and was asked for 30"]],
    )

    @classmethod
    def of(cls, device: DeviceSnapshot) -> Self:
        """Describe a device."""
        return cls(
            name=device.name,
            kind=device.kind,
            connected=device.lost is None,
            lost=device.lost,
            reconnects=device.reconnects,
            warnings=list(device.warnings),
        )


class StopDocument(BaseModel):
    """Whether a stop is latched, so that nothing may move."""

    latched: bool
    reason: str | None = Field(examples=["POST /stop"])
    since: datetime | None

    @classmethod
    def of(cls, latch: StopLatch) -> Self:
        """Describe the latch."""
        return cls(latched=latch.engaged, reason=latch.reason, since=latch.since)


class HolderDocument(BaseModel):
    """Who may move now."""

    owner: str
    note: str
    expires_at: datetime | None = Field(description="null for a run, which holds its lease to its end.")

    @classmethod
    def of(cls, lease: Lease) -> Self:
        """Describe a lease without its token."""
        return cls(owner=lease.owner, note=lease.note, expires_at=lease.expires_at)


class RigDocument(BaseModel):
    """Everything that can be known of the rig without touching it."""

    name: str = Field(description="The profile's name.")
    axes: list[AxisDocument] = Field(description="In chain order: the order of `readings` everywhere.")
    devices: list[DeviceDocument]
    moving: bool
    age_s: float | None = Field(description="Age of the oldest of the readings; null before the first.")
    stop: StopDocument
    lease: HolderDocument | None
    run: str | None = Field(description="The id of the run under way.")
    calibration_id: str | None = Field(description="The calibration that poses are computed from.")

    @classmethod
    def of(cls, service: Service) -> Self:
        """Describe the rig as it is now."""
        rig, lease, run = service.rig, service.leases.current, service.runs.active
        snapshot = rig.snapshot
        return cls(
            name=service.profile.name,
            axes=[AxisDocument.of(axis) for axis in snapshot.axes],
            devices=[DeviceDocument.of(device) for device in snapshot.devices],
            moving=snapshot.moving,
            age_s=rig.age(snapshot),
            stop=StopDocument.of(rig.latch),
            lease=None if lease is None else HolderDocument.of(lease),
            run=None if run is None else run.record.id,
            calibration_id=service.poses.calibration_id,
        )
