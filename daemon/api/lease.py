"""Routes of the motion lease."""

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from daemon.api.bodies import RequestBody
from daemon.api.dependencies import LeaseDep, LeaseToken, ServiceDep
from daemon.api.once import KEYED, ONCE, OnceRoute
from daemon.api.problems import answers
from daemon.api.witness import leave_unwritten
from daemon.errors import LeaseEndedError, LeaseHeldError, LeaseRequiredError

router = APIRouter(prefix="/lease", tags=["lease"], route_class=OnceRoute)


class LeaseRequest(RequestBody):
    """Who wants to move, what for, and for how long at most without being heard of."""

    owner: Annotated[str, Field(min_length=1, max_length=200, examples=["anna"])]
    note: Annotated[str, Field(max_length=1000, examples=["aligning the target"])] = ""
    ttl_s: Annotated[float, Field(ge=0.1, le=3600, description="Time to live in seconds.", examples=[30])] = (
        30.0
    )
    take_over: Annotated[bool, Field(description="Take it from the client that holds it.")] = False


class LeaseDocument(BaseModel):
    """A lease; its token goes into the header `X-Lease` of whatever moves."""

    token: str
    owner: str
    note: str
    expires_at: datetime


@router.post(
    "",
    summary="Take or renew the motion lease",
    responses=answers(LeaseHeldError, *KEYED),
    dependencies=[ONCE],
)
async def acquire_lease(
    http: Request, request: LeaseRequest, service: ServiceDep, token: LeaseToken = None
) -> LeaseDocument:
    """Take the lease where nobody holds it, or renew one's own by sending its token in `X-Lease`.

    When the lease expires, what its holder has set in motion is stopped. With `take_over` another client's lease
    ends by this, and the answer comes when what that client had in motion has stopped; a run's lease ends with
    the run alone.
    """
    if request.take_over:
        lease, former = service.leases.take_over(request.owner, request.note, request.ttl_s)
        if former is not None:
            await service.motions.stopped(former)
    else:
        lease = service.leases.acquire(request.owner, request.note, request.ttl_s, token)
        if lease.token == token:
            leave_unwritten(http.scope)  # or those who renew often would push all else out of the log
    assert lease.expires_at is not None
    return LeaseDocument(token=lease.token, owner=lease.owner, note=lease.note, expires_at=lease.expires_at)


@router.delete(
    "",
    status_code=204,
    summary="Give the motion lease back",
    responses=answers(LeaseRequiredError, LeaseEndedError, LeaseHeldError, *KEYED),
    dependencies=[ONCE],
)
async def release_lease(lease: LeaseDep, service: ServiceDep) -> Response:
    """End the lease, and stop what its holder has set in motion."""
    service.leases.release(lease.token)
    return Response(status_code=204)
