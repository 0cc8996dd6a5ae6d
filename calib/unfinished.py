"""What can be solved of a session that was cut off: the joints whose sweeps were begun well enough."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.closed_form import PoseViews
from calib.errors import UnsolvableError
from calib.parameters import Held
from calib.session import Camera, Joint, Session, View, WorldOrigin
from calib.sweeps import sweep_labels

Mask = NDArray[np.bool_]


def finished_part(session: Session) -> tuple[Session, str | None]:
    """Return `session` without the joints that were not exercised yet, and a sentence about them, or None.

    A joint left out stands still in what remains: of the views only those from before it moved are kept.
    Raises UnsolvableError where no joint has been exercised.
    """
    if session.complete or not session.joints or not session.views:
        return session, None
    fit = [index for index, view in enumerate(session.views) if view.use == "fit"]
    views = PoseViews.of(session, fit, np.zeros((len(fit), 4, 4)))
    labels = sweep_labels(views.readings, views.exercised, views.cameras, views.links)
    done: Mask = np.asarray((labels >= 0).any(axis=0))
    if done.all():
        return (
            session,
            f"the session was cut off after {len(session.views)} views: its joints are known less well",
        )
    if not done.any():
        raise UnsolvableError(
            f"the session was cut off after {len(session.views)} views, before any joint moved: "
            "run the calibration again"
        )
    swept = (labels[:, done] >= 0).any(axis=1)
    rest = np.median(views.readings[swept][:, ~done], axis=0)
    readings = session.readings()
    slack = 0.01 * np.maximum(np.ptp(readings[:, ~done], axis=0), 1e-12)
    kept: Mask = np.asarray((np.abs(readings[:, ~done] - rest) <= slack).all(axis=1))
    left_out = [joint for joint, finished in zip(session.joints, done, strict=True) if not finished]
    sentence = "the session was cut off: " + " and ".join(
        f"joint '{joint.name}' was not exercised and counts as fixed at {reading:g} {joint.reading_unit}"
        for joint, reading in zip(left_out, rest, strict=True)
    )
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
    return reduced.at(session.folder), sentence


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
