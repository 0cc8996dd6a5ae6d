"""Routes that show the rig and its profile, and stop everything."""

from datetime import datetime
from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field

from daemon.api.dependencies import CallerDep, ServiceDep
from daemon.api.once import KEYED, ONCE, OnceRoute
from daemon.api.problems import answers
from daemon.api.rig_documents import RigDocument, StopDocument
from daemon.errors import StandstillError
from daemon.profile_document import ProfileDocument

router = APIRouter(route_class=OnceRoute)


class Health(BaseModel):
    """Whether the daemon can do its work, and what is in the way if not."""

    status: Literal["ok", "degraded"]
    version: str | None = Field(examples=["0.1.0"])
    started_at: datetime | None
    problems: list[str] | None = Field(
        description="Sentences on every device that is lost or in fault, and on a calibration that cannot be used."
    )


@router.get("/health", tags=["rig"], summary="Whether the daemon can do its work")
async def get_health(service: ServiceDep, caller: CallerDep) -> Health:
    """Answer as soon as the daemon serves; `degraded` while there are problems.

    Where keys are asked for, it needs none: without one it says that the daemon serves, and nothing of the rig.
    """
    if caller is None:
        return Health(status="ok", version=None, started_at=None, problems=None)
    problems = service.problems
    status: Literal["ok", "degraded"] = "degraded" if problems else "ok"
    return Health(status=status, version=service.version, started_at=service.started_at, problems=problems)


@router.get("/rig", tags=["rig"], summary="The state of the axes and devices")
async def get_rig(service: ServiceDep) -> RigDocument:
    """Answer from the latest readings, without touching hardware."""
    return RigDocument.of(service)


@router.get("/profile", tags=["rig"], summary="The rig's description")
async def get_profile(service: ServiceDep) -> ProfileDocument:
    """Answer with the axes, the camera, the target and the procedure of the rig's profile."""
    return ProfileDocument.of(service.profile)


@router.post("/stop", tags=["motion"], summary="Stop everything at once", responses=answers(StandstillError))
async def stop(service: ServiceDep) -> StopDocument:
    """Stop all axes past every queue, and refuse all motion until the stop is acknowledged.

    Needs no lease. Answers when all axes are confirmed to stand; a run under way fails.
    """
    await service.rig.stop("a stop was asked for")
    return StopDocument.of(service.rig.latch)


@router.post(
    "/stop/acknowledge",
    tags=["motion"],
    summary="Allow motion again after a stop",
    responses=answers(*KEYED),
    dependencies=[ONCE],
)
async def acknowledge_stop(service: ServiceDep) -> StopDocument:
    """Release the latch; nothing moves by that. Harmless where nothing is latched."""
    service.rig.acknowledge_stop()
    return StopDocument.of(service.rig.latch)
