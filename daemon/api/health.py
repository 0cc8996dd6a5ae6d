"""Routes for whoever keeps the daemon running, or sends clients to it."""

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from daemon.api.dependencies import CallerDep, ServiceDep

router = APIRouter(prefix="/health", tags=["rig"])


class Live(BaseModel):
    """Whether the daemon works at all."""

    live: bool


class Ready(BaseModel):
    """Whether the daemon can be used."""

    ready: bool
    problems: Annotated[list[str], Field(description="Sentences on what is in the way, for who may read.")]


@router.get("/live", summary="Whether the daemon works at all", responses={503: {"model": Live}})
async def get_live(service: ServiceDep, response: Response) -> Live:
    """Answer 503 when a device's driver hangs: only a restart helps then. A lost device is none of its business."""
    live = not service.rig.hung
    response.status_code = 200 if live else 503
    return Live(live=live)


@router.get("/ready", summary="Whether the daemon can be used", responses={503: {"model": Ready}})
async def get_ready(service: ServiceDep, caller: CallerDep, response: Response) -> Ready:
    """Answer 503 while a device is lost, the store takes nothing, or the active calibration cannot be used."""
    problems = await service.missing()
    response.status_code = 503 if problems else 200
    # Who shows no key, where one is asked for, is told no more than yes or no.
    return Ready(ready=not problems, problems=[] if caller is None else problems)
