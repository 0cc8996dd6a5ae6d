"""The route that says how a run's views cover the camera's picture."""

from fastapi import APIRouter

from calib.stated_quality import CameraCoverage
from daemon.api.dependencies import ServiceDep
from daemon.api.problems import answers
from daemon.api.runs import RunId
from daemon.errors import SessionUnreadableError, StoreError, UnknownRunError

router = APIRouter(prefix="/runs", tags=["runs"])


@router.get(
    "/{run_id}/coverage",
    summary="How a run's views cover the picture",
    responses=answers(UnknownRunError, SessionUnreadableError, StoreError),
)
async def get_coverage(run_id: RunId, service: ServiceDep) -> CameraCoverage:
    """Answer with the places, sizes and leanings of the target in all views on disk, also while the run goes on."""
    return await service.judge.coverage(run_id, service.profile)
