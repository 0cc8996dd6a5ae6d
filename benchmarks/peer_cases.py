"""What the peers are given: a session's camera poses, and a drawing of its chain with the readings in its units."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.paper_rig import paper_world
from benchmarks.true_rig import Array
from calib import Calibration, Session, solve
from calib.dh import link_transform
from calib.first_solution import camera_views
from calib.observations import observe
from calib.session import SESSION_FORMAT
from daemon.profile import Profile
from drivers.simulated.world import SimulatedWorld

LENGTH_M, ANGLE_RAD, SCALE = 1e-3, np.radians(0.5), 0.01
"""Standard deviations of how a rig is built beside its drawing; of zero-offsets twice the angle."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A chain in modified D-H: `kinds` (m,), rows (alpha, a, theta, d) `mdh` (m, 4), and `scales` (m,) of readings."""

    kinds: list[str]
    mdh: Array
    scales: Array

    def poses(self, readings: Array) -> Array:
        """Return base_from_hand (n, 4, 4) at readings (n, m)."""
        poses = np.broadcast_to(np.eye(4), (len(readings), 4, 4))
        for joint, (kind, (alpha, a, theta, d), scale) in enumerate(
            zip(self.kinds, self.mdh, self.scales, strict=True)
        ):
            links = [link_transform(kind, a, alpha, d, theta, scale, value) for value in readings[:, joint]]
            poses = poses @ np.array(links)
        return poses

    def as_built_beside(self, rng: np.random.Generator) -> "Drawing":
        """Return a drawing from which the rig differs as rigs do: in lengths, angles, zero-offsets and scales."""
        off = rng.normal(size=self.mdh.shape) * [ANGLE_RAD, LENGTH_M, 2 * ANGLE_RAD, LENGTH_M]
        scales = self.scales * (1 + SCALE * rng.normal(size=len(self.scales)))
        return Drawing(self.kinds, self.mdh + off, scales)


@dataclass(frozen=True, eq=False)
class Rig:
    """A simulated rig: its session of points, and the truth: drawing, hand-eye and poses at the held-out readings."""

    session: Session
    drawing: Drawing
    hand_from_camera: Array
    held_out: Array
    true: Array


def simulated_rig(profile: Profile, noise: float, rng: np.random.Generator) -> Rig:
    """Return the rig of a shipped profile at the readings of its procedure, points off by `noise` px (std)."""
    world = paper_world(profile)
    points, views = world.target_points(), []
    planned = list(profile.procedure.planned_views())
    held_out = np.array([list(view.readings.values()) for view in planned if view.use == "verify"])
    for view in planned:
        readings = list(view.readings.values())
        pixels = world.project(points, readings)
        seen = {
            "ids": list(range(len(points))),
            "pixels": (pixels + rng.normal(0, noise, pixels.shape)).tolist(),
        }
        if view.use == "fit":
            views.append({"joint": view.joint, "readings": readings, "points": seen})
    header = profile.empty_session().model_dump(mode="json", exclude_unset=True)
    header |= {"format": SESSION_FORMAT, "complete": True}
    exact = solve(_with_exact_poses(header, views, world), "closed_form")
    hand = exact.cameras[0].link_from_camera
    true = np.array([world.world_from_camera(readings) for readings in held_out])
    return Rig(
        session=Session.model_validate(header | {"views": views}),
        drawing=_drawing(exact),
        hand_from_camera=np.array(hand),
        held_out=held_out,
        true=true,
    )


def peer_case(session: Session, drawing: Drawing, held_out: Array) -> dict[str, Any]:
    """Return what `peer_solvers` is given of a session's fit views: the camera's poses, the lens being found first."""
    observed = [o for o in observe(session).observations if session.views[o.view].use == "fit"]
    cameras = camera_views(session, observed).poses
    readings = session.readings()[[o.view for o in observed]]
    return {
        "kinds": drawing.kinds,
        "mdh": drawing.mdh.tolist(),
        "q": (readings * drawing.scales).tolist(),
        "q_held_out": (held_out * drawing.scales).tolist(),
        "world_from_camera": cameras.tolist(),
        "base_from_hand": drawing.poses(readings).tolist(),
        "held_out": drawing.poses(held_out).tolist(),
    }


def standard_drawing(session: Session) -> Drawing:
    """Return the drawing that a session brings along in standard D-H, all joints revolute: its last turn is the hand's.

    Rz(theta) Tz(d) Tx(a) Rx(alpha) of one row after the other is modified D-H with a and alpha of the row before.
    """
    assert session.nominal is not None
    rows = session.nominal.dh
    before = [(0.0, 0.0), *((row.alpha, row.a) for row in rows[:-1])]
    return Drawing(
        kinds=[joint.kind for joint in session.joints],
        mdh=np.array([[*pair, row.theta, row.d] for pair, row in zip(before, rows, strict=True)]),
        scales=np.array([row.scale for row in rows]),
    )


def _with_exact_poses(header: dict[str, Any], views: list[dict[str, Any]], world: SimulatedWorld) -> Session:
    """Return a session of the true poses, whose closed form is the truth in D-H."""
    posed = [
        {
            "joint": view["joint"],
            "readings": view["readings"],
            "world_from_camera": world.world_from_camera(view["readings"]).tolist(),
        }
        for view in views
    ]
    return Session.model_validate(header | {"target": {"kind": "none"}, "views": posed})


def _drawing(exact: Calibration) -> Drawing:
    rows = [[link.alpha_prev, link.a_prev, link.theta_offset, link.d_offset] for link in exact.dh]
    return Drawing(
        kinds=[joint.kind for joint in exact.joints],
        mdh=np.array(rows),
        scales=np.array([link.scale for link in exact.dh]),
    )
