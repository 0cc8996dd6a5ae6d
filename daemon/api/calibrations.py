"""Routes of the stored calibrations."""

import json
from datetime import datetime
from typing import Annotated, Any, Self

from fastapi import APIRouter, Path
from pydantic import BaseModel, Field

from calib.errors import FormatError
from daemon.api.dependencies import ServiceDep
from daemon.api.once import KEYED, ONCE_DURABLY, OnceRoute
from daemon.api.problems import answers
from daemon.errors import (
    CalibrationMismatchError,
    NotCalibratedError,
    StoreError,
    UnknownCalibrationError,
)
from daemon.service import Service
from daemon.store import CalibrationRecord, CalibrationSummary

router = APIRouter(prefix="/calibrations", tags=["calibrations"], route_class=OnceRoute)

CalibrationId = Annotated[str, Path(description="The calibration's id.")]


class CalibrationEntry(BaseModel):
    """A stored calibration without its document."""

    id: str
    created_at: datetime
    method: str = Field(examples=["ml"])
    active: bool = Field(description="Whether poses are computed from it.")
    run_id: str | None = Field(description="The run that found it.")
    judgement: str | None = Field(
        description="good, usable, poor, or unknown; null where it was not judged.", examples=["good"]
    )
    verdict: str | None = Field(description="What the judgement rests on, in a sentence.")
    problem: str | None = Field(
        description="Why poses are not computed from it though it was the active one, or the next in line."
    )

    @classmethod
    def of(cls, calibration: CalibrationSummary, service: Service) -> Self:
        """Describe a calibration."""
        return cls(
            id=calibration.id,
            created_at=calibration.created_at,
            method=calibration.method,
            active=calibration.id == service.poses.calibration_id,
            run_id=calibration.run_id,
            judgement=calibration.judgement,
            verdict=calibration.verdict,
            problem=None if service.fallback is None else service.fallback.reasons.get(calibration.id),
        )


class CalibrationDocument(CalibrationEntry):
    """A stored calibration."""

    calibration: dict[str, Any] = Field(description="The document, format activecam.calibration/1.")
    verification: dict[str, Any] | None = Field(description="What the held-out views of its run said of it.")

    @classmethod
    def whole(cls, record: CalibrationRecord, service: Service) -> Self:
        """Describe a calibration with its document; raises FormatError where that is damaged."""
        return cls(
            **CalibrationEntry.of(record.summary(), service).model_dump(),
            calibration=json.loads(record.document),
            verification=None if record.verification is None else json.loads(record.verification),
        )


@router.get("", summary="All calibrations, the newest first", responses=answers(StoreError))
async def list_calibrations(service: ServiceDep) -> list[CalibrationEntry]:
    """Answer with what every run has found."""
    return [CalibrationEntry.of(calibration, service) for calibration in await service.store.calibrations()]


@router.get(
    "/current",
    summary="The active calibration",
    responses=answers(NotCalibratedError, FormatError, StoreError),
)
async def get_current_calibration(service: ServiceDep) -> CalibrationDocument:
    """Answer with the calibration that poses are computed from."""
    return CalibrationDocument.whole(await service.store.calibration(service.poses.active.id), service)


@router.get(
    "/{calibration_id}",
    summary="One calibration",
    responses=answers(UnknownCalibrationError, FormatError, StoreError),
)
async def get_calibration(calibration_id: CalibrationId, service: ServiceDep) -> CalibrationDocument:
    """Answer with a calibration and its document."""
    return CalibrationDocument.whole(await service.store.calibration(calibration_id), service)


@router.post(
    "/{calibration_id}/activate",
    summary="Compute poses from this calibration",
    responses=answers(UnknownCalibrationError, CalibrationMismatchError, FormatError, StoreError, *KEYED),
    dependencies=[ONCE_DURABLY],
)
async def activate_calibration(calibration_id: CalibrationId, service: ServiceDep) -> CalibrationEntry:
    """Make this calibration the active one, now and after every restart."""
    return CalibrationEntry.of((await service.activate(calibration_id)).summary(), service)
