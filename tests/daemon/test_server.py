"""The daemon on a real socket: streams, shutdowns, and what a kill leaves behind."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from calib import load_session
from daemon.errors import ServeError
from daemon.operation.supervisor import Supervisor
from daemon.rig import make_devices
from daemon.server import Server, _until_end, address_of, bind, serving
from daemon.service import Service, running_service
from drivers.errors import MotionStoppedError
from tests.daemon.motions import home_all, until
from tests.daemon.rigs import small_rig, write_profile

DAEMON = """
import sys
from pathlib import Path
from daemon.profile import load_profile
from daemon.server import serve
profile, data = load_profile(sys.argv[1]), Path(sys.argv[2])
serve(profile, data, port=0, on_ready=lambda address: print(address, flush=True))
"""


async def read_events(client: httpx.AsyncClient, run: str, last: int | None = None) -> list[dict[str, Any]]:
    """Return a run's events as a browser would read them."""
    events = []
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    async with client.stream("GET", f"/runs/{run}/events", headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        fields: dict[str, str] = {}
        async for line in answer.aiter_lines():
            if line:
                key, _, value = line.partition(": ")
                fields[key] = value
                continue
            if "data" not in fields:
                continue  # a sign of life in between
            event = json.loads(fields["data"])
            assert fields["id"] == str(event["sequence"])
            assert fields["event"] == event["type"]
            events.append(event)
            fields = {}
    return events


async def test_events_come_in_order_and_go_on_where_a_client_left_off(http: httpx.AsyncClient) -> None:
    begun = await http.post("/runs", json={"owner": "anna", "note": "first light"})
    assert begun.status_code == 202
    run = begun.json()
    assert begun.headers["location"] == f"/api/v1/runs/{run['id']}"
    assert run["state"] == "running"
    events = await read_events(http, run["id"])
    assert [event["sequence"] for event in events] == list(range(1, len(events) + 1))
    assert events[0]["type"] == "state"
    assert [event["type"] for event in events].count("finished") == 1
    assert events[-1]["type"] == "finished"
    assert events[-1]["state"] == "succeeded"
    assert await read_events(http, run["id"], last=events[-3]["sequence"]) == events[-2:]
    finished = (await http.get(f"/runs/{run['id']}")).json()
    assert (finished["state"], finished["owner"]) == ("succeeded", "anna")
    assert (await http.get("/runs")).json() == [finished]
    missing = await http.get("/runs/none/events")
    assert (missing.status_code, missing.json()["code"]) == (404, "unknown_run")


async def test_a_run_is_paused_resumed_and_cancelled(http: httpx.AsyncClient, service: Service) -> None:
    run = (await http.post("/runs", json={})).json()["id"]
    second = await http.post("/runs", json={})
    assert (second.status_code, second.json()["code"]) == (409, "run_active")
    early = await http.post(f"/runs/{run}/resume")
    assert (early.status_code, early.json()["code"]) == (409, "run_state")
    assert (await http.post(f"/runs/{run}/pause")).status_code == 202
    async for event in service.runs.events(run):
        if event.type == "state" and event.state == "paused":
            break
    assert (await http.get(f"/runs/{run}")).json()["state"] == "paused"
    assert (await http.post(f"/runs/{run}/resume")).status_code == 202
    cancelled = await http.post(f"/runs/{run}/cancel")
    assert (cancelled.status_code, cancelled.json()["state"]) == (200, "cancelled")
    first = await service.rig.fresh_snapshot(service.rig.clock.now())
    second_look = await service.rig.fresh_snapshot(service.rig.clock.now())
    assert not first.moving
    assert first.readings == second_look.readings
    over = await http.post(f"/runs/{run}/cancel")
    assert (over.status_code, over.json()["code"]) == (409, "run_state")


async def test_the_pose_streams_with_the_axes(service: Service, address: str) -> None:
    stream = f"{address.replace('http', 'ws')}/api/v1/pose/stream"
    async with connect(stream) as socket_:
        assert json.loads(await socket_.recv())["code"] == "not_calibrated"
        run = await service.runs.start()
        await service.runs.wait(run.id)
        first = json.loads(await socket_.recv())
        while first.get("code"):  # what was in the way while the run went on
            first = json.loads(await socket_.recv())
        assert first["calibration_id"] == service.poses.calibration_id
        move = asyncio.create_task(service.rig.move({"pan": 3.0}))
        poses = [first]
        while poses[-1]["readings"][1] != 3.0:
            poses.append(json.loads(await socket_.recv()))
        await move
        times = [pose["timestamp"] for pose in poses]
        assert times == sorted(times)
    while service.streams.open:  # the stream ends with the client
        await service.rig.changed.wait()


async def test_a_page_from_elsewhere_gets_no_stream(address: str) -> None:
    stream = f"{address.replace('http', 'ws')}/api/v1/pose/stream"
    with pytest.raises(InvalidStatus):
        await connect(stream, origin="http://elsewhere.example")  # type: ignore[arg-type]
    async with connect(stream, origin=address) as socket_:  # type: ignore[arg-type]
        assert json.loads(await socket_.recv())["status"] == 409


async def test_the_picture_is_live(http: httpx.AsyncClient) -> None:
    answer = await http.get("/camera/frame.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture.shape == (360, 480)
    parts = 0
    async with http.stream("GET", "/camera/stream.mjpg", params={"fps": 60}) as stream:
        async for chunk in stream.aiter_bytes():
            parts += chunk.count(b"\xff\xd8\xff")
            if parts >= 3:
                break


@pytest.fixture
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clients that take their answers are given the time for it on any machine."""
    monkeypatch.setattr("daemon.server.FAREWELL", 60.0)
    monkeypatch.setattr("daemon.server.GRACE", 60.0)


@pytest.mark.usefixtures("unhurried")
async def test_open_streams_do_not_hold_up_the_end(service: Service) -> None:
    listening = bind("127.0.0.1", 0)
    address = address_of(listening)
    async with httpx.AsyncClient(base_url=f"{address}/api/v1", timeout=30) as client:
        async with serving(service, listening) as server:
            run = (await client.post("/runs", json={})).json()["id"]
            events = asyncio.create_task(read_events(client, run))
            video = client.stream("GET", "/camera/stream.mjpg")
            pictures = (await video.__aenter__()).aiter_bytes()
            await anext(pictures)
            pose = await connect(f"{address.replace('http', 'ws')}/api/v1/pose/stream")
            await pose.recv()
        assert server.exit_asked.is_set()
        assert all(event["type"] != "finished" or event["state"] == "interrupted" for event in await events)
        async for _ in pictures:
            pass
        await video.__aexit__(None, None, None)
        async for _ in pose:
            pass
        assert pose.close_code == 1001
    listening.close()
    assert service.runs.active is None
    assert not service.rig.snapshot.moving
    assert service.streams.open == 0


@pytest.mark.usefixtures("unhurried")
async def test_a_stream_says_why_it_ends_however_soon_the_server_does(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Server, "main_loop", lambda server: server.exit_asked.wait())
    with bind("127.0.0.1", 0) as listening:
        async with serving(service, listening):
            pose = await connect(f"{address_of(listening).replace('http', 'ws')}/api/v1/pose/stream")
            await pose.recv()
        await pose.wait_closed()
    assert pose.close_code == 1001


async def test_clients_that_read_nothing_do_not_hold_up_the_end(
    service: Service, caplog: pytest.LogCaptureFixture
) -> None:
    half = b"POST /api/v1/pose HTTP/1.1\r\nHost: [::1]\r\nContent-Type: application/json\r\nContent-Length: 99\r\n\r\n{"
    video = b"GET /api/v1/camera/stream.mjpg?fps=60 HTTP/1.1\r\nHost: [::1]\r\n\r\n"
    with bind("127.0.0.1", 0) as listening, socket.socket() as sender, socket.socket() as viewer:
        viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        async with serving(service, listening) as server:
            for client, request in ((sender, half), (viewer, video)):
                await asyncio.to_thread(client.connect, listening.getsockname())
                client.sendall(request)
            while not (service.streams.open and len(server.server_state.tasks) == 2):
                await service.rig.changed.wait()
    assert not service.streams.open
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


async def test_an_error_in_the_program_ends_it_with_axes_that_stand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = small_rig(
        tmp_path, time_scale=1, velocity=20
    )  # the motion lasts for seconds of the machine's time
    devices = make_devices(profile)

    def fail(*_: object) -> None:
        raise ZeroDivisionError("a fault of ours")

    async with running_service(profile, tmp_path / "data", devices) as service:
        rig = service.rig
        await home_all(rig)
        with bind("127.0.0.1", 0) as listening:
            async with serving(service, listening) as server:
                moving = asyncio.create_task(rig.move({"slide": 90.0}))
                await until(rig, lambda snapshot: snapshot.moving)
                monkeypatch.setattr(rig._controllers[0], "_publish", fail)
                with pytest.raises(ZeroDivisionError):
                    await _until_end(server, rig, Supervisor(None, None))
        with pytest.raises((MotionStoppedError, asyncio.CancelledError, ZeroDivisionError)):
            await moving
    assert devices.world is not None
    shaft, now = devices.world.shaft("slide")[1], devices.clock.now()
    assert shaft.motor(now) != 90.0
    assert not shaft.motion.velocity(now)


async def test_answers_are_not_held_back() -> None:
    """Without TCP_NODELAY, an answer's body waits some 40 ms for the client to acknowledge its head."""
    found: list[int] = []
    over = asyncio.Event()

    async def answer(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        accepted = writer.get_extra_info("socket")
        found.append(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
        writer.close()
        over.set()

    with bind("127.0.0.1", 0) as listening:
        async with await asyncio.start_server(answer, sock=listening):
            _, writer = await asyncio.open_connection(*listening.getsockname())
            await over.wait()
            writer.close()
            await writer.wait_closed()
    assert found == [1]


def test_a_port_in_use_is_one_sentence() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(
            ServeError, match=f"port {port}: Address already in use: stop what uses it, or choose"
        ):
            bind("127.0.0.1", port)
    for port in (99999, -1):
        with pytest.raises(ServeError, match=f"port {port}: choose a --port between 0 and 65535"):
            bind("127.0.0.1", port)
    with pytest.raises(ServeError, match="choose another --host"):
        bind("no such host", 0)


@contextmanager
def daemon(profile: Path, data: Path) -> Iterator[tuple["subprocess.Popen[str]", httpx.Client]]:
    """A daemon in a process of its own, which is ended by the test or at its end."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", DAEMON, str(profile), str(data)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        address = process.stdout.readline().strip()
        assert address, process.stderr.read()
        with httpx.Client(base_url=f"{address}/api/v1", timeout=30) as client:
            yield process, client
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


def follow(client: httpx.Client, run: str, until: str, count: int = 1) -> dict[str, Any]:
    """Return the event that is the `count`-th of type `until`."""
    with client.stream("GET", f"/runs/{run}/events") as answer:
        for line in answer.iter_lines():
            if line.startswith("data: "):
                event = json.loads(line.removeprefix("data: "))
                count -= event["type"] == until
                if count == 0:
                    return dict(event)
    raise AssertionError(f"no {until}")


def test_a_killed_daemon_loses_at_most_the_view_in_flight(tmp_path: Path) -> None:
    profile, data = write_profile(tmp_path), tmp_path / "data"
    with daemon(profile, data) as (process, client):
        first = client.post("/runs", json={}).json()["id"]
        assert follow(client, first, "finished")["state"] == "succeeded"
        calibration = client.get("/pose").json()["calibration_id"]
        run = client.post("/runs", json={}).json()["id"]
        follow(client, run, "view", count=3)
        process.send_signal(signal.SIGKILL)
        process.wait()

    session = load_session(data / "sessions" / run)
    assert len(session.views) >= 3
    for view in session.views:
        assert view.image is not None
        assert cv2.imread(str(session.folder / view.image)) is not None

    with daemon(profile, data) as (process, client):
        found = client.get(f"/runs/{run}").json()
        assert found["state"] == "interrupted"
        assert "resume it" in found["error"]
        assert client.get("/calibrations/current").json()["id"] == calibration
        assert client.get("/pose").json()["code"] == "not_homed"
        assert client.get(f"/runs/{first}").json()["state"] == "succeeded"
        process.send_signal(signal.SIGTERM)
        assert process.wait() == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_run_and_the_daemon_in_order(tmp_path: Path, number: signal.Signals) -> None:
    profile, data = write_profile(tmp_path), tmp_path / "data"
    with daemon(profile, data) as (process, client):
        run = client.post("/runs", json={}).json()["id"]
        follow(client, run, "view")
        process.send_signal(number)
        assert process.wait() == 0
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    session = json.loads((data / "sessions" / run / "session.json").read_text())
    assert session["complete"] is False
    last = (data / "sessions" / run / "events.jsonl").read_text().splitlines()[-1]
    assert json.loads(last)["state"] == "interrupted"


def test_a_start_loads_nothing_that_a_rig_at_rest_does_without(tmp_path: Path) -> None:
    code = """
import os, signal, sys
from daemon.cli import main
import typer

def ready(address):
    print(*sys.modules)
    os.kill(os.getpid(), signal.SIGTERM)

typer.echo = ready
main(["serve", "--profile", sys.argv[1], "--data", sys.argv[2], "--port", "0"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(write_profile(tmp_path)), str(tmp_path / "data")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert {"fastapi", "drivers.simulated.camera"} <= loaded
    assert (
        not {
            "scipy",
            "rich",
            "matplotlib",
            "calib.solver",
            "calib.detection.detector",
            "drivers.grbl",
            "daemon.printing",
        }
        & loaded
    )
