"""Routes of what a calibration is judged by."""

import asyncio

from fastapi import APIRouter

from calib.errors import CalibError, FormatError
from daemon.api.calibrations import CalibrationId
from daemon.api.dependencies import ServiceDep
from daemon.api.judging_documents import ResidualsDocument, TablesDocument, ViewResiduals
from daemon.api.problems import answers
from daemon.errors import SessionUnreadableError, StoreError, UnknownCalibrationError, UnknownRunError

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
