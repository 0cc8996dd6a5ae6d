"""The ways in which a run ends before its time: stops, shutdowns, faults of devices, of the solver and of the disk."""

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import cast

import pytest

from calib import load_session
from calib.errors import UnsolvableError
from daemon.errors import (
    StoreError,
)
from daemon.procedure.events import Warned
from daemon.profile import Profile
from daemon.rig import Devices
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from drivers.camera import Frame
from drivers.simulated import SimulatedController
from tests.daemon.motions import to_and_fro, until
from tests.daemon.runs import finish


async def test_a_stop_fails_the_run_and_leaves_its_views(service: Service) -> None:
    run = await service.runs.start()
    async for event in service.runs.events(run.id):
        if event.type == "view" and event.view == 1:
            await service.rig.stop("somebody pressed the button")
    run = await service.runs.get(run.id)
    assert run.state is RunState.FAILED
    assert "stop" in (run.error or "")
    assert len(load_session(service.store.session_folder(run)).views) >= 2
    assert service.poses.calibration_id is None


@pytest.mark.parametrize("during", ["homing", "moving", "settling", "paused", "solving"])
async def test_a_stop_ends_a_run_for_good_even_if_it_is_acknowledged_at_once(
    service: Service, during: str
) -> None:
    run = await service.runs.start()
    async for event in service.runs.events(run.id):
        if during == "paused" and event.type == "homing" and event.axis == "slide":
            service.runs.pause(run.id)
        phase = event.state.value if event.type == "state" else event.type
        if phase != ("moving" if during == "settling" else during):
            continue
        if during == "settling":
            await until(service.rig, lambda snapshot: snapshot.moving)
            await until(service.rig, lambda snapshot: not snapshot.moving)
        await service.rig.stop("somebody pressed the button")
        service.rig.acknowledge_stop()
        break
    assert (await service.runs.wait(run.id)).state is RunState.FAILED
    run = await service.runs.get(run.id)
    assert run.error == "a stop ended it: somebody pressed the button"
    assert service.leases.current is None
    readings = service.rig.snapshot.readings
    assert (await service.rig.fresh_snapshot(service.rig.clock.now())).readings == readings


async def test_a_stop_right_after_the_start_ends_the_run(service: Service) -> None:
    run = await service.runs.start()
    await service.rig.stop("somebody pressed the button")
    assert (await service.runs.wait(run.id)).error == "a stop ended it: somebody pressed the button"
    assert service.rig.snapshot.readings == (None, None)


async def test_a_stop_while_the_start_is_stored_ends_the_run_even_if_it_is_acknowledged_at_once(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_run = service.store.add_run

    async def stopped_meanwhile(run: RunRecord) -> None:
        await add_run(run)
        await service.rig.stop("somebody pressed the button")
        service.rig.latch.acknowledge()

    monkeypatch.setattr(service.store, "add_run", stopped_meanwhile)
    run = await service.runs.start()
    assert (await service.runs.wait(run.id)).error == "a stop ended it while it began"
    assert service.rig.snapshot.readings == (None, None)


async def test_a_shutdown_while_the_start_is_stored_interrupts_the_run(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_run, shutdowns = service.store.add_run, []

    async def shut_down_meanwhile(run: RunRecord) -> None:
        shutdowns.append(asyncio.create_task(service.halt()))
        await asyncio.sleep(0)
        await add_run(run)

    monkeypatch.setattr(service.store, "add_run", shut_down_meanwhile)
    run = await service.runs.start()
    await shutdowns[0]
    assert (await service.runs.get(run.id)).state is RunState.INTERRUPTED
    assert service.rig.snapshot.readings == (None, None)


async def test_a_camera_whose_driver_gives_old_frames_fails_the_run(
    service: Service, devices: Devices, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = devices.camera.frame

    async def newest(after: float | None = None) -> Frame:
        return await frame()

    monkeypatch.setattr(devices.camera, "frame", newest)
    run, _ = await finish(service, await service.runs.start())
    assert run.state is RunState.FAILED
    assert "older than was asked for" in (run.error or "")


async def test_an_alarm_while_the_axes_stand_fails_the_run_in_its_words(
    service: Service, devices: Devices
) -> None:
    run = await service.runs.start()
    async for event in service.runs.events(run.id):
        if event.type == "moving":
            await until(service.rig, lambda snapshot: snapshot.moving)
            await until(service.rig, lambda snapshot: not snapshot.moving)
            cast(SimulatedController, devices.controllers["head"]).inject("alarm")
            break
    run = await service.runs.wait(run.id)
    assert run.error is not None
    assert "axis 'pan': the controller is in alarm" in run.error


async def test_a_run_waits_until_what_its_starter_has_moved_stands(service: Service) -> None:
    lease = service.leases.acquire("anna", "", 60)
    jog = await service.motions.begin(lease, ["slide"], to_and_fro(service.rig, "slide"))
    run, _ = await finish(service, await service.runs.start(token=lease.token))
    assert (run.state, run.error) == (RunState.SUCCEEDED, None)
    assert jog.cancelled()


async def test_a_device_lost_in_the_middle_fails_the_run_in_its_words(
    service: Service, devices: Devices
) -> None:
    run = await service.runs.start()
    async for event in service.runs.events(run.id):
        if event.type == "view" and event.view == 1:
            cast(SimulatedController, devices.controllers["stage"]).inject("lost")
    run = await service.runs.get(run.id)
    assert run.state is RunState.FAILED
    assert "controller" in (run.error or "")
    assert "could not be confirmed" in (run.error or "")  # nobody can say that a lost axis stands
    assert "axis 'slide': axis 'slide'" not in (run.error or "")


async def test_a_shutdown_interrupts_the_run(profile: Profile, tmp_path: Path) -> None:
    async with running_service(profile, tmp_path / "data") as service:
        run = await service.runs.start()
        async for event in service.runs.events(run.id):
            if event.type == "view":
                break
    async with running_service(profile, tmp_path / "data") as service:
        (run,) = await service.runs.list()
        assert run.state is RunState.INTERRUPTED
        assert "shut down" in (run.error or "")
        past = [event async for event in service.runs.events(run.id, after=2)]
        assert past[0].sequence == 3
        assert past[-1].type == "finished"


async def test_the_events_of_a_killed_daemon_have_an_end_too(profile: Profile, tmp_path: Path) -> None:
    async with running_service(profile, tmp_path / "data") as service:
        run, events = await finish(service, await service.runs.start())
        file = service.store.session_folder(run) / "events.jsonl"
        whole = file.read_bytes().split(b"\n")
        # What a kill leaves: a line cut in the middle of a letter, and a store that says "running".
        warning = Warned(run_id=run.id, sequence=4, message="a line\u2028of two").model_dump_json()
        file.write_bytes(b"\n".join([*whole[:3], warning.encode(), whole[4] + "é".encode()[:1]]))
        await service.store.change_run(run.id, RunState.RUNNING)
    async with running_service(profile, tmp_path / "data") as service:
        past = [event async for event in service.runs.events(run.id)]
        assert past[:3] == events[:3]
        assert past[3].type == "warning"
        (last,) = past[4:]
        assert (last.type, last.sequence) == ("finished", 5)
        assert last.state is RunState.INTERRUPTED
        assert last.error == (await service.runs.get(run.id)).error


async def test_a_session_that_cannot_be_solved_fails_the_run_and_stays(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve(*_: object, **__: object) -> None:
        raise UnsolvableError("joint 'pan' does not turn far enough: sweep it further")

    monkeypatch.setattr("calib.solver.solve", solve)
    run, _ = await finish(service, await service.runs.start())
    assert run.state is RunState.FAILED
    assert run.error == "joint 'pan' does not turn far enough: sweep it further"
    assert await service.store.calibrations() == []
    assert len(load_session(service.store.session_folder(run)).views) == 10


async def test_an_error_in_the_program_fails_the_run_too(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def look(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("daemon.procedure.observation.detect_in_all", look)
    run, _ = await finish(service, await service.runs.start())
    assert run.state is RunState.FAILED
    assert "ZeroDivisionError" in (run.error or "")
    assert "Traceback" in caplog.text
    assert service.leases.current is None


async def test_an_end_that_cannot_be_stored_is_told_with_its_cause(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def full(*_: object, **__: object) -> None:
        raise StoreError("the database is full")

    run = await service.runs.start()
    monkeypatch.setattr(service.store, "change_run", full)
    await service.rig.stop("a test")
    run = await service.runs.wait(run.id)
    assert run.state is RunState.FAILED
    assert run.error == "a stop ended it: a test; its end could not be stored: the database is full"
    assert await service.runs.list() == [run]
    assert "Traceback" not in caplog.text


async def test_a_solver_that_nobody_waits_for_holds_nothing_up(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, ended = threading.Event(), threading.Event()
    go_on = threading.Event()

    def solve(*_: object, progress: Callable[[str], None]) -> None:
        progress("looking")
        begun.set()
        go_on.wait()
        try:
            progress("looking further")
        finally:
            ended.set()

    monkeypatch.setattr("calib.solve", solve)
    run = await service.runs.start()
    await asyncio.to_thread(begun.wait)
    assert (await service.runs.cancel(run.id)).state is RunState.CANCELLED
    await asyncio.get_running_loop().shutdown_default_executor()
    go_on.set()
    ended.wait()
    messages = [event.message async for event in service.runs.events(run.id) if event.type == "solving"]
    assert messages == ["looking"]


async def test_a_folder_that_cannot_be_made_fails_the_run(service: Service, tmp_path: Path) -> None:
    (tmp_path / "data" / "sessions").write_text("a file is in the way")
    run, events = await finish(service, await service.runs.start())
    assert run.state is RunState.FAILED
    assert "the session could not be written" in (run.error or "")
    assert events[-1].type == "finished"
