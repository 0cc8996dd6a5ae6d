"""Finding a printed target's points in a picture.

picture      what a camera gave, as grey values to search and to measure in
circle_grid  symmetric and asymmetric grids of disks;  ordering: of the blobs;  disks: centroids on the grey values
chessboard   its inner corners
charuco      chessboard corners, numbered by markers;  corners: both kinds' corners on the grey values,
             crossings: what is to be seen there;  misfit: what covers a part of it
markers      how OpenCV is to search for them
aprilgrid    corners of tags;  tag_corners: where sides cross, on the grey values;  tag_sides: how these are seen,
             tag_strips: the pixels along them, tag_fit: drawings fitted;  pixel_edge: what pixels make of edges
grey_fit     drawings fitted to grey values;  strips: the pixels along edges;  edge_profile: what blur makes of edges
plane        how a flat target lies in the picture, and how a lens bends it;  smooth: what changes smoothly over it
labelling    which of a grid's readings is the target's;  two_prints: what is said where it is there twice
detector     one call for all kinds;  averaging  over several frames of one view
tracking     measuring where the target is expected;  marks, lattice: what is to be seen there, and beyond
health       how good a picture is to measure in;  edges: how wide they are;  health_in_words: what to do
inspection   both at once

Each is loaded when it is first used: who only says how good a picture was does not wait for the search.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calib.detection.averaging import Averaged, detect_in_all, track_in_all
    from calib.detection.detection import Detection
    from calib.detection.detector import detect
    from calib.detection.health import PictureHealth, picture_health
    from calib.detection.health_in_words import Fault, faults
    from calib.detection.inspection import Inspection, inspect
    from calib.detection.tracking import Prediction, track

__all__ = [
    "Averaged",
    "Detection",
    "Fault",
    "Inspection",
    "PictureHealth",
    "Prediction",
    "detect",
    "detect_in_all",
    "faults",
    "inspect",
    "picture_health",
    "track",
    "track_in_all",
]

_MODULES = {
    "averaging": ("Averaged", "detect_in_all", "track_in_all"),
    "detection": ("Detection",),
    "detector": ("detect",),
    "health": ("PictureHealth", "picture_health"),
    "health_in_words": ("Fault", "faults"),
    "inspection": ("Inspection", "inspect"),
    "tracking": ("Prediction", "track"),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            from importlib import import_module

            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module '{__name__}' has no attribute {name!r}")
