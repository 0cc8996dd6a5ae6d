"""Keys as they are shown, and streams that end when they are not good any more."""

import contextlib

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosedError


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


async def close_code(stream: ClientConnection) -> int | None:
    """Read a stream to its end, and return why it ended."""
    with contextlib.suppress(ConnectionClosedError):
        async for _ in stream:
            pass
    return stream.close_code
