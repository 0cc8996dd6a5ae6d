"""How sure a calibration is of a pose: the covariance of its own numbers, carried through the chain. numpy alone.

The pose's covariance is of world_from_camera Exp(xi), xi = (rotation, position) in the camera's frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.transforms import inverse
from calib.twists import adjoint, joint_screw, skew

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TwistCovariance:
    """The covariance (q, q) of one camera's chain.

    Of each joint a twist and its relative scale, of the mount its twist, and the coefficients of the corrections.
    `by_number` (q, p) are their derivatives by the document's numbers, of which `numbers` (p, p) is the covariance.
    """

    matrix: Array
    by_number: Array
    numbers: Array


@dataclass(frozen=True, eq=False)
class CorrectedReadings:
    """Readings as the chain takes them: `values` (n, m), with how much of each correction is in them (n, m, k).

    `std` (n, m) is what is not known of them, such as the side they were approached from.
    """

    values: Array
    regressors: Array
    std: Array


@dataclass(frozen=True, eq=False)
class PoseTerms:
    """How poses change, in their cameras' frames: `by_twist` (n, 6, q) with the chain, `unknown` (n, 6, m) besides.

    The latter is by one standard deviation of what is not known of each reading.
    """

    by_twist: Array
    unknown: Array

    def covariances(self, known: TwistCovariance) -> Array:
        """Return the poses' covariances (n, 6, 6)."""
        covariances = self.by_twist @ known.matrix @ np.swapaxes(self.by_twist, 1, 2)
        if self.unknown.any():
            covariances = covariances + self.unknown @ np.swapaxes(self.unknown, 1, 2)
        return np.asarray(covariances)


def twist_covariance(
    chain: Chain,
    mount: Array,
    camera: int,
    link: int,
    corrections: Sequence[str],
    parameters: Sequence[str],
    matrix: Array,
) -> TwistCovariance:
    """Return what the document's covariance says of the first `link` joints and of the camera's mount (4, 4).

    `matrix` (p, p) is that of the numbers called `parameters`, by their dotted paths in the document, `corrections` are
    the paths of the corrections' coefficients.
    """
    place = {name: index for index, name in enumerate(parameters)}
    jacobian = np.zeros((7 * link + 6 + len(corrections), len(parameters)))
    jacobian[: 7 * link] = joint_twists(chain, parameters)[:link].reshape(-1, len(parameters))
    _put(jacobian[7 * link + 6 :], place, corrections, np.eye(len(corrections)))
    rows, back = jacobian[7 * link : 7 * link + 6], mount[:3, :3].T
    for column in range(3):
        names = [f"cameras.{camera}.world_from_camera.{row}.{column}" for row in range(3)]
        # omega is half the sum of e_c x (R' dR e_c) over the columns c.
        _put(rows[:3], place, names, 0.5 * skew(np.eye(3)[column]) @ back)
    _put(rows[3:], place, [f"cameras.{camera}.world_from_camera.{row}.3" for row in range(3)], back)
    return TwistCovariance(jacobian @ matrix @ jacobian.T, jacobian, matrix)


def joint_twists(chain: Chain, parameters: Sequence[str]) -> Array:
    """Return each joint's twist in the world and its relative scale by the document's numbers (m, 7, p)."""
    place = {name: index for index, name in enumerate(parameters)}
    twists = np.zeros((len(chain), 7, len(parameters)))
    for joint, rows in enumerate(twists):
        axis, point = chain.axes[joint], chain.points[joint]
        turn = skew(axis)
        _put(rows[:3], place, [f"joints.{joint}.axis.{i}" for i in range(3)], turn)
        _put(rows[3:6], place, [f"joints.{joint}.axis.{i}" for i in range(3)], skew(point) @ turn)
        _put(rows[3:6], place, [f"joints.{joint}.point.{i}" for i in range(3)], np.eye(3))
        _put(rows[6:7], place, [f"joints.{joint}.scale"], np.array([[1 / chain.scales[joint]]]))
    return twists


def _put(rows: Array, place: dict[str, int], names: Sequence[str], values: Array) -> None:
    for column, name in enumerate(names):
        if name in place:
            rows[:, place[name]] += values[:, column]


def pose_terms(chain: Chain, mount: Array, link: int, readings: CorrectedReadings) -> PoseTerms:
    """Return how the poses at `readings` change of a camera that `link` joints move."""
    count, corrections = len(readings.values), readings.regressors.shape[2]
    jacobian = np.zeros((count, 6, 7 * link + 6 + corrections))
    by_reading = np.zeros((count, 6, link))
    after = np.broadcast_to(inverse(mount), (count, 4, 4))
    carried = adjoint(after)
    for joint in reversed(range(link)):
        before = after @ inverse(chain.motion(joint, readings.values[:, joint]))
        carried_before = adjoint(before)
        jacobian[:, :, 7 * joint : 7 * joint + 6] = carried_before - carried
        by_reading[:, :, joint] = carried_before @ joint_screw(chain, joint) * chain.scales[joint]
        jacobian[:, :, 7 * joint + 6] = by_reading[:, :, joint] * readings.values[:, joint, None]
        after, carried = before, carried_before
    jacobian[:, :, 7 * link : 7 * link + 6] = np.eye(6)
    jacobian[:, :, 7 * link + 6 :] = by_reading @ readings.regressors[:, :link]
    return PoseTerms(jacobian, by_reading * readings.std[:, None, :link])
