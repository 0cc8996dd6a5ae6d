"""A service on a real socket."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from daemon.server import LOCAL, Door, address_of, bind, serving
from daemon.service import Service


@asynccontextmanager
async def on_a_socket(service: Service, door: Door = LOCAL) -> AsyncIterator[str]:
    """Serve it on a port of this machine, and yield its address."""
    with bind("127.0.0.1", 0) as listening:
        async with serving(service, listening, door):
            yield address_of(listening)
