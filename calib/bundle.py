"""A lens and the poses it was seen from, each view's pose free: the lens calibration for several views."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.lens_prior import LensPrior
from calib.likelihood.blocks import Blocks, disk_offsets, out_of_date, point_blocks
from calib.likelihood.lens_terms import lens_from_vector, lens_vector
from calib.likelihood.measurements import PointViews
from calib.session import Intrinsics
from calib.twists import exp_twist

Array = NDArray[np.float64]

MOST_STEPS = 50
CONVERGED = 1e-3
"""What a further step would gain, in units of one measurement's mean cost, below which it is not taken."""
FIRST_DAMPING, MOST_DAMPING = 1e-6, 1e12
FAR = 1000.0
"""What a step promises, in the same units, from which on what centroids of disks are off by is asked anew."""
OUT_OF_DATE = 0.01
"""What doing so may gain at the end."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """The lens, the poses `world_from_camera` (n, 4, 4), and the lens's covariance (l, l)."""

    lens: Intrinsics
    poses: Array
    covariance: Array

    def focal_std(self) -> float:
        """Return the standard deviation of the focal length, relative to it."""
        return float(np.sqrt(self.covariance[0, 0])) / self.lens.fx


def adjust(
    seen: PointViews, lens: Intrinsics, poses: Array, prior: LensPrior, disk_diameter: float | None
) -> Bundle:
    """Return the most likely lens and poses near these; `prior` says what of the lens may move, and how far."""
    values = prior.imposed(lens_vector(lens))
    lens = lens_from_vector(values, lens)
    freedom = max(2 * float(seen.present.sum()) - 6 * len(poses) - int(prior.free.sum()), 1)
    # At first the lens and the poses are off by far more than centroids of disks.
    offsets = np.zeros_like(seen.pixels)
    blocks = _blocks(seen, poses, values, lens, offsets)
    damping, growth = FIRST_DAMPING, 4.0
    for _ in range(MOST_STEPS):
        # How noisy the points are is not known: the prior is weighed by what they are seen to be here.
        noise = float(blocks.cost.sum()) / freedom
        step, twists, gain = _step(blocks, values, prior, noise, damping)
        moved, renewed = (poses @ exp_twist(twists), values + step), offsets
        if gain > FAR * noise:
            renewed = disk_offsets(seen, moved[0], lens_from_vector(moved[1], lens), disk_diameter)
        there = _blocks(seen, *moved, lens, renewed)
        cost = there.cost.sum() + noise * prior.misfit(moved[1])
        if cost <= blocks.cost.sum() + noise * prior.misfit(values):
            (poses, values), blocks, offsets = moved, there, renewed
            damping, growth = max(damping / 10, 1e-12), 4.0
            done = gain <= CONVERGED * cost / freedom
        else:
            damping, growth = damping * growth, growth * 2
            done = damping > MOST_DAMPING
        if done:
            renewed = disk_offsets(seen, poses, lens_from_vector(values, lens), disk_diameter)
            if out_of_date(seen, offsets, renewed) <= OUT_OF_DATE * noise:
                break
            offsets, damping, growth = renewed, FIRST_DAMPING, 4.0
            blocks = _blocks(seen, poses, values, lens, offsets)
    variance = float(blocks.cost.sum()) / freedom
    information, _, _ = _reduced(blocks, 0.0)
    by_step = prior.by_step()[:, prior.free]
    information = by_step.T @ (information + variance * prior.information()) @ by_step
    covariance = variance * by_step @ np.linalg.pinv(information, hermitian=True) @ by_step.T
    return Bundle(lens_from_vector(values, lens), poses, covariance)


def _blocks(seen: PointViews, poses: Array, values: Array, lens: Intrinsics, offsets: Array) -> Blocks:
    flat, none = np.zeros(seen.present.shape), np.zeros((*seen.present.shape, 0))
    return point_blocks(seen, poses, values, lens.model, offsets, seen.present, flat, none)


def _reduced(blocks: Blocks, damping: float) -> tuple[Array, Array, tuple[Array, Array]]:
    """Return the lens's information (l, l) and gradient (l,) with each view's pose at its best, and how it follows."""
    own = blocks.hessian[:, :6, :6]
    own = own + damping * np.eye(6) * np.diagonal(own, axis1=1, axis2=2)[:, None, :]
    mixed = blocks.hessian[:, :6, 6:]
    solved = np.linalg.solve(own, np.concatenate([mixed, blocks.gradient[:, :6, None]], axis=2))
    slope, offset = np.asarray(solved[..., :-1], float), np.asarray(solved[..., -1], float)
    # All views' rows together: one product of matrices.
    rows = mixed.reshape(-1, mixed.shape[2])
    information = blocks.hessian[:, 6:, 6:].sum(axis=0) - rows.T @ slope.reshape(rows.shape)
    gradient = blocks.gradient[:, 6:].sum(axis=0) - rows.T @ offset.ravel()
    return information, gradient, (slope, offset)


def _step(
    blocks: Blocks, values: Array, prior: LensPrior, noise: float, damping: float
) -> tuple[Array, Array, float]:
    """Return the steps of the lens (l,) and of the poses (n, 6), and twice what they should gain."""
    information, gradient, (slope, offset) = _reduced(blocks, damping)
    pull = noise * prior.information() @ (values - prior.mean)
    by_step = prior.by_step()[:, prior.free]
    information = by_step.T @ (information + noise * prior.information()) @ by_step
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information * np.outer(scale, scale) + damping * np.eye(len(scale))
    right = scale * (by_step.T @ (gradient + pull))
    step = -by_step @ (scale * np.linalg.lstsq(scaled, right, rcond=1e-14)[0])
    twists = -offset - slope @ step
    downhill = blocks.gradient[:, 6:].sum(axis=0) + pull
    gain = -float(step @ downhill + (twists * blocks.gradient[:, :6]).sum())
    return step, twists, gain
