"""Runs that ended before their time go on where they were, or are solved as they are."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from calib import load_session
from calib.detection import Prediction
from calib.errors import DetectionError, UnsolvableError
from calib.observations import Observation as Seen
from calib.prediction import predicted_by_views
from calib.session import Session
from calib.targets import Target
from daemon.errors import (
    LeaseHeldError,
    ProfileChangedError,
    RunActiveError,
    RunStateError,
    StopLatchedError,
    UnknownRunError,
)
from daemon.procedure.beginning import new_record, require_same_profile
from daemon.procedure.event_log import read_events
from daemon.procedure.observation import Observation, Taken, find
from daemon.profile import Profile
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from tests.daemon.rigs import small_rig
from tests.daemon.runs import finish, of


async def cut_off(service: Service, views: int) -> RunRecord:
    """Return a run that was cancelled once it had taken `views` views."""
    run = await service.runs.start("anna", "first light")
    async for event in service.runs.events(run.id):
        if event.type == "view" and event.view == views - 1:
            return await service.runs.cancel(run.id)
    raise AssertionError


async def test_a_run_goes_on_after_the_last_sweep_that_it_finished(profile: Profile, tmp_path: Path) -> None:
    views, done = 6, 4
    async with running_service(profile, tmp_path / "data") as service:
        before = await cut_off(service, views)
        folder = service.store.session_folder(before)
        taken = load_session(folder).views
        told = read_events(folder)
        pictures = {path.name: path.read_bytes() for path in (folder / "frames").iterdir()}
    async with running_service(profile, tmp_path / "data") as service:
        resumed = await service.runs.resume(before.id)
        assert (resumed.id, resumed.state, resumed.error) == (before.id, RunState.RUNNING, None)
        run, events = await finish(service, resumed)
        assert (run.state, run.error) == (RunState.SUCCEEDED, None)
        assert service.poses.calibration_id == run.calibration_id

    session = load_session(folder)
    assert session.complete
    assert session.views[:done] == taken[:done]
    assert session.set_aside == taken[done:]
    assert [view.sweep for view in session.views] == [0] * 4 + [1] * 4 + [2] * 2
    # What had been taken is all there, also what was taken again.
    assert all((folder / "frames" / name).read_bytes() == data for name, data in pictures.items())
    assert len({name for view in [*session.views, *session.set_aside] for name in view.frames}) == (
        10 + len(session.set_aside)
    )

    assert events[: len(told)] == told
    assert [event.sequence for event in events] == list(range(1, len(events) + 1))
    assert read_events(folder) == events
    again = events[len(told) :]
    assert [event.type for event in again[:4]] == ["state", "plan", "homing", "homing"]
    assert of(again, "plan")[0].done == done
    assert [event.position for event in of(again, "view")] == list(range(done + 1, 11))


async def test_going_on_homes_axes_that_say_they_are_homed(service: Service) -> None:
    before = await cut_off(service, 6)
    assert all(axis.homed for axis in service.rig.snapshot.axes)
    run, events = await finish(service, await service.runs.resume(before.id))
    assert run.state is RunState.SUCCEEDED
    assert [event.axis for event in of(events, "homing")] == ["slide", "pan", "slide", "pan"]


async def test_a_run_that_measured_everything_is_solved_without_a_move(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve(*_: object, **__: object) -> None:
        raise UnsolvableError("joint 'pan' does not turn far enough: sweep it further")

    with monkeypatch.context() as patch:
        patch.setattr("calib.solve", solve)
        run, events = await finish(service, await service.runs.start())
    assert run.state is RunState.FAILED
    run, again = await finish(service, await service.runs.resume(run.id))
    assert run.state is RunState.SUCCEEDED
    assert not of(again[len(events) :], "moving")
    assert not of(again[len(events) :], "homing")


async def test_a_kill_in_the_middle_of_a_line_leaves_a_run_that_goes_on(
    profile: Profile, tmp_path: Path
) -> None:
    async with running_service(profile, tmp_path / "data") as service:
        run = await cut_off(service, 5)
        file = service.store.session_folder(run) / "events.jsonl"
        *lines, _ = file.read_bytes().splitlines(keepends=True)
        file.write_bytes(b"".join(lines) + b'{"type": "view", "pos')
        await service.store.change_run(run.id, RunState.RUNNING)
    async with running_service(profile, tmp_path / "data") as service:
        before = [event async for event in service.runs.events(run.id)]
        assert before[-1].type == "finished"
        await service.runs.resume(run.id)
        await service.runs.cancel(run.id)
        events = [event async for event in service.runs.events(run.id)]
        assert events[: len(before)] == before
        assert [event.state for event in of(events, "finished")] == ["interrupted", "cancelled"]
        assert read_events(file.parent) == events


async def test_another_profile_is_no_way_to_go_on(profile: Profile, tmp_path: Path) -> None:
    async with running_service(profile, tmp_path / "data") as service:
        run = await cut_off(service, 5)
    async with running_service(small_rig(tmp_path, reach=10.0), tmp_path / "data") as service:
        with pytest.raises(ProfileChangedError, match=r"with another profile \(procedure\)"):
            await service.runs.resume(run.id)
        assert await service.runs.get(run.id) == run
        assert service.leases.current is None


def test_what_a_later_activecam_knows_besides_is_no_other_profile(profile: Profile) -> None:
    record = new_record(profile, "", "")
    then = json.loads(record.profile)
    del then["procedure"]["frames"], then["axes"][1]["reading_std"]
    require_same_profile(replace(record, profile=json.dumps(then)), profile)
    then["axes"].pop()
    with pytest.raises(ProfileChangedError, match=r"\(axes\)"):
        require_same_profile(replace(record, profile=json.dumps(then)), profile)


async def test_what_stands_against_a_new_run_stands_against_going_on(service: Service) -> None:
    run = await cut_off(service, 5)
    lease = service.leases.acquire("ben", "", 60)
    with pytest.raises(LeaseHeldError, match="'ben'"):
        await service.runs.resume(run.id)
    await service.rig.stop("a test")
    with pytest.raises(StopLatchedError):
        await service.runs.resume(run.id, lease.token)
    service.rig.acknowledge_stop()
    with pytest.raises(UnknownRunError):
        await service.runs.resume("none")
    with pytest.raises(UnknownRunError):
        await service.runs.solve("none")
    assert await service.runs.get(run.id) == run

    await service.runs.resume(run.id, lease.token)
    for another in (service.runs.start(), service.runs.solve(run.id)):
        with pytest.raises(RunActiveError):
            await another
    assert (await service.runs.wait(run.id)).state is RunState.SUCCEEDED
    with pytest.raises(RunStateError, match="has succeeded: start another"):
        await service.runs.resume(run.id)


async def test_a_session_that_cannot_be_read_fails_the_run_in_a_sentence(service: Service) -> None:
    run = await cut_off(service, 5)
    folder = service.store.session_folder(run)
    (folder / "frames" / "0002.png").unlink()
    run, _ = await finish(service, await service.runs.resume(run.id))
    assert run.error is not None
    assert run.error.endswith("0002.png: the picture of a view is gone: start a new run")
    (folder / "session.json").write_text('{"format": "activecam.session/1", "joi')
    run, _ = await finish(service, await service.runs.resume(run.id))
    assert "session.json: not JSON at line 1" in (run.error or "")


async def test_a_target_that_was_not_found_is_looked_for_where_earlier_views_predict_it(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What an earlier part of the run saw is read from its pictures again."""
    run = await cut_off(service, 5)

    def find_but_at_4(taken: Taken, target: Target) -> Observation:
        if abs(taken.readings[1] - 4) < 0.1 and taken.readings[0] > 40:
            raise DetectionError("somebody stood in the light")
        return find(taken, target)

    def predict(session: Session, seen: Sequence[Seen], readings: Sequence[float]) -> Prediction:
        places.append([observation.view for observation in seen])
        return predicted_by_views(session, seen, readings)

    places: list[list[int]] = []
    monkeypatch.setattr("daemon.procedure.survey.find", find_but_at_4)
    monkeypatch.setattr("calib.prediction.predicted_by_views", predict)
    await service.runs.resume(run.id)
    async for event in service.runs.events(run.id):
        if event.type == "joint" and event.joint is None:
            await service.runs.cancel(run.id)
    assert places == [list(range(7))]
    assert len(load_session(service.store.session_folder(run)).views) >= 8


async def test_the_views_of_a_run_that_was_cut_off_are_solved_as_they_are(
    service: Service, client: httpx.AsyncClient
) -> None:
    run = await cut_off(service, 9)
    lease = service.leases.acquire("anna", "", 60)  # nothing moves, so that nobody is in the way
    answer = await client.post(f"/runs/{run.id}/solve")
    assert (answer.status_code, answer.json()["state"]) == (202, "running")
    await service.rig.stop("somebody pressed the button")
    solved, events = await finish(service, run)
    assert service.leases.current == lease
    assert (solved.state, solved.error) == (RunState.CANCELLED, "it was cancelled")
    assert of(events, "solved")
    assert of(events, "finished")[-1].calibration_id == solved.calibration_id

    assert service.poses.calibration_id is None
    (entry,) = (await client.get("/calibrations")).json()
    assert (entry["id"], entry["active"], entry["run_id"]) == (solved.calibration_id, False, run.id)
    assert (await client.post(f"/calibrations/{entry['id']}/activate")).status_code == 200
    assert service.poses.calibration_id == solved.calibration_id


async def test_a_run_of_one_joint_alone_gives_a_calibration_that_this_rig_cannot_use(
    service: Service,
) -> None:
    run = await cut_off(service, 4)
    solved, _ = await finish(service, await service.runs.solve(run.id))
    assert solved.calibration_id is not None
    record = await service.store.calibration(solved.calibration_id)
    assert [joint["name"] for joint in json.loads(record.document)["joints"]] == ["slide"]
    assert record.verification is None
    assert service.poses.calibration_id is None


async def test_views_that_cannot_be_solved_leave_the_run_as_it_was(service: Service) -> None:
    run = await cut_off(service, 1)
    for _ in range(2):
        unsolved, events = await finish(service, await service.runs.solve(run.id))
        assert unsolved.state is RunState.CANCELLED
        assert unsolved.error is not None
        assert unsolved.error.startswith("it was cancelled; its views could not be solved: ")
        assert unsolved.error.count("could not be solved") == 1
        assert unsolved.calibration_id is None
    assert len(of(events, "finished")) == 3
