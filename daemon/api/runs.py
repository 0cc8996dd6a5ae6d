"""Routes of calibration runs and of their events."""

from collections.abc import AsyncIterator
from datetime import datetime
from typing import Annotated, Self

from fastapi import APIRouter, Body, Header, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, Field

from daemon.api.bodies import RequestBody
from daemon.api.dependencies import LeaseToken, ServiceDep
from daemon.api.once import KEYED, ONCE_DURABLY, OnceRoute
from daemon.api.problems import answers
from daemon.errors import (
    LeaseHeldError,
    ProfileChangedError,
    RigFaultError,
    RunActiveError,
    RunStateError,
    SessionUnreadableError,
    StopLatchedError,
    StoreError,
    UnknownAxisError,
    UnknownRunError,
    UnknownViewError,
)
from daemon.procedure import RunEvent
from daemon.store import RunRecord, RunState
from drivers.errors import AxisBusyError, LimitError, NotHomedError

router = APIRouter(prefix="/runs", tags=["runs"], route_class=OnceRoute)

RunId = Annotated[str, Path(description="The run's id.", examples=["20260314-092653-5f3a1c"])]


class RunRequest(RequestBody):
    """Who starts the run and what for, both for the record only; and from where, if not as the profile has it."""

    owner: Annotated[str, Field(max_length=200)] = ""
    note: Annotated[str, Field(max_length=1000)] = ""
    from_here: Annotated[
        list[str],
        Field(
            max_length=100,
            description="Joints whose sweep starts from where the axes stand now.",
            examples=[["pan"]],
        ),
    ] = []  # noqa: RUF012  pydantic copies it


ViewNumber = Annotated[int, Field(ge=0)]


class SolveRequest(RequestBody):
    """What to solve a run's views without."""

    leave_out: Annotated[
        list[ViewNumber], Field(max_length=10_000, description="Views that are not used, by their numbers.")
    ] = []  # noqa: RUF012  pydantic copies it


class RunDocument(BaseModel):
    """A calibration run."""

    id: str
    state: RunState
    profile_name: str
    owner: str
    note: str
    session: str = Field(description="The session's folder, from the data folder.")
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None
    error: str | None = Field(description="Why it did not succeed, in one sentence.")
    calibration_id: str | None = Field(description="What it has found.")

    @classmethod
    def of(cls, run: RunRecord) -> Self:
        """Describe a run."""
        return cls(
            id=run.id,
            state=run.state,
            profile_name=run.profile_name,
            owner=run.owner,
            note=run.note,
            session=run.session,
            created_at=run.created_at,
            started_at=run.started_at,
            ended_at=run.ended_at,
            error=run.error,
            calibration_id=run.calibration_id,
        )


@router.get("", summary="All runs, the newest first", responses=answers(StoreError))
async def list_runs(service: ServiceDep) -> list[RunDocument]:
    """Answer with the runs under way and over."""
    return [RunDocument.of(run) for run in await service.runs.list()]


@router.post(
    "",
    status_code=202,
    summary="Start the profile's procedure",
    responses=answers(
        RunActiveError,
        RunStateError,
        StopLatchedError,
        RigFaultError,
        LeaseHeldError,
        UnknownAxisError,
        NotHomedError,
        LimitError,
        AxisBusyError,
        StoreError,
        *KEYED,
    ),
    dependencies=[ONCE_DURABLY],
)
async def start_run(
    http: Request,
    response: Response,
    service: ServiceDep,
    request: Annotated[RunRequest | None, Body()] = None,
    token: LeaseToken = None,
) -> RunDocument:
    """Home what is not homed, take every view, solve, verify, store and activate.

    A run moves under a lease of its own, so that it goes on when the client that started it goes away. It
    needs none beforehand; the holder of the lease hands it over by showing its token in `X-Lease`.

    With `from_here` the first sweep of these joints starts from where all axes stand now, instead of where the profile
    says, and so do their others that it starts from the same place; the joint itself goes through the positions of
    the profile.
    """
    request = request or RunRequest()
    run = await service.runs.start(request.owner, request.note, token, request.from_here)
    response.headers["Location"] = http.url_for("get_run", run_id=run.id).path
    return RunDocument.of(run)


@router.get("/{run_id}", summary="One run", responses=answers(UnknownRunError, StoreError))
async def get_run(run_id: RunId, service: ServiceDep) -> RunDocument:
    """Answer with the run as it stands."""
    return RunDocument.of(await service.runs.get(run_id))


@router.post(
    "/{run_id}/pause",
    status_code=202,
    summary="Pause a run",
    responses=answers(UnknownRunError, RunStateError, StoreError),
)
async def pause_run(run_id: RunId, service: ServiceDep) -> RunDocument:
    """Let the run come to rest after the view in flight, as `paused`; it keeps its lease.

    One that takes no more views, as where it solves, is refused with `run_state`: nothing of it rests.
    """
    run = await service.runs.get(run_id)
    service.runs.pause(run_id)
    return RunDocument.of(run)


@router.post(
    "/{run_id}/resume",
    status_code=202,
    summary="Resume a run",
    responses=answers(
        UnknownRunError,
        RunActiveError,
        RunStateError,
        ProfileChangedError,
        StopLatchedError,
        RigFaultError,
        LeaseHeldError,
        StoreError,
        *KEYED,
    ),
    dependencies=[ONCE_DURABLY],
)
async def resume_run(run_id: RunId, service: ServiceDep, token: LeaseToken = None) -> RunDocument:
    """Let a paused run go on from where it rests, or take up one that ended before its time.

    One that was interrupted, failed or cancelled homes all axes and goes on after the last sweep that it had
    finished; views of the next one are set aside and taken again. It takes the lease as a new run does.
    """
    return RunDocument.of(await service.runs.resume(run_id, token))


@router.post(
    "/{run_id}/solve",
    status_code=202,
    summary="Solve what a run has measured",
    responses=answers(
        UnknownRunError,
        UnknownViewError,
        SessionUnreadableError,
        RunActiveError,
        RunStateError,
        StoreError,
        *KEYED,
    ),
    dependencies=[ONCE_DURABLY],
)
async def solve_run(
    run_id: RunId, service: ServiceDep, request: Annotated[SolveRequest | None, Body()] = None
) -> RunDocument:
    """Solve the views of a run that is over, as far as they go, or all but some of them.

    Nothing moves. The run keeps its state; `calibration_id` is what was found, which is stored and not activated.
    """
    return RunDocument.of(await service.runs.solve(run_id, (request or SolveRequest()).leave_out))


@router.post(
    "/{run_id}/cancel",
    summary="Cancel a run",
    responses=answers(UnknownRunError, RunStateError, StoreError),
)
async def cancel_run(run_id: RunId, service: ServiceDep) -> RunDocument:
    """Stop the axes, and answer when they stand and the run is over. Its views can be solved as they are."""
    await service.runs.get(run_id)
    return RunDocument.of(await service.runs.cancel(run_id))


@router.get(
    "/{run_id}/events",
    summary="A run's events, from its first to its last",
    response_class=StreamingResponse,
    responses={
        **answers(UnknownRunError, StoreError),
        200: {"description": "Server-sent events.", "model": RunEvent, "content": {"text/event-stream": {}}},
    },
)
async def follow_run(
    run_id: RunId,
    service: ServiceDep,
    last_event_id: Annotated[
        int | None, Header(ge=0, description="The last event received: what follows it is sent.")
    ] = None,
    after: Annotated[int, Query(ge=0, description="The same, for clients that cannot set a header.")] = 0,
) -> StreamingResponse:
    """Send what has happened so far, then each event as it happens; the stream ends with the run.

    `id` is the event's sequence, `event` its type, `data` the event as JSON; `finished` is the last.
    """
    await service.runs.get(run_id)
    seen = after if last_event_id is None else last_event_id
    events = service.streams.follow(service.runs.events(run_id, seen))
    return StreamingResponse(
        _written(events), media_type="text/event-stream", headers={"Cache-Control": "no-store"}
    )


async def _written(events: AsyncIterator[RunEvent | None]) -> AsyncIterator[str]:
    async for event in events:
        if event is None:
            yield ": still here\n\n"
        else:
            yield f"id: {event.sequence}\nevent: {event.type}\ndata: {event.model_dump_json()}\n\n"
