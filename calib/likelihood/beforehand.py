"""What is known before anything is measured: what is held, and about where the rest is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.lens_prior import LensPrior
from calib.likelihood.state import Layout, State
from calib.parameters import held_values
from calib.session import Session
from calib.units import nominal_scale

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beforehand:
    """Which parameters are `free` (p,), what is known of them as `information` (p, p), and of the start.

    `travel` (p,) is the step that leads from where they are most likely to be to where the fit begins.
    """

    free: NDArray[np.bool_]
    information: Array
    travel: Array


def beforehand(
    session: Session, layout: Layout, start: State, lenses: Sequence[LensPrior | None], drawing: Array | None
) -> Beforehand:
    """Return what the session knows of a fit's parameters.

    `lenses` is what it knows of each camera's lens, `drawing` (k, k) what a nominal model knows of the first k
    parameters, those of the joints and of the first camera's mount, in which the fit starts at the drawing.
    """
    free = np.ones(len(layout), dtype=bool)
    information, travel = np.zeros((len(layout), len(layout))), np.zeros(len(layout))
    if drawing is not None:
        information[: len(drawing), : len(drawing)] = drawing
    held = held_values(session)
    for index, joint in enumerate(session.joints):
        shape, scale = layout.shapes[index], layout.scales[index]
        free[shape.start : shape.start + 2] = f"{joint.name}.axis" not in held
        free[shape.start + 2 : shape.stop] = f"{joint.name}.point" not in held
        free[scale] = f"{joint.name}.scale" not in held
        unit = nominal_scale(joint.kind, joint.reading_unit)
        if joint.scale_std is not None and unit is not None:
            information[scale, scale] += joint.scale_std**-2.0
            travel[scale] = np.log(start.chain.scales[index] / unit)
    for part, prior, values in zip(layout.lenses, lenses, start.lenses, strict=True):
        if prior is None or values is None:
            continue
        free[part] = prior.free
        root = prior.root() @ prior.by_step()
        information[part, part] = root.T @ root
        travel[part] = np.linalg.lstsq(root, prior.root() @ (values - prior.mean), rcond=None)[0]
    return Beforehand(free, information, travel)
