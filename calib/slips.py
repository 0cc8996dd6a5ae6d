"""Joints that slipped in a session: what their readings were, and words for it.

Who has no encoder reads what was commanded, and does not notice lost steps. Only the session's own views do.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.corrections_in_words import size_in_words
from calib.likelihood.imperfections import Slipped
from calib.session import Joint

Array = NDArray[np.float64]


def as_it_stood(readings: Array, slips: Sequence[Slipped]) -> Array:
    """Return the session's readings (n, m) as they would have been if the joints had not slipped."""
    stood = readings.copy()
    for slip in slips:
        stood[slip.view :, slip.joint] += slip.size
    return stood


def slips_in_words(slips: Sequence[Slipped], joints: Sequence[Joint]) -> list[str]:
    """Return a sentence for each slip, and what to do."""
    sentences = []
    for slip in slips:
        joint = joints[slip.joint]
        size = size_in_words(slip.size, slip.std, joint.reading_unit)
        sentences.append(
            f"joint '{joint.name}' slipped by {size} on its way to view {slip.view}: check its motor's current and "
            "acceleration, and what might be loose or in its way, home it and run again"
        )
    return sentences
