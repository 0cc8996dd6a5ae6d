"""Errors as problem documents: every one of the trees', and those of HTTP itself."""

from collections.abc import AsyncIterator, Iterator

import httpx
import pytest

from calib import errors as calib
from daemon import errors as daemon
from daemon.api import create_app
from daemon.api.problems import INTERNAL, PROBLEMS, kind_of
from daemon.service import Service
from drivers import errors as drivers


def tree(root: type[Exception]) -> Iterator[type[Exception]]:
    yield root
    for child in root.__subclasses__():
        yield from tree(child)


INSIDE = {
    daemon.DaemonError,
    daemon.RigError,
    daemon.LeaseError,
    daemon.RunError,
    daemon.PoseError,
    daemon.IdempotencyError,
    daemon.TargetUnseenError,  # ends a run, whose `error` it becomes
    daemon.ExportError,
    daemon.BackupError,  # the command line alone makes backups
    daemon.AccessError,
    daemon.NoKeyError,  # as for ServeError
    daemon.KeyNameError,  # keys are made on the command line alone
    daemon.KeyExistsError,
    daemon.UnknownKeyError,
    daemon.ServeError,  # there is nobody yet to answer
    daemon.PrintError,  # the command line alone prints
}
"""Those that no request meets."""


@pytest.mark.parametrize("root", [drivers.DriverError, calib.CalibError, daemon.DaemonError])
def test_every_error_that_a_request_can_meet_is_in_the_table(root: type[Exception]) -> None:
    for error in set(tree(root)) - INSIDE:
        assert kind_of(error("a sentence")) is not INTERNAL, error


def test_a_code_means_one_thing() -> None:
    codes = [kind.code for kind in PROBLEMS.values()]
    assert len(set(codes)) == len(codes)
    for kind in PROBLEMS.values():
        assert 400 <= kind.status < 600
        assert kind.code.replace("_", "").isalpha()


def test_a_message_is_read_as_it_was_written() -> None:
    for error in tree(daemon.DaemonError):
        assert str(error("axis 'pan' is away")) == "axis 'pan' is away"


@pytest.mark.parametrize(
    ("method", "address", "status", "code"),
    [
        ("GET", "/nothing", 404, "not_found"),
        ("DELETE", "/pose", 405, "method_not_allowed"),
        ("GET", "/runs/none", 404, "unknown_run"),
        ("POST", "/runs/none/pause", 404, "unknown_run"),
        ("POST", "/runs/none/resume", 404, "unknown_run"),
        ("POST", "/runs/none/cancel", 404, "unknown_run"),
        ("GET", "/calibrations/none", 404, "unknown_calibration"),
        ("POST", "/pose", 422, "invalid_request"),
        ("POST", "/lease", 422, "invalid_request"),
        ("GET", "/camera/stream.mjpg?fps=0", 422, "invalid_request"),
    ],
)
async def test_http_has_problems_of_its_own(
    client: httpx.AsyncClient, method: str, address: str, status: int, code: str
) -> None:
    answer = await client.request(method, address)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert (problem["status"], problem["code"]) == (status, code)
    assert problem["instance"] == answer.request.url.path
    assert problem["title"]
    assert problem["detail"]
    if status == 405:
        assert "GET" in answer.headers["allow"]


@pytest.mark.parametrize(
    ("content_type", "body", "detail"),
    [
        ("application/x-www-form-urlencoded", b'{"owner": "anna"}', "Content-Type: application/json"),
        ("text/plain", b'{"owner": "anna"}', "Content-Type: application/json"),
        ("application/json", b'{"owner": ', "body: Not JSON at character 10"),
        ("application/json", b'{"owner": "\xff"}', "body: Not JSON: "),
        ("application/json", b'{"owner": "anna", "ttl": 5}', "body.ttl: Extra inputs"),
        ("application/json", b'{"owner": "anna", "ttl_s": -1}', "body.ttl_s: "),
        ("application/json", b'{"owner": "anna", "ttl_s": NaN}', "body.ttl_s: "),
    ],
)
async def test_a_body_that_is_wrong_is_told_how(
    client: httpx.AsyncClient, content_type: str, body: bytes, detail: str
) -> None:
    answer = await client.post("/lease", content=body, headers={"Content-Type": content_type})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert detail in answer.json()["detail"]


async def test_a_body_that_no_route_could_want_is_not_read_to_its_end(client: httpx.AsyncClient) -> None:
    sent = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal sent
        while True:
            sent += 1
            yield b" " * 2**20

    answer = await client.post("/pose", content=endless(), headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
    assert answer.headers["content-type"] == "application/problem+json"
    assert sent < 10


async def test_a_page_from_elsewhere_changes_nothing_but_may_stop(
    service: Service, client: httpx.AsyncClient
) -> None:
    elsewhere = {"Origin": "http://elsewhere.example"}
    for method, address in (("POST", "/runs"), ("POST", "/stop/acknowledge"), ("DELETE", "/lease")):
        answer = await client.request(method, address, headers=elsewhere)
        assert (answer.status_code, answer.json()["code"]) == (403, "foreign_page")
    assert service.runs.active is None
    assert (await client.get("/rig", headers=elsewhere)).status_code == 200
    assert (await client.post("/stop", headers=elsewhere)).status_code == 200
    assert (await client.post("/stop/acknowledge", headers={"Origin": "http://localhost"})).status_code == 200


async def test_an_error_in_the_program_is_logged_and_not_shown(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(*_: object) -> bytes:
        raise RuntimeError("the secret inside")

    monkeypatch.setattr(type(service.poses), "now", broken)
    transport = httpx.ASGITransport(create_app(service), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
        answer = await client.get("/pose")
    assert (answer.status_code, answer.json()["code"]) == (500, "internal_error")
    assert "secret" not in answer.text
    assert "the secret inside" in caplog.text


async def test_the_rest_of_the_rig_is_shown(service: Service, client: httpx.AsyncClient) -> None:
    assert (await client.get("/health")).json()["status"] == "ok"
    profile = (await client.get("/profile")).json()
    assert [axis["name"] for axis in profile["axes"]] == ["slide", "pan"]
    assert profile["procedure"]["sweeps"][1]["start"]["slide"] == 50.0
    assert "simulation" not in profile
    assert profile["target"]["kind"] == "circle_grid"
    metrics = (await client.get("http://localhost/metrics")).text
    assert 'activecam_axis_homed{axis="pan"} 0' in metrics
    await service.rig.home("pan")
    metrics = (await client.get("http://localhost/metrics")).text
    assert 'activecam_axis_homed{axis="pan"} 1' in metrics
    for line in metrics.splitlines():
        if not line.startswith("#"):
            float(line.rpartition(" ")[2])
