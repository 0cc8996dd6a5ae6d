"""Serving a rig: the socket first, then the devices, and at the end the axes before the connections."""

import asyncio
import contextlib
import gc
import ipaddress
import logging
import os
import signal
import socket
from collections.abc import AsyncIterator, Callable, Collection, Generator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Final

import uvicorn

from daemon.errors import ServeError
from daemon.operation.supervisor import Supervisor
from daemon.profile import Profile
from daemon.rig import Rig
from daemon.service import Service, running_service
from daemon.tls import Tls

logger = logging.getLogger(__name__)

DEFAULT_HOST: Final = "127.0.0.1"
DEFAULT_PORT: Final = 8080
GRACE: Final = 0.5
"""Seconds that clients have to take their answers at a shutdown, before they are hung up on."""
FAREWELL: Final = 0.2
"""Seconds of those in which streams say why they end."""
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What ends the daemon, in order; a terminal that is closed sends the last."""
LARGEST_MESSAGE: Final = 64 * 1024
"""Bytes of a WebSocket message from a client; none that there is to send has any."""


@dataclass(frozen=True, slots=True)
class Door:
    """How clients come in: the names that they may ask for, whether each shows a key, and TLS, if any.

    `proxy` is whether what a proxy on this machine says of its clients is believed.
    """

    host_names: Collection[str] = ()
    keys: bool = False
    proxy: bool = False
    tls: Tls | None = None


LOCAL: Final = Door()


class Server(uvicorn.Server):
    """uvicorn, which ends long answers before it waits for them, and leaves the signals to `serve`."""

    def __init__(self, config: uvicorn.Config, service: Service) -> None:
        super().__init__(config)
        self._service = service
        self.exit_asked = asyncio.Event()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Begin to shut down; uvicorn waits for every connection, and a stream would never end."""
        self._service.streams.close()
        self.exit_asked.set()
        super().handle_exit(sig, frame)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close connections, but let streams say first why they end; uvicorn would say that it starts again."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(FAREWELL):
                await self._service.streams.ended()
        await super().shutdown(sockets)

    def hang_up(self) -> None:
        """Drop the connections that there still are: a client that reads nothing never ends its own."""
        for connection in list(self.server_state.connections):
            connection.transport.abort()

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None]:
        """Capture none: uvicorn raises what it captured again when it ends, before the axes are let go."""
        yield


def serve(
    profile: Profile,
    data: Path,
    host: str = DEFAULT_HOST,
    port: int = DEFAULT_PORT,
    on_ready: Callable[[str], None] | None = None,
    *,
    host_names: Collection[str] = (),
    keys: bool = False,
    tls: Tls | None = None,
) -> None:
    """Serve the rig of `profile` until SIGINT, SIGTERM or SIGHUP, with what is stored in `data`.

    `on_ready` is called with the address (http://host:port) when requests are taken; port 0 takes a free one.
    `host_names` are names, beside `host`, under which clients may ask. Beyond this machine each request must show
    an API key; with `keys` on this machine as well, where a proxy then says for whom it asks.
    Raises ServeError, before anything is opened, when it cannot listen there or the files of `tls` are of no use;
    StoreError, NoKeyError and OptionsError.
    """
    if tls is not None:
        tls.check()
    listening = bind(host, port)
    local = ipaddress.ip_address(listening.getsockname()[0]).is_loopback
    if not local and tls is None:
        logger.warning(
            "ANYBODY ON THE NETWORK TO %s CAN READ THE KEYS that are sent, and move the axes with them: "
            "serve with --tls-certificate and --tls-key",
            host,
        )
    door = Door({host, *host_names}, keys=keys or not local, proxy=keys and local, tls=tls)
    # What is loaded stays: the collector would look at it again and again while more is.
    gc.disable()
    try:
        asyncio.run(_serve(profile, data, listening, door, on_ready))
    finally:
        gc.enable()
        listening.close()


def bind(host: str, port: int) -> socket.socket:
    """Return a socket bound to `host` and `port`; raises ServeError with what to do."""
    if not 0 <= port <= 65535:
        raise ServeError(f"cannot listen on port {port}: choose a --port between 0 and 65535")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        # asyncio sends small answers at once (TCP_NODELAY) only on sockets that say that they are TCP.
        listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    except OSError as error:
        raise ServeError(f"cannot listen on {host}: {error.strerror}: choose another --host") from None
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        # Listening already keeps a second daemon out while this one is still opening its devices.
        listening.listen(2048)
    except OSError as error:
        listening.close()
        raise ServeError(
            f"cannot listen on {host}, port {port}: {error.strerror}: "
            "stop what uses it, or choose another --port"
        ) from None
    return listening


async def _serve(
    profile: Profile,
    data: Path,
    listening: socket.socket,
    door: Door,
    on_ready: Callable[[str], None] | None,
) -> None:
    main = asyncio.current_task()
    assert main is not None
    loop = asyncio.get_running_loop()
    supervisor = Supervisor.of(os.environ)
    supervisor.tell(STATUS="opening the devices")
    # Until the server takes them over, a signal ends the opening of the devices in an orderly way.
    for number in SIGNALS:
        loop.add_signal_handler(number, main.cancel)
    # It takes long, and so do devices.
    imported = loop.run_in_executor(None, import_module, "daemon.api")
    try:
        async with contextlib.AsyncExitStack() as opened:
            service = await opened.enter_async_context(running_service(profile, data, keys_asked=door.keys))
            await imported
            server = await opened.enter_async_context(serving(service, listening, door))
            for number in SIGNALS:
                loop.add_signal_handler(number, server.handle_exit, number, None)
            # Not even now, or it would take longer at the end than all else does.
            gc.freeze()
            gc.enable()
            if on_ready is not None:
                on_ready(address_of(listening, door.tls))
            supervisor.tell(
                READY="1", STATUS=f"serving '{profile.name}' at {address_of(listening, door.tls)}"
            )
            try:
                await _until_end(server, service.rig, supervisor)
            finally:
                supervisor.tell(STOPPING="1", STATUS="stopping the axes")
    except asyncio.CancelledError:
        logger.info("ended before it was ready")
    finally:
        for number in SIGNALS:
            loop.remove_signal_handler(number)


async def _until_end(server: Server, rig: Rig, supervisor: Supervisor) -> None:
    """Return when the end is asked for; raises what ended a task that must not end, after which nothing is sure."""
    asked = asyncio.create_task(server.exit_asked.wait())
    feeding = asyncio.create_task(supervisor.feed(lambda: rig.hung))
    try:
        ended, _ = await asyncio.wait([asked, *rig.tasks], return_when=asyncio.FIRST_COMPLETED)
        for task in ended - {asked}:
            logger.critical(
                "'%s' has ended, which is an error in the program: the daemon ends", task.get_name()
            )
            task.result()
    finally:
        for task in (asked, feeding):
            task.cancel()


@contextlib.asynccontextmanager
async def serving(service: Service, listening: socket.socket, door: Door = LOCAL) -> AsyncIterator[Server]:
    """Answer requests to `service` on a bound socket; on leaving, the axes are stopped before all else."""
    from daemon.api import create_app  # FastAPI takes its time to import, and a port in use needs none of it

    config = uvicorn.Config(
        create_app(service, door.host_names),
        lifespan="off",
        log_config=None,
        access_log=False,
        ws_max_size=LARGEST_MESSAGE,
        ws_per_message_deflate=False,  # pictures are compressed already, and all else is small
        proxy_headers=door.proxy,
        ssl_certfile=None if door.tls is None else door.tls.certificate,
        ssl_keyfile=None if door.tls is None else door.tls.key,
    )
    server = Server(config, service)
    task = asyncio.create_task(server.serve(sockets=[listening]))
    task.add_done_callback(lambda _: server.exit_asked.set())
    try:
        yield server
    finally:
        server.handle_exit(signal.SIGTERM, None)
        drained = asyncio.create_task(asyncio.wait([task], timeout=GRACE))
        await service.halt()
        await drained
        server.hang_up()
        await task


def address_of(listening: socket.socket, tls: Tls | None = None) -> str:
    """Return the address at which a bound socket is reached."""
    scheme = "http" if tls is None else "https"
    host, port = listening.getsockname()[:2]
    return (
        f"{scheme}://[{host}]:{port}" if listening.family == socket.AF_INET6 else f"{scheme}://{host}:{port}"
    )
