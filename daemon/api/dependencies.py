"""What routes are given: the service behind the app, who asks, and the lease that a request shows.

All of it is found on the event loop, where nothing comes between the finding and the route: FastAPI calls what is not
`async` in a thread, and a lease could end on the way back.
"""

from typing import Annotated

from fastapi import Depends, Header, Request

from daemon.access.access import Caller
from daemon.lease import Lease
from daemon.service import Service


async def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


ServiceDep = Annotated[Service, Depends(_service)]


async def _caller(request: Request) -> Caller | None:
    caller: Caller | None = request.scope["caller"]
    return caller


CallerDep = Annotated[Caller | None, Depends(_caller)]
"""Who asks; None only where the route needs no role."""

LeaseToken = Annotated[
    str | None, Header(alias="X-Lease", description="The token of the motion lease, from POST /lease.")
]


async def _lease(service: ServiceDep, token: LeaseToken = None) -> Lease:
    return service.leases.require(token)


LeaseDep = Annotated[Lease, Depends(_lease)]
"""The lease that the request shows; without it the request is refused before its body is looked at."""
