"""The server of `pose_rate`, in a process of its own: the daemon as `serve` runs it, and one route more.

`python -m benchmarks.pose_server FOLDER` serves the paper's simulated table, with a calibration
solved from points, and prints its address. The route answers with a constant that it is given.
"""

import asyncio
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

from fastapi import Request, Response

from benchmarks.paper_rig import paper_profile, session_of_points
from calib import Calibration, solve
from daemon.api import poses, rules
from daemon.server import serve
from daemon.store import CalibrationRecord, RunRecord, RunState, Store

POSE = "/api/v1/pose"
CONSTANT = "/api/v1/pose/constant"


def main(folder: Path) -> None:
    """Serve until SIGTERM."""
    asyncio.run(store_calibration(folder, solve(session_of_points(views=22, noise_px=0.1))))
    _add_constant_route()
    serve(paper_profile(), folder, port=0, on_ready=lambda address: print(address, flush=True))


async def store_calibration(folder: Path, calibration: Calibration) -> None:
    """Store a calibration as a run would that has succeeded, so that the daemon starts with it."""
    store, now = await Store.open(folder), datetime.now(UTC)
    run = RunRecord("run", RunState.RUNNING, "paper-table", "{}", "sessions/run", "benchmark", "", now, now)
    record = CalibrationRecord(
        "calibration", now, calibration.method, True, run.id, calibration.model_dump_json()
    )
    try:
        await store.add_run(run)
        await store.change_run(run.id, RunState.SUCCEEDED, calibration=record)
    finally:
        await store.close()


def _add_constant_route() -> None:
    """Let the product's own router answer with a constant, in this process alone.

    The route stands next to that of `GET /pose` and is of its form, so that finding and calling it costs
    the same; what differs is where the answer comes from.
    """
    constant = b"{}"

    async def get_constant(request: Request) -> Response:  # noqa: ARG001 the form of GET /pose
        return Response(constant, media_type="application/json")

    async def set_constant(request: Request) -> Response:
        nonlocal constant
        constant = await request.body()
        return Response(json.dumps({"bytes": len(constant)}), media_type="application/json")

    path = CONSTANT.removeprefix("/api/v1")
    rules.ROLES |= {f"GET {path}": rules.VIEWER, f"POST {path}": rules.VIEWER}
    routes = poses.router.routes
    poses.router.post(path, include_in_schema=False)(set_constant)
    poses.router.get(path, include_in_schema=False)(get_constant)
    routes.insert(1, routes.pop())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
