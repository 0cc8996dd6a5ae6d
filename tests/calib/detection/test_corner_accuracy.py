"""Corners on drawn pictures: as near to the truth as the picture's noise allows, and no surer than they are."""

import cv2
import numpy as np
import pytest
from drawn_targets import INK, Drawn, draw, project
from scipy.ndimage import map_coordinates

from calib.detection import Detection, detect
from calib.detection.corners import measure_corners
from calib.detection.picture import read_picture
from calib.detection.plane import PlaneView, bent_view
from calib.detection.tag_corners import measure_tags
from calib.errors import DetectionError
from calib.targets import AprilGrid, Charuco, Chessboard, target_points

CHESSBOARD = Chessboard(rows=6, columns=9, pitch=0.025)
CHARUCO = Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100")
APRILGRID = AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009)
LARGE_TAGS = AprilGrid(rows=2, columns=3, tag=0.06, spacing=0.018)
KINDS = [pytest.param(target, id=target.kind) for target in (CHESSBOARD, CHARUCO, APRILGRID)]
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


def through_a_barrel(target: AprilGrid | Charuco | Chessboard, bend: float) -> tuple[Drawn, np.ndarray]:
    """Bend a drawing, so that the place at radius r, in half heights, shows that of r (1 + bend r²): it, the points."""
    straight = draw(target, size=(1280, 960), roll=7, blur=0.7)
    half, middle = 480, np.array([639.5, 479.5])
    y, x = np.mgrid[:960, :1280]
    places = (np.stack([y, x], axis=-1) - middle[::-1]) / half
    source = middle[::-1] + half * places * (1 + bend * np.square(places).sum(axis=-1, keepdims=True))
    # OpenCV's remap would round the places to a 32nd of a pixel.
    picture = map_coordinates(straight.picture.astype(float), np.moveaxis(source, -1, 0), mode="nearest")
    wanted = (straight.points - middle) / half
    bent = wanted.copy()
    for _ in range(100):
        bent = (bent + wanted / (1 + bend * np.square(bent).sum(axis=1, keepdims=True))) / 2
    grey = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return Drawn(grey, straight.picture_from_world, middle + half * bent), straight.points


@pytest.mark.parametrize(
    ("target", "bend"),
    [
        (CHESSBOARD, 0.05),
        (CHARUCO, 0.05),
        (APRILGRID, 0.05),
        pytest.param(APRILGRID, 0.12, id="strongly, aprilgrid"),
        pytest.param(LARGE_TAGS, 0.12, id="strongly, large tags"),
    ],
)
def test_a_lens_that_bends_the_edges_moves_no_corner(target, bend):
    drawn, straight = through_a_barrel(target, bend)
    detection = detect(drawn.picture, target)
    assert np.abs(straight - drawn.points).max() > 8
    # OpenCV before 5 reads the code of a tag that is bent so much less often.
    assert len(detection.ids) >= (1 if cv2.__version__ >= "5" else 0.9) * len(straight)
    assert np.sqrt(np.square(errors(drawn, detection)).mean()) < 0.02


def test_squares_that_touch_the_corners_of_tags_move_none():
    drawn = draw(APRILGRID, tilt=(20, 15), roll=7, blur=0.8)
    between = [
        np.array([[0.03, 0.03], [0.039, 0.03], [0.039, 0.039], [0.03, 0.039]])
        + 0.039 * np.array([column, row])
        for row in range(3)
        for column in range(4)
    ]
    fine = cv2.resize(drawn.picture, None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC)
    shape = np.zeros(fine.shape, np.uint8)
    for corners in between:
        pixels = (project(drawn.picture_from_world, corners) + 0.5) * 8 - 0.5
        cv2.fillConvexPoly(shape, np.rint(pixels).astype(np.int32), 1)
    ink = cv2.GaussianBlur(shape.astype(np.float32), (0, 0), 8 * 0.8)
    ink = cv2.resize(ink, drawn.picture.shape[::-1], interpolation=cv2.INTER_AREA)
    picture = np.rint(drawn.picture * (1 - ink) + INK * ink).astype(np.uint8)
    detection = detect(picture, APRILGRID)
    assert len(detection.ids) == len(drawn.points)
    assert np.sqrt(np.square(errors(drawn, detection)).mean()) < 0.02


@pytest.mark.parametrize("off", [0.0, 2.0])
def test_tags_are_measured_where_they_are_expected(off):
    drawn = draw(APRILGRID, tilt=(20, 15), roll=7, noise=1)
    picture = read_picture(drawn.picture)
    tags = np.array([3, 7, 18])
    true = drawn.points.reshape(-1, 4, 2)[tags]
    measured = measure_tags(picture, APRILGRID, tags, true + off * np.array([[0.6, 0.8], [-0.8, 0.6]] * 2))
    assert measured.found.all()
    assert np.abs(measured.pixels - true).max() < 0.05


def test_what_is_no_tag_is_not_measured_as_one():
    drawn = draw(CHESSBOARD, noise=1)
    expected = draw(APRILGRID).points.reshape(-1, 4, 2)
    measured = measure_tags(read_picture(drawn.picture), APRILGRID, np.arange(20), expected)
    assert not measured.found.any()


@pytest.mark.parametrize("off", [0.0, 1.0, 2.0])
def test_corners_are_measured_from_where_they_are_predicted_and_none_where_there_is_none(off):
    drawn = draw(CHESSBOARD, tilt=(24, 18), roll=7, blur=0.8, noise=2)
    covered = 20
    x, y = np.rint(drawn.points[covered]).astype(int)
    drawn.picture[y - 12 : y + 13, x - 12 : x + 13] = 120
    angles = np.random.default_rng(1).uniform(0, 2 * np.pi, len(drawn.points))
    predicted = drawn.points + off * np.column_stack([np.cos(angles), np.sin(angles)])

    points = target_points(CHESSBOARD)[:, :2]
    view, pitch = PlaneView(drawn.picture_from_world), CHESSBOARD.pitch
    corners = measure_corners(read_picture(drawn.picture), view, points, predicted, pitch, pitch / 2)
    assert np.flatnonzero(~corners.found).tolist() == [covered]
    assert np.sqrt(np.square(corners.pixels - drawn.points)[corners.found].mean()) < 0.02


def test_a_corner_that_a_search_put_far_off_is_measured_where_the_others_say():
    drawn = draw(CHESSBOARD, tilt=(24, 18), roll=7, blur=0.8, noise=2)
    found = drawn.points.copy()
    found[30] += [8, -9]

    points = target_points(CHESSBOARD)[:, :2]
    view, pitch = PlaneView(drawn.picture_from_world), CHESSBOARD.pitch
    corners = measure_corners(read_picture(drawn.picture), view, points, found, pitch, pitch / 2)
    assert corners.found.all()
    np.testing.assert_allclose(corners.pixels, drawn.points, atol=0.03)


def test_a_bent_view_follows_a_lens_by_few_points_and_between_them():
    view = PlaneView(np.array([[1000.0, 20, 300], [-30, 900, 200], [0.1, 0.2, 1]]))
    points = np.stack(np.meshgrid(np.linspace(0, 0.6, 4), np.linspace(0, 0.6, 3)), axis=-1).reshape(-1, 2)
    lens = np.array([[800.0, 0, 600], [0, 800, 450], [0, 0, 1]])

    def seen(at: np.ndarray) -> np.ndarray:
        rays = np.column_stack([(view.project(at) - [600, 450]) / 800, np.ones(len(at))])
        distortion = np.array([-0.2, 0.05, 1e-3, -1e-3])
        return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), lens, distortion)[0].reshape(-1, 2)

    between = (points[:-1] + points[1:]) / 2
    assert np.abs(seen(between) - view.project(between)).max() > 5
    bent = bent_view(view, points, seen(points), np.array([610.0, 445]))
    np.testing.assert_allclose(bent.project(between), seen(between), atol=0.03)


def test_a_view_is_bent_by_no_more_than_one_point_tells():
    view = PlaneView(np.array([[1000.0, 20, 300], [-30, 900, 200], [0.1, 0.2, 1]]))
    points = np.stack(np.meshgrid(np.linspace(0, 0.2, 8), np.linspace(0, 0.15, 6)), axis=-1).reshape(-1, 2)
    bent = bent_view(view, points[:1], view.project(points[:1]) + 1, np.array([400.0, 300]))
    np.testing.assert_allclose(bent.project(points), view.project(points), atol=1.5)


@pytest.mark.parametrize("target", KINDS)
@pytest.mark.parametrize("gain", [1.3, 1.8, 3.0, 6.0, np.inf])
def test_corners_of_saturated_pictures_are_as_good_as_they_claim(target, gain):
    """Up to a picture of black and white alone: less is claimed where less is told."""
    drawn = draw(target, size=(800, 600), tilt=(20, 10), noise=1)
    bright = np.where(drawn.picture > 120, 255.0, 0.0) if gain == np.inf else drawn.picture * gain
    found = detect(np.clip(bright, 0, 255).astype(np.uint8), target)
    off = errors(drawn, found)
    squares = (off * np.linalg.solve(found.covariances, off[..., None])[..., 0]).sum(axis=1) / 2
    assert np.median(squares) < 4
    if gain < 2:
        assert np.sqrt(np.square(off).mean()) < 0.03


@pytest.mark.parametrize("target", KINDS)
def test_corners_beside_what_covers_the_board_are_left_out(target):
    """As under a hand, or at the edge of something in front: they were off by pixels, and claimed little."""
    drawn, random = draw(target, fill=0.6), np.random.default_rng(5)
    y, x = np.mgrid[: drawn.picture.shape[0], : drawn.picture.shape[1]]
    seen, wrong = 0, 0
    for number in range(60):
        # In half of them along the edges of the squares.
        angle = random.integers(4) * np.pi / 2 if number % 2 else random.uniform(0, 2 * np.pi)
        place = random.uniform(drawn.points.min(axis=0) - 10, drawn.points.max(axis=0) + 10)
        picture = drawn.picture.copy()
        beyond = (x - place[0]) * np.cos(angle) + (y - place[1]) * np.sin(angle) > 0
        picture[beyond] = random.integers(10, 250)
        try:
            detection = detect(picture, target)
        except DetectionError:
            continue
        off = np.linalg.norm(errors(drawn, detection), axis=1)
        claimed = np.sqrt(np.linalg.eigvalsh(detection.covariances)[:, 1])
        seen += len(off)
        wrong += np.count_nonzero((off > 0.1) & (off > 4 * claimed))
    assert seen > 100
    assert wrong < 0.02 * seen
