"""The live picture as a WebSocket: binary messages, each when the client asks for the next one."""

import asyncio
import struct
from collections.abc import AsyncIterator
from typing import Final

from fastapi import APIRouter, WebSocket
from pydantic import BaseModel, Field
from pydantic_core import to_json

from daemon.api import problems
from daemon.api.detection_document import DetectionDocument
from daemon.api.sockets import first_of, left, send
from daemon.live_view import Look
from daemon.service import Service
from drivers.errors import DriverError

router = APIRouter(tags=["camera"])

AGAIN: Final = 0.25
"""Seconds until a camera that gives no picture is asked again."""


class PictureDocument(BaseModel):
    """What is told of a picture that follows."""

    sequence: int
    width: int
    height: int
    detection: DetectionDocument | None = Field(description="Where it was asked for.")

    @classmethod
    def of(cls, look: Look, *, detect: bool) -> "PictureDocument":
        """Describe a look, and what is seen in it if that was asked for."""
        width, height = look.picture.size
        seen = look.sighting if detect else None
        detection = None if seen is None else DetectionDocument.of(seen)
        return cls(sequence=look.picture.sequence, width=width, height=height, detection=detection)


class Packing:
    """Looks as messages: packed once for all who look."""

    def __init__(self) -> None:
        self._packed: dict[bool, tuple[Look, bytes]] = {}

    def of(self, look: Look, *, detect: bool) -> bytes:
        """Return the message that is told of `look`."""
        look_before, message = self._packed.get(detect, (None, b""))
        if look_before is not look:
            head = PictureDocument.of(look, detect=detect).model_dump_json().encode()
            message = _packed(head, look.picture.data)
            self._packed[detect] = look, message
        return message


@router.websocket("/camera/live")
async def follow_camera(socket: WebSocket, detect: bool = False) -> None:
    """Send a picture for each message that comes; while the camera gives none, a problem document once."""
    service: Service = socket.app.state.service
    await socket.accept()
    asked = asyncio.Event()
    pictures = _messages(service, socket.app.state.packing, asked, socket.url.path, detect=detect)
    await first_of(send(socket, service.streams.follow(pictures)), left(socket, asked.set))


async def _messages(
    service: Service, packing: Packing, asked: asyncio.Event, address: str, *, detect: bool
) -> AsyncIterator[bytes]:
    """Yield a message whenever `asked` is set: length of the head (4 bytes, big-endian), head (JSON), JPEG."""
    shown: int | None = None
    told = None
    while True:
        await asked.wait()
        try:
            look = await service.view.after(shown, detect=detect)
        except DriverError as error:
            shown, kind = None, problems.kind_of(error)
            if kind == told:
                await asyncio.sleep(AGAIN)
                continue
            told = kind
            message = _packed(to_json(problems.document(kind, str(error), address)), b"")
        else:
            shown, told = look.picture.sequence, None
            message = packing.of(look, detect=detect)
            asked.clear()
        yield message


def _packed(head: bytes, picture: bytes) -> bytes:
    return struct.pack(">I", len(head)) + head + picture
