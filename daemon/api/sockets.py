"""What the WebSockets have in common."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Callable, Coroutine
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect, status


async def first_of(*works: Coroutine[Any, Any, None]) -> None:
    """Do `works` side by side until one of them ends, and cancel the others; raises what ended it."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()


async def send(socket: WebSocket, messages: AsyncGenerator[str | bytes | None] | AsyncGenerator[str]) -> None:
    """Send `messages`, text as text, until they or the client end; None is none."""
    with contextlib.suppress(WebSocketDisconnect):
        async with contextlib.aclosing(messages):
            async for message in messages:
                if isinstance(message, str):
                    await socket.send_text(message)
                elif message is not None:
                    await socket.send_bytes(message)
        await socket.close(status.WS_1001_GOING_AWAY, "the daemon is shutting down")


async def left(socket: WebSocket, on_message: Callable[[], None] = lambda: None) -> None:
    """Return when the client has gone, which nothing else tells while there is nothing to send.

    Each of its messages until then, whatever it says, is told `on_message`.
    """
    while (await socket.receive())["type"] != "websocket.disconnect":
        on_message()
