"""The REST API, as FastAPI routes over a running service.

Its parts:

    app             all routes together
    guard           what no route gets to see;  observed  each request's id, log record and time
    gate            who is let in, by rules;  witness  what is written down of it;  security  what is described of it
    problems        errors as problem documents;  dependencies, bodies  what routes are given
    once            requests that are carried out once, however often they are sent
    rig, health, lease, axes, camera, runs, calibrations, exports, poses, pose_stream, metrics, session, audit
                    routes by what they are about;  *_documents  their larger answers
    reference       all of it as a page to read
"""

from daemon.api.app import create_app

__all__ = ["create_app"]
