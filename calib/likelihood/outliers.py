"""Measurements that do not belong: knocked views and bad detections are named and set aside, not averaged in.

Each view's pose is freed, robustly against its own bad points, and it is asked how far the chain's prediction is from
it: a view whose readings are wrong is far off. What then remains at a point tells a bad detection. Both are judged
against the median of all, so that neither the noise's size nor a few outliers matter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from calib.likelihood.blocks import Blocks
from calib.likelihood.measurements import PointViews
from calib.likelihood.problem import Evaluation, Problem, Weights, all_in

Array = NDArray[np.float64]

RARE = 1e-5
"""How rarely a good measurement may be set aside."""
TUKEY = 4.685
FREEING_PASSES = 15


@dataclass(frozen=True, eq=False)
class SetAside:
    """What was set aside: views by their places in the session, and points as (view, id)."""

    views: tuple[int, ...] = ()
    points: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Freed:
    """Views whose pose was freed: `gain` (n,) is the squared distance to the prediction, `left` (n, q) squared misfits."""

    gain: Array
    left: Array


def judged(problem: Problem, evaluation: Evaluation) -> tuple[Weights, SetAside]:
    """Return weights without the outliers, and what these are; `evaluation` is one in which everything counts."""
    present = all_in(problem).groups
    freed = [
        _freed(terms.blocks, weight) if isinstance(group.data, PointViews) else _given(terms.blocks)
        for group, terms, weight in zip(problem.groups, evaluation.terms, present, strict=True)
    ]
    points = [f.left[weight > 0] for f, weight in zip(freed, present, strict=True) if f.left.size]
    noise = float(np.median(np.concatenate(points))) / chi2.median(2) if points else 0.0
    spread = float(np.median(np.concatenate([f.gain for f in freed]))) / chi2.median(6)
    knocked: list[int] = []
    bad: list[tuple[int, int]] = []
    groups = []
    for group, base, view in zip(problem.groups, present, freed, strict=True):
        out = view.gain > chi2.isf(RARE, 6) * max(noise, spread)
        knocked += group.data.views[out].tolist()
        if not isinstance(group.data, PointViews):
            groups.append(np.where(out, 0.0, base))
            continue
        wrong = (view.left > chi2.isf(RARE, 2) * noise) & (base > 0) & ~out[:, None]
        rows, columns = np.nonzero(wrong)
        bad += zip(group.data.views[rows].tolist(), group.data.ids[rows, columns].tolist(), strict=True)
        groups.append(np.where(wrong | out[:, None], 0.0, base))
    return Weights(tuple(groups)), SetAside(tuple(sorted(knocked)), tuple(sorted(bad)))


def _freed(blocks: Blocks, present: Array) -> Freed:
    """Free each view's pose by Tukey's regression, started from least absolute misfits."""
    count, points = present.shape
    misfit = blocks.residuals.reshape(count, points, 2)
    by_pose = blocks.jacobian[:, :, :6].reshape(count, points, 2, 6)
    weight = present / np.maximum(np.linalg.norm(misfit, axis=-1), 1e-12)
    for _ in range(FREEING_PASSES):
        hessian = np.einsum("nq,nqik,nqil->nkl", weight, by_pose, by_pose, optimize=True)
        gradient = np.einsum("nq,nqik,nqi->nk", weight, by_pose, misfit, optimize=True)
        shift = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
        left = misfit + (by_pose @ shift[:, None, :, None])[..., 0]
        distance = np.linalg.norm(left, axis=-1)
        scale = np.array([np.median(row[seen > 0]) for row, seen in zip(distance, present, strict=True)])
        reach = TUKEY * np.maximum(scale, 1e-12)[:, None] / np.sqrt(chi2.median(2))
        weight = present * np.maximum(1 - (distance / reach) ** 2, 0) ** 2
    kept = present * (distance < reach)
    hessian = np.einsum("nq,nqik,nqil->nkl", kept, by_pose, by_pose, optimize=True)
    return Freed(np.einsum("nk,nkl,nl->n", shift, hessian, shift), distance**2)


def _given(blocks: Blocks) -> Freed:
    """A given pose has nothing beside itself: its whole misfit is its distance."""
    return Freed((blocks.residuals.reshape(len(blocks.residuals), -1) ** 2).sum(axis=1), np.zeros((0,)))
