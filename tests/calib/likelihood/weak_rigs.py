"""Rigs that are looked at too little: what their views do not tell, and the same rigs with the advice followed."""

from dataclasses import replace

import numpy as np

from benchmarks.random_rigs import POINTS, LookingRig, in_picture, session_of_views
from benchmarks.true_rig import Rig, unit
from calib.likelihood.other_views import Change, Nearer, Sweep, Tilt
from calib.session import Session
from tests.calib.scenes import look_at

CENTRE = POINTS.mean(axis=0)
Plan = list[tuple[int | None, np.ndarray]]


def looking_at_the_plate(lean: float) -> np.ndarray:
    """Return a camera's pose 0.6 m before the plate, which leans by so many degrees."""
    angle = np.radians(lean)
    return look_at(CENTRE - 0.6 * np.array([np.sin(angle), 0, np.cos(angle)]), CENTRE)


def slide_along_the_line_of_sight(lean: float = 0.0) -> LookingRig:
    mount = looking_at_the_plate(lean)
    rig = Rig(["prismatic"], mount[None, :3, 2], np.zeros((1, 3)), np.array([1e-3]), mount)
    return LookingRig(rig, np.array([[-100.0, 100.0]]))


def slide_and_pan(pan: float = 8.0) -> LookingRig:
    """Return a slide along the line of sight that carries a pan, before a plate parallel to the picture."""
    mount = looking_at_the_plate(0.0)
    return LookingRig(
        Rig(
            kinds=["prismatic", "revolute"],
            axes=np.array([mount[:3, 2], unit(mount[:3, 1] + 0.02)]),
            points=np.array([np.zeros(3), mount[:3, 3] - 0.08 * mount[:3, 2]]),
            scales=np.array([1e-3, np.pi / 180]),
            mount=mount,
        ),
        np.array([[-100.0, 100.0], [-pan, pan]]),
    )


def pan_and_tilt(lean: float, pan: float, tilt: float) -> LookingRig:
    mount = looking_at_the_plate(lean)
    return LookingRig(
        Rig(
            kinds=["revolute", "revolute"],
            axes=np.array([unit(mount[:3, 1] + 0.02), mount[:3, 0]]),
            points=mount[:3, 3] - np.array([[0.08], [0.03]]) * mount[:3, 2],
            scales=np.full(2, np.pi / 180),
            mount=mount,
        ),
        np.array([[-pan, pan], [-tilt, tilt]]),
    )


def seen(looking: LookingRig, plan: Plan, seed: int) -> Session:
    """Return a session of those positions of the plan at which the board is in the picture, with 0.1 px of noise."""
    taken = [(joint, at) for joint, at in plan if in_picture(looking.rig.pose(at))]
    pixels = looking.pixels(np.array([at for _, at in taken]))
    rng = np.random.default_rng(seed)
    return session_of_views(looking, taken, pixels + 0.1 * rng.normal(size=pixels.shape))


def advised(looking: LookingRig, plan: Plan, change: Change) -> tuple[LookingRig, Plan]:
    """Return the rig, in the world of its plate wherever that now is, and the plan, with the advice followed."""
    match change:
        case Sweep(joint, low, high, beside):
            index = int(joint[1:])
            own = [at.copy() for moved, at in plan if moved == index]
            for at, reading in zip(own, np.linspace(low, high, len(own)), strict=True):
                at[index] = reading
                if beside is not None:
                    at[int(beside[0][1:])] = beside[1]
            return looking, plan + [(index, at) for at in own]
        case Tilt(axis, degrees):
            turn = np.zeros(3)
            turn["XY".index(axis)] = np.radians(degrees)
            return replace(looking, rig=_with_the_plate(looking.rig, turn, np.zeros(3))), plan
        case Nearer():
            positions = [looking.rig.pose(at)[:3, 3] for _, at in plan]
            third = (np.mean(positions, axis=0) - CENTRE) / 3
            return replace(looking, rig=_with_the_plate(looking.rig, np.zeros(3), third)), plan
        case _:
            return looking, plan + plan


def _with_the_plate(rig: Rig, turn: np.ndarray, shift: np.ndarray) -> Rig:
    """Return the rig as seen from its plate, turned about its middle and shifted."""
    angle = float(np.linalg.norm(turn))
    x, y, _ = turn / max(angle, 1e-12)
    cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
    back = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    old = np.eye(4)
    old[:3, :3], old[:3, 3] = back, CENTRE - back @ (CENTRE + shift)
    return Rig(rig.kinds, rig.axes @ back.T, rig.points @ back.T + old[:3, 3], rig.scales, old @ rig.mount)
