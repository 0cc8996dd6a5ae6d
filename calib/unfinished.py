"""What can be solved of a session that was cut off: the joints whose sweeps were begun well enough."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.closed_form import PoseViews
from calib.errors import UnsolvableError
from calib.parameters import Held
from calib.session import Camera, Joint, Session, View, WorldOrigin
from calib.sweeps import SAME_START, reading_spans, sweep_labels

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """What can be solved of a session: `places` are those of its views in the whole; a sentence on what is missing."""

    session: Session
    places: Sequence[int]
    sentence: str | None


def finished_part(session: Session) -> FinishedPart:
    """Return `session` without the joints that were not exercised yet.

    A joint left out stands still in what remains: of the views only those from before it moved are kept.
    Raises UnsolvableError where no joint has been exercised.
    """
    everywhere = range(len(session.views))
    if session.complete or not session.joints or not session.views:
        return FinishedPart(session, everywhere, None)
    labels = _labels(session)
    done: Mask = np.asarray((labels >= 0).any(axis=0))
    if done.all():
        return FinishedPart(
            session,
            everywhere,
            f"the session was cut off after {len(session.views)} views: its joints are known less well",
        )
    if not done.any():
        raise UnsolvableError(
            f"the session was cut off after {len(session.views)} views, before any joint moved: "
            "run the calibration again"
        )
    swept = (labels[:, done] >= 0).any(axis=1)
    rest = np.median(session.readings()[swept], axis=0)
    left_out = [joint for joint, finished in zip(session.joints, done, strict=True) if not finished]
    sentence = "the session was cut off: " + " and ".join(
        f"joint '{joint.name}' was not exercised and counts as fixed at {reading:g} {joint.reading_unit}"
        for joint, reading in zip(left_out, rest[~done], strict=True)
    )
    part, kept = _where_others_stand(session, done, rest)
    return FinishedPart(part, np.flatnonzero(kept).tolist(), sentence)


def part_about(session: Session, readings: Sequence[float]) -> tuple[Session, list[int], list[float]]:
    """Return what tells of the camera at `readings` (m,): the views in which joints not exercised yet stand there.

    It comes as a session without those joints, with the places of its views in `session` and its own readings. Raises
    UnsolvableError where no joint has been exercised.
    """
    done: Mask = np.asarray((_labels(session) >= 0).any(axis=0))
    part, kept = _where_others_stand(session, done, np.asarray(readings, dtype=float))
    if not done.any() or not kept.any():
        raise UnsolvableError("no joint has been exercised yet from where the others stand")
    return part, np.flatnonzero(kept).tolist(), np.asarray(readings)[done].tolist()


def _labels(session: Session) -> NDArray[np.intp]:
    """Return which of each joint's sweeps a view belongs to (n, m), -1 for none, as views held out do."""
    views = PoseViews.of(session, range(len(session.views)), np.zeros((len(session.views), 4, 4)))
    fit = np.array([view.use == "fit" for view in session.views])
    exercised = np.where(fit, views.exercised, -1)
    return sweep_labels(views.readings, exercised, views.cameras, views.links)


def _where_others_stand(session: Session, done: Mask, rest: NDArray[np.float64]) -> tuple[Session, Mask]:
    """Return `session` with the joints `done` (m,) alone, and its views (n,): those with the others at `rest` (m,)."""
    readings = session.readings()
    exercised = PoseViews.of(session, range(len(readings)), np.zeros((len(readings), 4, 4))).exercised
    spans = reading_spans(np.vstack([readings, rest]), np.append(exercised, -1))
    slack = SAME_START * np.maximum(spans, 1e-12)
    kept: Mask = np.asarray((np.abs(readings - rest) <= slack)[:, ~done].all(axis=1))
    left_out = [joint for joint, finished in zip(session.joints, done, strict=True) if not finished]
    names = [joint.name for joint, finished in zip(session.joints, done, strict=True) if finished]
    reduced = session.model_copy(
        update={
            "joints": [joint for joint in session.joints if joint.name in names],
            "cameras": [_on_kept_link(session, camera, names) for camera in session.cameras],
            "views": [
                _with_readings(view, done, names)
                for view, keep in zip(session.views, kept, strict=True)
                if keep
            ],
            "held": _held_of_the_rest(session, left_out),
            "origin": session.origin and _reduced_origin(session.origin, done),
        }
    )
    return reduced.at(session.folder), kept


def _with_readings(view: View, done: Mask, names: list[str]) -> View:
    readings = [reading for reading, keep in zip(view.readings, done, strict=True) if keep]
    joint = view.joint if view.joint in names else None
    sides = view.approached and [side for side, keep in zip(view.approached, done, strict=True) if keep]
    return view.model_copy(update={"readings": readings, "joint": joint, "approached": sides})


def _held_of_the_rest(session: Session, left_out: Sequence[Joint]) -> dict[str, Held | None]:
    """Return what is held of all but the joints `left_out`."""
    gone = {f"{joint.name}.{entry}" for joint in left_out for entry in ("scale", "axis", "point")}
    return {name: value for name, value in session.held.items() if name not in gone}


def _reduced_origin(origin: WorldOrigin, done: Mask) -> WorldOrigin:
    readings = [reading for reading, keep in zip(origin.readings, done, strict=True) if keep]
    return origin.model_copy(update={"readings": readings})


def _on_kept_link(session: Session, camera: Camera, names: list[str]) -> Camera:
    """Return the camera on the last kept joint at or before its own link."""
    if camera.link is None:
        return camera
    before = [joint.name for joint in session.joints[: session.joint_index(camera.link) + 1]]
    riding = [name for name in before if name in names]
    if not riding:
        raise UnsolvableError(
            f"the session was cut off before any joint that moves camera '{camera.name}' was exercised: "
            "run the calibration again"
        )
    return camera.model_copy(update={"link": riding[-1]})
