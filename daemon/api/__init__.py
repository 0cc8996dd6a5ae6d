"""The REST API, as FastAPI routes over a running service.

Its parts:

    app             all routes together
    guard           what no route gets to see;  observed  each request's id, log record and time
    gate            who is let in, by rules;  witness  what is written down of it;  security  what is described of it
    problems        errors as problem documents;  wrong_requests  where a request may be one
    dependencies, bodies  what routes are given
    once            requests that are carried out once, however often they are sent
    rig, health, lease, axes, camera, runs, coverage, calibrations, exports, poses, metrics, session, audit
                    routes by what they are about;  *_documents  their larger answers
    live, live_state, relay
                    the page's socket, what it tells, and how a command over it is a request as any other
    pose_stream, camera_live, sockets
                    the other sockets, and what all of them have in common
    page            the technician's page, which is in daemon/page
    reference       all of it as a page to read
"""

from daemon.api.app import create_app

__all__ = ["create_app"]
