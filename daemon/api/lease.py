"""Routes of the motion lease."""

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from daemon.api.bodies import RequestBody
from daemon.api.dependencies import LeaseDep, LeaseToken, ServiceDep
from daemon.api.once import KEYED, ONCE, OnceRoute
from daemon.api.problems import answers
from daemon.errors import LeaseEndedError, LeaseHeldError, LeaseRequiredError

router = APIRouter(prefix="/lease", tags=["lease"], route_class=OnceRoute)


class LeaseRequest(RequestBody):
    """Who wants to move, what for, and for how long at most without being heard of."""

    owner: Annotated[str, Field(min_length=1, max_length=200, examples=["anna"])]
    note: Annotated[str, Field(max_length=1000, examples=["aligning the target"])] = ""
    ttl_s: Annotated[float, Field(ge=0.1, le=3600, description="Time to live in seconds.", examples=[30])] = (
        30.0
    )


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
    request: LeaseRequest, service: ServiceDep, token: LeaseToken = None
) -> LeaseDocument:
    """Take the lease where nobody holds it, or renew one's own by sending its token in `X-Lease`.

    When the lease expires, what its holder has set in motion is stopped.
    """
    lease = service.leases.acquire(request.owner, request.note, request.ttl_s, token)
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
