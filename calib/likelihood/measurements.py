"""What was seen, as padded arrays a camera, so that no step loops over points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.observations import Observation

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PointViews:
    """The point measurements of one camera's n views, padded to q points each.

    `views` (n,) are places in the session, `ids` (n, q) the points', `world` (n, q, 3) where these are (m),
    `pixels` (n, q, 2) where they are seen, `whitening` (n, q, 2, 2) the lower triangular W with W^T W the inverse
    of each point's covariance, `present` (n, q) 1 for a point and 0 for padding. `disk` (n,) tells whose pixels are
    centroids of disks.
    """

    views: NDArray[np.intp]
    ids: NDArray[np.int64]
    world: Array
    pixels: Array
    whitening: Array
    present: Array
    disk: NDArray[np.bool_]


def point_views(observations: Sequence[Observation], points: Array) -> PointViews:
    """Return the views of one camera, one or more; `points` (t, 3) are the target's by id.

    Points without a covariance count as known to 1 px: only their ratios matter then.
    """
    counts = np.array([len(observation.ids) for observation in observations], dtype=np.intp)
    present = np.arange(counts.max(initial=0)) < counts[:, None]
    ids, pixels = np.zeros(present.shape, dtype=np.int64), np.zeros((*present.shape, 2))
    ids[present] = np.concatenate([observation.ids for observation in observations])
    pixels[present] = np.concatenate([observation.pixels for observation in observations])
    # Places without a point repeat the first one, so that their projection is finite.
    ids = np.where(present, ids, ids[:, :1])
    whitening = np.broadcast_to(np.eye(2), (*present.shape, 2, 2)).copy()
    known = np.array([observation.covariances is not None for observation in observations], dtype=bool)
    if known.any():
        covariances = [o.covariances for o in observations if o.covariances is not None]
        # The inverse of a covariance's lower Cholesky factor whitens.
        whitening[present & known[:, None]] = np.linalg.inv(np.linalg.cholesky(np.concatenate(covariances)))
    return PointViews(
        views=np.array([observation.view for observation in observations], dtype=np.intp),
        ids=ids,
        world=points[ids],
        pixels=np.where(present[..., None], pixels, pixels[:, :1]),
        whitening=whitening,
        present=present.astype(float),
        disk=np.array([observation.disk for observation in observations], dtype=bool),
    )


@dataclass(frozen=True, eq=False)
class GivenPoses:
    """Camera poses `world_from_camera` (n, 4, 4) of one camera that another system measured.

    `whitening` (6, 6) is W with W^T W the inverse of their covariance, as of `pose_residuals`.
    """

    views: NDArray[np.intp]
    poses: Array
    whitening: Array
