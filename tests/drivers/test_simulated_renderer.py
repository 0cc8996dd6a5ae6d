"""The pictures agree with the geometry, which is computed here by OpenCV and not by the world's own lens."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter
from scipy.special import ndtr

from drivers.simulated.exposure import Exposure
from drivers.simulated.options import PictureOptions
from drivers.simulated.renderer import Renderer
from drivers.simulated.sensor import Sensor
from drivers.simulated.world import SimulatedWorld
from tests.drivers import geometry, rigs

Array = NDArray[Any]
INK, PAPER = 25.0, 215.0
VIEWS = {
    "straight": {"position": rigs.mm(90, 75, -500)},
    "tilted": {"position": rigs.mm(300, -100, -400), "look_at": rigs.mm(95, 80, 0)},
    "tilted and turned": {
        "position": rigs.mm(-250, 300, -350),
        "look_at": rigs.mm(95, 80, 0),
        "up": [0.3, -1, 0.1],
    },
    "upside down": {"up": [0, 1, 0]},
}


def rendered(world: SimulatedWorld) -> Array:
    return Renderer(world.plate, world.lens, rigs.WIDTH, rigs.HEIGHT).render(world.world_from_camera([]))


def picture(world: SimulatedWorld, **options: Any) -> Array:
    """A picture as a camera would take it."""
    sensor = Sensor(PictureOptions.model_validate(options), rigs.WIDTH, rigs.HEIGHT)
    return sensor.read(sensor.gather(rendered(world)), np.random.default_rng(1))


def inside(pixels: Array, margin: float) -> Array:
    return np.all((pixels > margin) & (pixels < np.array([rigs.WIDTH, rigs.HEIGHT]) - margin), axis=1)


def measured_centroid(image: Array, centre: Array, radius: float) -> tuple[Array, float]:
    """Centroid and area of the ink in a window around a disk."""
    half = int(radius * 1.5 + 3)
    u, v = np.rint(centre).astype(int)
    y, x = np.mgrid[v - half : v + half + 1, u - half : u + half + 1]
    ink = (PAPER - image[y, x]) / (PAPER - INK)
    return np.array([(ink * x).sum(), (ink * y).sum()]) / ink.sum(), float(ink.sum())


@pytest.mark.parametrize("view", VIEWS)
def test_disks_lie_where_the_geometry_puts_them(view: str) -> None:
    world = rigs.still_world(**VIEWS[view])
    pose, image = world.world_from_camera([]), rendered(world).astype(float)
    offsets, growth = [], []
    for centre in world.target_points():
        expected, area = geometry.disk_centroid(centre, 0.009, pose)
        radius = np.sqrt(area / np.pi)
        if inside(expected[None], 2 * radius).all():
            found, found_area = measured_centroid(image, expected, radius)
            offsets.append(np.linalg.norm(found - expected))
            growth.append(abs(found_area / area - 1))
    assert len(offsets) >= 35
    assert max(offsets) < 0.002
    assert max(growth) < 0.001


def test_disks_in_a_clean_8_bit_picture_are_right_to_a_hundredth_of_a_pixel() -> None:
    world = rigs.still_world(**VIEWS["tilted"])
    image = picture(world, noise=0.0, defocus="0.7 px").astype(float)
    pose = world.world_from_camera([])
    for centre in world.target_points():
        expected, area = geometry.disk_centroid(centre, 0.009, pose)
        found, _ = measured_centroid(image, expected, np.sqrt(area / np.pi))
        assert np.linalg.norm(found - expected) < 0.01


def saddle(image: Array, near: Array, blur: float = 3.0) -> Array:
    """Find a chessboard corner: the saddle of the blurred picture, where two straight edges cross."""
    half = 16
    u, v = np.rint(near).astype(int)
    window = gaussian_filter(image[v - half : v + half + 1, u - half : u + half + 1].astype(float), blur)
    spline, at, h = spline_filter(window, 5), near[::-1] - (v - half, u - half), 0.5
    corner_of_window = np.array([v, u]) - half
    steps = h * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]])
    for _ in range(20):
        f = map_coordinates(spline, (at + steps).T, order=5, prefilter=False)
        gradient = np.array([f[1] - f[2], f[3] - f[4]]) / (2 * h)
        mixed = (f[5] - f[6] - f[7] + f[8]) / 4
        hessian = np.array([[f[1] - 2 * f[0] + f[2], mixed], [mixed, f[3] - 2 * f[0] + f[4]]]) / h**2
        at = at - np.linalg.solve(hessian, gradient)
    return np.asarray(at + corner_of_window)[::-1]


@pytest.mark.parametrize("view", VIEWS)
def test_chessboard_corners_lie_where_the_geometry_puts_them(view: str) -> None:
    world = rigs.still_world("chessboard", **VIEWS[view])
    image = rendered(world)
    corners = geometry.project(world.target_points(), world.world_from_camera([]))
    corners = corners[inside(corners, 20)]
    offsets = [np.linalg.norm(saddle(image, corner) - corner) for corner in corners]
    assert len(offsets) >= 50
    assert max(offsets) < 0.02


@pytest.mark.parametrize("view", VIEWS)
def test_every_pixel_has_its_share_of_ink(view: str) -> None:
    world = rigs.still_world("chessboard", **VIEWS[view])
    image, pose = rendered(world), world.world_from_camera([])
    # Pixels around the corners, where edges cross, each with 32 x 32 rays through OpenCV's lens.
    corners = geometry.project(world.target_points(), pose)
    corners = np.rint(corners[inside(corners, 20)][::9])
    around = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)
    pixels = (corners[:, None] + around).reshape(-1, 2)
    grid = (np.arange(32) + 0.5) / 32 - 0.5
    rays = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    xy = geometry.on_plane((pixels[:, None] + rays).reshape(-1, 2), pose)
    black = np.floor(xy / 0.025).sum(axis=1) % 2 == 0
    share = black.reshape(len(pixels), -1).mean(axis=1)
    u, v = pixels.astype(int).T
    assert 0.2 < share.mean() < 0.8
    error = np.abs((PAPER - image[v, u]) / (PAPER - INK) - share)
    assert error.max() < 0.08  # in the one pixel that has the corner in it
    assert error.mean() < 0.005


@pytest.mark.parametrize("blur", [0.5, 1.0])
@pytest.mark.parametrize("view", VIEWS)
def test_light_is_blurred_before_pixels_add_it_up(view: str, blur: float) -> None:
    world = rigs.still_world("chessboard", picture={"noise": 0.0, "defocus": f"{blur} px"}, **VIEWS[view])
    pose = world.world_from_camera([])
    taken = Exposure(world, rigs.WIDTH, rigs.HEIGHT).picture([pose], np.random.default_rng(1))
    # Edges along y, half way from corner to corner, where they are straight and nothing else is near.
    middles = world.target_points()[:-9] + np.array([0, 0.0125, 0])
    places, left, below = (
        geometry.project(middles + step, pose) for step in ([0, 0, 0], [-0.005, 0, 0], [0, 0.001, 0])
    )
    along = (below - places) / np.linalg.norm(below - places, axis=1)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    normals *= np.sign(((places - left) * normals).sum(axis=1))[:, None]  # from the square before to the next
    black_before = np.add(*np.divmod(np.arange(len(middles)), 9)) % 2 == 1
    seen = inside(places, 20)
    offsets = np.arange(-3, 4)
    around = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    pixels = np.rint(places[seen])[:, None] + around
    square = (np.arange(16) + 0.5) / 16 - 0.5
    within = np.stack(np.meshgrid(square, square), axis=-1).reshape(-1, 2)
    beyond = np.einsum("npsc,nc->nps", pixels[:, :, None] + within - places[seen, None, None], normals[seen])
    after = ndtr(beyond / blur).mean(axis=2)
    expected = np.where(black_before[seen, None], 1 - after, after)
    u, v = np.moveaxis(pixels.astype(int), -1, 0)
    errors = np.abs((PAPER - taken[v, u].astype(float)) / (PAPER - INK) - expected)
    assert seen.sum() >= 40
    assert errors.mean() < 0.003
    assert errors.max() < 0.02


def test_a_bulging_plate_is_seen_where_its_points_are() -> None:
    plate = {"bulge": "3 mm", "print_scale": 1.002}
    world = rigs.still_world(plate=plate, **VIEWS["tilted"])
    flat = rigs.still_world(**VIEWS["tilted"])
    pose, image = world.world_from_camera([]), rendered(world).astype(float)
    seen = geometry.project(world.target_points(), pose)
    moved = np.linalg.norm(seen - geometry.project(flat.target_points(), pose), axis=1)
    assert moved.max() > 2.0
    for point, flat_point in zip(seen, flat.target_points(), strict=True):
        # A small disk on a gently bent surface: its centroid is that of a flat one but for the bend.
        flat_centroid, area = geometry.disk_centroid(flat_point, 0.009, pose)
        bias = flat_centroid - geometry.project(flat_point, pose)[0]
        found, _ = measured_centroid(image, point, np.sqrt(area / np.pi))
        assert np.linalg.norm(found - point - bias) < 0.1


def test_the_plates_back_is_blank_and_nothing_is_seen_when_looking_away() -> None:
    behind = rendered(rigs.still_world(position=rigs.mm(90, 75, 450)))
    assert behind.min() > 90
    assert np.count_nonzero(behind == PAPER) > 10000
    away = rendered(rigs.still_world(look_at=rigs.mm(90, 75, -900)))
    assert 80 < away.min() < away.max() < 140


def test_the_background_holds_no_blobs() -> None:
    away = rendered(rigs.still_world(look_at=rigs.mm(90, 75, -900)))
    assert away.std() > 1.0
    assert np.abs(np.diff(away, axis=1)).max() < 1.0


def test_a_plate_that_fills_the_picture_leaves_no_background() -> None:
    image = rendered(rigs.still_world(position=rigs.mm(90, 75, -100)))
    assert np.isin(image, [INK, PAPER]).mean() > 0.98


def test_exposure_noise_and_vignetting_do_what_they_say() -> None:
    world = rigs.still_world(look_at=rigs.mm(90, 75, -900))
    clean = rendered(world)
    plain = picture(world, noise=0.0, defocus="0 px")
    assert np.array_equal(plain, np.rint(clean))
    noisy = picture(world, noise=3.0, defocus="0 px").astype(float) - clean
    assert noisy.std() == pytest.approx(3.0, rel=0.02)
    bright = picture(world, noise=0.0, brightness=4.0, defocus="0 px")
    assert bright.max() == 255
    dark = picture(world, noise=0.0, vignetting=0.4, defocus="0 px").astype(float) / clean
    assert dark[480, 640] == pytest.approx(1.0, abs=0.01)
    assert dark[0, 0] == pytest.approx(0.6, abs=0.01)
    lit = picture(world, noise=0.0, light_gradient=0.2, defocus="0 px").astype(float) / clean
    assert lit[480, -1] == pytest.approx(1.2, abs=0.01)


def detect_grid(kind: str, flags: int) -> Callable[[Array], tuple[Array, Array]]:
    def detect(image: Array) -> tuple[Array, Array]:
        size = (rigs.TARGETS[kind]["columns"], rigs.TARGETS[kind]["rows"])
        found, points = cv2.findCirclesGrid(image, size, flags=flags)
        assert found
        return in_order(points.reshape(-1, 2))

    return detect


def detect_chessboard(image: Array) -> tuple[Array, Array]:
    found, points = cv2.findChessboardCornersSB(image, (9, 6))
    assert found
    return in_order(points.reshape(-1, 2))


def in_order(points: Array) -> tuple[Array, Array]:
    ids = np.arange(len(points))
    return points, ids if points[0, 1] < points[-1, 1] else ids[::-1]  # a detector may begin at the other end


def detect_charuco(image: Array) -> tuple[Array, Array]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((10, 7), 0.025, 0.018, dictionary)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(image)
    # OpenCV 4.10 gives these corners half a pixel too far right and down, later versions do not.
    done = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-3)
    refined = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), done)
    return refined.reshape(-1, 2), ids.ravel()


def detect_aprilgrid(image: Array) -> tuple[Array, Array]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    refined = cv2.aruco.DetectorParameters()
    refined.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    corners, tags, _ = cv2.aruco.ArucoDetector(dictionary, refined).detectMarkers(image)
    ids = [4 * tag + corner for tag in np.ravel(tags) for corner in range(4)]
    return np.concatenate(corners).reshape(-1, 2), np.array(ids)


DETECT = {
    "circle_grid": detect_grid("circle_grid", cv2.CALIB_CB_SYMMETRIC_GRID),
    "asymmetric_circle_grid": detect_grid("asymmetric_circle_grid", cv2.CALIB_CB_ASYMMETRIC_GRID),
    "chessboard": detect_chessboard,
    "charuco": detect_charuco,
    "aprilgrid": detect_aprilgrid,
}


@pytest.mark.parametrize("view", ["straight", "tilted", "tilted and turned"])
@pytest.mark.parametrize("kind", rigs.TARGETS)
def test_opencv_finds_every_target(kind: str, view: str) -> None:
    world = rigs.still_world(kind, **VIEWS[view])
    image = picture(world, noise=1.0, vignetting=0.2)
    expected = geometry.project(world.target_points(), world.world_from_camera([]))
    found, ids = DETECT[kind](image)
    assert len(found) >= 0.9 * len(expected)
    offsets = np.linalg.norm(found - expected[ids], axis=1)
    assert np.median(offsets) < 0.35  # centroids of tilted disks are off by that much by perspective
    assert offsets.max() < 1.5
