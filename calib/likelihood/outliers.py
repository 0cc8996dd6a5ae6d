"""Measurements that do not belong: knocked views and bad detections are named and set aside, not averaged in.

Each view's pose is freed, robustly against its own bad points, and it is asked how far the chain's prediction is from
it: a view whose readings are wrong is far off. What then remains at a point tells a bad detection. Both are judged
against the median of all, so that neither the noise's size nor a few outliers matter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, f

from calib.likelihood.blocks import Blocks
from calib.likelihood.measurements import PointViews
from calib.likelihood.normal import local_by_parameter
from calib.likelihood.problem import Group, GroupTerms, Problem, Weights, all_in
from calib.sweeps import SAME_START

Array = NDArray[np.float64]

RARE = 1e-5
"""How rarely a good measurement may be set aside."""
TUKEY = 4.685
WEAKEST = 1e-12  # of the information about a pose
FREEING_PASSES = 10
STUDENT = 4.0
"""Degrees of freedom of given poses' errors: other systems have longer tails than a picture's points, in rotation
and in position each for itself."""
KNOCKED = 3 * float(f.isf(1e-3, 3, STUDENT))
"""How far a given pose's squared rotation or position error may be, in units of its size, for it to count at all."""
EXACT = 0.1
"""Part of its noise below which a misfit is rounding."""
FARTHEST = {freedom: float(chi2.isf(RARE, freedom)) for freedom in (2, 6)}
"""How far the square of so many numbers of unit variance may be for good ones."""
MEDIAN = {freedom: float(chi2.median(freedom)) for freedom in (2, 3, 6)}


@dataclass(frozen=True)
class SetAside:
    """What was set aside: views by their places in the session, and points as (view, id)."""

    views: tuple[int, ...] = ()
    points: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Freed:
    """Views whose pose was freed: `shift` (n, 6) away from the prediction, known with `information` (n, 6, 6).

    `left` (n, q) are the squared misfits of the points that remain.
    """

    shift: Array
    information: Array
    left: Array

    def rescaled(self, size: Array) -> "Freed":
        """Return the same with misfits in units of `size`."""
        return Freed(self.shift, self.information / size**2, self.left / size**2)

    def loosened(self, looseness: float) -> "Freed":
        """Return the same with poses that may be off at random: by `looseness` times their own covariance."""
        return replace(self, information=self.information / (1 + looseness))

    def distance(self, scatter: Array) -> Array:
        """Return the squared distances (n, 1) in units of their noise, the views scattered besides (n, 6, 6)."""
        covariance = np.linalg.inv(self.information) + scatter
        reach = np.linalg.solve(covariance, self.shift[..., None])[..., 0]
        return np.asarray((self.shift * reach).sum(axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class Given:
    """Given poses, beside which nothing could be bad: their whitened `residuals` (n, 6), with `jacobian` (n, 6, 6)."""

    residuals: Array
    jacobian: Array

    @classmethod
    def of(cls, blocks: Blocks) -> "Given":
        """Return the poses of these blocks."""
        return cls(blocks.residuals[..., 0], blocks.jacobian[:, :, :6])

    @property
    def left(self) -> Array:
        """The squared misfits of points, of which there are none (n, 0)."""
        return np.zeros((len(self.residuals), 0))

    def rescaled(self, size: Array) -> "Given":
        """Return the same with residuals in units of `size` (6,)."""
        return Given(self.residuals / size, self.jacobian / size[:, None])

    def distance(self, scatter: Array) -> Array:
        """Return the squared misfits (n, 2) of rotations and positions, the views scattered besides (n, 6, 6)."""
        covariance = np.eye(6) + self.jacobian @ scatter @ np.swapaxes(self.jacobian, 1, 2)
        parts = []
        for part in (slice(0, 3), slice(3, 6)):
            reach = np.linalg.solve(covariance[:, part, part], self.residuals[:, part, None])[..., 0]
            parts.append((self.residuals[:, part] * reach).sum(axis=1))
        return np.column_stack(parts)


@dataclass(frozen=True, eq=False)
class Misfits:
    """How far each group's views are from the prediction, squared, and their points' squared misfits `left` (n, q).

    `distances` are (n, 1) of whole poses that points tell, (n, 2) of given poses' rotations and positions. They are in
    units of what noise makes of them, but for `noise` (of points) and `spread` (of views), which are by their medians.
    """

    distances: tuple[Array, ...]
    left: tuple[Array, ...]
    noise: float
    spread: float


def freed_views(problem: Problem, terms: Sequence[GroupTerms]) -> list[Freed | Given]:
    """Return each group's views with their poses freed from their points; in the groups' terms everything counts."""
    return [
        _freed(own.blocks, group.data.present) if isinstance(group.data, PointViews) else Given.of(own.blocks)
        for group, own in zip(problem.groups, terms, strict=True)
    ]


def misfits(
    problem: Problem,
    terms: Sequence[GroupTerms],
    freed: Sequence[Freed | Given],
    weights: Weights,
    covariance: Array,
) -> Misfits:
    """Return the misfits of views `freed` as of `freed_views`, at `terms` where readings are taken as they were read.

    A view that `weights` leave out is predicted by a fit that knows nothing of it: `covariance` (p, p) says how well.
    """
    distances, lefts, typical, typical_point = [], [], [], []
    for group, own, view, present, weight in zip(
        problem.groups, terms, freed, all_in(problem).groups, weights.groups, strict=True
    ):
        spread = own.chain.by_reading * problem.reading_std
        scatter = spread @ np.swapaxes(spread, 1, 2)
        out = ~weight.any(axis=1)
        if out.any():
            unseen = _shift_by_parameter(problem, group, own)[out]
            scatter[out] += unseen @ covariance @ np.swapaxes(unseen, 1, 2)
        if isinstance(view, Freed):
            distance = view.loosened(problem.looseness).distance(scatter)
            typical_point.append(view.left[present > 0])
        else:
            distance = view.distance(scatter)
        distances.append(np.nan_to_num(distance, nan=np.inf))
        lefts.append(view.left)
        typical.append(distances[-1].ravel() / MEDIAN[_freedom(distance)])
    # Whitened misfits are about 1, and far less only where the measurements are exact to rounding.
    median = float(np.nanmedian(np.concatenate(typical_point))) / MEDIAN[2] if typical_point else 0.0
    noise = max(median, EXACT)
    return Misfits(
        tuple(distances), tuple(lefts), noise, max(noise, float(np.median(np.concatenate(typical))))
    )


def _shift_by_parameter(problem: Problem, group: Group, terms: GroupTerms) -> Array:
    """Return how the distances between freed and predicted poses (n, 6) change with the parameters (n, 6, p).

    The prediction moves with the chain, and the freed pose with the lens: errors of both that leave the points where
    they are seen, as a camera turned and its principal point shifted, leave the two together.
    """
    local, hessian = local_by_parameter(problem, group, terms), terms.blocks.hessian
    follows = np.linalg.solve(hessian[:, :6, :6], hessian[:, :6, 6:])
    return np.asarray(local[:, :6] + follows @ local[:, 6:])


def _freedom(distances: Array) -> int:
    """Return of how many numbers each of the distances (n, 1) or (n, 2) is made: a pose has six."""
    return 6 // int(distances.shape[1])


def without_bad_points(problem: Problem, found: Misfits) -> Weights:
    """Return weights with which all views count, without their bad points."""
    return _judged(problem, replace(found, spread=np.inf))[0]


def softened(problem: Problem, found: Misfits) -> Weights:
    """Return Cauchy's weights of whole views, and no bad points: a first idea, while the chain itself is still off."""
    groups = []
    for weight, distance in zip(without_bad_points(problem, found).groups, found.distances, strict=True):
        soft = 1 / (1 + distance / (_freedom(distance) * found.spread))
        groups.append(weight * np.repeat(soft, weight.shape[1] // soft.shape[1], axis=1))
    return Weights(tuple(groups))


def judged(problem: Problem, found: Misfits) -> tuple[Weights, SetAside]:
    """Return weights without the outliers, and what these are.

    Not all views in which a joint moved can have been knocked: it slipped, or is not what the others hold it for. Then
    none is set aside.
    """
    weights, aside = _judged(problem, found)
    seen = np.concatenate([group.data.views for group in problem.groups])
    kept = np.setdiff1d(seen, aside.views)
    spans = np.ptp(problem.readings[seen], axis=0)
    if len(kept) and np.any((np.ptp(problem.readings[kept], axis=0) <= SAME_START * spans) & (spans > 0)):
        return _judged(problem, replace(found, spread=np.inf))
    return weights, aside


def _judged(problem: Problem, found: Misfits) -> tuple[Weights, SetAside]:
    knocked: list[int] = []
    bad: list[tuple[int, int]] = []
    groups = []
    for group, base, left, distance in zip(
        problem.groups, all_in(problem).groups, found.left, found.distances, strict=True
    ):
        farthest = FARTHEST[6] if isinstance(group.data, PointViews) else KNOCKED
        # A view that the prediction puts behind the camera has no distance at all.
        out = np.any(~(distance <= farthest * found.spread), axis=1)
        knocked += group.data.views[out].tolist()
        if not isinstance(group.data, PointViews):
            tails = (STUDENT + 3) / (STUDENT + distance)
            groups.append(np.where(out[:, None], 0.0, base * np.repeat(tails, 3, axis=1)))
            continue
        wrong = ~(left <= FARTHEST[2] * found.noise) & (base > 0)
        rows, columns = np.nonzero(wrong & ~out[:, None])
        bad += zip(group.data.views[rows].tolist(), group.data.ids[rows, columns].tolist(), strict=True)
        groups.append(np.where(wrong | out[:, None], 0.0, base))
    return Weights(tuple(groups)), SetAside(tuple(sorted(knocked)), tuple(sorted(bad)))


def point_noise(left: Array, present: Array) -> float:
    """Return the standard deviation of a whitened point measurement, from what is `left` with each view's pose free.

    Bad points are left out, so that what remains is a truncated noise: the few good ones lost do not matter.
    """
    first = float(np.nanmedian(left[present > 0])) / MEDIAN[2]
    good = (present > 0) & (left < FARTHEST[2] * first)
    freedom = 2 * good.sum() - 6 * len(left)
    return float(np.sqrt(left[good].sum() / max(freedom, 1)))


def _freed(blocks: Blocks, present: Array) -> Freed:
    """Free each view's pose by Tukey's regression, started from least absolute misfits."""
    flat, right = blocks.jacobian[:, :, :6], blocks.residuals.reshape(len(present), -1, 1)
    transposed, square = np.swapaxes(flat, 1, 2), _squares(right)
    weight = present / np.maximum(np.sqrt(square), 1e-12)
    for _ in range(FREEING_PASSES):
        weighted = transposed * np.repeat(weight, 2, axis=1)[:, None]
        normal = weighted @ flat
        # Of a view's few points, those that are kept may not tell all of its pose.
        normal += (WEAKEST * np.einsum("vii->vi", normal))[:, None] * np.eye(6)
        shift = -np.linalg.solve(normal, weighted @ right)
        square = _squares(right + flat @ shift)
        typical = np.maximum(_median(square, present), 1e-24)
        reach = TUKEY**2 / MEDIAN[2] * typical[:, None]
        weight = present * np.maximum(1 - square / reach, 0) ** 2
    kept = np.repeat(weight > 0, 2, axis=1)[:, None]
    return Freed(np.asarray(shift[..., 0], float), (transposed * kept) @ flat, square)


def _squares(misfits: Array) -> Array:
    """Return the squared misfits of points (n, q) from those of their coordinates (n, 2 q, 1)."""
    return np.asarray(misfits[:, ::2, 0] ** 2 + misfits[:, 1::2, 0] ** 2)


def _median(values: Array, present: Array) -> Array:
    """Return the median (n,) of those `values` (n, q) that are `present`."""
    ordered = np.sort(np.where(present > 0, values, np.inf), axis=1)
    middle = np.maximum(present.sum(axis=1).astype(int) - 1, 0) // 2
    return np.asarray(ordered[np.arange(len(ordered)), middle])
