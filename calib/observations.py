"""What was measured, as arrays: each view's points found in its picture, or given, or its pose."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.detection import Detection
from calib.errors import DetectionError, ImageError, UnsolvableError
from calib.picture_file import load_picture
from calib.session import Session, View
from calib.targets import TargetSymmetry
from calib.transforms import rigid

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Observation:
    """One view's measurement.

    `ids` (n,) and `pixels` (n, 2) are points of the target and where they are seen, `disk` whether these are
    centroids of disks, `covariances` (n, 2, 2) theirs in px^2 where known. `pose` is the camera's pose where
    another system gave it, else None.
    """

    view: int
    camera: int
    ids: NDArray[np.int64]
    pixels: Array
    disk: bool
    covariances: Array | None = None
    pose: Array | None = None

    def turned(self, symmetry: TargetSymmetry) -> "Observation":
        """Return the same picture read the other way round that `symmetry` allows."""
        label = np.argsort(symmetry.permutation)[self.ids]
        order = np.argsort(label)
        covariances = None if self.covariances is None else self.covariances[order]
        return replace(self, ids=label[order], pixels=self.pixels[order], covariances=covariances)


@dataclass(frozen=True, eq=False)
class Observed:
    """A session's observations, in the order of its views.

    `unseen` says of each view, by place, in which the target was not found why that was, `remarks` of others what a
    person should know.
    """

    observations: list[Observation]
    unseen: dict[int, str]
    remarks: dict[int, str]

    def of(self, views: set[int]) -> list[Observation]:
        """Return the observations of these views."""
        return [observation for observation in self.observations if observation.view in views]

    def warnings(self, session: Session) -> list[str]:
        """Return a sentence for each view of `session` that is used and that there is something to be said of."""
        said = sorted([*self.unseen.items(), *self.remarks.items()])
        return [
            f"view {view} ({session.views[view].image}): {sentence}"
            for view, sentence in said
            if session.views[view].use != "none"
        ]


def observe(
    session: Session, progress: Progress | None = None, only: Sequence[int] | None = None
) -> Observed:
    """Return what each view measured, or those of places `only`, finding the target in its picture.

    Several frames of a view are averaged. A picture in which the target is not found is left out and named. Raises
    ImageError for a picture that is missing or unreadable, and UnsolvableError where no view shows the target or
    there are no views at all.
    """
    if not session.views:
        raise UnsolvableError("the session has no views: take some before solving it")
    observed = Observed([], {}, {})
    wanted = range(len(session.views)) if only is None else only
    for count, index in enumerate(wanted, start=1):
        view = session.views[index]
        if progress is not None and view.image is not None:
            progress(f"looking for the target in view {count} of {len(wanted)}")
        try:
            observation, remark = _observation(session, index, view)
        except DetectionError as error:
            observed.unseen[index] = str(error)
            continue
        observed.observations.append(observation)
        if remark is not None:
            observed.remarks[index] = remark
    if not observed.observations:
        raise UnsolvableError(
            f"the target was not found in any of the {len(wanted)} views: {observed.warnings(session)[0]}"
        )
    return observed


def _observation(session: Session, index: int, view: View) -> tuple[Observation, str | None]:
    """Return what a view measured, and what is to be said about its frames, if anything."""
    camera = session.camera_index(view)
    if view.world_from_camera is not None:
        nothing = np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        pose = rigid(view.world_from_camera)
        return Observation(index, camera, *nothing, disk=False, pose=pose), None
    if view.points is not None:
        ids = np.array(view.points.ids, dtype=np.int64)
        pixels = np.array(view.points.pixels, dtype=float).reshape(-1, 2)
        return Observation(index, camera, ids, pixels, disk=view.points.disk == "centroid"), None
    from calib.detection import detect_in_all  # loaded with the first picture: many have none to look at

    averaged = detect_in_all(pictures(session, view), session.target)
    return observed_in(averaged.detection, index, camera), averaged.warning


def observed_in(detection: Detection, view: int, camera: int) -> Observation:
    """Return what was found in the pictures of a view, by its place and its camera's."""
    return Observation(
        view=view,
        camera=camera,
        ids=detection.ids,
        pixels=detection.pixels,
        disk=detection.disk == "centroid",
        covariances=detection.covariances,
    )


def pictures(session: Session, view: View) -> Iterator[NDArray[np.generic]]:
    """Yield a view's pictures as they are on disk; raises ImageError that names the file."""
    return (_picture(session, name) for name in view.frames)


def _picture(session: Session, name: str) -> NDArray[np.generic]:
    """Return a picture as it is on disk; raises ImageError that names the file."""
    try:
        return load_picture(session.folder / name)
    except ImageError as error:
        raise ImageError(f"{error}, or take its view out of session.json") from error
