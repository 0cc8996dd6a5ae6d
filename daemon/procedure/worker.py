"""Work that can be abandoned: nobody waits for its thread, neither a cancelled task nor the end of the process."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


async def in_worker(work: Callable[[], Result]) -> Result:
    """Return what `work` returns in a thread of its own, or raise what it raises.

    Once this is cancelled, the thread goes on unheard. The threads of `asyncio.to_thread` would be waited for
    when the daemon ends.
    """
    loop = asyncio.get_running_loop()
    outcome: asyncio.Future[Result] = loop.create_future()

    def settle(result: Result | None, error: Exception | None) -> None:
        if outcome.done():
            return
        if error is None:
            outcome.set_result(result)  # type: ignore[arg-type]  # None only where `work` returns it
        else:
            outcome.set_exception(error)

    def run() -> None:
        result, error = None, None
        try:
            result = work()
        except Exception as raised:
            error = raised
        with contextlib.suppress(RuntimeError):  # the loop is closed, and nobody is left to tell
            loop.call_soon_threadsafe(settle, result, error)

    threading.Thread(target=run, name="worker", daemon=True).start()
    return await outcome
