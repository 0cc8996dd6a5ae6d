"""The pose over HTTP: right during and after a run, refused in words where it cannot be known."""

from dataclasses import replace
from typing import Any, cast

import httpx
import numpy as np
import pytest
from numpy.typing import ArrayLike

from calib import Calibration
from daemon.rig import Devices
from daemon.service import Service
from daemon.store import CalibrationRecord, RunState
from drivers.simulated import SimulatedController
from tests.daemon.motions import home_all, until

POSITION = 2e-3
ROTATION = 5e-3
"""What the fit reaches on this rig's little pictures (m, rad), with a margin of five."""


@pytest.fixture
async def calibrated(service: Service) -> Service:
    run = await service.runs.start()
    assert (await service.runs.wait(run.id)).state is RunState.SUCCEEDED
    return service


def assert_true(service: Service, pose: dict[str, Any]) -> None:
    """The answer agrees with the simulated truth at its own readings."""
    assert service.rig.world is not None
    true = service.rig.world.world_from_camera(pose["readings"])
    found = np.array(pose["world_from_camera"])
    assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < POSITION
    assert np.linalg.norm(found[:3, :3] - true[:3, :3]) < ROTATION
    assert pose["position"] == [row[3] for row in pose["world_from_camera"][:3]]
    assert np.allclose(rotation_of(pose["quaternion"]), found[:3, :3], atol=1e-9)


def rotation_of(quaternion: ArrayLike) -> Any:
    x, y, z, w = np.asarray(quaternion, dtype=float)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


async def test_the_pose_is_right_during_and_after_a_run(
    calibrated: Service, client: httpx.AsyncClient
) -> None:
    assert_true(calibrated, (await client.get("/pose")).json())
    run = (await client.post("/runs", json={})).json()
    moving = []
    async for event in calibrated.runs.events(run["id"]):
        if event.type == "moving":
            # Its last motion may be over by now.
            await until(calibrated.rig, lambda snapshot: snapshot.moving or calibrated.runs.active is None)
        answer = await client.get("/pose")
        assert answer.status_code == 200
        assert_true(calibrated, answer.json())
        moving.append(answer.json()["moving"])
    assert any(moving)
    assert not all(moving)
    pose = (await client.get("/pose")).json()
    finished = (await client.get(f"/runs/{run['id']}")).json()
    assert pose["calibration_id"] == finished["calibration_id"]
    assert_true(calibrated, pose)


async def test_an_answer_says_how_old_and_how_far_out_it_is(
    calibrated: Service, client: httpx.AsyncClient
) -> None:
    inside = (await client.get("/pose", params={"camera": "main"})).json()
    assert inside["out_of_range"] == []
    covariance = np.array(inside["covariance"])
    assert covariance.shape == (6, 6)
    assert (np.linalg.eigvalsh(covariance) > 0).all()
    assert 0 <= inside["age_s"] < 2
    assert inside["timestamp"].endswith("Z")
    await calibrated.rig.move({"pan": 15.0})
    await calibrated.rig.fresh_snapshot(calibrated.rig.clock.now())
    beyond = (await client.get("/pose")).json()
    assert beyond["out_of_range"] == ["pan"]
    assert beyond["timestamp"] > inside["timestamp"]
    calibration = (await client.get("/calibrations/current")).json()["calibration"]
    base = np.array(calibration["world_from_base"])
    assert np.allclose(base @ beyond["base_from_camera"], beyond["world_from_camera"], atol=1e-12)


@pytest.mark.parametrize("count", [1, 64, 65, 300])
async def test_many_poses_are_those_of_each(
    calibrated: Service, client: httpx.AsyncClient, count: int
) -> None:
    readings = np.random.default_rng(0).uniform([0, -12], [100, 12], (count, 2)).tolist()
    answer = (await client.post("/pose", json={"readings": readings})).json()
    assert [pose["readings"] for pose in answer["poses"]] == readings
    assert answer["calibration_id"] == calibrated.poses.calibration_id
    for pose in answer["poses"]:
        assert_true(calibrated, pose)
        expected = calibrated.poses.active.calibration.world_from_camera(pose["readings"])
        assert np.allclose(pose["world_from_camera"], expected, atol=1e-12)


async def test_a_joint_with_play_is_answered_by_its_side(
    calibrated: Service, client: httpx.AsyncClient
) -> None:
    poses = calibrated.poses
    loose = {"backlash": [{"joint": "pan", "half_gap": 0.5}]}
    document = poses.active.calibration.model_dump(mode="json", exclude_unset=True) | {"corrections": loose}
    poses.activate(poses.prepare("loose", Calibration.model_validate(document)))
    at = poses.active.calibration.world_from_camera
    for target, side in ((3.0, 1), (1.0, -1), (2.0, 1)):
        await calibrated.rig.move({"slide": 50.0, "pan": target})
        pose = (await client.get("/pose")).json()
        assert pose["approached"][1] == side
        assert np.allclose(pose["world_from_camera"], at(pose["readings"], approached=[0, side]))
    readings = [[50.0, 2.0], [50.0, 2.0]]
    answer = await client.post("/pose", json={"readings": readings, "approached": [[0, 1], [0, 0]]})
    known, unknown = answer.json()["poses"]
    assert np.allclose(known["world_from_camera"], pose["world_from_camera"])
    assert np.allclose(unknown["world_from_camera"], at(readings[1]))
    assert np.trace(unknown["covariance"]) > 10 * np.trace(known["covariance"])
    plain = (await client.post("/pose", json={"readings": readings[:1]})).json()["poses"][0]
    assert plain["covariance"] == unknown["covariance"]
    project = {"points": [[0.05, 0.05, 0.0]]}
    now = (await client.post("/project", json=project)).json()["pixels"]
    anywhere = (await client.post("/project", json=project | {"readings": readings[:1]})).json()["pixels"]
    assert np.linalg.norm(np.subtract(now, anywhere)) > 1


@pytest.mark.parametrize("sides", [[[1]], [[1, 0], [1, 0]], [[1, 0, 0]]])
async def test_sides_that_do_not_fit_are_refused(
    calibrated: Service, client: httpx.AsyncClient, sides: list[list[int]]
) -> None:
    answer = await client.post("/pose", json={"readings": [[1.0, 2.0]], "approached": sides})
    assert answer.status_code == 422
    assert answer.json()["code"] == "readings_invalid"


@pytest.mark.parametrize("readings", [[[1.0]], [[1.0, 2.0], [1.0, 2.0, 3.0]]])
async def test_readings_that_do_not_fit_are_refused(
    calibrated: Service, client: httpx.AsyncClient, readings: list[list[float]]
) -> None:
    for address, more in (
        ("/pose", {}),
        ("/project", {"points": [[0, 0, 0]]}),
        ("/rays", {"pixels": [[0, 0]]}),
    ):
        answer = await client.post(address, json={"readings": readings, **more})
        assert answer.status_code == 422
        assert answer.json()["code"] == "readings_invalid"


async def test_points_and_pixels_lead_to_each_other(calibrated: Service, client: httpx.AsyncClient) -> None:
    readings = [[20.0, 3.0], [90.0, -4.0]]
    points = [[0.0, 0.0, 0.0], [0.12, 0.09, 0.0], [0.05, 0.05, -5.0]]  # the last one is behind the camera
    seen = (await client.post("/project", json={"points": points, "readings": readings})).json()["pixels"]
    assert calibrated.rig.world is not None
    for vector, pixels in zip(readings, seen, strict=True):
        true = calibrated.rig.world.project(points[:2], vector)
        assert np.abs(np.array(pixels[:2]) - true).max() < 1.0
        assert pixels[2] is None
    for vector, pixels in zip(readings, seen, strict=True):
        (bundle,) = (await client.post("/rays", json={"pixels": pixels[:2], "readings": [vector]})).json()[
            "rays"
        ]
        origin = np.array(bundle["origin"])
        for point, direction in zip(points[:2], bundle["directions"], strict=True):
            towards = np.array(point) - origin
            assert np.allclose(direction, towards / np.linalg.norm(towards), atol=1e-9)
    now = (await client.post("/project", json={"points": points[:1]})).json()
    assert now["readings"] == [list(calibrated.rig.snapshot.readings)]


async def test_a_lens_that_is_not_known_is_said_so(calibrated: Service, client: httpx.AsyncClient) -> None:
    document = calibrated.poses.active.calibration.model_dump(mode="json")
    document["cameras"][0]["intrinsics"] = None
    without = calibrated.poses.prepare("without a lens", Calibration.model_validate(document))
    calibrated.poses.activate(without)
    answer = await client.post("/project", json={"points": [[0, 0, 0]]})
    assert (answer.status_code, answer.json()["code"]) == (409, "lens_unknown")


async def test_nothing_calibrated_is_a_409(service: Service, client: httpx.AsyncClient) -> None:
    await home_all(service.rig)
    for answer in (
        await client.get("/pose"),
        await client.post("/pose", json={"readings": [[0, 0]]}),
        await client.post("/project", json={"points": [[0, 0, 0]]}),
        await client.post("/rays", json={"pixels": [[0, 0]]}),
        await client.get("/calibrations/current"),
    ):
        assert (answer.status_code, answer.json()["code"]) == (409, "not_calibrated")


async def test_an_unknown_camera_is_a_404(calibrated: Service, client: httpx.AsyncClient) -> None:
    answer = await client.get("/pose", params={"camera": "second"})
    assert (answer.status_code, answer.json()["code"]) == (404, "unknown_camera")
    assert answer.json()["detail"] == "there is no camera 'second': this calibration has main"


async def test_a_lost_device_is_a_503_and_then_an_unhomed_axis_a_409(
    calibrated: Service, client: httpx.AsyncClient, devices: Devices
) -> None:
    stage = cast(SimulatedController, devices.controllers["stage"])
    stage.inject("lost")
    await until(calibrated.rig, lambda snapshot: snapshot.axis("slide").lost is not None)
    answer = await client.get("/pose")
    assert (answer.status_code, answer.json()["code"]) == (503, "device_lost")
    assert (await client.get("/health")).json()["status"] == "degraded"
    stage.repair()
    await until(calibrated.rig, lambda snapshot: snapshot.axis("slide").lost is None)
    answer = await client.get("/pose")
    assert (answer.status_code, answer.json()["code"]) == (409, "not_homed")
    await calibrated.rig.home("slide")
    assert (await client.get("/pose")).status_code == 200


async def test_a_mute_device_never_gives_an_old_pose(
    calibrated: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(calibrated.rig), "age", lambda *_: 2.5)
    answer = await client.get("/pose")
    assert (answer.status_code, answer.json()["code"]) == (503, "reading_stale")
    assert "2.5 s old, and the profile allows 2 s" in answer.json()["detail"]


async def test_a_calibration_that_does_not_fit_is_refused_and_the_active_one_stays(
    calibrated: Service, client: httpx.AsyncClient
) -> None:
    first = calibrated.poses.calibration_id
    assert first is not None
    record = await calibrated.store.calibration(first)
    renamed = record.document.replace(
        '"slide"', '"tilt"'
    )  # wherever it is named, as in corrections that were found
    await keep(calibrated, replace(record, id="another-rigs", document=renamed))
    await keep(calibrated, replace(record, id="cut-off", document=record.document[:100]))
    await calibrated.store.activate(first)
    for other, code in (("another-rigs", "calibration_mismatch"), ("cut-off", "calibration_damaged")):
        answer = await client.post(f"/calibrations/{other}/activate")
        assert (answer.status_code, answer.json()["code"]) == (409, code)
        assert other in answer.json()["detail"]
    assert calibrated.poses.calibration_id == first
    assert (await calibrated.store.active_and_earlier())[0] == first


async def keep(service: Service, record: CalibrationRecord) -> None:
    """Store a calibration, active, as a run's."""
    assert record.run_id is not None
    await service.store.change_run(record.run_id, RunState.SUCCEEDED, calibration=record)


async def test_an_earlier_calibration_can_be_activated(
    calibrated: Service, client: httpx.AsyncClient
) -> None:
    first = calibrated.poses.calibration_id
    await calibrated.runs.wait((await calibrated.runs.start()).id)
    assert (await client.get("/pose")).json()["calibration_id"] != first
    entries = (await client.get("/calibrations")).json()
    assert [entry["active"] for entry in entries] == [True, False]
    answer = await client.post(f"/calibrations/{first}/activate")
    assert (answer.status_code, answer.json()["active"]) == (200, True)
    assert (await client.get("/pose")).json()["calibration_id"] == first
    assert (await client.get("/calibrations/current")).json()["id"] == first
    one = (await client.get(f"/calibrations/{entries[0]['id']}")).json()
    assert one["verification"]["views"] == 2
    assert one["calibration"]["format"] == "activecam.calibration/1"
    missing = await client.post("/calibrations/none/activate")
    assert (missing.status_code, missing.json()["code"]) == (404, "unknown_calibration")
