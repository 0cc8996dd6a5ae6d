"""How a fit read its session's readings, as its calibration states it and as it is read back from there.

A joint that slipped stood elsewhere than its readings say, and from which side it came the fit may know where nobody
noted it.
"""

from bisect import bisect_left
from collections.abc import Sequence

from calib.calibration import Calibration
from calib.likelihood.imperfections import Slipped
from calib.session import Session
from calib.slips import as_it_stood
from calib.solution import Solution
from calib.stated_quality import Quality, Slip


def read_by_fit(session: Session, solution: Solution) -> Session:
    """Return `session` with the readings and sides of approach that its solution found."""
    known = session.approached_from(solution.sides)
    return known.read_as(as_it_stood(known.readings(), solution.slips)) if solution.slips else known


def stating_readings(
    quality: Quality, session: Session, solution: Solution, places: Sequence[int]
) -> Quality:
    """Return `quality` with what the solution of `session` found of its readings.

    Its views are named by their `places` in a session of which `session` may be a part.
    """
    sides = session.sides() if solution.sides is None else solution.sides
    found = (sides != session.sides()).any(axis=1)
    views = [
        view.model_copy(
            update={"view": places[view.view]}
            | ({"approached": sides[view.view].astype(int).tolist()} if found[view.view] else {})
        )
        for view in quality.views
    ]
    slips = [
        Slip(joint=session.joints[slip.joint].name, view=places[slip.view], size=slip.size, std=slip.std)
        for slip in solution.slips
    ]
    return quality.model_copy(update={"views": views, "slips": slips})


def as_solved(calibration: Calibration, session: Session, places: Sequence[int] | None = None) -> Session:
    """Return `session`, from which `calibration` was solved, with the readings and sides that its fit found.

    `places` are those of its views in the whole session, where it is a part of that.
    """
    places = range(len(session.views)) if places is None else places
    names = [joint.name for joint in session.joints]
    slips = [
        Slipped(names.index(slip.joint), bisect_left(places, slip.view), slip.size, slip.std)
        for slip in calibration.quality.slips
    ]
    sides = {view.view: view.approached for view in calibration.quality.views if view.approached is not None}
    views = [
        view.model_copy(update={"approached": sides.get(place, view.approached)})
        for place, view in zip(places, session.views, strict=True)
    ]
    return session.with_views(views).read_as(as_it_stood(session.readings(), slips))
