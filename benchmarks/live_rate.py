"""How many live pictures a second are searched, and tracked in, on one core: rendered plates of all five kinds.

The plate moves by 4 px from picture to picture. `detect`, and `track` from the picture before, are timed in turns, by
the processor's clock; with 1080 lines so is OpenCV's own detector, the first that `peers` names. A picture in which a
tracked point is more than 2 px from the truth is a false lock.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Final

import cv2
import numpy as np

from benchmarks.peer_detectors import Picture, peers
from benchmarks.printing import console, say, table
from benchmarks.rendered_plates import TARGETS, Printed, Scene, SeenPlate
from benchmarks.timing import Pairs, in_turns, threads
from benchmarks.true_rig import Array
from calib.detection import Detection, Prediction, detect, track
from calib.errors import DetectionError
from calib.targets import target_symmetries

WIDE: Final = Scene(width=1280)
FULL_HD: Final = Scene(width=1920, fill=0.5)
FULL_HD_ROWS: Final = 1080
MOVES: Final = 4.0
"""px from picture to picture."""
OFF: Final = 8.0
"""px that the prediction says it may be off."""
LOCKED: Final = 2.0


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the main figures."""
    cv2.setNumThreads(1)
    pairs, frames = (1, 2) if quick else (9, 12)
    say(f"{pairs} pairs, {frames} pictures of a moving plate; {threads()}")
    rows = table(
        "Live rates", "target", "1280 x 960: searched /s", "tracked /s", "1920 x 1080: detect / track",
        "OpenCV / track", "(detect, OpenCV, track, ms)", "tracked", "rms px", "false locks",
    )  # fmt: skip
    figures: dict[str, float] = {}
    for target in TARGETS:
        plate = SeenPlate(target, WIDE)
        wide = _pictures(plate, frames)
        full = [_cut(each) for each in _pictures(SeenPlate(target, FULL_HD), 2)]
        peer = next(iter(peers(target).values()))
        live = _timed(partial(detect, target=target), wide[:2], target, pairs)
        ours = _timed(partial(detect, target=target), full, target, pairs)
        theirs = _timed(peer, full, target, pairs)
        followed, rms, false_locks = _followed(plate, wide)
        searched, tracked = (1 / float(np.median(each)) for each in (live.a, live.b))
        each = ", ".join(f"{1e3 * float(np.median(times)):.1f}" for times in (ours.a, theirs.a, ours.b))
        rows.add_row(
            target.kind, f"{searched:.0f}", f"{tracked:.0f}", f"{ours.ratio.median:.1f}",
            f"{theirs.ratio.median:.1f}", each, f"{100 * followed:.0f} %", f"{rms:.4f}", f"{false_locks}",
        )  # fmt: skip
        figures |= {
            f"{target.kind}: searched (1/s)": searched,
            f"{target.kind}: tracked (1/s)": tracked,
            f"{target.kind}: detect / track at 1080 lines": ours.ratio.median,
            f"{target.kind}: OpenCV / track at 1080 lines": theirs.ratio.median,
            f"{target.kind}: tracked (share)": followed,
        }
    console.print(rows)
    return figures


def _timed(
    search: Callable[[Picture], object], pictures: list[Picture], target: Printed, pairs: int
) -> Pairs:
    """Time a search of the last of two pictures, and tracking from the first to it."""
    before, now = pictures
    predicted = Prediction.of(detect(before, target), OFF)
    searched, followed = partial(search, now), partial(track, now, target, predicted)
    return in_turns(partial(_processor_seconds, searched), partial(_processor_seconds, followed), pairs)


def _processor_seconds(work: Callable[[], object]) -> float:
    """Return how long a core is busy with `work`, whatever else the machine does."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def _pictures(plate: SeenPlate, count: int) -> list[Picture]:
    """Render pictures of a plate that moves along a circle."""
    noise = np.random.default_rng(0)
    return [plate.picture(plate.light((float(x), float(y))), noise) for x, y in _shifts(count)]


def _shifts(count: int) -> Array:
    turns = np.arange(count) / 8
    radius = MOVES / (2 * np.sin(1 / 16))
    return np.asarray(radius * np.column_stack([np.sin(turns), 1 - np.cos(turns)]))


def _cut(picture: Picture) -> Picture:
    """Cut the middle rows out of a picture of 4 : 3."""
    first = (len(picture) - FULL_HD_ROWS) // 2
    return np.ascontiguousarray(picture[first : first + FULL_HD_ROWS])


def _followed(plate: SeenPlate, pictures: list[Picture]) -> tuple[float, float, int]:
    """Follow a moving plate; return the share of pictures in which it was, the points' rms (px), and false locks."""
    target = plate.target
    seen: Detection | None = None
    errors: list[Array] = []
    false_locks = 0
    for picture, (x, y) in zip(pictures, _shifts(len(pictures)), strict=True):
        if seen is None:
            seen = detect(picture, target)
            continue
        try:
            seen = track(picture, target, Prediction.of(seen, OFF))
        except DetectionError:
            seen = None
            continue
        off = _off(seen, plate.points() + np.array([x, y]), target)
        if np.abs(off).max() > LOCKED:
            false_locks += 1
        else:
            errors.append(off)
    rms = (
        float(np.sqrt(np.mean(np.concatenate([np.square(off).sum(axis=1) for off in errors]))))
        if errors
        else 0.0
    )
    return len(errors) / (len(pictures) - 1), rms, false_locks


def _off(seen: Detection, truth: Array, target: Printed) -> Array:
    """Return how far points are off, of a target that may look the same after a turn."""
    readings = [truth, *(truth[symmetry.permutation] for symmetry in target_symmetries(target))]
    return min(
        (seen.pixels - reading[seen.ids] for reading in readings), key=lambda off: float(np.abs(off).max())
    )
