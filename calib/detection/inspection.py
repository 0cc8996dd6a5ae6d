"""One look at a picture: what is found of the target in it, and how good it is."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.detector import detect
from calib.detection.health import PictureHealth, picture_health
from calib.detection.health_in_words import Fault, faults
from calib.detection.tracking import Prediction, track
from calib.errors import DetectionError
from calib.targets import Target

MOVED = 20.0  # px, from frame to frame; what is faster is blurred, and looked for anew


@dataclass(frozen=True, eq=False)
class Inspection:
    """What one look at a picture tells; `problem` says why there is no `detection`, where there is none."""

    detection: Detection | None
    problem: str | None
    health: PictureHealth | None
    """None where the array is no picture."""
    faults: tuple[Fault, ...]


def inspect(
    image: NDArray[np.generic],
    target: Target,
    predicted: Prediction | None = None,
    before: Detection | None = None,
) -> Inspection:
    """Look for the target in a picture, as `detect` does, and at the picture itself; raises nothing.

    The target is tracked from where it was `before`, in the last frame, and looked for in the whole picture where it is
    not there any more. Where it is not found so, it is measured where it is `predicted`.
    """
    detection, problem, health = None, None, None
    try:
        detection = _tracked(image, target, before) or detect(image, target)
    except DetectionError as error:
        problem = str(error)
        if predicted is not None:
            with suppress(DetectionError):
                detection, problem = track(image, target, predicted), None
    try:
        health = picture_health(image, target, detection)
    except DetectionError as error:
        problem = str(error)
    return Inspection(detection, problem, health, () if health is None else tuple(faults(health)))


def _tracked(image: NDArray[np.generic], target: Target, before: Detection | None) -> Detection | None:
    if before is None:
        return None
    try:
        return track(image, target, Prediction.of(before, MOVED))
    except DetectionError:
        return None
