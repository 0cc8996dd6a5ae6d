"""Routes of a browser's session: it shows a key once, and a cookie that no script can read stands for it."""

from typing import Final, Literal, Self

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from daemon.access.access import Caller
from daemon.access.roles import Role
from daemon.access.sessions import LIFE
from daemon.api.dependencies import CallerDep, ServiceDep
from daemon.api.gate import cookie_name

router = APIRouter(prefix="/session", tags=["session"])

Act = Literal["read", "move", "audit"]
ACTS: Final[dict[Role, list[Act]]] = {
    Role.VIEWER: ["read"],
    Role.OPERATOR: ["read", "move"],
    Role.ADMIN: ["read", "move", "audit"],
}


class SessionDocument(BaseModel):
    """Who asks, as the daemon sees it."""

    key: str | None = Field(
        description="The key's name; null where nobody is asked for one.", examples=["anna"]
    )
    role: Role
    may: list[Act] = Field(description="What this role may do.", examples=[["read", "move"]])

    @classmethod
    def of(cls, caller: Caller | None) -> Self:
        """Describe who asks."""
        assert caller is not None  # the rules ask for a role
        key = None if caller.key is None else caller.key.name
        return cls(key=key, role=caller.role, may=ACTS[caller.role])


@router.get("", summary="Who I am, and what I may do")
async def get_session(caller: CallerDep) -> SessionDocument:
    """Answer with the role of the key, or of the session, that the request shows."""
    return SessionDocument.of(caller)


@router.post("", summary="Begin a browser's session")
async def begin_session(
    http: Request, response: Response, caller: CallerDep, service: ServiceDep
) -> SessionDocument:
    """Set a cookie that stands for the key in `Authorization`, for 12 hours or until the key is removed."""
    if caller is not None and caller.key is not None and caller.session is None:
        response.set_cookie(
            cookie_name(http.scope),
            service.access.sessions.begin(caller.key),
            max_age=int(LIFE),
            httponly=True,
            samesite="strict",
            secure=http.url.scheme == "https",
        )
    return SessionDocument.of(caller)


@router.delete("", status_code=204, summary="End a browser's session")
async def end_session(http: Request, caller: CallerDep, service: ServiceDep) -> Response:
    """Forget the session whose cookie the request shows."""
    if caller is not None and caller.session is not None:
        service.access.sessions.end(caller.session)
    response = Response(status_code=204)
    response.delete_cookie(cookie_name(http.scope), httponly=True, samesite="strict")
    return response
