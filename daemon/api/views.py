"""Routes of the views that runs have taken."""

from datetime import datetime
from typing import Annotated, Self

from fastapi import APIRouter, Header, Path, Query, Response
from pydantic import BaseModel, Field

from calib.errors import FormatError
from daemon.api.dependencies import ServiceDep
from daemon.api.problems import answers
from daemon.api.runs import RunId
from daemon.errors import (
    SessionUnreadableError,
    StoreError,
    UnknownCalibrationError,
    UnknownRunError,
    UnknownViewError,
)
from daemon.judging.judge import JudgedRun
from daemon.judging.views import JudgedView

router = APIRouter(prefix="/runs/{run_id}/views", tags=["runs"])


class ViewDocument(BaseModel):
    """A view of a run."""

    number: int = Field(description="Its place in the session, from 0.")
    joint: str | None = Field(description="The joint that moved alone; null for a free view.")
    use: str = Field(description="What it was taken for: fit or verify.", examples=["fit"])
    readings: list[float] = Field(description="In chain order, each in its own unit.")
    taken_at: datetime | None
    image: str | None = Field(description="Its picture's path in the session's folder.")
    points: int | None = Field(description="Target points found in it.")
    residual_px: float | None = Field(
        description="By how much they miss where the calibration predicts them (rms); without one, the best pose of "
        "this view alone. Null where the target was not found, or nothing is known of the lens yet."
    )
    held_out_px: float | None = Field(
        description="The same against the fit of all other views, where it was computed."
    )
    set_aside: bool = Field(
        description="Whether the fit did not use it, as it does not agree with the others."
    )
    left_out: bool = Field(description="Whether a person had it left out.")

    @classmethod
    def of(cls, view: JudgedView) -> Self:
        """Describe a view."""
        return cls(**{name: getattr(view, name) for name in JudgedView.__dataclass_fields__})


class ViewsDocument(BaseModel):
    """A run's views."""

    run_id: str
    calibration_id: str | None = Field(
        description="By which calibration they are judged; null where each is by itself, as before it is solved."
    )
    views: list[ViewDocument]

    @classmethod
    def of(cls, run_id: str, run: JudgedRun) -> Self:
        """Describe a run's views."""
        return cls(
            run_id=run_id,
            calibration_id=run.calibration_id,
            views=[ViewDocument.of(view) for view in run.views],
        )


@router.get(
    "",
    summary="A run's views",
    responses=answers(
        UnknownRunError, UnknownCalibrationError, SessionUnreadableError, FormatError, StoreError
    ),
)
async def list_views(
    run_id: RunId,
    service: ServiceDep,
    calibration: Annotated[
        str | None,
        Query(description="A calibration of this run to judge them by; its latest where left out."),
    ] = None,
) -> ViewsDocument:
    """Answer with the views on disk, also while the run goes on, and how well each agrees."""
    return ViewsDocument.of(run_id, await service.judge.views(run_id, calibration))


@router.get(
    "/{number}/image.jpg",
    summary="A view's picture",
    response_class=Response,
    responses=answers(UnknownRunError, UnknownViewError, SessionUnreadableError, StoreError)
    | {
        200: {
            "description": "A JPEG picture.",
            "content": {"image/jpeg": {"schema": {"type": "string", "format": "binary"}}},
        },
        304: {"description": "It is the one that the client has."},
    },
)
async def get_view_image(
    run_id: RunId,
    number: Annotated[int, Path(ge=0, le=2**31 - 1, description="The view's number, from 0.")],
    service: ServiceDep,
    width: Annotated[
        int | None, Query(ge=16, le=8192, description="Make it smaller where it is wider (px).")
    ] = None,
    if_none_match: Annotated[
        str | None, Header(description="The `ETag` of the one that the client has.")
    ] = None,
) -> Response:
    """Answer with the view's picture, of several frames the first."""
    picture = await service.judge.picture(run_id, number)
    # A run never gives a picture's name twice, though resumed it may give a view's number to another picture.
    headers = {"ETag": f'"{run_id}-{picture.stem}-{width or 0}"', "Cache-Control": "private, no-cache"}
    if if_none_match == headers["ETag"]:
        return Response(status_code=304, headers=headers)
    return Response(await service.judge.jpeg(picture, width), media_type="image/jpeg", headers=headers)
