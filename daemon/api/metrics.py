"""The daemon's figures for Prometheus, in its text format."""

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse
from prometheus_client import generate_latest

from daemon.api.dependencies import ServiceDep
from daemon.operation.rig_figures import RigFigures

router = APIRouter(tags=["rig"])


@router.get("/metrics", summary="Figures for Prometheus", response_class=PlainTextResponse)
async def get_metrics(service: ServiceDep) -> PlainTextResponse:
    """Answer in the text exposition format, version 0.0.4."""
    text = generate_latest(service.figures.registry) + generate_latest(RigFigures(service))
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4; charset=utf-8")
