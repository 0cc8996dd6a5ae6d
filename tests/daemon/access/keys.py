"""Keys as they are made and shown, and streams that end when they are not good any more."""

import contextlib

import pytest
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosedError

from daemon.cli import main


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


def command(*arguments: object) -> int:
    """Run `activecam` with these arguments, and return its exit status."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


async def close_code(stream: ClientConnection) -> int | None:
    """Read a stream to its end, and return why it ended."""
    with contextlib.suppress(ConnectionClosedError):
        async for _ in stream:
            pass
    return stream.close_code
