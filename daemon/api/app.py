"""The app: every route under /api/v1, described for OpenAPI, with problems for errors."""

from collections.abc import Collection
from typing import Any, Final

from fastapi import FastAPI
from fastapi.routing import APIRoute

from daemon.api import (
    audit,
    axes,
    calibrations,
    camera,
    camera_live,
    coverage,
    exports,
    health,
    judging,
    lease,
    live,
    metrics,
    page,
    plan,
    pose_stream,
    poses,
    problems,
    reference,
    rig,
    runs,
    session,
    views,
)
from daemon.api.camera_live import Packing
from daemon.api.gate import Gate
from daemon.api.guard import Guard
from daemon.api.live_state import LiveState
from daemon.api.observed import Observed
from daemon.api.rules import PREFIX, ROLES, ROLES_AT_ROOT, Rules
from daemon.api.security import describe_roles
from daemon.api.wrong_requests import forget_wrong_requests
from daemon.service import Service

API_VERSION: Final = "1.6.3"
"""Of the API, not of activecam: docs/reference/openapi.json is the description of this one."""

DESCRIPTION: Final = """
Calibrates a camera on motorised axes with the camera itself, and says where the camera is.

Metres, radians, seconds and pixels, except for what concerns an axis as such: readings, limits, moves and
jogs are in that axis's own reading unit. Times are RFC 3339 in UTC. A transform `target_from_source` takes
points of the source frame to the target frame. Errors are RFC 9457 problem documents; go by their `code`,
which is stable.

Beyond the daemon's own machine each request shows an API key, as `Authorization: Bearer KEY`, whose role allows it
(`x-role`): viewers read, operators move, stop, run and activate as well, admins also see who did. `GET /health`
needs none.

Whatever moves carries the token of the motion lease in the header `X-Lease`; `POST /stop` needs none.
Whatever changes something is refused to a browser's page of another address (403, `foreign_page`), but for a
stop; a body of more than 8 MiB is refused everywhere (413, `body_too_large`), and so is a request under a name
that the daemon was not told to be known by (421, `host_unknown`).
"""

TAGS: Final = [
    {"name": "pose", "description": "Where the camera is, and what it sees where."},
    {"name": "runs", "description": "Calibration runs: one at a time, each under its own lease."},
    {"name": "calibrations", "description": "What runs have found."},
    {"name": "motion", "description": "Moving axes by hand, and stopping them."},
    {"name": "lease", "description": "Who may move."},
    {"name": "camera", "description": "The live picture."},
    {"name": "rig", "description": "What there is, and how it is."},
    {"name": "session", "description": "Who asks, and browsers that have shown a key."},
    {"name": "audit", "description": "Who did what."},
]


def create_app(service: Service, host_names: Collection[str] = ()) -> FastAPI:
    """Return the ASGI app of `service`, which its caller opens and closes; `host_names` as for the `Guard`."""
    app = FastAPI(
        title="activecam",
        version=API_VERSION,
        summary="Where is the camera?",
        description=DESCRIPTION,
        openapi_url=f"{PREFIX}/openapi.json",
        openapi_tags=TAGS,
        # FastAPI's own pages load scripts from elsewhere, which a laboratory's network may not have.
        docs_url=None,
        redoc_url=None,
        generate_unique_id_function=_operation_id,
    )
    app.state.service = service
    app.state.live_state = LiveState(service)
    app.state.packing = Packing()
    # Routes are tried in this order, so that the pose, which is asked most, comes first.
    for part in (
        poses,
        pose_stream,
        health,
        rig,
        live,
        lease,
        axes,
        camera,
        camera_live,
        plan,
        runs,
        views,
        judging,
        coverage,
        calibrations,
        exports,
        session,
        audit,
    ):
        app.include_router(part.router, prefix=PREFIX)
    app.include_router(metrics.router)
    app.include_router(reference.router)
    app.include_router(page.router)
    problems.install(app)
    app.add_middleware(Gate, service=service, rules=Rules(ROLES, ROLES_AT_ROOT))
    app.add_middleware(Guard, host_names=host_names)
    app.add_middleware(Observed, prefix=PREFIX)
    _describe_problems(app)
    return app


def _operation_id(route: APIRoute) -> str:
    return route.name


def _describe_problems(app: FastAPI) -> None:
    """Add the problem documents, which routes refer to by name, and the roles to the OpenAPI description."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = describe()
            schemas = document["components"]["schemas"]
            for model in (problems.Problem, problems.InvalidField, problems.InvalidRequest):
                reference = "#/components/schemas/{model}"
                schema = model.model_json_schema(ref_template=reference)
                schema.pop("$defs", None)
                schemas[model.__name__] = schema
            describe_roles(document)
            forget_wrong_requests(document)
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]  # the way that FastAPI documents
