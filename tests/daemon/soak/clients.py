"""Clients of all kinds, which come, take a while, and leave in the middle of whatever they were told."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Awaitable, Callable

import httpx
from websockets.asyncio.client import connect

Client = Callable[["Crowd"], Awaitable[None]]


class Crowd:
    """Whoever asks the daemon at `address`, from `present` until its end."""

    def __init__(self, address: str, rng: random.Random) -> None:
        self.address = address
        self.rng = rng
        self.http = httpx.AsyncClient(base_url=f"{address}/api/v1", timeout=60)
        self.runs: dict[str, int] = {}
        """How many runs ended how."""
        self.poses = self.visits = 0
        self.run: str | None = None

    @contextlib.asynccontextmanager
    async def present(self) -> AsyncIterator[None]:
        """Let all kinds of clients ask, each again and again."""
        async with asyncio.TaskGroup() as tasks:
            clients = [tasks.create_task(self._again_and_again(client)) for client in CLIENTS]
            try:
                yield
            finally:
                for client in clients:
                    client.cancel()

    async def _again_and_again(self, client: Client) -> None:
        while True:
            await client(self)

    def a_while(self) -> float:
        """Return seconds: mostly few."""
        return self.rng.expovariate(1.0)


async def calibrate(crowd: Crowd) -> None:
    """Run the procedure; pause, cancel or stop it now and then."""
    begun = await crowd.http.post("/runs", json={"owner": "soak"})
    if begun.status_code != 202:
        await crowd.http.post("/stop/acknowledge")
        await asyncio.sleep(0.1)
        return
    run = crowd.run = begun.json()["id"]
    if crowd.rng.random() < 0.3:
        await asyncio.sleep(crowd.a_while())
        await crowd.http.post(crowd.rng.choice([f"/runs/{run}/pause", f"/runs/{run}/cancel", "/stop"]))
        await crowd.http.post(f"/runs/{run}/resume")
    await crowd.http.get(f"/runs/{run}/events")  # which end with the run
    state = (await crowd.http.get(f"/runs/{run}")).json()["state"]
    crowd.runs[state] = crowd.runs.get(state, 0) + 1


async def poll(crowd: Crowd) -> None:
    """Ask for the pose, a hundred times a second."""
    answer = await crowd.http.get("/pose")
    crowd.poses += answer.status_code == 200
    await asyncio.sleep(0.01)


async def follow_poses(crowd: Crowd) -> None:
    """Read the pose stream for a while, and close it in order or break the connection."""
    async with connect(f"{crowd.address.replace('http', 'ws', 1)}/api/v1/pose/stream") as stream:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(crowd.a_while()):
                async for _ in stream:
                    pass
        crowd.visits += 1
        if crowd.rng.random() < 0.5:
            stream.transport.abort()


async def watch(crowd: Crowd) -> None:
    """Look at the live picture for a while."""
    await _read("/camera/stream.mjpg?fps=5", crowd)


async def follow_run(crowd: Crowd) -> None:
    """Follow the events of the run for a while."""
    if crowd.run is None:
        await asyncio.sleep(0.1)
    else:
        await _read(f"/runs/{crowd.run}/events", crowd)


async def move(crowd: Crowd) -> None:
    """Take the lease where there is none, jog, and go away without a word."""
    await asyncio.sleep(crowd.a_while())
    taken = await crowd.http.post("/lease", json={"owner": "soak", "ttl_s": 0.1})
    if taken.status_code == 200:
        await crowd.http.post(
            "/axes/pan/jog", json={"distance": 1.0}, headers={"X-Lease": taken.json()["token"]}
        )


async def _read(address: str, crowd: Crowd) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(crowd.a_while()), crowd.http.stream("GET", address) as answer:
            async for _ in answer.aiter_raw():
                pass
    crowd.visits += 1
    await asyncio.sleep(0.02)


CLIENTS: tuple[Client, ...] = (
    calibrate,
    poll,
    follow_poses,
    follow_poses,
    watch,
    follow_run,
    follow_run,
    move,
)
