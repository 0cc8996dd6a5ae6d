"""Tsai's two-stage calibration from a single view, with the division model (eq 15 to 22, 72, 73, corrected).

Stage 1 takes rotation and the sideways translation from the radial alignment constraint, which holds
whatever the focal length and radial distortion; stage 2 takes focal length, distortion and depth from one
linear system. The image centre is to be known, for a coplanar target the aspect ratio too.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.errors import UnsolvableError
from calib.session import Intrinsics
from calib.transforms import inverse, nearest_rotation, transform

Array = NDArray[np.float64]

PARALLEL_TO_IMAGE = 0.02
"""Sine of the target's tilt below which focal length and distance cannot be told apart."""


@dataclass(frozen=True, eq=False)
class SingleView:
    """A lens of the division model, and the pose `world_from_camera` (4, 4) it was found at."""

    intrinsics: Intrinsics
    world_from_camera: Array


def tsai(world: ArrayLike, pixels: ArrayLike, centre: ArrayLike, aspect: float = 1.0) -> SingleView:
    """Calibrate from points `world` (n, 3) in m seen at `pixels` (n, 2), with the image centre `centre` (2,).

    `aspect` is fx / fy; points that are not in one plane find it themselves, and then it is not used.
    Coplanar points must have Z = 0. Raises UnsolvableError for too few points, or a target parallel to the
    image plane.
    """
    world, pixels = np.asarray(world, dtype=float), np.asarray(pixels, dtype=float)
    spread = np.linalg.svd(world - world.mean(axis=0), compute_uv=False) if len(world) else np.zeros(3)
    coplanar = bool(spread[2] <= 1e-6 * spread[0])
    if coplanar and np.abs(world[:, 2]).max(initial=0) > 1e-9:
        raise UnsolvableError("Tsai's method wants a coplanar target in the world's plane Z = 0")
    if len(world) < (6 if coplanar else 8) or spread[1] <= 1e-6 * spread[0]:
        raise UnsolvableError(
            f"Tsai's method needs 6 points in a plane, or 8 that are not; it was given {len(world)}"
        )
    seen = pixels - np.asarray(centre, dtype=float)
    # Eq 72 divides by Ty: take the point seen farthest above or below the centre as origin.
    origin = world[np.argmax(np.abs(seen[:, 1]))]
    local = world - origin
    if coplanar:
        seen = seen * [1 / aspect, 1]
        rotation, sideways = _stage_1_coplanar(local, seen)
    else:
        rotation, sideways, aspect = _stage_1(local, seen)
        seen = seen * [1 / aspect, 1]
    focal, bend, depth = _stage_2(local, seen, rotation, sideways)
    if focal < 0:
        # The plane's mirror image through the image plane fits stage 1 as well.
        flip = np.array([[1, 1, -1], [1, 1, -1], [-1, -1, 1.0]])
        rotation = rotation * flip
        focal, bend, depth = _stage_2(local, seen, rotation, sideways)
    if not (focal > 0 and depth > 0):
        raise UnsolvableError("no camera in front of the target fits this view: are the points' ids right?")
    lens = Intrinsics(
        model="division",
        fx=focal * aspect,
        fy=focal,
        cx=float(np.asarray(centre)[0]),
        cy=float(np.asarray(centre)[1]),
        distortion=[bend * focal**2],
    )
    camera_from_local = transform(rotation, [*sideways, depth])
    return SingleView(lens, inverse(camera_from_local @ transform(np.eye(3), -origin)))


def _stage_1_coplanar(world: Array, seen: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3) and (Tx, Ty) of a target in Z = 0 (eq 72)."""
    x, y = seen.T
    X, Y = world[:, 0], world[:, 1]
    # Points in metres and pixels differ by orders of magnitude: columns of like size keep the digits.
    rows = np.column_stack([y * X, y * Y, y, -x * X, -x * Y])
    r1, r2, tx, r4, r5 = _scaled_lstsq(rows, x)
    square, determinant = r1**2 + r2**2 + r4**2 + r5**2, r1 * r5 - r4 * r2
    # The smaller root of Tsai's quadratic in Ty^2, in the form that lives with a determinant of 0.
    ty = np.sqrt(2 / (square + np.sqrt(max(square**2 - 4 * determinant**2, 0.0))))
    ty *= _sign_of_ty(np.column_stack([r1 * X + r2 * Y + tx, r4 * X + r5 * Y + 1]), seen)
    r1, r2, tx, r4, r5 = r1 * ty, r2 * ty, tx * ty, r4 * ty, r5 * ty
    r3 = np.sqrt(max(1 - r1**2 - r2**2, 0.0))
    r6 = np.sqrt(max(1 - r4**2 - r5**2, 0.0)) * (-1 if r1 * r4 + r2 * r5 > 0 else 1)
    rotation = np.array([[r1, r2, r3], [r4, r5, r6], np.cross([r1, r2, r3], [r4, r5, r6])])
    if np.hypot(r3, r6) < PARALLEL_TO_IMAGE:
        raise UnsolvableError(
            "the target is parallel to the image plane, where focal length and distance cannot be told "
            "apart: tilt it by 20 degrees or more"
        )
    return nearest_rotation(rotation), np.array([tx, ty])


def _stage_1(world: Array, seen: Array) -> tuple[Array, Array, float]:
    """Return the rotation, (Tx, Ty) and fx / fy of a target that is not in one plane."""
    x, y = seen.T
    rows = np.column_stack([y[:, None] * world, y, -x[:, None] * world])
    solution = _scaled_lstsq(rows, x)
    ty = 1 / np.linalg.norm(solution[4:])
    aspect = float(ty * np.linalg.norm(solution[:3]))
    ty *= _sign_of_ty(np.column_stack([world @ solution[:3] + solution[3], world @ solution[4:] + 1]), seen)
    first, second = solution[:3] * ty / aspect, solution[4:] * ty
    rotation = nearest_rotation(np.array([first, second, np.cross(first, second)]))
    return rotation, np.array([solution[3] * ty / aspect, ty]), aspect


def _sign_of_ty(sideways: Array, seen: Array) -> float:
    """Return the sign of Ty: points are seen on the side where they are, `sideways` being for Ty > 0."""
    return 1.0 if float((sideways * seen).sum()) > 0 else -1.0


def _stage_2(world: Array, seen: Array, rotation: Array, sideways: Array) -> tuple[float, float, float]:
    """Return focal length (px), distortion (1 / px^2) and depth (m), from one linear system (eq 73)."""
    across = world @ rotation[:2].T + sideways
    away = world @ rotation[2]
    square = (seen**2).sum(axis=1, keepdims=True)
    rows = np.stack([across, across * square, -seen], axis=-1).reshape(-1, 3)
    focal, product, depth = _scaled_lstsq(rows, (seen * away[:, None]).ravel())
    return float(focal), float(product / focal), float(depth)


def _scaled_lstsq(rows: Array, right: Array) -> Any:
    scale = np.linalg.norm(rows, axis=0)
    return np.linalg.lstsq(rows / scale, right, rcond=None)[0] / scale
