"""Corners on drawn pictures: as near to the truth as the picture's noise allows, and no surer than they are."""

import cv2
import numpy as np
import pytest
from drawn_targets import Drawn, draw

from calib.detection import Detection, detect
from calib.detection.plane import PlaneView, bent_view
from calib.targets import Charuco, Chessboard

CHESSBOARD = Chessboard(rows=6, columns=9, pitch=0.025)
CHARUCO = Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100")
KINDS = [pytest.param(target, id=target.kind) for target in (CHESSBOARD, CHARUCO)]
TILTED = (36, 27)  # by 45 degrees altogether


def errors(drawn: Drawn, detection: Detection) -> np.ndarray:
    return detection.pixels - drawn.points[detection.ids]


def over_claims(drawn: Drawn, detection: Detection) -> np.ndarray:
    """Squared errors (n,) over what the covariances say that they are."""
    off = errors(drawn, detection)
    return np.einsum("ni,nij,nj->n", off, np.linalg.inv(detection.covariances), off) / 2


@pytest.mark.parametrize("blur", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("tilt", [(0, 0), (24, 18), TILTED], ids=["0", "30", "45"])
@pytest.mark.parametrize("target", KINDS)
def test_corners_are_within_a_fiftieth_of_a_pixel(target, tilt, blur):
    drawn = draw(target, tilt=tilt, roll=7, blur=blur, noise=2, shading=0.2)
    detection = detect(drawn.picture, target)
    assert len(detection.ids) > 0.7 * len(drawn.points)
    assert np.sqrt(np.square(errors(drawn, detection)).mean()) < 0.02


@pytest.mark.parametrize("blur", [0.7, 1.5])
@pytest.mark.parametrize("target", KINDS)
def test_claims_are_the_errors_that_are_made(target, blur):
    drawn = [draw(target, tilt=(12, 9), roll=7, blur=blur, noise=4, seed=seed) for seed in range(3)]
    assert 0.6 < np.mean([over_claims(each, detect(each.picture, target)).mean() for each in drawn]) < 1.6


@pytest.mark.parametrize("target", KINDS)
def test_blurred_corners_claim_less(target):
    sharp, blurred = (detect(draw(target, blur=blur, noise=2).picture, target) for blur in (0.7, 2.0))
    assert np.trace(blurred.covariances.mean(axis=0)) > 1.5 * np.trace(sharp.covariances.mean(axis=0))


@pytest.mark.parametrize("target", KINDS)
def test_what_the_camera_clips_pulls_no_corner(target):
    drawn = draw(target, tilt=(24, 18), roll=7, blur=1.5, noise=1)
    clipped = np.clip(drawn.picture.astype(float) * 1.9 - 60, 0, 255).astype(np.uint8)
    off = errors(drawn, detect(clipped, target))
    assert np.mean(clipped == 255) > 0.1
    assert np.sqrt(np.square(off).mean()) < 0.02


@pytest.mark.parametrize("target", KINDS)
def test_a_lens_that_bends_the_edges_moves_no_corner(target):
    straight = draw(target, size=(1280, 960), roll=7, blur=0.7)
    bend = 0.05  # a barrel: the picture's place at radius r, in half heights, is that of r (1 + bend r²)
    half, middle = 480, np.array([639.5, 479.5])
    y, x = np.mgrid[:960, :1280]
    places = (np.stack([x, y], axis=-1) - middle) / half
    source = middle + half * places * (1 + bend * np.square(places).sum(axis=-1, keepdims=True))
    picture = cv2.remap(straight.picture, *np.moveaxis(source, -1, 0).astype(np.float32), cv2.INTER_CUBIC)

    wanted = (straight.points - middle) / half
    bent = wanted.copy()
    for _ in range(50):
        bent = wanted / (1 + bend * np.square(bent).sum(axis=1, keepdims=True))
    detection = detect(picture, target)
    off = detection.pixels - (middle + half * bent)[detection.ids]
    assert np.abs(straight.points - (middle + half * bent)).max() > 8
    assert np.sqrt(np.square(off).mean()) < 0.02


def test_a_bent_view_follows_the_points_and_what_is_between_them():
    view = PlaneView(np.array([[1000.0, 20, 300], [-30, 900, 200], [0.1, 0.2, 1]]))
    points = np.stack(np.meshgrid(np.linspace(0, 0.2, 8), np.linspace(0, 0.15, 6)), axis=-1).reshape(-1, 2)

    def seen(at: np.ndarray) -> np.ndarray:
        pixels = view.project(at)
        return pixels + 1e-4 * np.square(pixels - 300)

    between = points[:-1] + 0.01
    fitted = bent_view(view, points, seen(points))
    np.testing.assert_allclose(fitted.project(between), seen(between), atol=1e-6)
    one = bent_view(view, points[:1], seen(points[:1]))
    np.testing.assert_allclose(one.project(points), view.project(points), atol=1e-9)
