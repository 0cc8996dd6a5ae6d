"""The peers' side of `peers`: what they are given is right, and they find what is in it."""

import numpy as np
import pytest

from benchmarks import peers
from benchmarks.peer_cases import peer_case, simulated_rig
from calib.transforms import pose_error
from daemon.profile import load_profile


@pytest.fixture(scope="module")
def rig():
    return simulated_rig(load_profile("six-axis-arm"), 0.0, np.random.default_rng(0))


def test_the_true_drawing_leads_from_hand_to_hand(rig) -> None:
    """What the drawing and the hand-eye leave between base and world is the same at all readings."""
    base = rig.true @ np.linalg.inv(rig.drawing.poses(rig.held_out) @ rig.hand_from_camera)
    position, rotation = pose_error(base[1:], np.broadcast_to(base[0], base[1:].shape))
    assert position.max() < 1e-9
    assert rotation.max() < 1e-9


def test_a_rig_is_built_beside_its_drawing_by_what_is_said(rig) -> None:
    rng = np.random.default_rng(1)
    off = [rig.drawing.as_built_beside(rng).mdh - rig.drawing.mdh for _ in range(200)]
    assert np.std(off, axis=(0, 1)) == pytest.approx([0.0087, 0.001, 0.0175, 0.001], rel=0.1)


def test_peers_find_an_exact_hand_eye(rig) -> None:
    if not peers.PEERS.exists():
        pytest.skip("the peers are not installed: 'make bench-peers' installs them")
    case = peer_case(rig.session, rig.drawing, rig.held_out)
    case["world_from_camera"] = (
        rig.true[0]
        @ np.linalg.inv(rig.drawing.poses(rig.held_out[:1])[0] @ rig.hand_from_camera)
        @ np.array(case["base_from_hand"])
        @ rig.hand_from_camera
    ).tolist()
    (found,) = peers.solved_by_peers([case])
    assert len(found) == 8
    for name, each in found.items():
        assert isinstance(each, peers.Found), name
        assert pose_error(each.poses, rig.true)[0].max() < 1e-4, name
