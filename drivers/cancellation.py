"""Cancelling code is not stopping hardware: what has to be finished although a task is being cancelled."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")


async def finish(work: Coroutine[Any, Any, Result]) -> Result:
    """Await `work` to its end, however often the calling task is cancelled meanwhile.

    A cancellation that came meanwhile goes on when `work` is over, in place of its result or error.
    """
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is None:
        return task.result()
    if not task.cancelled():
        task.exception()  # asked for, so that asyncio does not report it as never retrieved
    raise cancelled
