"""Routes of what is looked at before a run."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from daemon.api.dependencies import ServiceDep
from daemon.api.problems import answers
from daemon.errors import UnknownAxisError
from daemon.procedure.plan import planned_positions, starts_here
from daemon.profile import Procedure
from daemon.service import Service
from drivers.errors import LimitError, NotHomedError

router = APIRouter(prefix="/runs", tags=["runs"])

FromHere = Annotated[
    list[str],
    Query(
        max_length=100,
        description="A joint whose sweep is to start from where the axes stand now; may be repeated.",
    ),
]
PROBLEMS = answers(UnknownAxisError, NotHomedError, LimitError)


class PositionDocument(BaseModel):
    """A position of the plan."""

    position: int = Field(description="Counts from 1, as the events do.")
    joint: str | None = Field(description="The joint that moves alone; null for a free view.")
    use: Literal["fit", "verify"] = Field(description="Whether it is solved from, or held out to verify by.")
    readings: list[float] = Field(description="Where all axes stand, in chain order, each in its own unit.")
    seconds: float = Field(description="About how long it takes, from the position before.")


class PlanDocument(BaseModel):
    """What a run would do."""

    views: int = Field(description="Pictures to take.")
    seconds: float = Field(description="About how long that takes, without homing and solving.")
    joints: list[str] = Field(description="The joints, in the order of their sweeps.")
    from_here: list[str] = Field(description="Those whose sweep starts from where the axes stand.")
    positions: list[PositionDocument]


class CheckDocument(BaseModel):
    """One thing that was looked at."""

    name: str = Field(examples=["target"])
    title: str = Field(examples=["The target is seen"])
    ok: bool | None = Field(description="Null where that is not known, or the run sees to it itself.")
    message: str = Field(description="What was found, and where it is not as it should be what to do.")


class ChecklistDocument(BaseModel):
    """What stands for and against a run."""

    ready: bool = Field(description="Whether nothing was found that stands against it.")
    checks: list[CheckDocument]


@router.get("/plan", summary="What a run would do", responses=PROBLEMS)
async def get_plan(service: ServiceDep, from_here: FromHere = []) -> PlanDocument:  # noqa: B006  it is not changed
    """Answer with every position of the procedure, and about how long it takes; moves nothing."""
    procedure = _procedure(service, from_here)
    standing = service.rig.snapshot.readings
    positions = [
        PositionDocument(
            position=planned.position,
            joint=planned.joint,
            use=planned.use,
            readings=planned.readings,
            seconds=round(planned.seconds, 3),
        )
        for planned in planned_positions(service.profile, procedure, standing)
    ]
    return PlanDocument(
        views=len(positions),
        seconds=round(sum(position.seconds for position in positions), 3),
        joints=list(dict.fromkeys(sweep.joint for sweep in procedure.sweeps)),
        from_here=from_here,
        positions=positions,
    )


@router.get("/checklist", summary="What to look at before a run", responses=PROBLEMS)
async def get_checklist(
    service: ServiceDep,
    from_here: FromHere = [],  # noqa: B006  it is not changed
) -> ChecklistDocument:
    """Look at devices, axes, picture and disk, and at where the plan leads; moves nothing. No check keeps a run off."""
    checks = await service.checklist.checks(_procedure(service, from_here))
    return ChecklistDocument(
        ready=all(check.ok is not False for check in checks),
        checks=[
            CheckDocument(name=check.name, title=check.title, ok=check.ok, message=check.message)
            for check in checks
        ],
    )


def _procedure(service: Service, from_here: list[str]) -> Procedure:
    return service.profile.procedure.starting(starts_here(service.rig, from_here))
