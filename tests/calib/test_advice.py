"""The sentences in which a fit says what it cannot tell, and what would help."""

import numpy as np
import pytest

from calib.advice import weakness_in_words
from calib.likelihood.other_views import Change, Nearer, Sweep, Tilt, Twice
from calib.likelihood.quantities import ANGLE, RELATIVE, Kind, Quantity
from calib.likelihood.weakness import Advice, Known, Weakness

UNITS = {"pan": "deg", "slide": "mm"}


def known(kind: Kind, owner: str, std: float) -> Known:
    tolerance = {"direction": ANGLE, "look": ANGLE, "place": 0.006, "stand": 0.006}.get(kind, RELATIVE)
    return Known(Quantity(kind, owner, np.zeros((1, 1)), tolerance), std)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (Sweep("pan", -16.0, 16.0), "sweeping pan from -16 to 16 deg as well"),
        (
            Sweep("pan", -8.0, 8.0, ("slide", 100.0)),
            "sweeping pan from -8 to 8 deg with slide at 100 mm as well",
        ),
        (Tilt("X", -30.0), "tilting the target by -30 degrees about its X axis and running again"),
        (Nearer(), "moving the target nearer by a third and running again"),
        (Twice(), "taking every view twice"),
    ],
)
def test_a_change_is_said_with_its_gain(change: Change, words: str) -> None:
    weakness = Weakness((known("place", "pan", 2.0),), Advice(change, 2.5))
    said = weakness_in_words(weakness, UNITS)
    assert (
        said
        == f"the views tell where pan's axis lies to 12 mm only: {words} would make it 2.5 times better known"
    )


def test_what_hides_each_other_is_named_together() -> None:
    group = (known("scale", "pan", 4.0), known("focal_length", "main", 3.0), known("look", "main", 1.0))
    assert weakness_in_words(Weakness(group, Advice(Tilt("X", 30.0), 6.0)), UNITS) == (
        "pan's scale (4 %), the focal length of main (3 %) and which way main looks (0.5 deg) can't be told apart: "
        "tilting the target by 30 degrees about its X axis and running again would make them 6 times better known; "
        "known intrinsics would help too"
    )


def test_what_is_not_determined_has_no_figures() -> None:
    pair = (known("scale", "pan", 400.0), known("focal_length", "main", 300.0))
    said = weakness_in_words(Weakness(pair, Advice(Twice(), 2.0)), UNITS)
    assert said.startswith("pan's scale and the focal length of main can't be told apart: ")
    assert "taking every view twice would help most" in said
    alone = Weakness((known("principal_point", "main", 50.0),), None)
    assert weakness_in_words(alone, UNITS) == (
        "the views do not tell the principal point of main: give known intrinsics"
    )


def test_without_a_remedy_nothing_is_advised() -> None:
    weakness = Weakness((known("direction", "pan", 2.0),), None)
    assert weakness_in_words(weakness, UNITS) == "the views tell the direction of pan's axis to 1 deg only"
