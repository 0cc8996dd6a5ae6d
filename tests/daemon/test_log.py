"""The log: a line a record, what it is about as fields, a request's id in all of them, and nothing secret."""

import io
import json
import logging
from collections.abc import Iterator
from typing import Any, cast

import httpx
import pytest

from daemon.operation.log_fields import log_fields
from daemon.operation.log_format import OURS, JsonLines, LogFormat, LogLevel, TextLines, log_to_stderr
from daemon.rig import Devices
from daemon.service import Service
from drivers.simulated import SimulatedController
from tests.daemon.motions import home_all


@pytest.fixture
def lines() -> Iterator[io.StringIO]:
    """What is logged from debug on, as JSON lines."""
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(JsonLines())
    root = logging.getLogger()
    root.addHandler(handler)
    levels = {name: logging.getLogger(name).level for name in OURS}
    for name in OURS:
        logging.getLogger(name).setLevel(logging.DEBUG)
    yield stream
    root.removeHandler(handler)
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)


def records(lines: io.StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in lines.getvalue().splitlines()]


def record(message: str, **extra: object) -> logging.LogRecord:
    made = logging.makeLogRecord(
        {"msg": message, "levelname": "WARNING", "name": "daemon.lease", "created": 0.5}
    )
    vars(made).update(extra)
    return made


def test_a_record_is_a_line_that_says_what_it_is_about() -> None:
    with log_fields(run="20260314-092653-5f3a1c"), log_fields(axis="pan"):
        text = TextLines().format(record("it\nis \x1b[31m late", status=409))
        document = json.loads(JsonLines().format(record("größer", status=409)))
    assert text == (
        "1970-01-01T00:00:00.500Z WARNING it\\nis \\x1b[31m late [run=20260314-092653-5f3a1c axis=pan status=409]"
    )
    assert document == {
        "time": "1970-01-01T00:00:00.500Z",
        "level": "warning",
        "logger": "daemon.lease",
        "message": "größer",
        "run": "20260314-092653-5f3a1c",
        "axis": "pan",
        "status": 409,
    }
    assert TextLines().format(record("done")).endswith("WARNING done")


def test_a_traceback_follows_its_line_or_is_in_it() -> None:
    try:
        int("no")
    except ValueError as error:
        failed = record("failed", exc_info=(ValueError, error, error.__traceback__))
    assert TextLines().format(failed).splitlines()[1] == "Traceback (most recent call last):"
    written = JsonLines().format(failed)
    assert "\n" not in written
    assert json.loads(written)["exception"].endswith("invalid literal for int() with base 10: 'no'")


def test_libraries_are_not_heard_at_debug(capsys: pytest.CaptureFixture[str]) -> None:
    """websockets writes every header at that level, keys among them."""
    root, before = logging.getLogger(), logging.getLogger().handlers[:]
    try:
        log_to_stderr(LogFormat.JSON, LogLevel.DEBUG)
        logging.getLogger("websockets.server").debug("< Authorization: Bearer secret")
        logging.getLogger("uvicorn.error").info('"WebSocket /pose/stream?key=secret" [accepted]')
        logging.getLogger("daemon.api").debug("seen")
    finally:
        root.handlers[:] = before
        root.setLevel(logging.WARNING)
        for name in (*OURS, "uvicorn"):
            logging.getLogger(name).setLevel(logging.NOTSET)
    assert [json.loads(line)["message"] for line in capsys.readouterr().err.splitlines()] == ["seen"]


async def test_all_that_a_request_does_has_its_id(
    service: Service, client: httpx.AsyncClient, lines: io.StringIO
) -> None:
    made = await client.get("/pose")
    given = await client.get("/pose", headers={"X-Request-ID": "trace-1"})
    strange = await client.get("/pose", headers={"X-Request-ID": "two words"})
    assert given.headers["x-request-id"] == "trace-1"
    assert len(made.headers["x-request-id"]) == 16
    assert strange.headers["x-request-id"] != "two words"
    begun = await client.post("/runs", json={}, headers={"X-Request-ID": "trace-2"})
    await service.runs.wait(begun.json()["id"])
    of_run = [entry for entry in records(lines) if entry.get("run") == begun.json()["id"]]
    assert of_run
    assert {entry["request"] for entry in of_run} == {"trace-2"}
    answered = [entry for entry in records(lines) if entry["logger"] == "daemon.api.observed"]
    assert [(entry["level"], entry["message"], entry["status"]) for entry in answered] == [
        ("debug", "GET /api/v1/pose: 409", 409),
        ("debug", "GET /api/v1/pose: 409", 409),
        ("debug", "GET /api/v1/pose: 409", 409),
        ("info", "POST /api/v1/runs: 202", 202),
    ]
    assert all(entry["duration_ms"] > 0 for entry in answered)


async def test_a_motion_that_fails_names_its_axis(
    service: Service, client: httpx.AsyncClient, devices: Devices, lines: io.StringIO
) -> None:
    await home_all(service.rig)
    cast(SimulatedController, devices.controllers["stage"]).inject("stall", "slide")
    headers = {"X-Lease": service.leases.acquire("anna", "", 60.0).token, "X-Request-ID": "far"}
    await client.post("/axes/slide/move?wait=true", json={"target": 90}, headers=headers)
    [failed] = [entry for entry in records(lines) if entry["logger"] == "daemon.client_motion"]
    assert (failed["axis"], failed["request"]) == ("slide", "far")


async def test_a_failure_is_answered_and_logged_with_its_id(
    service: Service, client: httpx.AsyncClient, lines: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> bytes:
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setattr(service.poses, "now", fail)
    answer = await client.get("/pose", headers={"X-Request-ID": "trace-3"})
    assert (answer.status_code, answer.json()["code"]) == (500, "internal_error")
    assert answer.headers["x-request-id"] == "trace-3"
    [failed] = [entry for entry in records(lines) if "exception" in entry]
    assert failed["request"] == "trace-3"
    assert "a fault of ours" in failed["exception"]


async def test_nothing_secret_is_logged(client: httpx.AsyncClient, lines: io.StringIO) -> None:
    secrets = ["an-api-key", "an-idempotency-key", "a-session-cookie", "a-query"]
    headers = {"Authorization": f"Bearer {secrets[0]}", "Idempotency-Key": secrets[1], "Cookie": secrets[2]}
    lease = (await client.post("/lease", json={"owner": "anna"}, headers=headers)).json()
    shown = headers | {"X-Lease": lease["token"]}
    await client.post(f"/axes/pan/home?key={secrets[3]}", params={"wait": True}, headers=shown)
    await client.post("/axes/pan/home", json="no object", headers=shown)
    await client.post("/axes/pan/jog", json={"distance": 1e9}, headers=headers | {"X-Lease": "a wrong lease"})
    await client.delete("/lease", headers={"X-Lease": lease["token"]})
    written = lines.getvalue()
    assert "/axes/pan/home" in written
    for secret in [*secrets, lease["token"], "a wrong lease"]:
        assert secret not in written
