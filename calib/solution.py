"""What a solver found, before it is written down."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.corrections import NO_CORRECTIONS, Corrections
from calib.likelihood.imperfections import Slipped
from calib.likelihood.refinement import Refined
from calib.likelihood.weakness import Weakness
from calib.session import Intrinsics, WorldOrigin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solution:
    """The chain, each camera's pose at all readings 0 `mounts` (c, 4, 4), and its lens; None where there is none.

    `origin` says which way round a symmetric target is taken, `undecided` are the views, by place, that may have seen
    it another way round, `covariance` the names of the document's numbers and their covariance (d, d), `left_out`
    (views by place, and points as (view, id)) what did not belong, `refined` the
    fit that it is from, if any, `weaknesses` what the views leave in the dark, `noise_px` how much single points
    scatter. `prior` (k, k) is what a nominal model knows of the chain, and `world_from_base`
    (4, 4) its base. `corrections` are what imperfect joints add to their readings, `warp` the height (m) of each
    shape of the target's, and `unused_warp` about what that would be where the data support one that nobody asked
    for; `aspects` by how much a sensor that gives poses sees y too large. `sides` (n, m) are from which joints
    approached their readings, as far as the fit has found that out; `slips` are the steps that they lost on the way.
    """

    chain: Chain
    mounts: Array | None
    lenses: list[Intrinsics | None]
    origin: WorldOrigin | None = None
    undecided: Sequence[int] = ()
    covariance: tuple[list[str], Array] | None = None
    left_out: tuple[Sequence[int], Sequence[tuple[int, int]]] = ((), ())
    refined: Refined | None = None
    weaknesses: Sequence[Weakness] = ()
    noise_px: float | None = None
    prior: Array | None = None
    world_from_base: Array | None = None
    corrections: Corrections = NO_CORRECTIONS
    warp: dict[str, float] = field(default_factory=dict)
    unused_warp: dict[str, float] = field(default_factory=dict)
    aspects: dict[str, float] = field(default_factory=dict)
    sides: Array | None = None
    slips: Sequence[Slipped] = ()
