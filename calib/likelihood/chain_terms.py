"""Each view's camera pose, and how it changes with every parameter and every reading.

A small change of the pose is a twist xi in the camera's frame, world_from_camera Exp(xi). A joint's screw S moved by
a twist eta (S -> Ad(Exp eta) S) turns the motion E = exp(S q) into Exp(eta) E Exp(-eta), so that with U the camera
as seen from before and after the joint, xi = (Ad(U_before) - Ad(U_after)) eta; its reading gives xi =
Ad(U_before) S s dv.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.state import Layout, State, joint_basis
from calib.transforms import inverse
from calib.twists import adjoint, joint_screw

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ChainTerms:
    """Of n views of one camera: `poses` (n, 4, 4), and how the pose changes in its own frame.

    `by_parameter` (n, 6, p) by the layout's parameters, `by_reading` (n, 6, m) by the joints' readings.
    """

    poses: Array
    by_parameter: Array
    by_reading: Array


def chain_terms(
    state: State, layout: Layout, camera: int, link: int, readings: Array, regressors: Array
) -> ChainTerms:
    """Return the terms of views at `readings` (n, m) of a camera that `link` joints move.

    `regressors` (n, m, r + k) say how much of each rest, and of each correction's coefficient, is added to readings.
    """
    chain, count = state.chain, len(readings)
    corrected = readings + regressors @ np.concatenate([state.rests, state.corrections])
    by_parameter = np.zeros((count, 6, len(layout)))
    by_reading = np.zeros((count, 6, len(chain)))
    after = np.broadcast_to(inverse(state.mounts[camera]), (count, 4, 4))
    carried = adjoint(after)
    for joint in reversed(range(link)):
        before = after @ chain.motion(joint, -corrected[:, joint])
        carried_before = adjoint(before)
        by_parameter[:, :, layout.shapes[joint]] = (carried_before - carried) @ joint_basis(chain, joint)
        turning = carried_before @ joint_screw(chain, joint) * chain.scales[joint]
        by_parameter[:, :, layout.scales[joint]] = turning * corrected[:, joint, None]
        by_reading[:, :, joint] = turning
        after, carried = before, carried_before
    by_parameter[:, :, layout.mounts[camera]] = np.eye(6)
    by_parameter[:, :, layout.rests.start : layout.corrections.stop] = by_reading @ regressors
    return ChainTerms(inverse(after), by_parameter, by_reading)
