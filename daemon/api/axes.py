"""Routes that move axes. All positions and distances are in the axis's own reading unit."""

from collections.abc import Collection
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Path, Query, Response
from pydantic import Field

from daemon.api.bodies import RequestBody
from daemon.api.dependencies import LeaseDep, ServiceDep
from daemon.api.once import KEYED, ONCE, OnceRoute
from daemon.api.problems import answers
from daemon.api.rig_documents import AxisDocument
from daemon.client_motion import Motion
from daemon.errors import (
    LeaseEndedError,
    LeaseHeldError,
    LeaseRequiredError,
    StandstillError,
    StopLatchedError,
    UnknownAxisError,
)
from daemon.lease import Lease
from daemon.service import Service
from drivers.errors import (
    AxisBusyError,
    DeviceFaultError,
    DeviceLostError,
    DeviceTimeoutError,
    LimitError,
    MotionError,
    MotionStoppedError,
    NotHomedError,
)

router = APIRouter(prefix="/axes", tags=["motion"], route_class=OnceRoute)

AxisName = Annotated[str, Path(description="The axis's name in the profile.", examples=["pan"])]
Wait = Annotated[bool, Query(description="Answer 200 when the motion has ended, rather than 202 at once.")]
Reading = Annotated[float, Field(allow_inf_nan=False)]

MOTION = {
    **answers(
        LeaseRequiredError,
        LeaseEndedError,
        LeaseHeldError,
        UnknownAxisError,
        StopLatchedError,
        NotHomedError,
        AxisBusyError,
        MotionStoppedError,
        MotionError,
        DeviceFaultError,
        LimitError,
        DeviceLostError,
        DeviceTimeoutError,
        *KEYED,
    ),
    200: {"description": "With `wait=true`: the motion has ended at its target, where the axis stands."},
    202: {"description": "The motion has begun.", "model": AxisDocument},
}


class Move(RequestBody):
    """Where to go."""

    target: Annotated[Reading, Field(examples=[12.5])]


class Jog(RequestBody):
    """How far to go from where the axis is."""

    distance: Annotated[Reading, Field(examples=[-0.5])]


class CombinedMove(RequestBody):
    """Where several axes go at once."""

    targets: Annotated[dict[str, Reading], Field(min_length=1, examples=[{"slide": 40.0, "pan": -5.0}])]


@router.post(
    "/move",
    summary="Move several axes at once",
    responses=MOTION | {202: {"model": list[AxisDocument]}},
    dependencies=[ONCE],
)
async def move_axes(
    request: CombinedMove, lease: LeaseDep, service: ServiceDep, response: Response, wait: Wait = False
) -> list[AxisDocument]:
    """Check every axis's limits and homing before any of them moves; when one fails, all are stopped."""
    service.rig.check_move(request.targets)
    await _begin(
        service, lease, request.targets, partial(service.rig.move, request.targets), response, wait=wait
    )
    return [AxisDocument.of(service.rig.axis(name)) for name in request.targets]


@router.post("/{name}/home", summary="Home an axis", responses=MOTION, dependencies=[ONCE])
async def home_axis(
    name: AxisName, lease: LeaseDep, service: ServiceDep, response: Response, wait: Wait = False
) -> AxisDocument:
    """Let the axis find its zero, after which its readings mean something."""
    service.rig.check_home(name)
    await _begin(service, lease, [name], partial(service.rig.home, name), response, wait=wait)
    return AxisDocument.of(service.rig.axis(name))


@router.post("/{name}/move", summary="Move an axis to a position", responses=MOTION, dependencies=[ONCE])
async def move_axis(
    name: AxisName,
    request: Move,
    lease: LeaseDep,
    service: ServiceDep,
    response: Response,
    wait: Wait = False,
) -> AxisDocument:
    """Go to `target`; the axis must be homed, and the target within its limits."""
    targets = {name: request.target}
    service.rig.check_move(targets)
    await _begin(service, lease, targets, partial(service.rig.move, targets), response, wait=wait)
    return AxisDocument.of(service.rig.axis(name))


@router.post("/{name}/jog", summary="Move an axis by a distance", responses=MOTION, dependencies=[ONCE])
async def jog_axis(
    name: AxisName, request: Jog, lease: LeaseDep, service: ServiceDep, response: Response, wait: Wait = False
) -> AxisDocument:
    """Go by `distance`, homed or not; a homed axis keeps to its limits. Ends with the lease."""
    service.rig.check_jog(name, request.distance)
    await _begin(
        service, lease, [name], partial(service.rig.jog, name, request.distance), response, wait=wait
    )
    return AxisDocument.of(service.rig.axis(name))


@router.post("/{name}/stop", summary="Stop an axis", responses=answers(UnknownAxisError, StandstillError))
async def stop_axis(name: AxisName, service: ServiceDep) -> AxisDocument:
    """Stop one axis, and answer when it stands. Needs no lease, and latches nothing."""
    await service.rig.stop_axes([name])
    return AxisDocument.of(service.rig.axis(name))


async def _begin(
    service: Service,
    lease: Lease,
    axes: Collection[str],
    motion: Motion,
    response: Response,
    *,
    wait: bool,
) -> None:
    task = await service.motions.begin(lease, axes, motion)
    if wait:
        await service.motions.ended(task)
    else:
        response.status_code = 202
