"""The pose as a WebSocket stream: a message for each new reading, or the problem that is in its way."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query, WebSocket
from pydantic_core import to_json

from calib.errors import CalibError
from daemon.api import problems
from daemon.api.sockets import first_of, left, send
from daemon.errors import DaemonError
from daemon.service import Service
from drivers.errors import DriverError

router = APIRouter(tags=["pose"])


@router.websocket("/pose/stream")
async def stream_pose(
    socket: WebSocket,
    camera: str | None = None,
    rate: Annotated[float | None, Query(gt=0)] = None,
    ask: bool = False,
) -> None:
    """Send what `GET /pose` answers at each new reading; a problem document is sent once, when it arises.

    `rate` is how many poses a second are sent at most. `dropped` of a pose says how many readings were left out before
    it, since the client asked for fewer or read too slowly. With `ask`, each of its messages asks for one: what nobody
    has asked for does not grow old on its way.
    """
    service: Service = socket.app.state.service
    await socket.accept()
    poses = messages(service, camera, socket.url.path, 0.0 if rate is None else 1 / rate)
    asked = asyncio.Semaphore(0)
    sent = service.streams.follow(_asked_for(poses, asked) if ask else poses)
    await first_of(send(socket, sent), left(socket, asked.release))


async def _asked_for(poses: AsyncIterator[str], asked: asyncio.Semaphore) -> AsyncIterator[str]:
    while True:
        await asked.acquire()
        yield await anext(poses)


async def messages(service: Service, camera: str | None, address: str, period: float) -> AsyncIterator[str]:
    """Yield the pose now and at each new reading, `period` (s) apart at least, and each problem when it arises.

    Whoever asks for the next one late gets the newest.
    """
    loop, rig = asyncio.get_running_loop(), service.rig
    due, told = loop.time(), None
    sent: list[int] | None = None  # how many times each axis had been read at the pose before
    while True:
        read = [axis.number for axis in rig.snapshot.axes]
        try:
            pose = service.poses.now(camera)
        except (DaemonError, DriverError, CalibError) as error:
            sent, kind = None, problems.kind_of(error)
            if kind != told:
                told = kind
                yield to_json(problems.document(kind, str(error), address)).decode()
        else:
            if read != sent:
                since = 1 if sent is None else max(now - then for now, then in zip(read, sent, strict=True))
                yield f'{pose[:-1].decode()},"dropped":{since - 1}}}'
                sent, told = read, None
                due = max(due + period, loop.time())
                await asyncio.sleep(due - loop.time())
                continue
        # Nothing new comes from axes that have fallen silent, which is to be told as well.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(rig.profile.procedure.max_reading_age):
                await rig.changed.wait()
