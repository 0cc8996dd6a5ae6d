"""Pictures in which the target was not found, looked at once more where it is predicted.

A grid without numbers is found as a whole or not at all. Where it is partly out of the picture, or partly covered, its
points are measured all the same once it is known where they are.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter

from calib.detection import Detection, Prediction, track_in_all
from calib.errors import CalibError, ImageError
from calib.observations import Observation, Observed, Progress, observed_in, pictures
from calib.session import Session, View
from calib.targets import Target, target_points

Predict = Callable[[Sequence[Observation], View], Prediction]


def second_look(
    session: Session, observed: Observed, predict: Predict, progress: Progress | None = None
) -> Observed:
    """Return what was observed, and what is found in the other views where `predict` has the target.

    It is told what was observed so far, so that what is found tells where to look in others; a CalibError of its leaves
    a view unseen. Raises ImageError.
    """
    looking = True
    while looking and observed.unseen:
        looking = False
        observations = list(observed.observations)
        unseen, remarks = dict(observed.unseen), dict(observed.remarks)
        for index in observed.unseen:
            view = session.views[index]
            if progress is not None:
                progress(f"looking for the target in view {index} where it should be")
            try:
                predicted = predict(observed.observations, view)
                seen = track_in_all(pictures(session, view), session.target, predicted)
            except ImageError:
                raise
            except CalibError:
                continue
            observations.append(observed_in(seen.detection, index, session.camera_index(view)))
            found = partly_seen(seen.detection, session.target)
            remarks[index] = found if seen.warning is None else f"{found}; {seen.warning}"
            del unseen[index]
            looking = True
        observations.sort(key=attrgetter("view"))
        observed = Observed(observations, unseen, remarks)
    return observed


def partly_seen(detection: Detection, target: Target) -> str:
    """Say how many of the target's points were measured by a prediction."""
    count = len(target_points(target))
    return (
        f"{len(detection.ids)} of the target's {count} points are seen, and measured where they are predicted"
    )
