"""How late the event loop is: everything that is asked of the daemon waits as long."""

import asyncio
from collections.abc import Callable
from typing import Final

PERIOD: Final = 0.25
"""Seconds between two looks."""


async def watch_loop(late: Callable[[float], None]) -> None:
    """Call `late` with the seconds by which the loop came round too late, for ever."""
    loop = asyncio.get_running_loop()
    while True:
        due = loop.time() + PERIOD
        await asyncio.sleep(PERIOD)
        late(max(0.0, loop.time() - due))
