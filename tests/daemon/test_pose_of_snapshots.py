"""Whatever a rig reports, a pose is one of readings that are known, fresh and of no lost device, or it is none."""

import asyncio
import json
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.api import pose_stream, problems
from daemon.pose import PoseService
from daemon.rig import AxisSnapshot, Rig, RigSnapshot, make_devices
from daemon.service import Service
from tests.daemon.calibrations import calibrate
from tests.daemon.rigs import small_rig

AGES = st.one_of(st.none(), st.floats(0, 1.9), st.floats(2.1, 1e4))
LOW, HIGH = [0.0, -12.0], [100.0, 12.0]
"""What the readings of the calibration spanned."""


@pytest.fixture(scope="module")
def still(tmp_path_factory: pytest.TempPathFactory) -> Service:
    """As much of a calibrated service as poses need; its rig is never opened: its snapshots are set by hand."""
    profile = small_rig(tmp_path_factory.mktemp("snapshots"), time_scale=1.0)
    rig = Rig(profile, make_devices(profile))
    service = cast(Service, SimpleNamespace(profile=profile, rig=rig, poses=PoseService(rig)))
    calibrate(service)
    return service


@st.composite
def axis_states(draw: st.DrawFn, name: str, low: float, high: float) -> dict[str, object]:
    return {
        "name": name,
        "position": draw(st.one_of(st.none(), st.floats(2 * low - high, 2 * high - low))),
        "age": draw(AGES),
        "moving": draw(st.booleans()),
        "homed": draw(st.sampled_from([True, True, True, False])),
        "approached": draw(st.sampled_from([-1, 0, 1])),
        "fault": draw(st.sampled_from([None, "alarm"])),
        "lost": draw(st.sampled_from([None, None, None, "unplugged"])),
    }


states = st.tuples(axis_states("slide", LOW[0], HIGH[0]), axis_states("pan", LOW[1], HIGH[1]))


def set_snapshot(rig: Rig, axes: tuple[dict[str, object], ...]) -> None:
    now = rig.clock.now()
    rig.snapshot = RigSnapshot(
        tuple(
            AxisSnapshot(
                rig.specs[str(axis["name"])],
                "controller",
                timestamp=None if axis["age"] is None else now - float(str(axis["age"])),
                **{key: axis[key] for key in axis if key not in ("name", "age")},  # type: ignore[arg-type]
            )
            for axis in axes
        ),
        (),
    )


def expected_problem(axes: tuple[dict[str, object], ...]) -> str | None:
    if any(axis["lost"] for axis in axes):
        return "device_lost"
    if any(axis["age"] is None or float(str(axis["age"])) > 2 for axis in axes):
        return "reading_stale"
    if any(not axis["homed"] or axis["position"] is None for axis in axes):
        return "not_homed"
    return None


@settings(max_examples=150, deadline=None)
@given(states)
def test_a_pose_is_of_believable_readings_or_none(
    still: Service, axes: tuple[dict[str, object], ...]
) -> None:
    set_snapshot(still.rig, axes)
    code = expected_problem(axes)
    for message in (first_of_stream(still), answer(still)):
        if code is not None:
            assert (message["code"], message["status"]) == (code, 409 if code == "not_homed" else 503)
            continue
        readings = [axis["position"] for axis in axes]
        assert message["readings"] == readings
        assert message["approached"] == [axis["approached"] for axis in axes]
        assert message["moving"] == any(axis["moving"] for axis in axes)
        expected = still.poses.active.calibration.world_from_camera(
            readings, approached=message["approached"]
        )
        assert np.allclose(message["world_from_camera"], expected, atol=1e-12)
        low, high = np.transpose(still.poses.active.calibration.range)
        assert message["out_of_range"] == [
            axis["name"]
            for axis, at, least, most in zip(axes, readings, low, high, strict=True)
            if not least <= at <= most
        ]
        assert message["age_s"] >= max(float(str(axis["age"])) for axis in axes)


def answer(service: Service) -> dict[str, object]:
    try:
        message: dict[str, object] = json.loads(service.poses.now())
    except Exception as error:
        return problems.document(problems.kind_of(error), str(error), "")
    return message


def first_of_stream(service: Service) -> dict[str, object]:
    async def first() -> dict[str, object]:
        messages = pose_stream.messages(service, None, "", 0.0)
        message: dict[str, object] = json.loads(await anext(messages))
        await messages.aclose()  # type: ignore[attr-defined]
        return message

    return asyncio.run(first())
