"""The daemon's figures for Prometheus, in its text format."""

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse

from daemon.api.dependencies import ServiceDep

router = APIRouter(tags=["rig"])


@router.get("/metrics", summary="Figures for Prometheus", response_class=PlainTextResponse)
async def get_metrics(service: ServiceDep) -> PlainTextResponse:
    """Answer in the text exposition format, version 0.0.4."""
    text = service.figures.written()
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4; charset=utf-8")
