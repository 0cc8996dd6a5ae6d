"""A daemon that says what it takes whenever it is asked: a line of JSON for each line that it reads."""

import asyncio
import json
import os
import sys
import threading
from pathlib import Path

from daemon.server import address_of, bind, serving
from daemon.service import running_service
from tests.daemon.rigs import small_rig

MIB = 1024 * 1024


async def serve(folder: Path) -> None:
    """Serve the small rig, at twenty times its pace, until there is nothing more to read."""
    listening = bind("127.0.0.1", 0)
    profile = small_rig(folder, time_scale=20.0, positions=3)
    async with running_service(profile, folder / "data") as service, serving(service, listening):
        tell(address=address_of(listening))
        while await asyncio.to_thread(sys.stdin.readline):
            tell(**taken(), streams=service.streams.open)
    listening.close()


def taken() -> dict[str, float]:
    """Return what this process takes; the task that asks is in it each time.

    Threads of asyncio's own pool are left out, which begins them as they are needed, a few at most, and keeps them.
    """
    threads = [thread for thread in threading.enumerate() if not thread.name.startswith("asyncio_")]
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return {
        "rss_mib": pages * os.sysconf("SC_PAGE_SIZE") / MIB,
        "tasks": len(asyncio.all_tasks()),
        "threads": len(threads),
        "files": len(os.listdir("/proc/self/fd")),  # noqa: PTH208  names are enough
    }


def tell(**facts: object) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(serve(Path(sys.argv[1])))
