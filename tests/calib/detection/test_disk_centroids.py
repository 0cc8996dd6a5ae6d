"""Disks' centroids on pictures of ellipses whose centres are known, drawn in pixels eight times finer."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calib.detection.disks import Disks, disk_centroids
from calib.detection.picture import Picture, read_picture

FINER = 8
PAPER, INK = 180.0, 20.0


@dataclass(frozen=True, eq=False)
class Ellipses:
    """A picture free of noise of ellipses, and the truth about them."""

    light: NDArray[np.float64]
    centres: NDArray[np.float64]
    shape: NDArray[np.float64]

    def picture(self, noise: float, seed: int) -> Picture:
        noisy = self.light + noise * np.random.default_rng(seed).standard_normal(self.light.shape)
        return read_picture(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))

    def roughly(self, *, light: bool = False, clear: float = 1.6) -> Disks:
        off = np.random.default_rng(5).uniform(-0.1, 0.1, self.centres.shape) * np.sqrt(
            np.linalg.det(self.shape)
        )
        shapes = np.broadcast_to(1.05 * self.shape, (len(self.centres), 2, 2))
        return Disks(self.centres + off, shapes, np.full(len(self.centres), clear), light)


def drawn(
    radii: tuple[float, float] = (11.0, 7.5),
    *,
    blur: float = 0.8,
    gradient: float = 0.3,
    inverted: bool = False,
) -> Ellipses:
    """Draw twenty ellipses, each elsewhere among the pixels, under a light that grows to the right."""
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    shape = turn @ np.diag(radii)
    side = int(3.6 * max(radii))
    fine = (np.arange(FINER * side) + 0.5) / FINER - 0.5
    rng, centres, rows = np.random.default_rng(1), [], []
    for row in range(4):
        tiles = []
        for column in range(5):
            centre = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
            x, y = np.meshgrid(fine - centre[0], fine - centre[1])
            (xx, xy), (_, yy) = np.linalg.inv(shape @ shape.T)
            inside = 1 - (xx * x * x + 2 * xy * x * y + yy * y * y)
            steepness = 2 * np.hypot(xx * x + xy * y, xy * x + yy * y)
            tiles.append(np.clip(0.5 + FINER * inside / steepness, 0, 1).astype(np.float32))
            centres.append(centre + np.array([column * side, row * side]))
        rows.append(np.hstack(tiles))
    covered = cv2.GaussianBlur(np.vstack(rows), (0, 0), FINER * blur)
    covered = cv2.resize(covered, (5 * side, 4 * side), interpolation=cv2.INTER_AREA).astype(float)
    grey = INK + (PAPER - INK) * covered if inverted else PAPER - (PAPER - INK) * covered
    grey *= 1 + gradient * np.linspace(-1, 1, 5 * side)
    return Ellipses(grey, np.array(centres), shape)


@pytest.mark.parametrize(
    ("radii", "looks"),
    [
        pytest.param((11.0, 7.5), {}, id="usual"),
        pytest.param((11.0, 7.5), {"blur": 2.0}, id="blurred"),
        pytest.param((11.0, 7.5), {"blur": 0.5, "gradient": 0.0}, id="sharp, in even light"),
        pytest.param((11.0, 7.5), {"inverted": True}, id="light on dark"),
        pytest.param((3.5, 2.5), {"blur": 0.6}, id="small"),
        pytest.param((30.0, 18.0), {}, id="large"),
    ],
)
def test_squared_errors_are_as_large_as_the_covariances_say(radii, looks):
    ellipses = drawn(radii, **looks)
    squares, errors = [], []
    for seed in range(12):
        disks = ellipses.roughly(light=looks.get("inverted", False))
        centroids = disk_centroids(ellipses.picture(3.0, seed), disks)
        errors.append(centroids.pixels - ellipses.centres)
        weighed = np.linalg.solve(centroids.covariances, errors[-1][..., None])[..., 0]
        squares.append(np.sum(errors[-1] * weighed, axis=1) / 2)
    # 480 squared normal deviates: a standard error of 0.065.
    assert 0.75 < np.mean(squares) < 1.25
    bias = np.mean(errors, axis=0)
    assert np.sqrt(np.mean(bias**2)) < 1.25 * np.sqrt(np.mean(np.square(errors)) / 12) + 0.001


def test_without_noise_a_centroid_is_exact_to_a_thousandth_of_a_pixel():
    ellipses = drawn((18.0, 9.0))
    centroids = disk_centroids(ellipses.picture(0.0, 0), ellipses.roughly())
    np.testing.assert_allclose(centroids.pixels, ellipses.centres, atol=0.003)
    assert np.sqrt(np.mean(np.square(centroids.pixels - ellipses.centres))) < 0.001


def test_a_disk_beside_the_pictures_edge_is_measured_from_what_is_in_the_picture():
    ellipses = drawn()
    disks, picture = ellipses.roughly(), ellipses.picture(1.0, 0)
    left = int(ellipses.centres[0, 0] - 13)
    cut = read_picture(np.ascontiguousarray(ellipses.light[:, left:]).astype(np.uint8))
    shift = np.array([left, 0.0])
    first = np.s_[:1]
    whole = disk_centroids(
        picture, Disks(disks.centres[first], disks.shapes[first], disks.clear[first], False)
    )
    part = disk_centroids(
        cut, Disks(disks.centres[first] - shift, disks.shapes[first], disks.clear[first], False)
    )
    assert np.abs(part.pixels + shift - whole.pixels).max() < 0.05


def test_there_are_no_disks_of_the_wrong_colour():
    ellipses = drawn()
    assert disk_centroids(ellipses.picture(1.0, 0), ellipses.roughly(light=True)) is None


def test_one_that_is_no_disk_is_enough_for_none():
    ellipses = drawn()
    light = ellipses.light.copy()
    x, y = np.rint(ellipses.centres[7]).astype(int)
    light[y - 14 : y + 15, x - 14 : x + 15] = PAPER
    erased = Ellipses(light, ellipses.centres, ellipses.shape)
    assert disk_centroids(erased.picture(1.0, 0), ellipses.roughly()) is None


def test_a_disk_of_another_size_is_another_thing():
    ellipses = drawn()
    disks = ellipses.roughly(clear=2.0)
    smaller = Disks(disks.centres, 0.7 * disks.shapes, disks.clear, False)
    assert disk_centroids(ellipses.picture(1.0, 0), smaller) is None


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_disk(seed):
    ellipses = drawn(gradient=0.0)
    noise = Ellipses(np.full_like(ellipses.light, 120.0), ellipses.centres, ellipses.shape)
    assert disk_centroids(noise.picture(25.0, seed), ellipses.roughly()) is None
