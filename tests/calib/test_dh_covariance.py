"""How sure D-H parameters are, against differences of `links_of` itself and against drawn calibrations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.random_rigs import looking_rig, noisy_session
from calib import Calibration, solve
from calib.chain import Chain
from calib.dh_covariance import ENTRIES, dh_covariance, dh_jacobian
from calib.links import Links, based, links_of
from calib.transforms import inverse, rotation_log
from calib.twists import exp_twist
from tests.calib.rigs import Rig, rigs

STEP = 1e-7


def numbers_of(joints: int) -> list[str]:
    vectors = [f"joints.{j}.{key}.{i}" for j in range(joints) for key in ("axis", "point") for i in range(3)]
    return vectors + [f"joints.{j}.scale" for j in range(joints)]


def changed(chain: Chain, names: list[str], steps: np.ndarray) -> Chain:
    """Return the chain with the document's numbers of these names changed by `steps`."""
    axes, points, scales = chain.axes.copy(), chain.points.copy(), chain.scales.copy()
    for name, step in zip(names, steps, strict=True):
        _, joint, key, *rest = name.split(".")
        if key == "scale":
            scales[int(joint)] += step
        else:
            (axes if key == "axis" else points)[int(joint), int(rest[0])] += step
    kinds = ["revolute" if revolute else "prismatic" for revolute in chain.revolute]
    return Chain.of(kinds, list(axes), list(points), scales.tolist())


def rows_of(links: Links, chain: Chain) -> np.ndarray:
    """Return the D-H entries (m, 5) in the order of `ENTRIES`."""
    read = [[getattr(row, entry) for entry in ENTRIES[:4]] for row in links.rows]
    return np.column_stack([np.array(read), chain.scales])


def difference(there: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Return the difference of D-H rows (..., m, 5), angles by the short way round."""
    apart = there - back
    apart[..., [1, 3]] = (apart[..., [1, 3]] + np.pi) % (2 * np.pi) - np.pi
    return apart


def base_twist(base: np.ndarray, moved: np.ndarray) -> np.ndarray:
    motion = inverse(base) @ moved
    return np.concatenate([rotation_log(motion[None])[0], motion[:3, 3]])


def chain_of(rig: Rig) -> Chain:
    return Chain.of(rig.kinds, list(rig.axes), list(rig.points), rig.scales.tolist())


def expect_derivatives(chain: Chain, names: list[str], drawn: np.ndarray | None = None) -> None:
    def read(one: Chain) -> Links:
        return links_of(one) if drawn is None else based(links_of(one), drawn)

    base = read(chain).world_from_base
    rows, moved = dh_jacobian(chain, base, names)
    for column, step in enumerate(STEP * np.eye(len(names))):
        there, back = changed(chain, names, step), changed(chain, names, -step)
        expected = difference(rows_of(read(there), there), rows_of(read(back), back)) / (2 * STEP)
        size = max(1.0, float(np.abs(rows).max()))
        assert np.allclose(rows[:, :, column], expected, rtol=1e-4, atol=1e-5 * size), names[column]
        bases = [base_twist(base, read(one).world_from_base) for one in (there, back)]
        assert np.allclose(moved[:, column], (bases[0] - bases[1]) / (2 * STEP), rtol=1e-4, atol=1e-5 * size)


def skewness(chain: Chain) -> float:
    """Return the sine of the smallest angle between neighbouring axes."""
    return float(np.linalg.norm(np.cross(chain.axes[:-1], chain.axes[1:]), axis=1).min(initial=1.0))


@settings(max_examples=60, deadline=None)
@given(rigs(joints=(1, 5)))
def test_derivatives_are_differences(drawn: tuple[Rig, np.random.Generator]) -> None:
    chain = chain_of(drawn[0])
    names = numbers_of(len(chain))
    rows, moved = dh_jacobian(chain, links_of(chain).world_from_base, names)
    assert np.isfinite(rows).all()
    assert np.isfinite(moved).all()
    if skewness(chain) > 0.05:
        expect_derivatives(chain, names)


def test_a_drawings_base_moves_with_the_first_axis() -> None:
    rng = np.random.default_rng(1)
    axes = rng.normal(size=(3, 3))
    chain = Chain.of(
        ["revolute", "prismatic", "revolute"], list(axes), list(rng.normal(size=(3, 3))), [1, 1, 1]
    )
    first = links_of(chain).world_from_base
    turned = first @ exp_twist(np.array([0, 0, 0.7, 0, 0, 0.2]))
    expect_derivatives(chain, numbers_of(3), turned)


@pytest.mark.parametrize("senses", [(1, 1), (1, -1), (-1, 1)])
def test_axes_that_are_held_parallel_go_round_each_other(senses: tuple[int, int]) -> None:
    up = np.array([0.0, 0.0, 1.0])
    axes = [up, senses[0] * up, senses[0] * senses[1] * up, np.array([0.0, 1.0, 0.3])]
    points = np.random.default_rng(3).normal(size=(4, 3))
    chain = Chain.of(["revolute"] * 4, axes, list(points), [1.0] * 4)
    expect_derivatives(chain, [name for name in numbers_of(4) if "point" in name])


def calibrated(seed: int, joints: int) -> Calibration:
    rng = np.random.default_rng(seed)
    return solve(noisy_session(looking_rig(rng, joints), rng))


@pytest.mark.parametrize("seed", [9, 10])
def test_drawn_calibrations_scatter_as_stated(seed: int) -> None:
    calibration = calibrated(seed, 2)
    known, stated = calibration.dh_covariance(), calibration.covariance
    assert known is not None
    assert stated is not None
    chain = calibration.chain
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(
        np.zeros(len(stated.parameters)), np.array(stated.matrix), size=3000, tol=1e-6
    )
    ours = [index for index, name in enumerate(stated.parameters) if name.startswith("joints")]
    names = [stated.parameters[index] for index in ours]
    at, base = rows_of(links_of(chain), chain), links_of(chain).world_from_base
    rows, bases = [], []
    for steps in drawn[:, ours]:
        other = changed(chain, names, steps)
        links = links_of(other)
        rows.append(difference(rows_of(links, other), at).ravel())
        bases.append(base_twist(base, links.world_from_base))
    for sample, covariance in ((rows, known.rows), (bases, known.base)):
        found, size = np.cov(np.array(sample).T), np.sqrt(np.diag(covariance))
        scale = np.where(size > 0, size, 1.0)
        assert np.abs((found - covariance) / np.outer(scale, scale)).max() < 0.1
    in_document = [[getattr(row.std, entry) for entry in ENTRIES] for row in calibration.dh]
    assert np.allclose(in_document, np.sqrt(np.diag(known.rows)).reshape(2, 5))
    assert [row.std.scale for row in calibration.dh if row.std] == pytest.approx(
        [joint.scale_std for joint in calibration.joints]
    )


@settings(max_examples=30, deadline=None)
@given(angle=st.sampled_from([1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 0.0]), seed=st.integers(0, 100))
def test_near_parallel_axes_are_as_uncertain_as_they_are(angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    axes = [[0, 0, 1], [np.sin(angle), 0, np.cos(angle)], [0, 1, 0.5]]
    chain = Chain.of(["revolute"] * 3, axes, rng.normal(size=(3, 3)).tolist(), [1, 1, 1])
    names = numbers_of(3)
    known = dh_covariance(chain, links_of(chain).world_from_base, names, 1e-10 * np.eye(len(names)))
    assert np.isfinite(known.rows).all()
    assert np.isfinite(known.base).all()
    first, second, _ = known.std()
    assert second["alpha_prev"] < 1e-4
    assert first["d_offset"] == first["theta_offset"] == 0
    if angle <= 1e-6:
        assert second["theta_offset"] > 1
        assert second["d_offset"] > 1
        assert np.diag(known.base)[2] > 1


def test_what_is_not_known_has_no_standard_deviation() -> None:
    rng = np.random.default_rng(9)
    calibration = solve(noisy_session(looking_rig(rng, 2), rng), "closed_form")
    assert calibration.dh_covariance() is None
    assert all(row.std is None for row in calibration.dh)
