"""The route of the audit log."""

from datetime import datetime
from typing import Annotated, Self

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.api.dependencies import ServiceDep
from daemon.api.problems import answers
from daemon.errors import StoreError

router = APIRouter(tags=["audit"])


class AuditDocument(BaseModel):
    """Something that somebody did, or tried to do."""

    id: int = Field(description="Its number; greater than that of every older one.")
    time: datetime
    who: str | None = Field(
        description="The key's name; null where nobody is asked for one.", examples=["anna"]
    )
    role: Role
    address: str = Field(description="Where from.", examples=["192.0.2.7"])
    method: str = Field(examples=["POST"])
    path: str = Field(examples=["/api/v1/axes/pan/move"])
    asked: str = Field(description="The body, up to 1000 bytes of it.", examples=['{"target": 12.5}'])
    status: int | None = Field(description="HTTP's; null where no answer was given (yet).", examples=[202])
    code: str | None = Field(description="The problem's, where there was one.", examples=["limit_exceeded"])

    @classmethod
    def of(cls, entry: AuditEntry) -> Self:
        """Describe an entry that is in the store."""
        return cls(**{name: getattr(entry, name) for name in AuditEntry.__dataclass_fields__})


@router.get("/audit", summary="Who did what", responses=answers(StoreError))
async def get_audit(
    service: ServiceDep,
    before: Annotated[
        int | None, Query(ge=1, le=2**63 - 1, description="Only entries older than that of this id.")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=1000, description="Entries at most.")] = 100,
) -> list[AuditDocument]:
    """Answer with whatever moved, created, steered or activated something, the newest first."""
    return [AuditDocument.of(entry) for entry in await service.access.book.read(before, limit)]
