"""Every point of every view, and by how much it misses: what a person looks for a pattern in."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.as_solved import as_solved
from calib.calibration import Calibration
from calib.errors import CalibError
from calib.observations import Observed
from calib.prediction import by_calibration
from calib.residuals import view_residuals
from calib.second_look import second_look
from calib.session import Session
from calib.unfinished import finished_part

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewMisses:
    """One view's points `ids` (n,), where they are seen `pixels` (n, 2), and `misses` (n, 2), predicted less seen."""

    view: int
    ids: NDArray[np.int64]
    pixels: Array
    misses: Array

    @property
    def rms_px(self) -> float:
        """The misses' root mean square, over points."""
        return float(np.sqrt((self.misses**2).sum(axis=1).mean()))


def residual_map(calibration: Calibration, session: Session, observed: Observed) -> list[ViewMisses]:
    """Return what each view of `session`, which `calibration` was solved from, is off by; `observed` is what it shows.

    Readings are those that the fit found, where a joint slipped. A target that was not found is looked for where the
    calibration has it. Views that carry poses have no points. Raises CalibError where the session has gone on since
    then, and ImageError for a missing picture.
    """
    part = finished_part(session)
    solved = [joint.name for joint in calibration.joints]
    if solved != [joint.name for joint in part.session.joints]:
        raise CalibError(
            f"the calibration is of the joints {', '.join(solved) or 'none'}, and its run was taken up again since"
        )
    numbers = {place: number for number, place in enumerate(part.places)}
    own = Observed(
        [replace(o, view=numbers[o.view]) for o in observed.observations if o.view in numbers],
        {numbers[place]: why for place, why in observed.unseen.items() if place in numbers},
        {},
    )
    read = as_solved(calibration, part.session, part.places)
    seen = second_look(read, own, by_calibration(calibration, read)).observations
    return [
        ViewMisses(part.places[residual.view], residual.ids, residual.places, residual.pixels)
        for residual in view_residuals(calibration, read, seen)
        if residual.pixels is not None
    ]
