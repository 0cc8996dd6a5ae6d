"""Places that lie on a lattice in a plane, seen in perspective: put in order, from one to the next.

From two neighbours of one place the lattice is continued all round, each ring where the homography of all before it
puts it. The steps found that way are some basis of the lattice, a diagonal perhaps where the view is oblique; which
one is told by the pattern that is looked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib.detection.plane import PlaneView, view_of_plane

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

NEAR = 0.3  # steps from where a place is expected
SEEDS = 3  # places from which a lattice is tried to be grown
NEIGHBOURS = 12  # of a place; among them there are two that are no multiples of each other
LEAST_SINE = 0.5  # of the angle between the two shortest steps of a lattice, which is 60 degrees or more
MOST_PLACES = 2  # times as many as the pattern has: in more there is no telling which part of them is meant
OPPOSITE = 0.6  # of a step; how unlike the one to the other side may be
ENOUGH = 6  # places that fix a homography well enough to go on by one step
AROUND = np.array([step for step in product(range(-2, 3), repeat=2) if any(step)])
BASES = np.array(
    [
        basis
        for basis in np.array(list(product(range(-2, 3), repeat=4))).reshape(-1, 2, 2)
        if abs(basis[0, 0] * basis[1, 1] - basis[0, 1] * basis[1, 0]) == 1
    ]
)
"""All changes (k, 2, 2) of a lattice's basis that a view which is not from the side may ask for."""


def patterns(places: Array, pattern: Numbers) -> list[Numbers]:
    """Find the `pattern` (q, 2), whole numbers of steps, among places (n, 2) in px.

    Gives for each reading of it the places (q,) in its order; those of a symmetric pattern are several readings of
    the same places, those in a larger lattice of different ones.
    """
    if not len(pattern) <= len(places) <= MOST_PLACES * len(pattern):
        return []
    middle = np.linalg.norm(places - places.mean(axis=0), axis=1)
    for seed in np.argsort(middle)[:SEEDS]:
        reached, numbers = _grown(places, int(seed))
        if len(reached) >= len(pattern):
            found = [reached[reading] for reading in _readings(numbers, pattern)]
            if found:
                return found
    return []


def _grown(places: Array, seed: int) -> tuple[Numbers, Numbers]:
    """Continue the lattice round one place: which places (m,) are on it, and their numbers of steps (m, 2)."""
    reached, numbers = np.array([seed]), np.zeros((1, 2), dtype=np.int64)
    steps = _shortest_steps(places - places[seed])
    if steps is None:
        return reached, numbers
    view = PlaneView(np.vstack([np.column_stack([steps.T, places[seed]]), [0, 0, 1]]))
    left = np.delete(np.arange(len(places)), seed)
    while len(left):
        ring = _unique(numbers[:, None] + AROUND, numbers)
        expected = ring.astype(np.float64)
        apart = np.linalg.norm(view.project(expected)[:, None] - places[left], axis=2)
        near = apart.min(axis=1) < NEAR * view.scales(expected)
        hit, first = np.unique(apart.argmin(axis=1)[near], return_index=True)
        if not len(hit):
            break
        reached, numbers = np.concatenate([reached, left[hit]]), np.concatenate([numbers, ring[near][first]])
        left = np.delete(left, hit)
        if len(left) and len(reached) >= ENOUGH:
            view = view_of_plane(numbers.astype(np.float64), places[reached]) or view
    return reached, numbers


def _shortest_steps(away: Array) -> Array | None:
    """Choose the two shortest of the ways (n, 2) that go in different directions; None where there are no such."""
    lengths = np.linalg.norm(away, axis=1)
    nearest = np.argsort(lengths)[1 : NEIGHBOURS + 1]
    ways, lengths = away[nearest], lengths[nearest]
    if not len(nearest) or lengths[0] == 0:
        return None
    sines = np.abs(ways[0, 0] * ways[:, 1] - ways[0, 1] * ways[:, 0]) / (lengths[0] * lengths)
    other = np.flatnonzero(sines > LEAST_SINE)
    if not len(other):
        return None
    steps = ways[[0, other[0]]]
    # Perspective makes steps to opposite sides unlike: half of both together is right in between.
    back = ways[np.linalg.norm(ways + steps[:, None], axis=2).argmin(axis=1)]
    opposite = np.linalg.norm(back + steps, axis=1) < OPPOSITE * np.linalg.norm(steps, axis=1)
    return np.where(opposite[:, None], (steps - back) / 2, steps)


def _unique(numbers: Numbers, known: Numbers) -> Numbers:
    """Return each pair of `numbers` (..., 2) once, without the `known` ones (m, 2)."""
    reach = int(np.abs(numbers).max()) + 1
    base = 2 * reach + 1
    codes = (numbers + reach) @ [base, 1]
    fresh = np.setdiff1d(codes, (known + reach) @ [base, 1])
    return np.stack(np.divmod(fresh, base), axis=1) - reach


def _readings(numbers: Numbers, pattern: Numbers) -> Iterator[Numbers]:
    """Yield for each way in which the pattern (q, 2) fits on lattice places (m, 2) the places (q,) in its order."""
    wanted = pattern - pattern.min(axis=0)
    turned = numbers @ BASES
    turned -= turned.min(axis=1, keepdims=True)
    rooms = turned.max(axis=1) - wanted.max(axis=0)
    roomy = np.all(rooms == 0 if len(numbers) == len(wanted) else rooms >= 0, axis=1)
    for cells, room in zip(turned[roomy], rooms[roomy], strict=True):
        at = np.full(cells.max(axis=0) + 1, -1)
        at[tuple(cells.T)] = np.arange(len(cells))
        shifts = np.array(list(np.ndindex(*(room + 1))))
        readings = at[tuple(np.moveaxis(shifts[:, None] + wanted, -1, 0))]
        yield from readings[np.all(readings >= 0, axis=1)]
