"""The peers of `peers`, in an environment of their own: OpenCV 4's hand-eye solvers and pybotics.

`python peer_solvers.py` reads cases as JSON from stdin and writes what each peer makes of each to stdout. It imports
nothing of this project, whose environment has another OpenCV, without these solvers, and another numpy.
"""

import json
import sys
from collections.abc import Callable
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from pybotics.kinematic_chain import MDHKinematicChain
from pybotics.link import PrismaticMDHLink, RevoluteMDHLink
from pybotics.optimization import OptimizationHandler
from pybotics.robot import Robot
from pybotics.tool import Tool
from scipy.optimize import least_squares

HAND_EYE = ("TSAI", "PARK", "HORAUD", "ANDREFF", "DANIILIDIS")
ROBOT_WORLD = ("SHAH", "LI")
EVALUATIONS = 50
"""Most derivatives that pybotics' fit may take."""


def solve(case: dict[str, Any]) -> dict[str, Any]:
    """Return what each peer found by its name: held-out poses (n, 4, 4), hand-eye (4, 4), seconds, or its error.

    A case has the camera's poses `world_from_camera`, the drawing's `base_from_hand` at the same readings and at those
    `held_out` (n, 4, 4), and for pybotics the drawing itself: `kinds`, `mdh` rows (alpha, a, theta, d), and joint
    values `q` and `q_held_out` (rad, m).
    """
    solvers: dict[str, Callable[[], dict[str, Any]]] = {}
    for name in HAND_EYE:
        solvers[f"hand-eye, {name.title()}"] = lambda name=name: _hand_eye(case, name)
    for name in ROBOT_WORLD:
        solvers[f"robot-world, {name.title()}"] = lambda name=name: _robot_world(case, name)
    solvers["pybotics"] = lambda: _pybotics(case)
    return {name: _tried(solver) for name, solver in solvers.items()}


def _tried(solver: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    begin = perf_counter()
    try:
        found = solver()
    except (cv2.error, np.linalg.LinAlgError, ValueError) as error:
        # OpenCV wraps its reason into version, file and function.
        reason = str(error).strip().splitlines()[0].rpartition("error: ")[2]
        return {"error": reason.partition(" in function")[0]}
    if not all(np.isfinite(found[key]).all() for key in found):
        return {"error": "what it returns is not finite"}
    turn = found["hand_from_camera"][:3, :3]
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0:
        return {"error": "what it returns is no rotation"}
    return {key: value.tolist() for key, value in found.items()} | {"seconds": perf_counter() - begin}


def _hand_eye(case: dict[str, Any], name: str) -> dict[str, Any]:
    """AX = XB; where the base stands is then the mean over the views."""
    hands, cameras = np.array(case["base_from_hand"]), np.array(case["world_from_camera"])
    worlds = np.linalg.inv(cameras)
    method = getattr(cv2, f"CALIB_HAND_EYE_{name}")
    rotation, position = cv2.calibrateHandEye(*_parts(hands), *_parts(worlds), method=method)
    hand_from_camera = _transform(rotation, position)
    bases = cameras @ np.linalg.inv(hands @ hand_from_camera)
    return _predicted(case, _mean(bases), hand_from_camera)


def _robot_world(case: dict[str, Any], name: str) -> dict[str, Any]:
    hands, cameras = np.array(case["base_from_hand"]), np.array(case["world_from_camera"])
    method = getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{name}")
    found = cv2.calibrateRobotWorldHandEye(
        *_parts(np.linalg.inv(cameras)), *_parts(np.linalg.inv(hands)), method=method
    )
    return _predicted(case, _transform(*found[:2]), np.linalg.inv(_transform(*found[2:])))


def _predicted(case: dict[str, Any], world_from_base: Any, hand_from_camera: Any) -> dict[str, Any]:
    poses = world_from_base @ np.array(case["held_out"]) @ hand_from_camera
    return {"poses": poses, "hand_from_camera": hand_from_camera}


def _pybotics(case: dict[str, Any]) -> dict[str, Any]:
    """Fit the whole drawing, the hand-eye and the base to the camera's poses, as far as pybotics models them.

    Its own objective takes positions alone; rotations are added to it, times how far the camera is from the world's
    origin. It starts at the drawing, with the hand-eye that fits best among those of the solvers above.
    """
    cameras, hands = np.array(case["world_from_camera"]), np.array(case["base_from_hand"])
    hand_from_camera = min(_hand_eyes(case), key=lambda each: _misfit(cameras, hands, each))
    base = _mean(cameras @ np.linalg.inv(hands @ hand_from_camera))
    links = {"revolute": RevoluteMDHLink, "prismatic": PrismaticMDHLink}
    chain = MDHKinematicChain(
        [links[kind](*row) for kind, row in zip(case["kinds"], case["mdh"], strict=True)]
    )
    robot = Robot(kinematic_chain=chain, tool=Tool(matrix=hand_from_camera), world_frame=base)
    handler = OptimizationHandler(robot, kinematic_chain_mask=True, tool_mask=True, world_mask=True)
    reach = np.linalg.norm(cameras[:, :3, 3], axis=1).mean()
    weights = np.array([reach, reach, reach, 1.0])

    def misfit(vector: Any) -> Any:
        handler.apply_optimization_vector(vector)
        away = [handler.robot.fk(q) for q in np.array(case["q"])] - cameras
        return (away[:, :3] * weights).ravel()

    fit = least_squares(misfit, handler.generate_optimization_vector(), max_nfev=EVALUATIONS)
    handler.apply_optimization_vector(fit.x)
    poses = np.array([handler.robot.fk(q) for q in np.array(case["q_held_out"])])
    return {"poses": poses, "hand_from_camera": handler.robot.tool.matrix}


def _hand_eyes(case: dict[str, Any]) -> list[Any]:
    """Return what the hand-eye solvers find (4, 4), of those that find anything."""
    found = [_tried(lambda name=name: _hand_eye(case, name)) for name in HAND_EYE]
    found += [_tried(lambda name=name: _robot_world(case, name)) for name in ROBOT_WORLD]
    return [np.array(each["hand_from_camera"]) for each in found if "error" not in each]


def _misfit(cameras: Any, hands: Any, hand_from_camera: Any) -> float:
    """Return by how much the camera's positions are missed (m, rms)."""
    predicted = hands @ hand_from_camera
    predicted = _mean(cameras @ np.linalg.inv(predicted)) @ predicted
    return float(np.sqrt(((predicted - cameras)[:, :3, 3] ** 2).sum(axis=1).mean()))


def _parts(transforms: Any) -> tuple[list[Any], list[Any]]:
    return [each[:3, :3] for each in transforms], [each[:3, 3] for each in transforms]


def _transform(rotation: Any, position: Any) -> Any:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, np.ravel(position)
    return transform


def _mean(transforms: Any) -> Any:
    """Return the mean of transforms (n, 4, 4): of their positions, and the rotation nearest to that of the rest."""
    left, _, right = np.linalg.svd(transforms[:, :3, :3].mean(axis=0))
    nearest = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return _transform(nearest, transforms[:, :3, 3].mean(axis=0))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    json.dump([solve(case) for case in json.load(sys.stdin)], sys.stdout)
