"""Whether marks look as they should where they are expected."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.detection.marks import Marks
from calib.detection.places import Places
from calib.detection.window import CLEAR_OF_NOISE, Window

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DISAGREEING = 0.8  # of the samples, where a mark surely is none
CLEARLY = 0.2  # of the contrast: a colour is so far from the middle of the two
ALIKE = 0.4  # of the median contrast
NO_INK, LEAST_BARE = 0.3, 0.4  # of the contrast from ink, and of the places where a mark has ink


class Looks(NamedTuple):
    """How marks and places beyond a grid's rim look: the grey values of `paper` and `ink` (m + b,).

    The part `agreeing` (m + b,) of the samples has the right colour, none where there is no contrast to speak of or not
    all is in the picture: those are not `whole` (m + b,). Places beyond are `bare` (b,) that have no mark, and no ink
    in a good part of where one has it.
    """

    paper: Array
    ink: Array
    agreeing: Array
    whole: Mask
    bare: Mask


def look_at(window: Window, marks: Marks, places: Places) -> Looks:
    """Take the grey values at the marks' samples, and judge each mark by them."""
    values = window.at(places.samples)
    paper, ink = (np.einsum("mk,mk->m", values, part) for part in (marks.paper, marks.ink))
    contrasts, own = paper - ink, len(marks.points)
    sign = -1 if marks.either_way and contrasts[:own].sum() < 0 else 1
    signs = np.concatenate([np.full(own, sign), np.sign(contrasts[own:])])
    from_middle = values - ((paper + ink) / 2)[:, None]
    contrasts = signs * contrasts
    agreeing = (signs[:, None] * from_middle * marks.colours > CLEARLY * contrasts[:, None]).mean(axis=1)
    whole = window.holds(places.samples)
    agreeing[~whole | (contrasts < CLEAR_OF_NOISE * window.noise)] = 0
    usual = contrasts[:own][agreeing[:own] >= marks.agreeing]
    if len(usual):
        agreeing[contrasts < ALIKE * np.median(usual)] = 0

    nearest = marks.nearest[own:]
    no_ink = sign * (values[own:] - ink[nearest, None]) > NO_INK * contrasts[nearest, None]
    bare = (
        whole[own:] & (agreeing[own:] < DISAGREEING) & ((no_ink * marks.ink[own:]).sum(axis=1) > LEAST_BARE)
    )
    return Looks(paper, ink, agreeing, whole, bare)
