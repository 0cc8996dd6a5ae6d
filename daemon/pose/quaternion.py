"""Rotation matrices as unit quaternions."""

import numpy as np
from numpy.typing import NDArray


def quaternions(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternions (n, 4), as x, y, z, w with w >= 0, of rotation matrices (n, 3, 3).

    Each is computed from its largest component, so that no rotation loses digits (Shepperd's method).
    """
    diagonal = np.diagonal(rotations, axis1=1, axis2=2)
    trace = diagonal.sum(axis=1, keepdims=True)
    # Four times the square of x, y, z and w.
    squares = np.concatenate([1 + 2 * diagonal - trace, 1 + trace], axis=1)
    r = rotations
    # Row k holds four times the products of component k with x, y, z and w.
    products = np.empty((len(r), 4, 4))
    for k in range(4):
        products[:, k, k] = squares[:, k]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products[:, i, j] = products[:, j, i] = r[:, i, j] + r[:, j, i]
        products[:, k, 3] = products[:, 3, k] = r[:, j, i] - r[:, i, j]
    best = products[np.arange(len(r)), np.argmax(squares, axis=1)]
    unit = best / np.linalg.norm(best, axis=1, keepdims=True)
    return np.asarray(np.where(unit[:, 3:] < 0, -unit, unit))
