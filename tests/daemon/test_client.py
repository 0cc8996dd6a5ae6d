"""The client against a served daemon: it asks, moves, follows, and says what goes wrong."""

import asyncio
import re
import time
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime
from itertools import islice
from typing import TypeVar, cast

import numpy as np
import pytest

from activecam_client import Client, ProblemError, UnreachableError
from daemon.rig import Devices
from daemon.service import Service
from drivers.simulated import SimulatedController
from tests.daemon.calibrations import calibrate
from tests.daemon.motions import home_all, until

Result = TypeVar("Result")


@pytest.fixture
async def client(address: str) -> AsyncIterator[Client]:
    with Client(address) as client:
        yield client


@pytest.fixture
async def posed(service: Service) -> Service:
    await home_all(service.rig)
    calibrate(service)
    return service


async def aside(work: Callable[[], Result]) -> Result:
    """Ask from another thread, since the daemon answers in this one."""
    return await asyncio.to_thread(work)


async def test_poses_are_the_daemons(client: Client, posed: Service) -> None:
    calibration = posed.poses.active.calibration
    pose = await aside(client.pose)
    assert np.allclose(pose.world_from_camera, calibration.world_from_camera(pose.readings))
    assert pose.covariance is not None
    assert (pose.covariance.shape, pose.position.shape, pose.quaternion.shape) == ((6, 6), (3,), (4,))
    readings = [[10.0, 3.0], [20.0, -19.0]]
    there = await aside(lambda: client.poses(readings, approached=[[1, 0], [0, -1]]))
    assert [one.approached for one in there] == [[1, 0], [0, -1]]
    assert [one.out_of_range for one in there] == [[], ["pan"]]
    expected = calibration.world_from_camera(np.array(readings))
    assert np.allclose([one.world_from_camera for one in there], expected)


async def test_past_poses_are_asked_by_their_time(client: Client, posed: Service) -> None:
    times = [datetime.now(UTC), datetime.now(UTC).astimezone()]
    then = await aside(lambda: client.pose_at(times[1], camera="main"))
    assert then.timestamp == times[1]
    assert len(then.between) == 2
    several = await aside(lambda: client.poses_at(times))
    assert [pose.timestamp for pose in several] == times
    with pytest.raises(ValueError, match="has no zone"):
        client.pose_at(datetime(2026, 3, 14))


async def test_points_lead_to_pixels_and_back(client: Client, posed: Service) -> None:
    points = np.array(
        [[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.05, 0.05, -5.0]]
    )  # the last one is behind the camera
    readings = [[20.0, 3.0], [90.0, -4.0]]
    pixels = await aside(lambda: client.project(points, readings))
    assert pixels.shape == (2, 3, 2)
    assert np.isnan(pixels[:, 2]).all()
    rays = await aside(lambda: client.rays(pixels[0, :2], readings[:1]))
    towards = points[:2] - rays.origins[0]
    assert np.allclose(rays.directions[0], towards / np.linalg.norm(towards, axis=1, keepdims=True))
    assert (await aside(lambda: client.project(points))).shape == (1, 3, 2)


async def test_a_lease_is_renewed_and_given_back(client: Client, service: Service) -> None:
    def move() -> None:
        with client.lease("anna", note="tests", ttl=3.0) as lease:
            slide = lease.home("slide")
            lease.home("pan")
            assert (slide.name, slide.position) == ("slide", 0.0)
            assert [axis.position for axis in lease.move({"slide": 5.0, "pan": 1.0})] == [5.0, 1.0]
            assert lease.jog("pan", 0.5).position == 1.5
            held = service.leases.current
            assert held is not None
            while (renewed := service.leases.current) == held:
                time.sleep(0.02)
            assert renewed is not None
            assert renewed.token == held.token

    await aside(move)
    assert service.leases.current is None


async def test_a_lease_that_somebody_holds_is_refused(client: Client, service: Service) -> None:
    service.leases.acquire("ben", "", 60)

    def take() -> None:
        with client.lease("anna"):
            pytest.fail("it was given")

    with pytest.raises(ProblemError) as refused:
        await aside(take)
    assert (refused.value.code, refused.value.status) == ("lease_held", 409)
    assert "'ben'" in refused.value.detail


async def test_a_run_takes_the_lease_over_and_tells_its_events(client: Client, service: Service) -> None:
    def calibrate() -> list[str]:
        with client.lease("anna") as lease:
            run = client.run("anna", "by the client", lease)
        events = list(run.events())
        assert [event.sequence for event in events] == list(range(1, len(events) + 1))
        assert events[-1].state == "succeeded"
        assert [event.type for event in run.events(after=len(events) - 1)] == ["finished"]
        record = run.wait()
        assert (record.state, record.owner, record.note) == ("succeeded", "anna", "by the client")
        assert client.rig().calibration_id == record.calibration_id
        return [event.type for event in events]

    kinds = await aside(calibrate)
    assert {"plan", "view", "solved", "finished"} < set(kinds)


async def test_a_run_is_cut_off_resumed_and_solved_without_a_view(client: Client, service: Service) -> None:
    def calibrate() -> None:
        started = client.run("anna")
        next(event for event in started.events() if event.type == "view" and event.view == 4)
        assert started.cancel().state == "cancelled"
        assert [record.id for record in client.runs()] == [started.id]
        run = client.run_of(started.id)
        assert 4 < len(run.views()) < 10
        with client.lease("anna") as lease:
            assert run.resume(lease).state == "running"
        first = run.wait()
        assert first.state == "succeeded"
        assert run.solve([2]).state == "running"
        second = run.wait()
        assert (second.state, second.calibration_id == first.calibration_id) == ("succeeded", False)
        assert [view.number for view in run.views() if view.left_out] == [2]
        assert not any(view.left_out for view in run.views(first.calibration_id))
        assert client.rig().calibration_id == first.calibration_id

        new, old = client.calibrations()
        assert ([new.active, old.active], old.id) == ([False, True], first.calibration_id)
        assert client.compare(old.id, new.id).agree
        assert client.activate(new.id).active
        assert client.rig().calibration_id == new.id

    await aside(calibrate)


async def test_what_is_in_the_way_of_a_run_is_asked_for(client: Client, service: Service) -> None:
    with pytest.raises(ProblemError, match=r"\(not_homed\)"):
        await aside(lambda: client.checklist(from_here=["pan"]))
    await home_all(service.rig)
    await service.rig.stop("a test")
    checks = await aside(lambda: client.checklist(from_here=["slide", "pan"]))
    assert [check.name for check in checks if check.ok is False] == ["stop"]


async def test_a_run_is_cancelled_and_a_stop_acknowledged(client: Client, service: Service) -> None:
    run = await aside(client.run)
    assert (await aside(run.cancel)).state == "cancelled"
    assert (await aside(client.stop)).latched
    with pytest.raises(ProblemError, match=r"\(stop_latched\)"):
        await aside(client.run)
    assert not (await aside(client.acknowledge_stop)).latched


async def test_the_stream_gives_poses_until_a_problem_comes(
    client: Client, posed: Service, devices: Devices
) -> None:
    poses = await aside(lambda: list(islice(client.stream(rate=100), 3)))
    assert [pose.timestamp for pose in poses] == sorted(pose.timestamp for pose in poses)
    cast(SimulatedController, devices.controllers["stage"]).inject("lost")
    await until(posed.rig, lambda snapshot: snapshot.axis("slide").lost is not None)
    with pytest.raises(ProblemError) as lost:
        await aside(lambda: next(client.stream()))
    assert lost.value.code == "device_lost"
    with pytest.raises(ProblemError, match="device_lost"):
        await aside(client.pose)


async def test_a_daemon_that_is_not_there_is_said_so() -> None:
    with Client("http://127.0.0.1:9") as client:
        for ask in (client.pose, lambda: next(client.stream())):
            with pytest.raises(UnreachableError):
                ask()


async def test_something_else_that_answers_is_said_so() -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append((await reader.readuntil(b"\r\n\r\n")).decode())
        writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 2\r\n\r\nno")
        writer.close()

    asked: list[str] = []
    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        with (
            Client(f"http://127.0.0.1:{port}/", key="secret") as client,
            pytest.raises(UnreachableError, match="no activecam daemon"),
        ):
            await aside(client.pose)
    assert re.search(r"(?i)authorization: Bearer secret\r\n", asked[0])
