"""The API looks for the target in the live picture, and says how good the picture is."""

import asyncio
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest

from calib import detection
from calib.detection import inspection
from daemon.api import create_app
from daemon.service import Service, running_service
from tests.daemon.rigs import LOOKING_AWAY, small_rig


async def test_the_target_is_found_in_the_live_picture(client: httpx.AsyncClient) -> None:
    answer = await client.get("/camera/detection")
    assert answer.status_code == 200
    seen = answer.json()
    assert seen["found"]
    assert seen["problem"] is None
    assert seen["ids"] == list(range(20))
    assert all(0 < x < 480 and 0 < y < 360 for x, y in seen["pixels"])
    assert seen["sequence"] >= 1
    assert seen["health"]["target"]["points"] == 20
    assert 1 < seen["health"]["edges"]["narrowest_px"] < 5


async def test_a_picture_without_the_target_is_an_answer_too(tmp_path: Path) -> None:
    profile = small_rig(tmp_path, look_at=LOOKING_AWAY)
    async with running_service(profile, tmp_path / "data") as service:
        transport = httpx.ASGITransport(create_app(service))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
            seen = (await client.get("/camera/detection")).json()
    assert not seen["found"]
    assert "4 x 5 circle grid was not found" in seen["problem"]
    assert seen["ids"] == seen["pixels"] == []
    assert seen["health"]["target"] is None


async def test_many_who_ask_share_one_look(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = await service.rig.frame()

    async def same_frame() -> object:
        return frame

    looks, really = [], inspection.inspect

    def look(*given: object, **more: object) -> detection.Inspection:
        looks.append(given)
        return really(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(service.rig, "frame", same_frame)
    monkeypatch.setattr(inspection, "inspect", look)
    sightings = await asyncio.gather(*(service.sightings.newest() for _ in range(5)))
    assert len(looks) == 1
    assert all(sighting is sightings[0] for sighting in sightings)


async def test_from_look_to_look_the_target_is_tracked(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = (await service.sightings.newest()).inspection.detection
    assert first is not None
    monkeypatch.setattr(inspection, "detect", lambda *_: pytest.fail("the whole picture was searched"))
    sighting = await service.sightings.newest()
    assert sighting.inspection.detection is not None
    np.testing.assert_allclose(sighting.inspection.detection.pixels, first.pixels, atol=0.2)


async def test_where_tracking_ends_the_whole_picture_is_searched(service: Service) -> None:
    frame, target = await service.rig.frame(), service.profile.target
    seen = detection.detect(frame.image, target)
    elsewhere = replace(seen, pixels=seen.pixels * 0.5)
    again = detection.inspect(frame.image, target, before=elsewhere).detection
    assert again is not None
    np.testing.assert_array_equal(again.pixels, seen.pixels)
