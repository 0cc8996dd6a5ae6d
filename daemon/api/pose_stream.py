"""The pose as a WebSocket stream: a message for each new reading, or the problem that is in its way."""

from collections.abc import AsyncIterator

from fastapi import APIRouter, WebSocket, WebSocketDisconnect, status
from pydantic_core import to_json

from calib.errors import CalibError
from daemon.api import problems
from daemon.errors import DaemonError
from daemon.rig import Rig
from daemon.service import Service
from drivers.errors import DriverError

router = APIRouter(tags=["pose"])


@router.websocket("/pose/stream")
async def stream_pose(socket: WebSocket, camera: str | None = None) -> None:
    """Send what `GET /pose` answers at each new reading; a problem document is sent once, when it arises."""
    service: Service = socket.app.state.service
    await socket.accept()
    sent_problem: str | None = None
    try:
        async for _ in service.streams.follow(_readings(service.rig)):
            try:
                message = service.poses.now(camera)
                sent_problem = None
            except (DaemonError, DriverError, CalibError) as error:
                kind = problems.kind_of(error)
                if kind.code == sent_problem:
                    continue
                sent_problem = kind.code
                message = to_json(problems.document(kind, str(error), socket.url.path))
            await socket.send_text(message.decode())
        await socket.close(status.WS_1001_GOING_AWAY, "the daemon is shutting down")
    except WebSocketDisconnect:
        pass  # the client has seen enough


async def _readings(rig: Rig) -> AsyncIterator[None]:
    """Yield now, and whenever there is a new reading."""
    seen = None
    while True:
        if rig.snapshot.timestamp != seen or seen is None:
            seen = rig.snapshot.timestamp
            yield None
        await rig.changed.wait()
