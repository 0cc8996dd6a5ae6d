"""What is known beforehand counts for what it says: held exactly, or weighed against the measurements."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.random_rigs import LookingRig, looking_rig, noisy_session
from calib import Calibration, solve
from calib.errors import FormatError, UnsolvableError
from calib.lens_prior import LensPrior
from calib.parameters import LENS_NAMES
from calib.session import Session
from calib.units import nominal_scale
from tests.calib.scenes import DISK_CENTRES, DISKS, plan, points_session, two_axis_rig

OFF = 4e-4
"""By how much, relative to it, a true scale differs from what the unit says."""
ABOUT = {name: 1e3 if name in LENS_NAMES["opencv"][:4] else 10.0 for name in LENS_NAMES["opencv"]}
"""Standard deviations that say next to nothing."""


@cache
def rig_and_session() -> tuple[LookingRig, Session]:
    rng = np.random.default_rng(9)
    looking = looking_rig(rng, 2)
    nominal = np.array(
        [nominal_scale(k, {"revolute": "deg", "prismatic": "mm"}[k]) for k in looking.rig.kinds]
    )
    looking = replace(looking, rig=replace(looking.rig, scales=nominal * (1 + OFF)))
    return looking, noisy_session(looking, rng)


@cache
def plain() -> Calibration:
    return solve(rig_and_session()[1])


def changed(session: Session, **keys: Any) -> Session:
    """Return the session with other keys of its first joint or camera."""
    document = session.model_dump(exclude_unset=True)
    for key, value in keys.items():
        document["cameras" if key.startswith("intrinsics") else "joints"][0][key] = value
    return Session.model_validate(document)


def numbers(calibration: Calibration) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return the names, values and covariance of the numbers that a fit finds independently of conventions."""
    assert calibration.covariance is not None
    names = [
        n for n in calibration.covariance.parameters if "intrinsics" in n or "scale" in n or ".3" in n[-2:]
    ]
    place = [calibration.covariance.parameters.index(name) for name in names]
    document = calibration.model_dump()
    values = []
    for name in names:
        value: Any = document
        for step in name.split("."):
            value = value[int(step)] if isinstance(value, list) else value[step]
        values.append(value)
    return names, np.array(values), np.array(calibration.covariance.matrix)[np.ix_(place, place)]


def updated(name: str, mean: float, std: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what the plain fit's numbers and covariance become once `name` is also known from elsewhere (Kalman)."""
    names, values, covariance = numbers(plain())
    column = covariance[:, names.index(name)]
    gain = column / (column[names.index(name)] + std**2)
    return values + gain * (mean - values[names.index(name)]), covariance - np.outer(gain, column)


def expect(calibration: Calibration, values: np.ndarray, covariance: np.ndarray, within: float = 0.1) -> None:
    """Expect these numbers within a part of their standard deviations, and this covariance."""
    _, found, spread = numbers(calibration)
    sizes = np.sqrt(np.diag(numbers(plain())[2]))
    assert np.abs((found - values) / sizes).max() < within
    assert np.abs((spread - covariance) / np.outer(sizes, sizes)).max() < 0.03


def about(fx: float, std: float) -> Session:
    lens = plain().cameras[0].intrinsics
    assert lens is not None
    given_lens = lens.model_copy(update={"fx": fx}).model_dump()
    return changed(rig_and_session()[1], intrinsics=given_lens, intrinsics_std=ABOUT | {"fx": std})


def test_a_lens_that_is_about_known_is_weighed_against_the_pictures() -> None:
    name = "cameras.0.intrinsics.fx"
    names, values, covariance = numbers(plain())
    found, std = values[names.index(name)], np.sqrt(covariance[names.index(name), names.index(name)])
    for pull, size in ((3.0, 1.0), (-2.0, 0.3)):
        calibration = solve(about(found + pull * std, size * std))
        expect(calibration, *updated(name, found + pull * std, size * std))


def test_a_lens_of_which_nothing_is_known_is_found_as_without() -> None:
    expect(solve(about(1400.0, 1e3)), *numbers(plain())[1:], within=0.02)


def test_numbers_without_a_standard_deviation_are_kept() -> None:
    lens = {
        "model": "opencv",
        "fx": 1505.0,
        "fy": 1505.0,
        "cx": 641.0,
        "cy": 478.0,
        "distortion": [-0.1, 0.05, 0, 0, 0],
    }
    session = changed(rig_and_session()[1], intrinsics=lens, intrinsics_std={"fx": 5.0, "fy": 5.0})
    for method in ("ml", "closed_form"):
        found = solve(session, method).cameras[0].intrinsics
        assert found is not None
        assert (found.cx, found.cy, found.distortion) == (641.0, 478.0, [-0.1, 0.05, 0, 0, 0])
        assert 1498 < found.fx < 1505


def test_a_trusted_encoder_is_weighed_against_the_pictures() -> None:
    joint = rig_and_session()[1].joints[0]
    nominal = nominal_scale(joint.kind, joint.reading_unit)
    assert nominal is not None
    for relative in (OFF, 2e-5):
        calibration = solve(changed(rig_and_session()[1], scale_std=relative))
        expect(calibration, *updated("joints.0.scale", nominal, relative * nominal))
        assert calibration.joints[0].scale_std is not None
        assert calibration.joints[0].scale_std < relative * nominal


def test_a_joint_that_hardly_moved_keeps_the_scale_of_its_unit() -> None:
    looking, _ = rig_and_session()
    still = replace(looking, ranges=np.array([looking.ranges[0] * 2e-3, looking.ranges[1]]))
    session = noisy_session(still, np.random.default_rng(1))
    nominal = nominal_scale(session.joints[0].kind, session.joints[0].reading_unit)
    assert nominal is not None
    alone, known = solve(session).joints[0], solve(changed(session, scale_std=1e-3)).joints[0]
    assert alone.scale_std is not None
    assert alone.scale_std > 0.02 * nominal
    assert known.scale == pytest.approx(nominal, rel=1e-3)
    assert known.scale_std == pytest.approx(1e-3 * nominal, rel=0.05)


@pytest.mark.parametrize("name", ["joints.0.scale", "cameras.0.intrinsics.cy"])
def test_holding_is_conditioning(name: str) -> None:
    """What is held where it was found changes no other number, and takes its share out of their covariance."""
    session = rig_and_session()[1]
    names, values, _ = numbers(plain())
    short = name.replace("joints.0", session.joints[0].name).replace("cameras.0.intrinsics", "main")
    for shift in (0.0, 1.0):
        value = values[names.index(name)] + shift * np.sqrt(
            numbers(plain())[2][names.index(name), names.index(name)]
        )
        calibration = solve(session, hold={short: float(value)})
        _, found, spread = numbers(calibration)
        assert found[names.index(name)] == value
        assert not spread[names.index(name)].any()
        expect(calibration, *updated(name, value, 0.0))


@pytest.mark.parametrize("method", ["ml", "closed_form"])
def test_what_is_held_is_kept_exactly(method: Any) -> None:
    looking, session = rig_and_session()
    joint, axis = session.joints[0].name, looking.rig.axes[0]
    hold = {
        f"{joint}.scale": None,
        f"{joint}.axis": (-3 * axis).tolist(),
        "main.k3": 0,
        "main.cx": 640.0,
        "main.aspect": 1,
    }
    calibration = solve(session, method, hold=hold)
    lens = calibration.cameras[0].intrinsics
    assert lens is not None
    assert calibration.joints[0].scale == nominal_scale(
        session.joints[0].kind, session.joints[0].reading_unit
    )
    assert np.allclose(calibration.joints[0].axis, axis, atol=1e-15)
    assert (lens.distortion[4], lens.cx) == (0.0, 640.0)
    assert lens.fx == pytest.approx(lens.fy, rel=1e-14)
    assert lens.fx == pytest.approx(1500, rel=0.01)
    if calibration.covariance is not None:
        names, spread = calibration.covariance.parameters, np.array(calibration.covariance.matrix)
        zero = {name for name, row in zip(names, spread, strict=True) if not row.any()}
        assert {"joints.0.scale", "joints.0.axis.0", "cameras.0.intrinsics.distortion.4"} <= zero
        both = [names.index(f"cameras.0.intrinsics.{entry}") for entry in ("fx", "fy")]
        assert np.allclose(spread[both[0]], spread[both[1]])
        assert spread[both[0], both[0]] > 0


def test_an_axis_goes_through_the_point_that_it_is_held_at() -> None:
    rig = two_axis_rig()
    views = [{"joint": "slide", "readings": [s, 0.0]} for s in (0, 50, 100)]
    views += [{"joint": "pan", "readings": [0.0, s]} for s in (-8, -4, 0, 4, 8)]
    session = points_session(
        rig, views, {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}, DISK_CENTRES
    )
    point = rig.points[1] + [0.002, 0.0, 0.001]
    for method in ("ml", "closed_form"):
        pan = solve(session, method, hold={"pan.point": point.tolist()}).joints[1]
        assert np.linalg.norm(np.cross(point - pan.point, pan.axis)) < 1e-12
        assert np.dot(pan.point, pan.axis) == pytest.approx(0, abs=1e-12)


def test_a_single_view_keeps_what_is_held_of_its_lens() -> None:
    view = [{"joint": "slide", "readings": [0.0, 0.0]}]
    session = points_session(two_axis_rig(), view, {**DISKS, "kind": "chessboard"}, DISK_CENTRES)
    document = session.model_dump(exclude_unset=True) | {"joints": []}
    document["views"] = [view | {"joint": None, "readings": []} for view in document["views"]]
    alone = Session.model_validate(document)
    lens = solve(alone, hold={"main.cx": 640.0, "main.cy": 480.0, "main.k1": 0.0}).cameras[0].intrinsics
    assert lens is not None
    assert (lens.model, lens.cx, lens.cy, lens.distortion) == ("division", 640.0, 480.0, [0.0])
    assert lens.fx == pytest.approx(1500, rel=1e-6)
    lens = solve(alone, hold={"main.fx": 1490.0, "main.aspect": 1.0}).cameras[0].intrinsics
    assert lens is not None
    assert (lens.fx, lens.fy) == (1490.0, 1490.0)
    with pytest.raises(
        UnsolvableError, match="camera 'main': a single view gives the lens model 'division', which has no k3"
    ):
        solve(alone, hold={"main.k3": 0.0})


def test_what_is_held_far_from_the_truth_is_said_to_disagree() -> None:
    session = rig_and_session()[1]
    pan = next(joint.name for joint in session.joints if joint.kind == "revolute")
    calibration = solve(session, hold={f"{pan}.axis": [0.3, 0.4, 0.5]})
    aside = [
        warning for warning in calibration.quality.warnings if "does not agree with the others" in warning
    ]
    assert len(aside) > len(session.views) / 4
    assert calibration.covariance is not None
    assert np.isfinite(calibration.covariance.matrix).all()


@pytest.mark.parametrize(
    ("held", "noise"),
    [({"slide.scale": 0.00101}, 0.0), ({"pan.axis": [0, 1, 0.4]}, 0.1), ({"main.fx": 3000}, 0.1)],
)
def test_what_contradicts_the_views_ends_in_warnings_or_a_sentence(
    held: dict[str, Any], noise: float
) -> None:
    target = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}
    session = points_session(two_axis_rig(), plan(), target, DISK_CENTRES)
    rng, document = np.random.default_rng(0), session.model_dump(exclude_unset=True)
    for view in document["views"]:
        pixels = np.array(view["points"]["pixels"])
        view["points"]["pixels"] = (pixels + noise * rng.normal(size=pixels.shape)).tolist()
    try:
        said = solve(Session.model_validate(document), hold=held).quality.warnings
    except UnsolvableError as error:
        said = [str(error)]
    told = ("does not agree with the others", "set aside", "that are held right?")
    assert any(words in sentence for sentence in said for words in told), said


@pytest.mark.parametrize(
    ("held", "says"),
    [
        ({"pam.scale": 1}, "held: there is no parameter 'pam.scale' to hold; there are j0.scale, j0.axis, "),
        ({"j0.scale": -1}, "held: j0.scale: must be greater than 0, unlike -1"),
        ({"j0.scale": [1, 2, 3]}, "held: j0.scale: must be a single number"),
        ({"j0.axis": None}, "held: j0.axis: give the value to hold it at, which nothing else says"),
        ({"j0.axis": 1}, "held: j0.axis: must be three numbers"),
        ({"j0.axis": [0, 0, 0]}, "held: j0.axis: must be a direction, not three zeros"),
        ({"main.k1": None}, "held: main.k1: give the value to hold it at, which nothing else says"),
        ({"main.k1": "x"}, "held: must be a number, three numbers, or null"),
        (
            {"main.fx": 1, "main.fy": 1, "main.aspect": 1},
            "held: main.aspect: fx and fy are both known exactly",
        ),
    ],
)
def test_what_cannot_be_held_is_said(held: dict[str, Any], says: str) -> None:
    with pytest.raises(FormatError) as raised:
        solve(rig_and_session()[1], hold=held)
    assert str(raised.value).startswith(says)


numbers_of_a_lens = st.lists(st.floats(0.5, 2.0), min_size=9, max_size=9).map(np.array)


@settings(deadline=None)
@given(
    mean=numbers_of_a_lens,
    values=numbers_of_a_lens,
    std=st.lists(st.sampled_from([0.0, 0.1, np.inf]), min_size=9, max_size=9).map(np.array),
    aspect=st.none() | st.floats(0.5, 2.0),
    step=numbers_of_a_lens,
)
def test_steps_of_a_lens_keep_what_is_held(
    mean: np.ndarray, values: np.ndarray, std: np.ndarray, aspect: float | None, step: np.ndarray
) -> None:
    prior = LensPrior(mean, std)
    if aspect is not None:
        prior = prior.with_aspect(aspect)
    start = prior.imposed(values)
    moved = start + prior.by_step() @ step
    fixed = prior.std == 0
    assert np.allclose(moved[fixed], prior.mean[fixed], rtol=1e-15)
    assert np.array_equal(prior.imposed(start), start)
    if aspect is not None:
        assert moved[0] == pytest.approx(aspect * moved[1], rel=1e-12)
    assert np.linalg.matrix_rank(prior.by_step()) == prior.free.sum()
    assert prior.misfit(prior.mean) == 0
