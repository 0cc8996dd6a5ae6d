"""What a calibration is judged by, asked of one that a run has found."""

import json
import shutil

import httpx
import numpy as np
import pytest

from calib import Calibration, load_session, paper, solve, verify
from calib.verification import VERIFICATION
from daemon.api.judging_documents import TablesDocument
from daemon.service import Service
from daemon.store import RunRecord, RunState
from tests.calib.test_paper_tables import noisy_session
from tests.daemon.judged import asked, forget
from tests.daemon.runs import finish


@pytest.fixture
async def run(service: Service) -> RunRecord:
    run, _ = await finish(service, await service.runs.start())
    assert run.state is RunState.SUCCEEDED
    return run


async def calibration_of(service: Service, run: RunRecord) -> Calibration:
    assert run.calibration_id is not None
    return (await service.store.calibration(run.calibration_id)).read()


async def test_residuals_are_those_that_the_quality_sums_up(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    found = await asked(client, f"/calibrations/{run.calibration_id}/residuals")
    assert (found["run_id"], found["camera"], found["width"], found["height"]) == (run.id, "main", 480, 360)
    quality = (await calibration_of(service, run)).quality
    assert [view["number"] for view in found["views"]] == list(range(10))
    for view, own in zip(found["views"], quality.views, strict=True):
        assert (view["joint"], view["use"], view["set_aside"]) == (own.joint, own.use, False)
        assert view["ids"] == list(range(20))
        assert view["rms_px"] == pytest.approx(own.rms_px, rel=1e-6)
        residuals = np.array(view["residuals"])
        assert np.sqrt((residuals**2).sum(axis=1).mean()) == pytest.approx(view["rms_px"], rel=0.01)


async def test_pixels_and_residuals_lead_to_where_points_are_predicted(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    found = await asked(client, f"/calibrations/{run.calibration_id}/residuals")
    session, calibration = load_session(service.store.session_folder(run)), await calibration_of(service, run)
    points = calibration.points_of(session.target)
    for view in found["views"]:
        taken = session.views[view["number"]]
        predicted = calibration.project(points, taken.readings, approached=taken.approached)
        shown = np.array(view["pixels"]) + np.array(view["residuals"])
        # A disk's centroid is not its centre: by less than a pixel, that are these.
        assert np.abs(shown - predicted[view["ids"]]).max() < 0.6


async def test_residuals_are_worked_out_once(
    client: httpx.AsyncClient, run: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = f"/calibrations/{run.calibration_id}/residuals"
    first = await asked(client, path)
    monkeypatch.setattr("calib.residual_map.residual_map", lambda *_: pytest.fail("again"))
    assert await asked(client, path) == first


async def test_residuals_of_a_run_whose_pictures_are_gone_are_refused_in_words(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    path = f"/calibrations/{run.calibration_id}/residuals"
    forget(service)
    (service.store.session_folder(run) / "frames" / "0002.png").unlink()
    refused = await client.get(path)
    assert (refused.status_code, refused.json()["code"]) == (409, "session_unreadable")
    shutil.rmtree(service.store.session_folder(run))
    refused = await client.get(path)
    assert (refused.status_code, refused.json()["code"]) == (409, "session_unreadable")


async def test_a_run_that_was_resumed_after_it_was_solved_has_other_joints(
    client: httpx.AsyncClient, service: Service
) -> None:
    started = await service.runs.start()
    async for event in service.runs.events(started.id):
        if event.type == "view" and event.view == 3:
            await service.runs.cancel(started.id)
    early, _ = await finish(service, await service.runs.solve(started.id))
    slide_alone = await asked(client, f"/calibrations/{early.calibration_id}/residuals")
    assert [view["number"] for view in slide_alone["views"]] == [0, 1, 2, 3]
    tables = await asked(client, f"/calibrations/{early.calibration_id}/tables")
    assert (tables["verified"], tables["travel"], tables["prediction"]) == (None, [], [])
    assert {parameter["name"].partition(".")[0] for parameter in tables["parameters"]} == {"slide", "main"}


async def test_the_papers_tables_are_those_of_the_verification(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    tables = await asked(client, f"/calibrations/{run.calibration_id}/tables")
    record = await service.store.calibration(run.calibration_id or "")
    verification = VERIFICATION.validate_python(json.loads(record.verification or ""))
    assert tables["verified"]["views"] == verification.views == 2
    assert tables["verified"]["mean_px"] == verification.mean_px
    # This rig's held-out views are free ones: no joint moves alone in them.
    assert (tables["travel"], tables["prediction"]) == ([], [])


def test_the_papers_own_figures_stand_beside_those_of_a_table() -> None:
    """Of a session whose held-out views are sweeps."""
    session = noisy_session(1)
    calibration = solve(session)
    tables = TablesDocument.of("an id", calibration, verify(calibration, session))
    assert [(table.number, table.joint, len(table.rows), len(table.paper)) for table in tables.travel] == [
        (1, "slide", 8, 10),
        (2, "pan", 8, 10),
    ]
    assert [(table.number, len(table.rows), table.paper) for table in tables.prediction] == [
        (3, 5, list(paper.PREDICTION_AFTER_TRANSLATION_PX)),
        (4, 5, list(paper.PREDICTION_AFTER_ROTATION_PX)),
    ]
    assert tables.travel[0].paper[-1].travel == 1.0


async def test_parameters_have_the_documents_values_and_standard_deviations(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    tables = await asked(client, f"/calibrations/{run.calibration_id}/tables")
    calibration = await calibration_of(service, run)
    parameters = {one["name"]: one for one in tables["parameters"]}
    pan, lens = calibration.joints[1], calibration.cameras[0].intrinsics
    assert lens is not None
    assert parameters["pan.scale"] == {
        "name": "pan.scale", "value": pan.scale, "std": pan.scale_std, "unit": "rad/deg", "frame": "none",
    }  # fmt: skip
    assert (parameters["slide.scale"]["unit"], parameters["main.fx"]["value"]) == ("m/mm", lens.fx)
    assert [parameters[f"pan.point.{axis}"]["value"] for axis in "xyz"] == pan.point
    assert "slide.point.x" not in parameters
    row = calibration.dh[1]
    assert row.std is not None
    assert (parameters["pan.alpha_prev"]["value"], parameters["pan.alpha_prev"]["std"]) == (
        row.alpha_prev,
        row.std.alpha_prev,
    )
    assert all(one["std"] is not None and one["std"] >= 0 for one in tables["parameters"])


async def test_what_is_not_stored_is_not_judged(client: httpx.AsyncClient) -> None:
    for what in ("residuals", "tables"):
        answer = await client.get(f"/calibrations/none/{what}")
        assert (answer.status_code, answer.json()["code"]) == (404, "unknown_calibration")


async def test_the_scene_is_of_now_or_of_given_readings(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    path = f"/calibrations/{run.calibration_id}/scene"
    await service.rig.move({"slide": 30.0, "pan": 4.0})
    now, given = await asked(client, path), await asked(client, path, readings=[30.0, 4.0])
    assert now["readings"] == pytest.approx([30.0, 4.0], abs=0.05)
    pose = await asked(client, "/pose")
    np.testing.assert_allclose(now["cameras"][0]["pose"], pose["world_from_camera"], atol=1e-4)
    np.testing.assert_allclose(given["cameras"][0]["pose"], now["cameras"][0]["pose"], atol=2e-3)
    assert [joint["name"] for joint in given["joints"]] == ["slide", "pan"]
    assert len(given["target"]["points"]) == 20
    assert given["cameras"][0]["uncertainty"] is not None
    for readings, code in ([[1.0]], "readings_invalid"), ([["nan", 0]], "invalid_request"):
        refused = await client.get(path, params={"readings": readings[0]})
        assert (refused.status_code, refused.json()["code"]) == (422, code)


async def test_a_scene_at_the_same_readings_is_worked_out_once(
    client: httpx.AsyncClient, run: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = f"/calibrations/{run.calibration_id}/scene"
    first = await asked(client, path, readings=[30.0, 4.0])
    monkeypatch.setattr("daemon.judging.judge.scene", lambda *_: pytest.fail("again"))
    assert await asked(client, path, readings=[30.0, 4.0]) == first


async def test_two_calibrations_are_compared(
    client: httpx.AsyncClient, service: Service, run: RunRecord
) -> None:
    again, _ = await finish(service, await service.runs.solve(run.id, [1]))
    found = await asked(client, f"/calibrations/{run.calibration_id}/compare/{again.calibration_id}")
    assert (found["first"], found["second"]) == (run.calibration_id, again.calibration_id)
    assert (found["agree"], found["sentence"].partition(":")[0]) == (True, "They agree")
    assert found["poses"]["position_max_m"] > 0
    early = await service.runs.start()
    async for event in service.runs.events(early.id):
        if event.type == "view" and event.view == 3:
            await service.runs.cancel(early.id)
    slide_alone, _ = await finish(service, await service.runs.solve(early.id))
    refused = await client.get(f"/calibrations/{run.calibration_id}/compare/{slide_alone.calibration_id}")
    assert (refused.status_code, refused.json()["code"]) == (409, "calibration_unusable")
    mismatched = await client.get(f"/calibrations/{slide_alone.calibration_id}/scene")
    assert (mismatched.status_code, mismatched.json()["code"]) == (409, "calibration_mismatch")
    assert (await client.get(f"/calibrations/none/compare/{run.calibration_id}")).status_code == 404
