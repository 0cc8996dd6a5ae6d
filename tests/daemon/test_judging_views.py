"""A run's views as a person judges them: seen, left out, solved again without."""

import threading
from datetime import datetime
from itertools import pairwise
from typing import Any, cast

import cv2
import httpx
import numpy as np
import pytest

from calib import load_session
from daemon.procedure.assignment import UNSOLVED
from daemon.service import Service
from daemon.store import RunRecord, RunState
from tests.daemon.judged import forget
from tests.daemon.runs import finish


@pytest.fixture
async def run(service: Service) -> RunRecord:
    run, _ = await finish(service, await service.runs.start())
    assert run.state is RunState.SUCCEEDED
    return run


async def views(client: httpx.AsyncClient, run: RunRecord, **query: str) -> dict[str, Any]:
    answer = await client.get(f"/runs/{run.id}/views", params=query)
    assert answer.status_code == 200, answer.text
    return cast("dict[str, Any]", answer.json())


async def test_a_runs_views_are_listed_with_what_its_calibration_says_of_each(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    answer = await views(client, run)
    assert answer["calibration_id"] == run.calibration_id
    session = load_session(service.store.session_folder(run))
    assert [view["number"] for view in answer["views"]] == list(range(10))
    assert [view["joint"] for view in answer["views"]] == ["slide"] * 4 + ["pan"] * 4 + [None] * 2
    assert [view["use"] for view in answer["views"]] == ["fit"] * 8 + ["verify"] * 2
    for view, taken in zip(answer["views"], session.views, strict=True):
        assert (view["readings"], view["image"], view["points"]) == (taken.readings, taken.image, 20)
        assert 0 < view["residual_px"] < 0.3
        assert (view["held_out_px"] is not None) == (view["use"] == "fit")
        assert not view["left_out"]
    times = [datetime.fromisoformat(view["taken_at"]) for view in answer["views"]]
    assert all(earlier <= later for earlier, later in pairwise(times))


async def test_a_run_under_way_tells_how_well_each_view_agrees_with_itself(
    client: httpx.AsyncClient, service: Service
) -> None:
    started = await service.runs.start()
    assert (await views(client, started))["views"] == []
    async for event in service.runs.events(started.id):
        if event.type == "view" and event.view == 5:
            answer = await views(client, started)
            await service.runs.cancel(started.id)
    assert answer["calibration_id"] is None
    assert len(answer["views"]) >= 6
    for view in answer["views"]:
        assert view["points"] == 20
        assert 0 < view["residual_px"] < 0.3


async def test_the_coverage_of_a_run_grows_with_its_views(
    client: httpx.AsyncClient, service: Service
) -> None:
    started = await service.runs.start()
    none = (await client.get(f"/runs/{started.id}/coverage")).json()
    assert (none["views"], none["covered"], none["missing"]) == (0, 0.0, ["no view shows the target"])
    run, _ = await finish(service, started)
    all_views = (await client.get(f"/runs/{run.id}/coverage")).json()
    assert all_views["views"] == 10
    assert sum(map(sum, all_views["cells"])) == 10 * 20
    assert 0 < all_views["covered"] < 1
    assert 0 < all_views["x"] <= 1
    assert (await client.get("/runs/none/coverage")).json()["code"] == "unknown_run"


async def test_what_a_run_has_seen_is_not_looked_for_again(
    client: httpx.AsyncClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = await service.runs.start()
    async for event in service.runs.events(started.id):
        if event.type == "view" and event.view == 5:
            await service.runs.cancel(started.id)
    with monkeypatch.context() as patch:
        patch.setattr("daemon.judging.sightings.observe", lambda *_, **__: pytest.fail("it was looked for"))
        known = await views(client, started)
        covered = (await client.get(f"/runs/{started.id}/coverage")).json()
    forget(service)
    assert await views(client, started) == known
    assert (await client.get(f"/runs/{started.id}/coverage")).json() == covered


async def test_the_target_is_looked_for_once_in_each_picture(
    client: httpx.AsyncClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = await service.runs.start()
    async for event in service.runs.events(started.id):
        if event.type == "view" and event.view == 2:
            await service.runs.cancel(started.id)
    forget(service)
    first = await views(client, started)
    monkeypatch.setattr("daemon.judging.sightings.observe", lambda *_, **__: pytest.fail("it was looked for"))
    assert await views(client, started) == first


async def test_a_views_picture_is_shown_as_small_as_it_is_asked_for(
    client: httpx.AsyncClient, run: RunRecord
) -> None:
    for query, shape in (({}, (360, 480)), ({"width": "160"}, (120, 160)), ({"width": "900"}, (360, 480))):
        answer = await client.get(f"/runs/{run.id}/views/3/image.jpg", params=query)
        assert answer.headers["content-type"] == "image/jpeg"
        picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        assert picture.shape == shape
        again = await client.get(
            f"/runs/{run.id}/views/3/image.jpg",
            params=query,
            headers={"If-None-Match": answer.headers["etag"]},
        )
        assert (again.status_code, again.content) == (304, b"")


async def test_what_is_not_there_is_said_so(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    for path, code in (
        ("/runs/none/views", "unknown_run"),
        (f"/runs/{run.id}/views?calibration=none", "unknown_calibration"),
        (f"/runs/{run.id}/views/10/image.jpg", "unknown_view"),
    ):
        answer = await client.get(path)
        assert (answer.status_code, answer.json()["code"]) == (404, code)
    refused = await client.post(f"/runs/{run.id}/solve", json={"leave_out": [10]})
    assert (refused.status_code, refused.json()["code"]) == (404, "unknown_view")
    folder = service.store.session_folder(run)
    (folder / "frames" / "0003.png").unlink()
    gone = await client.get(f"/runs/{run.id}/views/3/image.jpg")
    assert (gone.status_code, gone.json()["code"]) == (409, "session_unreadable")
    (folder / "session.json").write_text("{")
    for path in ("views", "views/2/image.jpg"):
        damaged = await client.get(f"/runs/{run.id}/{path}")
        assert (damaged.status_code, damaged.json()["code"]) == (409, "session_unreadable")


async def test_a_run_is_solved_again_without_some_of_its_views(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    session_file = service.store.session_folder(run) / "session.json"
    measured = session_file.read_bytes()
    answer = await client.post(f"/runs/{run.id}/solve", json={"leave_out": [1, 6]})
    assert answer.status_code == 202
    again = await service.runs.wait(run.id)
    assert (again.state, again.error) == (RunState.SUCCEEDED, None)
    assert again.calibration_id != run.calibration_id
    assert session_file.read_bytes() == measured
    assert service.poses.calibration_id == run.calibration_id  # which one is used is for a person to say

    after, before = await views(client, run), await views(client, run, calibration=run.calibration_id or "")
    assert (after["calibration_id"], before["calibration_id"]) == (again.calibration_id, run.calibration_id)
    assert [view["number"] for view in after["views"] if view["left_out"]] == [1, 6]
    assert not any(view["left_out"] for view in before["views"])
    assert all(0 < view["residual_px"] < 0.3 for view in after["views"])
    assert [view["held_out_px"] is None for view in after["views"]] == [
        view["number"] in (1, 6, 8, 9) for view in after["views"]
    ]
    new, old = (await client.get("/calibrations")).json()
    assert (new["active"], old["active"]) == (False, True)
    assert "; 2 views left out by hand" in new["verdict"]
    assert "left out" not in old["verdict"]
    document = (await client.get(f"/calibrations/{new['id']}")).json()
    assert [joint["views"] for joint in document["calibration"]["quality"]["joints"]] == [3, 3, 0]


async def test_a_run_that_cannot_be_solved_without_them_stays_as_it_was(
    service: Service, run: RunRecord
) -> None:
    unsolved, events = await finish(service, await service.runs.solve(run.id, range(7)))
    assert (unsolved.state, unsolved.calibration_id) == (RunState.SUCCEEDED, run.calibration_id)
    assert (unsolved.error or "").startswith(UNSOLVED)
    assert events[-1].type == "finished"
    assert events[-1].error == unsolved.error
    solved, _ = await finish(service, await service.runs.solve(run.id))
    assert (solved.state, solved.error) == (RunState.SUCCEEDED, None)


async def test_a_succeeded_run_whose_solving_is_cut_off_has_still_succeeded(
    service: Service, run: RunRecord, solver: threading.Event
) -> None:
    solver.clear()
    await service.runs.solve(run.id)
    assert [stored.state for stored in await service.store.runs()] == [RunState.SUCCEEDED]
    await service.runs.cancel(run.id)
    assert (await service.runs.get(run.id)).state is RunState.SUCCEEDED


async def test_what_a_shutdown_has_cut_off_is_asked_for_again(service: Service, run: RunRecord) -> None:
    await service.runs.solve(run.id)
    await service.runs.close()
    cut_off = await service.runs.get(run.id)
    assert cut_off.state is RunState.SUCCEEDED
    assert cut_off.error == f"{UNSOLVED}the daemon was shut down: solve its views again"


async def test_a_succeeded_run_that_the_disk_does_not_take_again_has_still_succeeded(
    service: Service, run: RunRecord
) -> None:
    (service.store.session_folder(run) / ".calibration.json.tmp").symlink_to("/dev/full")
    unsolved, events = await finish(service, await service.runs.solve(run.id))
    assert (unsolved.state, unsolved.calibration_id) == (RunState.SUCCEEDED, run.calibration_id)
    assert unsolved == await service.store.run(run.id)
    assert (unsolved.error or "").startswith(f"{UNSOLVED}its end could not be stored: the disk is full: ")
    assert (unsolved.error or "").endswith(": make room, then solve its views again")
    assert events[-1].error == unsolved.error
