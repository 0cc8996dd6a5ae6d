"""How well each view agrees with itself: its points, where the camera may have been anywhere.

That needs no chain, so that it can be told of a session that is still being taken. It tells of a blurred picture, a
finger on the target, a print that is not flat. Where the views tell the lens, one more of them changes the fits of all,
so that none is kept: together they take some milliseconds.
"""

from collections.abc import Sequence

import numpy as np

from calib.errors import UnsolvableError
from calib.first_solution import camera_views
from calib.observations import Observation
from calib.residuals import misfits
from calib.session import Session
from calib.targets import target_points


def own_fits(session: Session, observations: Sequence[Observation]) -> dict[int, float]:
    """Return by how much (px, rms) each view's points miss the best pose of its own, by the view's number.

    The lens is the session's, or what the views themselves tell of it. Empty where they tell none yet; views that carry
    a pose have no such figure.
    """
    try:
        seen = camera_views(session, observations)
    except UnsolvableError:
        return {}
    points = target_points(session.target)
    fits: dict[int, float] = {}
    for camera, lens in enumerate(seen.lenses):
        rows = [i for i, o in enumerate(observations) if o.camera == camera and o.pose is None]
        if lens is None or not rows:
            continue
        own = [observations[row] for row in rows]
        missed = misfits(own, session.target, points, lens, seen.poses[rows])
        fits |= {
            observation.view: float(np.sqrt((away**2).sum(axis=1).mean()))
            for observation, away in zip(own, missed, strict=True)
        }
    return fits
