"""A chain with what a session holds of it."""

from dataclasses import replace

import numpy as np

from calib.chain import Chain
from calib.parameters import held_values
from calib.session import Session


def held_chain(session: Session, chain: Chain) -> Chain:
    """Return the chain of the session's first joints with scales, directions and points held where it says so.

    An axis that is held keeps the sense of growing readings, whichever way round its direction was given.
    """
    held = held_values(session)
    axes, points, scales = chain.axes.copy(), chain.points.copy(), chain.scales.copy()
    for joint, known in enumerate(session.joints[: len(chain)]):
        scales[joint] = held.get(f"{known.name}.scale", scales[joint])
        points[joint] = held.get(f"{known.name}.point", points[joint])
        direction = np.array(held.get(f"{known.name}.axis", axes[joint]))
        axes[joint] = direction / np.linalg.norm(direction) * (1 if direction @ axes[joint] >= 0 else -1)
    return replace(chain, axes=axes, points=points, scales=scales)
