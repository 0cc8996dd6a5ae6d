"""The profile as the daemon shows and stores it: without its drivers' options and a simulation's truth."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from daemon.profile import Profile

Limits = Annotated[list[float], Field(min_length=2, max_length=2)]
"""The lowest and highest reading that an axis may be sent to."""


class _Part(BaseModel):
    """A part of the profile, or all of it."""

    model_config = ConfigDict(frozen=True, defer_build=True)


class AxisDocument(_Part):
    """An axis; limits, velocity, acceleration and tolerance are in its reading unit."""

    name: str
    kind: Literal["revolute", "prismatic"]
    unit: str
    limits: Limits
    velocity: float
    acceleration: float
    tolerance: float
    reading_std: float | None
    unit_trusted: bool
    scale_std: float | None
    controller: str
    driver: str


class CameraDocument(_Part):
    """The camera; width and height in pixels."""

    name: str
    driver: str
    width: int
    height: int
    link: str | None
    intrinsics: dict[str, Any] | None
    intrinsics_std: dict[str, Any] | None


class SweepDocument(_Part):
    """One joint exercised alone, from `start` through `readings` (reading units)."""

    joint: str
    start: dict[str, float]
    readings: list[float]
    use: Literal["fit", "verify"]


class FreeViewDocument(_Part):
    """A picture outside the joint-by-joint plan."""

    readings: dict[str, float]
    use: Literal["fit", "verify"]


class ProcedureDocument(_Part):
    """The pictures of a run."""

    settle_s: float
    max_reading_age_s: float
    frame_timeout_s: float
    frames: int = Field(description="Pictures at each position, which are averaged.")
    sweeps: list[SweepDocument]
    views: list[FreeViewDocument]


class ProfileDocument(_Part):
    """A rig: its axes in chain order, its camera, its target (metres) and its procedure."""

    name: str
    description: str
    simulated: bool = Field(description="Whether the devices are simulated.")
    axes: list[AxisDocument]
    camera: CameraDocument
    target: dict[str, Any]
    procedure: ProcedureDocument

    @classmethod
    def of(cls, profile: Profile) -> Self:
        """Describe `profile`."""
        return cls(
            name=profile.name,
            description=profile.description,
            simulated=profile.simulation is not None,
            axes=_axes(profile),
            camera=_camera(profile),
            target=profile.target.model_dump(mode="json", exclude_none=True),
            procedure=_procedure(profile),
        )


def _axes(profile: Profile) -> list[AxisDocument]:
    return [
        AxisDocument(
            name=axis.spec.name,
            kind=axis.spec.kind,
            unit=axis.spec.unit,
            limits=list(axis.spec.limits),
            velocity=axis.spec.velocity,
            acceleration=axis.spec.acceleration,
            tolerance=axis.spec.tolerance,
            reading_std=axis.reading_std,
            unit_trusted=axis.unit_trusted,
            scale_std=axis.scale_std,
            controller=axis.controller,
            driver=profile.controllers[axis.controller].driver,
        )
        for axis in profile.axes
    ]


def _camera(profile: Profile) -> CameraDocument:
    camera = profile.camera
    return CameraDocument(
        name=camera.spec.name,
        driver=camera.driver,
        width=camera.spec.width,
        height=camera.spec.height,
        link=camera.link,
        intrinsics=None if camera.intrinsics is None else camera.intrinsics.model_dump(mode="json"),
        intrinsics_std=None
        if camera.intrinsics_std is None
        else camera.intrinsics_std.model_dump(mode="json"),
    )


def _procedure(profile: Profile) -> ProcedureDocument:
    procedure = profile.procedure
    return ProcedureDocument(
        settle_s=procedure.settle,
        max_reading_age_s=procedure.max_reading_age,
        frame_timeout_s=procedure.frame_timeout,
        frames=procedure.frames,
        sweeps=[
            SweepDocument(
                joint=sweep.joint, start=dict(sweep.start), readings=list(sweep.readings), use=sweep.use
            )
            for sweep in procedure.sweeps
        ],
        views=[FreeViewDocument(readings=dict(view.readings), use=view.use) for view in procedure.views],
    )
