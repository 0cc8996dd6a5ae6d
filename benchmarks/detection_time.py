"""Time to find the target in a picture over `cv2.findCirclesGrid` on the same picture.

Rendered pictures (1280 x 960, lens, defocus, noise) of the paper's simulated table, spread over both sweeps.
Ours measures each disk's centroid and its covariance; the peer gives the blobs' centres.
"""

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.paper_rig import paper_profile, paper_world, swept_readings
from benchmarks.printing import add_pairs, console, say, timing_table
from benchmarks.timing import Pairs, in_turns, seconds, threads
from calib.detection import detect
from calib.targets import CircleGrid
from drivers.simulated.exposure import Exposure

Picture = NDArray[np.uint8]


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the ratio."""
    cv2.setNumThreads(1)
    views, pairs = (2, 1) if quick else (10, 3)
    target = paper_profile().target
    assert isinstance(target, CircleGrid)
    pictures = _pictures(views)
    found = sum(peer(picture, target) for picture in pictures)
    say(f"{views} pictures, {pairs} pairs each; {threads()}; the peer finds the grid in {found} of them")
    timed = [_timed(picture, target, pairs) for picture in pictures]
    together = Pairs([s for each in timed for s in each.a], [s for each in timed for s in each.b])
    rows = timing_table("Detection time of a picture (ms)")
    add_pairs(rows, "detect / findCirclesGrid", together, factor=1e3, digits=1)
    console.print(rows)
    return {"detect / findCirclesGrid": together.ratio.median}


def peer(picture: Picture, target: CircleGrid) -> bool:
    """Look for the grid with OpenCV's own settings, and return whether it was found."""
    found, _ = cv2.findCirclesGrid(picture, (target.columns, target.rows), flags=cv2.CALIB_CB_SYMMETRIC_GRID)
    return bool(found)


def _timed(picture: Picture, target: CircleGrid, pairs: int) -> Pairs:
    ours, theirs = (partial(seconds, partial(finder, picture, target)) for finder in (detect, peer))
    return in_turns(ours, theirs, pairs)


def _pictures(count: int) -> list[Picture]:
    profile = paper_profile()
    world, noise = paper_world(profile), np.random.default_rng(0)
    exposure = Exposure(world, profile.camera.spec.width, profile.camera.spec.height)
    return [exposure.picture([world.world_from_camera(v)], noise) for _, v in swept_readings(count)]
