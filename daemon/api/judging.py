"""Routes of what a calibration is judged by."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Path, Query
from pydantic import Field

from calib.errors import CalibError, FormatError, ReadingsError
from daemon.api.calibrations import CalibrationId
from daemon.api.comparison_document import ComparisonDocument
from daemon.api.dependencies import ServiceDep
from daemon.api.judging_documents import ResidualsDocument, TablesDocument, ViewResiduals
from daemon.api.problems import answers
from daemon.api.scene_document import SceneDocument
from daemon.errors import (
    CalibrationMismatchError,
    SessionUnreadableError,
    StaleReadingError,
    StoreError,
    UnknownCalibrationError,
    UnknownRunError,
)
from drivers.errors import DeviceLostError, NotHomedError

router = APIRouter(prefix="/calibrations/{calibration_id}", tags=["calibrations"])


@router.get(
    "/residuals",
    summary="What every point of every view is off by",
    responses=answers(
        UnknownCalibrationError, UnknownRunError, SessionUnreadableError, FormatError, CalibError, StoreError
    ),
)
async def get_residuals(calibration_id: CalibrationId, service: ServiceDep) -> ResidualsDocument:
    """Answer with the views that the calibration was solved from, held out or left out, point by point.

    The target is looked for in their pictures, which takes some seconds for the first who asks.
    """
    stored = await service.judge.calibration(calibration_id)
    views = await service.judge.residuals(calibration_id)
    quality = {view.view: view for view in stored.calibration.quality.views}
    camera = stored.calibration.cameras[0]
    return ResidualsDocument(
        calibration_id=calibration_id,
        run_id=stored.record.run_id,
        camera=camera.name,
        width=None if camera.intrinsics is None else camera.intrinsics.width,
        height=None if camera.intrinsics is None else camera.intrinsics.height,
        views=[ViewResiduals.of(view, quality.get(view.view)) for view in views],
    )


@router.get(
    "/tables",
    summary="The paper's tables 1 to 4 for this rig, and all parameters",
    responses=answers(UnknownCalibrationError, FormatError, StoreError),
)
async def get_tables(calibration_id: CalibrationId, service: ServiceDep) -> TablesDocument:
    """Answer with predicted against measured travel and image points, and each parameter's standard deviation."""
    stored = await service.judge.calibration(calibration_id)
    return await asyncio.to_thread(
        lambda: TablesDocument.of(calibration_id, stored.calibration, stored.record.read_verification())
    )


@router.get(
    "/scene",
    summary="The rig in 3-D",
    responses=answers(
        UnknownCalibrationError,
        FormatError,
        ReadingsError,
        CalibrationMismatchError,
        NotHomedError,
        DeviceLostError,
        StaleReadingError,
        StoreError,
    ),
)
async def get_scene(
    calibration_id: CalibrationId,
    service: ServiceDep,
    readings: Annotated[
        list[Annotated[float, Field(allow_inf_nan=False)]] | None,
        Query(max_length=100, description="One number an axis, in chain order; the latest where left out."),
    ] = None,
) -> SceneDocument:
    """Answer with what stands where in the world, and how surely that is known; moves nothing."""
    if readings is None:
        stored = await service.judge.calibration(calibration_id)
        service.poses.prepare(
            calibration_id, stored.calibration
        )  # another rig's readings say nothing of this one
        now, sides = service.poses.readings_now()
        values: list[float] = now.tolist()
        found = await service.judge.scene(calibration_id, values, sides.tolist())
    else:
        values = readings
        found = await service.judge.scene(calibration_id, values)
    return SceneDocument.of(calibration_id, values, found)


@router.get(
    "/compare/{other_id}",
    summary="Two calibrations side by side",
    responses=answers(UnknownCalibrationError, FormatError, CalibError, StoreError),
)
async def compare_calibrations(
    calibration_id: CalibrationId,
    other_id: Annotated[str, Path(description="The other calibration's id.")],
    service: ServiceDep,
) -> ComparisonDocument:
    """Answer with what the other has otherwise: poses over the range that both have, and parameters."""
    found = await service.judge.comparison(calibration_id, other_id)
    return ComparisonDocument.of(calibration_id, other_id, found)
