"""The REST API, as FastAPI routes over a running service.

Its parts:

    app             all routes together
    guard           what no route gets to see
    problems        errors as problem documents;  dependencies, bodies  what routes are given
    rig, lease, axes, camera, runs, calibrations, poses, pose_stream, metrics
                    routes by what they are about;  *_documents  their larger answers
    reference       all of it as a page to read
"""

from daemon.api.app import create_app

__all__ = ["create_app"]
