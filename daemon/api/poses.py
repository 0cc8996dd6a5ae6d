"""Routes of the camera's pose, and of what it sees where."""

import asyncio
from datetime import datetime
from typing import Annotated, Any, Literal, Self

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.exceptions import RequestValidationError
from numpy.typing import ArrayLike, NDArray
from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import to_json

from calib.errors import ReadingsError
from daemon.api.bodies import RequestBody
from daemon.api.dependencies import ServiceDep
from daemon.api.pose_documents import Pixels, Pose, PoseAtTime, PosesAtReadings, PosesAtTimes, Rays
from daemon.api.problems import answers
from daemon.errors import (
    LensUnknownError,
    NotCalibratedError,
    StaleReadingError,
    TimeNotCoveredError,
    UnknownCameraError,
)
from daemon.pose.pixels import project, rays
from daemon.service import Service
from drivers.errors import DeviceLostError, NotHomedError

router = APIRouter(tags=["pose"])

Number = Annotated[float, Field(allow_inf_nan=False)]
Readings = Annotated[
    list[list[Number]],
    Field(
        min_length=1,
        max_length=10_000,
        description="Vectors of raw joint readings in chain order, each in its axis's own unit.",
        examples=[[[12.5, 30.0]]],
    ),
]
Time = Annotated[AwareDatetime, Field(strict=False)]
Times = Annotated[
    list[Time],
    Field(
        min_length=1,
        max_length=1_000,
        description="Past times (RFC 3339), such as those of another camera's pictures.",
        examples=[["2026-03-14T09:27:12.732569Z"]],
    ),
]
FewReadings = Annotated[
    list[list[Number]],
    Field(min_length=1, max_length=100, description="As for poses; the latest readings where left out."),
]
Sides = Annotated[
    list[list[Literal[-1, 0, 1]]] | None,
    Field(
        max_length=10_000,
        description="From which side each joint came to each of the readings: 1 from below, -1 from above, 0 where not "
        "known. Of a joint with backlash whose side is not known, the middle of its play is taken.",
        examples=[[[1, -1]]],
    ),
]
CameraName = Annotated[str | None, Field(description="The camera; the first where left out.")]

_TIME: TypeAdapter[datetime] = TypeAdapter(AwareDatetime)

SMALL = 64
"""Vectors of readings that are computed at once; more go to a worker thread, so that others need not wait."""


class PosesRequest(RequestBody):
    """Readings at which the camera would be, or past times at which it was: one of both."""

    readings: Readings | None = None
    approached: Sides = None
    times: Times | None = None
    camera: CameraName = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.readings is None) == (self.times is None):
            raise ValueError("give either readings or times")
        if self.approached is not None and self.readings is None:
            raise ValueError("approached goes with readings; of past times it is known")
        return self


class ProjectRequest(RequestBody):
    """World points (m) to be seen."""

    points: Annotated[
        list[Annotated[list[Number], Field(min_length=3, max_length=3)]],
        Field(min_length=1, max_length=10_000, examples=[[[0.0, 0.0, 0.0]]]),
    ]
    readings: FewReadings | None = None
    camera: CameraName = None


class RaysRequest(RequestBody):
    """Pixels to look through; (0, 0) is the centre of the top-left pixel."""

    pixels: Annotated[
        list[Annotated[list[Number], Field(min_length=2, max_length=2)]],
        Field(min_length=1, max_length=10_000, examples=[[[319.5, 239.5]]]),
    ]
    readings: FewReadings | None = None
    camera: CameraName = None


def _query(name: str, schema: dict[str, str], description: str) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": False,
        "schema": {"type": "string"} | schema,
        "description": description,
    }


@router.get(
    "/pose",
    summary="The camera's pose now, or at a past time",
    response_model=Pose | PoseAtTime,
    responses=answers(
        NotCalibratedError,
        NotHomedError,
        UnknownCameraError,
        TimeNotCoveredError,
        DeviceLostError,
        StaleReadingError,
    ),
    openapi_extra={
        "parameters": [
            _query("camera", {}, "The camera; the first where left out."),
            _query("at", {"format": "date-time"}, "A time of the last minute; now where left out."),
        ]
    },
)
async def get_pose(request: Request) -> Response:
    """Answer from the latest readings, or those around a past time, and the active calibration."""
    # The hot path: nothing is resolved, validated or serialised that need not be.
    service: Service = request.app.state.service
    asked = request.query_params
    if "at" in asked:
        return _json(await service.poses.past(_time(asked["at"]), asked.get("camera")))
    return _json(service.poses.now(asked.get("camera")))


@router.post(
    "/pose",
    summary="Poses at given readings, or at past times",
    response_model=PosesAtReadings | PosesAtTimes,
    responses=answers(
        NotCalibratedError,
        UnknownCameraError,
        ReadingsError,
        TimeNotCoveredError,
        DeviceLostError,
        StaleReadingError,
    ),
)
async def get_poses(request: PosesRequest, service: ServiceDep) -> Response:
    """Answer with one pose for each vector of readings, or for each time; moves nothing."""
    if request.times is not None:
        return _json(await service.poses.past_list(request.times, request.camera))
    assert request.readings is not None
    readings = _vectors(service, request.readings)
    sides = None if request.approached is None else _sides(request.approached, readings)
    if len(readings) <= SMALL:
        return _json(service.poses.at(readings, request.camera, sides))
    return _json(await asyncio.to_thread(service.poses.at, readings, request.camera, sides))


PIXEL_PROBLEMS = answers(
    NotCalibratedError,
    NotHomedError,
    UnknownCameraError,
    LensUnknownError,
    ReadingsError,
    DeviceLostError,
    StaleReadingError,
)


@router.post("/project", summary="World points to pixels", response_model=Pixels, responses=PIXEL_PROBLEMS)
async def project_points(request: ProjectRequest, service: ServiceDep) -> Response:
    """Answer with the pixel at which each point is seen, for each vector of readings."""
    active = service.poses.active
    points, (readings, sides) = np.array(request.points, dtype=float), _readings(service, request.readings)
    pixels = await asyncio.to_thread(project, active, points, readings, request.camera, sides)
    return _json(
        to_json(
            {
                "calibration_id": active.id,
                "camera": active.camera(request.camera),
                "readings": readings.tolist(),
                "pixels": [_rows(row) for row in pixels],
            }
        )
    )


@router.post("/rays", summary="Pixels to rays in the world", response_model=Rays, responses=PIXEL_PROBLEMS)
async def pixel_rays(request: RaysRequest, service: ServiceDep) -> Response:
    """Answer with the ray along which each pixel looks, for each vector of readings."""
    active = service.poses.active
    pixels, (readings, sides) = np.array(request.pixels, dtype=float), _readings(service, request.readings)
    found = await asyncio.to_thread(rays, active, pixels, readings, request.camera, sides)
    bundles = [
        {"origin": origin.tolist(), "directions": _rows(directions)}
        for origin, directions in zip(found.origins, found.directions, strict=True)
    ]
    return _json(
        to_json(
            {
                "calibration_id": active.id,
                "camera": active.camera(request.camera),
                "readings": readings.tolist(),
                "rays": bundles,
            }
        )
    )


def _time(text: str) -> datetime:
    """Return the time that a query states; raises RequestValidationError."""
    try:
        return _TIME.validate_python(text)
    except ValidationError as error:
        raise RequestValidationError(
            [{**wrong, "loc": ("query", "at")} for wrong in error.errors()]
        ) from None


def _readings(
    service: Service, given: list[list[float]] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return readings (n, m), the latest where none are given, and their sides (n, m), of the latest alone known."""
    if given is not None:
        return _vectors(service, given), None
    readings, sides = service.poses.readings_now()
    return readings[None], sides[None]


def _vectors(service: Service, given: list[list[float]]) -> NDArray[np.float64]:
    """Return readings (n, m); raises ReadingsError naming the first vector of the wrong length."""
    axes = list(service.rig.specs)
    for index, vector in enumerate(given):
        if len(vector) != len(axes):
            raise ReadingsError(
                f"readings[{index}] has {len(vector)} numbers: give one for each axis, {', '.join(axes)}"
            )
    return np.array(given, dtype=float)


def _sides(given: list[list[Literal[-1, 0, 1]]], readings: NDArray[np.float64]) -> NDArray[np.int_]:
    """Return the sides (n, m) of `readings` (n, m); raises ReadingsError unless there is one for each of them."""
    if [len(sides) for sides in given] != [readings.shape[1]] * len(readings):
        raise ReadingsError("approached must have as many lists, of as many numbers, as readings")
    return np.array(given)


def _rows(values: ArrayLike) -> list[Any]:
    """Return rows as lists, with None for those that are not all finite."""
    rows = np.asarray(values, dtype=float)
    return [
        row if good else None
        for row, good in zip(rows.tolist(), np.isfinite(rows).all(axis=-1).tolist(), strict=True)
    ]


def _json(content: bytes) -> Response:
    return Response(content, media_type="application/json")
