"""A calibrated rig that is served from a thread of its own, for clients that ask and wait."""

import asyncio
import contextlib
import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from daemon.access.keys import make_key
from daemon.access.roles import Role
from daemon.server import address_of, bind, serving
from daemon.service import Service, running_service
from daemon.store import Store
from tests.daemon.rigs import small_rig


@dataclass(frozen=True)
class Served:
    """A service in another thread's loop, where it is reached, and the keys of each role that it asks for, if any."""

    address: str
    service: Service
    loop: asyncio.AbstractEventLoop
    secrets: dict[Role, str]
    run: str
    """The run that calibrated it."""

    def state(self) -> tuple[object, ...]:
        """Return what requests change; not when keys were used, which is written down of those refused as well."""

        async def read() -> tuple[object, ...]:
            service = self.service
            return (
                service.leases.current,
                service.rig.latch.engaged,
                service.rig.snapshot.readings,
                await service.runs.list(),
                service.poses.calibration_id,
                await service.access.book.read(),
                [replace(key, last_used_at=None) for key in await service.store.keys.all()],
            )

        return asyncio.run_coroutine_threadsafe(read(), self.loop).result(60)

    def free_to_move(self) -> None:
        """End whatever run and lease the questions before have begun."""

        async def free() -> None:
            await self.service.runs.close()
            self.service.leases.close()
            self.service.rig.acknowledge_stop()

        asyncio.run_coroutine_threadsafe(free(), self.loop).result(60)


@contextlib.contextmanager
def served(folder: Path, *, keys_asked: bool) -> Iterator[Served]:
    """Serve the small rig with what is stored in `folder`."""
    over = asyncio.Event()
    begun: queue.Queue[Served] = queue.Queue()
    listening = bind("127.0.0.1", 0)

    async def serve() -> None:
        secrets = await _made(folder / "data") if keys_asked else {}
        async with running_service(small_rig(folder), folder / "data", keys_asked=keys_asked) as service:
            run = await service.runs.wait((await service.runs.start()).id)
            async with serving(service, listening):
                address = address_of(listening)
                begun.put(Served(address, service, asyncio.get_running_loop(), secrets, run.id))
                await over.wait()

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    rig = begun.get(timeout=60)
    yield rig
    rig.loop.call_soon_threadsafe(over.set)
    thread.join()
    listening.close()


async def _made(data: Path) -> dict[Role, str]:
    """Return a new key of each role, which the rig of `data` knows."""
    made = {role: make_key(role.value, role) for role in Role}
    store = await Store.open(data)
    for _, key in made.values():
        await store.keys.add(key)
    await store.close()
    return {role: secret for role, (secret, _) in made.items()}
