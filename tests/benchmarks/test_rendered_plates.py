"""The plates that detectors are judged on: their pictures, their truth and their bound agree."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.picture_bound import place_bounds
from benchmarks.rendered_plates import TARGETS, Scene, SeenPlate

SCENE = Scene(width=640, tilt=40.0, gradient=0.0)


@pytest.mark.parametrize("target", TARGETS[:2], ids=lambda target: target.kind)
def test_the_ink_of_a_disk_is_centred_on_its_true_centroid(target) -> None:
    plate = SeenPlate(target, SCENE)
    light, truth = plate.light().astype(float), plate.points()
    apart = np.sort(np.linalg.norm(truth[:, None] - truth, axis=2), axis=1)[:, 1]
    for place, reach in zip(truth, apart / 2, strict=True):
        left, top = np.floor(place - reach).astype(int)
        right, bottom = np.ceil(place + reach).astype(int)
        window = light[top : bottom + 1, left : right + 1]
        y, x = np.mgrid[top : bottom + 1, left : right + 1]
        within = np.hypot(x - place[0], y - place[1]) < reach
        ink = np.where(within, window.max() - window, 0)
        centroid = np.array([(ink * x).sum(), (ink * y).sum()]) / ink.sum()
        np.testing.assert_allclose(centroid, place, atol=0.005)


def test_the_bound_grows_with_the_noise_and_with_nothing_else() -> None:
    calm, noisy = (
        place_bounds(SeenPlate(TARGETS[0], replace(SCENE, noise=noise)), 30.0) for noise in (1.0, 3.0)
    )
    np.testing.assert_allclose(noisy, calm * (9 + 1 / 12) / (1 + 1 / 12))


def test_the_bound_is_that_of_a_line_of_sharp_edges() -> None:
    """Across an edge of contrast c and blur s, each pixel of its length tells c² / (2 sqrt(pi) s noise²)."""
    plate = SeenPlate(TARGETS[0], replace(SCENE, tilt=0.0))
    contrast = np.ptp(plate.light()[200:280, 280:360])
    radius = 0.6 * np.linalg.norm(np.diff(plate.points()[:2], axis=0)) / 2
    spread = np.sqrt(SCENE.blur**2 + 1 / 12)
    information = np.pi * radius * contrast**2 / (2 * np.sqrt(np.pi) * spread) / (SCENE.noise**2 + 1 / 12)
    bounds = place_bounds(plate, 1.6 * radius)
    np.testing.assert_allclose(
        bounds, np.broadcast_to(np.eye(2) / information, bounds.shape), rtol=0.1, atol=1e-7
    )
