"""Joints that lose steps in a run: found at their views, named, and judged poor; clean rigs do not slip."""

import numpy as np
import pytest

from benchmarks.random_rigs import LookingRig, looking_rig, session_of_views
from calib import Calibration, solve
from calib.errors import UnsolvableError
from calib.session import Session
from calib.stated_quality import Quality
from calib.verdict import judgement_and_verdict

NOISE = 0.1


def slipping_session(
    looking: LookingRig,
    rng: np.random.Generator,
    slips: list[tuple[int, int, float]],
    noise: float = NOISE,
) -> Session:
    """Return a session in which a joint loses `size` on its way to a view, by (joint, view, size)."""
    plan = looking.plan()
    true = np.array([at for _, at in plan])
    for joint, view, size in slips:
        true[view:, joint] += size
    pixels = looking.pixels(true) + noise * rng.normal(size=(len(plan), 42, 2))
    return session_of_views(looking, plan, pixels)


def check_found(calibration: Calibration, slips: list[tuple[int, int, float]], noise: float = NOISE) -> None:
    quality = calibration.quality
    sentences = [sentence for sentence in quality.warnings if " slipped by " in sentence]
    assert len(sentences) == len(slips)
    for sentence, (joint, view, size) in zip(sentences, sorted(slips, key=lambda s: s[1]), strict=True):
        assert sentence.startswith(f"joint 'j{joint}' slipped by ")
        assert f"on its way to view {view}:" in sentence
        assert float(sentence.split()[4]) == pytest.approx(size, abs=0.05 * abs(size))
    assert quality.judgement == "poor"
    assert quality.verdict is not None
    assert all(sentence in quality.verdict for sentence in sentences)
    # The chain is that of the joints that did not slip, and the views agree with it.
    assert quality.rms_px == pytest.approx(noise * np.sqrt(2), rel=0.1)
    assert quality.held_out_rms_px == pytest.approx(noise * np.sqrt(2), rel=0.15)


@pytest.mark.parametrize("part", [0.004, 0.02, -0.08])
@pytest.mark.parametrize("seed", [0, 2])
def test_a_slip_amid_a_sweep_is_found(seed: int, part: float) -> None:
    rng = np.random.default_rng(seed)
    looking = looking_rig(rng, 2 + seed)
    slips = [(seed // 2, 9 * (seed // 2) + 5, part * float(np.ptp(looking.ranges[seed // 2])))]
    check_found(solve(slipping_session(looking, rng, slips)), slips)


@pytest.mark.parametrize("view", [3, 4])
@pytest.mark.parametrize("seed", [2, 3])
def test_a_slip_that_sets_the_few_views_before_it_aside_is_found(seed: int, view: int) -> None:
    """Hundreds of times the noise, so that these hardly count any more."""
    rng = np.random.default_rng(seed)
    looking = looking_rig(rng, 2)
    slips, noise = [(0, view, 0.01 * float(np.ptp(looking.ranges[0])))], 0.002
    check_found(solve(slipping_session(looking, rng, slips, noise)), slips, noise)


@pytest.mark.parametrize("view", [9, 18])
def test_a_slip_between_sweeps_is_found(view: int) -> None:
    rng = np.random.default_rng(1)
    looking = looking_rig(rng, 3)
    slips = [(view // 9 - 1, view, 0.02 * float(np.ptp(looking.ranges[view // 9 - 1])))]
    check_found(solve(slipping_session(looking, rng, slips)), slips)


def test_two_slips_are_found() -> None:
    rng = np.random.default_rng(4)
    looking = looking_rig(rng, 3)
    slips = [
        (0, 5, 0.02 * float(np.ptp(looking.ranges[0]))),
        (2, 21, 0.02 * float(np.ptp(looking.ranges[2]))),
    ]
    check_found(solve(slipping_session(looking, rng, slips)), slips)


@pytest.mark.parametrize("seed", range(12))
def test_joints_that_hold_do_not_slip(seed: int) -> None:
    rng = np.random.default_rng(500 + seed)
    looking = looking_rig(rng, 2 + seed % 3)
    session = slipping_session(looking, rng, [])
    noisy = 0.002 * np.ptp(looking.ranges, axis=1) * (seed % 2)
    read = session.readings() + noisy * rng.normal(size=session.readings().shape)
    assert not [
        sentence for sentence in solve(session.read_as(read)).quality.warnings if "slipped" in sentence
    ]


def test_a_slip_is_poor_however_small_the_misses() -> None:
    judgement, verdict = judgement_and_verdict(Quality(), True, [], ["joint 'pan' slipped by 2 deg"])
    assert judgement == "poor"
    assert "slipped by 2 deg" in verdict


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("moved", [0, 1])
def test_a_joint_that_stands_while_its_readings_change_is_named(seed: int, joint: int, moved: int) -> None:
    """A stepper stalls as its sweep begins, or after its first step."""
    rng = np.random.default_rng(seed)
    looking = looking_rig(rng, 2)
    plan = looking.plan()
    true = np.array([at for _, at in plan])
    own = slice(9 * joint, 9 * joint + 9)
    true[own, joint] = np.minimum(true[own, joint], true[9 * joint + moved, joint])
    pixels = looking.pixels(true) + NOISE * rng.normal(size=(len(plan), 42, 2))
    with pytest.raises(UnsolvableError, match=f"joint 'j{joint}' did not move the camera") as caught:
        solve(session_of_views(looking, plan, pixels))
    assert "coupled" in str(caught.value)
