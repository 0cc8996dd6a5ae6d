"""Routes of the live picture, and of what is seen in it."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse

from daemon.api.dependencies import ServiceDep
from daemon.api.detection_document import DetectionDocument
from daemon.api.problems import answers
from daemon.live_picture import JpegPicture
from daemon.service import Service
from drivers.errors import DeviceLostError, DeviceTimeoutError, DriverError

router = APIRouter(prefix="/camera", tags=["camera"])

JPEG = {"content": {"image/jpeg": {"schema": {"type": "string", "format": "binary"}}}}
BOUNDARY = "frame"


@router.get(
    "/frame.jpg",
    summary="The newest picture",
    response_class=Response,
    responses=answers(DeviceLostError, DeviceTimeoutError)
    | {200: {"description": "A JPEG picture.", **JPEG}},
)
async def get_frame(service: ServiceDep) -> Response:
    """Answer with the newest frame; `X-Frame-Sequence` is its number."""
    picture = await service.pictures.newest()
    headers = {"Cache-Control": "no-store", "X-Frame-Sequence": str(picture.sequence)}
    return Response(picture.data, media_type="image/jpeg", headers=headers)


@router.get(
    "/detection",
    summary="The target in the newest picture",
    responses=answers(DeviceLostError, DeviceTimeoutError),
)
async def get_detection(service: ServiceDep) -> DetectionDocument:
    """Look for the target in the newest frame, and say how good the picture is to measure in."""
    return DetectionDocument.of(await service.sightings.newest())


@router.get(
    "/stream.mjpg",
    summary="The live picture",
    response_class=StreamingResponse,
    responses={
        **answers(DeviceLostError, DeviceTimeoutError),
        200: {
            "description": "JPEG pictures one after another.",
            "content": {"multipart/x-mixed-replace": {}},
        },
    },
)
async def stream_frames(
    service: ServiceDep,
    fps: Annotated[float, Query(gt=0, le=60, description="Pictures a second at most.")] = 10.0,
) -> StreamingResponse:
    """Send pictures until the client has seen enough or the camera is lost."""
    first = await service.pictures.newest()
    pictures = service.streams.follow(_pictures(service, first, 1 / fps))
    return StreamingResponse(
        _parts(pictures),
        media_type=f"multipart/x-mixed-replace; boundary={BOUNDARY}",
        headers={"Cache-Control": "no-store"},
    )


async def _pictures(service: Service, picture: JpegPicture, period: float) -> AsyncIterator[JpegPicture]:
    while True:
        yield picture
        shown = picture.sequence
        while picture.sequence == shown:
            await asyncio.sleep(period)
            try:
                picture = await service.pictures.newest()
            except DriverError:
                return  # an ended stream is how a picture says that its camera is gone


async def _parts(pictures: AsyncIterator[JpegPicture | None]) -> AsyncIterator[bytes]:
    async for picture in pictures:
        if picture is not None:
            head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture.data)}\r\n\r\n"
            yield head.encode() + picture.data + b"\r\n"
