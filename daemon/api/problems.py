"""Errors as RFC 9457 problem documents: one table from the exception trees to status, code and title."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from pydantic import BaseModel, Field
from pydantic_core import to_json
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from calib.documents import field_path
from calib.errors import CalibError, FormatError, ReadingsError
from daemon import errors as daemon
from drivers import errors as drivers

logger = logging.getLogger(__name__)

MEDIA_TYPE: Final = "application/problem+json"


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem. Programs go by `code`, which never changes its meaning."""

    status: int
    code: str
    title: str


PROBLEMS: Final[dict[type[Exception], Kind]] = {
    drivers.LimitError: Kind(422, "limit_exceeded", "The target is outside the axis's limits"),
    drivers.NotHomedError: Kind(409, "not_homed", "An axis is not homed"),
    drivers.AxisBusyError: Kind(409, "axis_busy", "The axis is already moving"),
    drivers.MotionStoppedError: Kind(409, "motion_stopped", "A stop ended the motion"),
    drivers.MotionError: Kind(409, "motion_failed", "The axis did not reach its target"),
    drivers.DeviceFaultError: Kind(409, "device_fault", "A device reports a fault"),
    drivers.DeviceLostError: Kind(503, "device_lost", "A device is lost"),
    drivers.DeviceTimeoutError: Kind(503, "device_timeout", "A device did not finish in time"),
    drivers.DriverError: Kind(503, "device_error", "A device cannot do this"),
    ReadingsError: Kind(422, "readings_invalid", "The readings do not fit the calibration"),
    FormatError: Kind(409, "calibration_damaged", "The stored calibration cannot be read"),
    CalibError: Kind(409, "calibration_unusable", "The calibration cannot be applied"),
    daemon.UnknownAxisError: Kind(404, "unknown_axis", "There is no such axis"),
    daemon.StopLatchedError: Kind(409, "stop_latched", "A stop waits to be acknowledged"),
    daemon.RigFaultError: Kind(409, "rig_fault", "The rig is in fault"),
    daemon.TimeNotCoveredError: Kind(404, "time_not_covered", "There are no readings of that time"),
    daemon.StandstillError: Kind(503, "standstill_unconfirmed", "A standstill could not be confirmed"),
    daemon.LeaseRequiredError: Kind(401, "lease_required", "Moving needs the motion lease"),
    daemon.LeaseEndedError: Kind(403, "lease_ended", "The lease is over"),
    daemon.LeaseHeldError: Kind(409, "lease_held", "Somebody else holds the motion lease"),
    daemon.UnknownRunError: Kind(404, "unknown_run", "There is no such run"),
    daemon.RunActiveError: Kind(409, "run_active", "A run is under way"),
    daemon.RunStateError: Kind(409, "run_state", "The run's state does not allow this"),
    daemon.ProfileChangedError: Kind(409, "profile_changed", "The run was taken with another profile"),
    daemon.NotCalibratedError: Kind(409, "not_calibrated", "Nothing is calibrated"),
    daemon.CalibrationMismatchError: Kind(409, "calibration_mismatch", "The calibration is of another rig"),
    daemon.StaleReadingError: Kind(503, "reading_stale", "The latest reading is too old"),
    daemon.LensUnknownError: Kind(409, "lens_unknown", "The camera's lens is not known"),
    daemon.UnknownCameraError: Kind(404, "unknown_camera", "There is no such camera"),
    daemon.UnknownViewError: Kind(404, "unknown_view", "The run has no such view"),
    daemon.SessionUnreadableError: Kind(409, "session_unreadable", "The run's views cannot be read"),
    daemon.UnknownCalibrationError: Kind(404, "unknown_calibration", "There is no such calibration"),
    daemon.UnknownExportError: Kind(404, "unknown_export", "There is no such export"),
    daemon.ExportUnavailableError: Kind(
        409, "export_unavailable", "The calibration cannot be had in this form"
    ),
    daemon.IdempotencyConflictError: Kind(422, "idempotency_conflict", "The key was another request's"),
    daemon.IdempotencyInProgressError: Kind(
        409, "idempotency_in_progress", "The first request of this key is under way"
    ),
    daemon.IdempotencyUnknownError: Kind(
        409, "idempotency_unknown", "How the first request of this key ended is not known"
    ),
    daemon.KeyRequiredError: Kind(401, "key_required", "A key is needed"),
    daemon.KeyUnknownError: Kind(401, "key_unknown", "The key is not known"),
    daemon.RoleRequiredError: Kind(403, "role_required", "The key's role does not allow this"),
    daemon.StoreError: Kind(503, "store_unavailable", "The database cannot be used"),
}
INVALID: Final = Kind(422, "invalid_request", "The request is not what this address takes")
HTTP_PROBLEMS: Final = {
    404: Kind(404, "not_found", "There is nothing at this address"),
    405: Kind(405, "method_not_allowed", "This address does not take this method"),
}
BODY_TOO_LARGE: Final = Kind(413, "body_too_large", "The request's body is too large")
FOREIGN_PAGE: Final = Kind(403, "foreign_page", "A page from elsewhere may not do this")
HOST_UNKNOWN: Final = Kind(421, "host_unknown", "This daemon is not known by that name")
TOO_MANY_COMMANDS: Final = Kind(429, "too_many_commands", "Too many commands wait for their answers")
INTERNAL: Final = Kind(500, "internal_error", "The daemon has failed")


class Problem(BaseModel):
    """What went wrong, as RFC 9457 says it."""

    type: str = Field(
        description="A name of the kind of problem.", examples=["urn:activecam:problem:not_homed"]
    )
    code: str = Field(description="The same for programs; stable.", examples=["not_homed"])
    title: str = Field(examples=["An axis is not homed"])
    status: int = Field(examples=[409])
    detail: str = Field(
        description="What happened and what to do, in one sentence.",
        examples=["axis 'pan' is not homed: home it before moving it to a position"],
    )
    instance: str = Field(description="The address that was asked.", examples=["/api/v1/axes/pan/move"])


class InvalidField(BaseModel):
    """A field of a request that is wrong."""

    field: str = Field(examples=["body.readings[0]"])
    message: str


class InvalidRequest(Problem):
    """A problem with the request itself, field by field."""

    errors: list[InvalidField]


def kind_of(error: Exception) -> Kind:
    """Return the kind of problem that `error` is, by its nearest class in the table."""
    return next((PROBLEMS[cls] for cls in type(error).__mro__ if cls in PROBLEMS), INTERNAL)


def document(kind: Kind, detail: str, instance: str) -> dict[str, Any]:
    """Return a problem document."""
    return {
        "type": f"urn:activecam:problem:{kind.code}",
        "code": kind.code,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "instance": instance,
    }


def answers(*errors: type[Exception]) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI responses of an operation that may raise `errors`, and of a wrong request."""
    codes: dict[int, list[str]] = {422: [INVALID.code]}
    for kind in (PROBLEMS[error] for error in errors):
        codes.setdefault(kind.status, []).append(kind.code)
    responses: dict[int | str, dict[str, Any]] = {}
    for status, names in sorted(codes.items()):
        model = InvalidRequest if names == [INVALID.code] else Problem
        schema = {"$ref": f"#/components/schemas/{model.__name__}"}
        responses[status] = {
            "description": f"{HTTPStatus(status).phrase}: {', '.join(f'`{name}`' for name in names)}",
            "content": {MEDIA_TYPE: {"schema": schema}},
        }
    return responses


def install(app: FastAPI) -> None:
    """Let `app` answer every error with a problem document."""
    for tree in (drivers.DriverError, CalibError, daemon.DaemonError):
        app.add_exception_handler(tree, _answer_known)
    app.add_exception_handler(RequestValidationError, _answer_invalid)
    app.exception_handler(WebSocketRequestValidationError)(_refuse_invalid)
    app.add_exception_handler(HTTPException, _answer_http)
    app.add_exception_handler(Exception, _answer_unexpected)


async def answer(request: Request, error: Exception) -> Response:
    """Return what `error` is answered with."""
    if isinstance(error, RequestValidationError):
        return await _answer_invalid(request, error)
    if isinstance(error, HTTPException):
        return await _answer_http(request, error)
    if isinstance(error, drivers.DriverError | CalibError | daemon.DaemonError):
        return await _answer_known(request, error)
    return await _answer_unexpected(request, error)


def respond(request: HTTPConnection, kind: Kind, detail: str, headers: Any = None, **more: Any) -> Response:
    """Return the answer that is a problem document; to a WebSocket, in place of its acceptance."""
    content = document(kind, detail, request.url.path) | more
    return Response(to_json(content), kind.status, headers, MEDIA_TYPE)


async def _answer_known(request: Request, error: Exception) -> Response:
    kind = kind_of(error)
    # RFC 9110 wants a 401 to say how to be let in.
    headers = {"WWW-Authenticate": "Lease"} if kind.status == HTTPStatus.UNAUTHORIZED else None
    return respond(request, kind, str(error), headers)


async def _refuse_invalid(socket: WebSocket, error: WebSocketRequestValidationError) -> None:
    await socket.send_denial_response(_invalid(socket, [_invalid_field(e) for e in error.errors()]))


async def _answer_invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    wrong = [_invalid_field(e) for e in error.errors()]
    if wrong[0]["field"] == "body" and "json" not in request.headers.get("content-type", ""):
        # The commonest slip with curl, which says that what it sends is a form.
        wrong = [{"field": "body", "message": "Send JSON, with the header Content-Type: application/json"}]
    return _invalid(request, wrong)


def invalid(errors: Sequence[Mapping[str, Any]], instance: str) -> dict[str, Any]:
    """Return the problem document on what pydantic finds wrong with a message."""
    wrong = [_invalid_field(error) for error in errors]
    wrong = [{**each, "field": each["field"] or "message"} for each in wrong]
    return document(INVALID, _in_words(wrong), instance) | {"errors": wrong}


def _invalid(request: HTTPConnection, wrong: list[dict[str, str]]) -> Response:
    return respond(request, INVALID, _in_words(wrong), errors=wrong)


def _in_words(wrong: list[dict[str, str]]) -> str:
    more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
    return f"{wrong[0]['field']}: {wrong[0]['message']}{more}"


def _invalid_field(error: Mapping[str, Any]) -> dict[str, str]:
    if error["type"] == "json_invalid" and error["loc"]:
        where, why = error["loc"][-1], error["ctx"]["error"]
        return {"field": "body", "message": f"Not JSON at character {where}: {why}"}
    return {"field": field_path(tuple(error["loc"])), "message": error["msg"]}


async def _answer_http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if (
        error.status_code == HTTPStatus.BAD_REQUEST
    ):  # what FastAPI says of bytes that are no text, let alone JSON
        return _invalid(
            request, [{"field": "body", "message": "Not JSON: it cannot be read as text in UTF-8"}]
        )
    kind = (
        BODY_TOO_LARGE if error.status_code == BODY_TOO_LARGE.status else HTTP_PROBLEMS.get(error.status_code)
    )
    if kind is None:
        phrase = HTTPStatus(error.status_code).phrase
        kind = Kind(error.status_code, phrase.lower().replace(" ", "_").replace("-", "_"), phrase)
    return respond(request, kind, f"{kind.title}: {request.method} {request.url.path}", error.headers)


async def _answer_unexpected(request: Request, error: Exception) -> Response:
    logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return respond(request, INTERNAL, "an error in the program, which its log describes: please report it")
