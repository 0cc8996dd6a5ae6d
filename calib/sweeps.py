"""Which views belong together: one joint moved alone, one camera, all else at rest."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

EXACTLY = 1e-12
SAME_START = 0.01
"""Two views belong to one sweep when their idle readings agree within this part of the joint's range."""


def sweep_labels(readings: Array, exercised: Ints, cameras: Ints, links: Sequence[int]) -> Ints:
    """Return for each view and joint (n, m) which of the joint's sweeps the view belongs to, -1 for none.

    `readings` (n, m); `exercised` (n,) is the joint moved alone in a view, -1 for none; `cameras` (n,) who
    took it; `links` how many joints move each camera. A sweep has the joint at two readings or more.
    """
    labels = np.full(readings.shape, -1, dtype=np.intp)
    if not len(readings):
        return labels
    spans = reading_spans(readings, exercised)
    reach = np.asarray(links)[cameras]
    for joint in range(readings.shape[1]):
        own = np.flatnonzero((exercised == joint) & (reach > joint))
        idle = np.delete(readings[own] / np.where(spans > 0, spans, 1), joint, axis=1)
        labels[own, joint] = _starts(np.column_stack([idle, cameras[own]]), readings[own, joint])
    return labels


def reading_spans(readings: Array, exercised: Ints) -> Array:
    """Return how far apart each joint's readings (n, m) lie (m,): infinitely, where they are one place's noise.

    `readings` and `exercised` are as for `sweep_labels`, in the order in which they were taken. Only a joint that no
    view exercises can have been in one place all the time: then no gap between its readings stands out.
    """
    spans = np.ptp(readings, axis=0) if len(readings) else np.zeros(readings.shape[1])
    for joint in range(readings.shape[1]):
        if spans[joint] > 0 and not (exercised == joint).any() and _in_one_place(readings[:, joint]):
            spans[joint] = np.inf
    return spans


def _in_one_place(values: Array) -> bool:
    """Return whether the largest gap between `values` (n,) is of the kind that noise leaves, too."""
    ordered = np.sort(values)
    largest = int(np.argmax(np.diff(ordered)))
    below, above = ordered[: largest + 1], ordered[largest + 1 :]
    noise = max(np.ptp(below), np.ptp(above))
    if noise == 0:
        # Two values alone: an axis goes from one to the other once, and noise goes back and forth.
        return int(np.count_nonzero(np.diff(values))) > 1
    return bool(noise > SAME_START * (above[0] - below[-1]))


def _starts(idle: Array, moved: Array) -> Ints:
    """Return for each view (n,) which start it belongs to, -1 for one that stands alone at its start.

    Starts may be close to each other, and idle readings may jitter, between a few counts too: where every view shares
    its idle ones exactly with a view at another reading, and one start's views come after another's, starts are told
    apart exactly, else within a tolerance.
    """
    labels = np.zeros(len(idle), dtype=np.intp)
    for tolerance in (EXACTLY, SAME_START):
        labels = _clusters(idle, tolerance)
        for label in np.unique(labels):
            if np.ptp(moved[labels == label]) == 0:
                labels[labels == label] = -1
        if (labels >= 0).all() and not _interleaved(labels):
            break
    return labels


def _interleaved(labels: Ints) -> bool:
    """Return whether a label comes up again after another one."""
    return bool(np.count_nonzero(np.diff(labels)) >= len(np.unique(labels)))


def readings_at_rest(readings: Array, labels: Ints) -> Array:
    """Return the readings (n, m) with those of idle joints replaced by their sweep's mean.

    An idle joint stands still: what its readings jitter is their own noise, and the mean has less of it.
    """
    at_rest = readings.copy()
    for joint in range(labels.shape[1]):
        for sweep in np.unique(labels[labels[:, joint] >= 0, joint]):
            members = labels[:, joint] == sweep
            own = at_rest[members, joint]
            # A shift by the first member keeps readings that did not jitter exactly as they are.
            base = at_rest[members][0]
            at_rest[members] = base + (at_rest[members] - base).mean(axis=0)
            at_rest[members, joint] = own
    return at_rest


def _clusters(rows: Array, tolerance: float) -> Ints:
    """Return a label for each row (n,), shared by all within `tolerance` of a cluster's first row."""
    labels = np.full(len(rows), -1, dtype=np.intp)
    while (labels < 0).any():
        head = rows[np.argmax(labels < 0)]
        near = (np.abs(rows - head) <= tolerance).all(axis=1)
        labels[near & (labels < 0)] = labels.max() + 1
    return labels
