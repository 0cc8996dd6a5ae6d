"""Several frames of one view: a mean that is better by the root of their number, and says so."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_targets import draw

from calib.detection import Detection, detect, detect_in_all
from calib.detection.averaging import average
from calib.errors import DetectionError
from calib.targets import AprilGrid, CircleGrid, target_symmetries

GRID = CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018)
TAGS = AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009)
TRUE = np.stack(np.meshgrid(np.arange(7.0), np.arange(6.0)), axis=-1).reshape(-1, 2) * 40 + 100


def frame(
    rng: np.random.Generator, noise: float = 0.05, claimed: float = 0.05, shift: tuple[float, float] = (0, 0)
) -> Detection:
    """Return the grid as one frame has it: its points' noise and what is claimed of it (px), and all shifted."""
    covariances = np.broadcast_to(claimed**2 * np.eye(2), (42, 2, 2)).copy()
    # One half of the points is twice as noisy as the other, and known to be.
    covariances[::2] *= 4
    scatter = rng.normal(size=(42, 2)) * noise
    scatter[::2] *= 2
    return Detection(np.arange(42), TRUE + scatter + shift, covariances, disk="centroid")


def part(detection: Detection, ids: np.ndarray) -> Detection:
    chosen = np.isin(detection.ids, ids)
    return replace(
        detection,
        ids=detection.ids[chosen],
        pixels=detection.pixels[chosen],
        covariances=detection.covariances[chosen],
    )


def squared_misfits(detection: Detection) -> np.ndarray:
    away = detection.pixels - TRUE[detection.ids]
    return np.einsum("qi,qij,qj->q", away, np.linalg.inv(detection.covariances), away)


@pytest.mark.parametrize("frames", [2, 4, 16])
@pytest.mark.parametrize("claimed", [0.025, 0.05])
def test_the_mean_is_as_good_as_its_covariance_says(frames, claimed):
    rng = np.random.default_rng(1)
    means = [average([frame(rng, 0.05, claimed) for _ in range(frames)], GRID).detection for _ in range(100)]
    away = np.array([mean.pixels[1::2] for mean in means]) - TRUE[1::2]
    assert away.std() == pytest.approx(0.05 / np.sqrt(frames), rel=0.05)
    said = np.mean([np.trace(mean.covariances[1], axis1=0, axis2=1) / 2 for mean in means])
    assert np.sqrt(said) == pytest.approx(0.05 / np.sqrt(frames), rel=0.06 if frames > 2 else 0.12)
    misfit = np.mean([squared_misfits(mean) for mean in means]) / 2
    assert misfit == pytest.approx(1, abs=0.12 if frames > 2 else 0.25)


def test_a_claim_that_the_scatter_does_not_fill_is_not_averaged_away():
    """Corners that all frames put wrong by the same are as wrong on the mean."""
    rng = np.random.default_rng(2)
    wrong = rng.normal(size=(42, 2)) * 0.05
    frames = [replace(each, pixels=each.pixels + wrong) for each in (frame(rng, 0.005) for _ in range(16))]
    mean = average(frames, GRID).detection
    assert squared_misfits(mean).mean() == pytest.approx(1, abs=0.7)
    assert np.sqrt(mean.covariances[1, 0, 0]) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("shake", [0.0, 0.3])
def test_what_moves_the_whole_picture_is_no_noise_of_points(shake):
    rng = np.random.default_rng(3)
    shifts = shake * rng.normal(size=(8, 2))
    seen = average([frame(rng, shift=shift) for shift in shifts], GRID)
    assert np.sqrt(seen.detection.covariances[1, 0, 0]) == pytest.approx(0.05 / np.sqrt(8), rel=0.1)
    assert np.abs(seen.detection.pixels[1::2] - TRUE[1::2] - shifts.mean(axis=0)).max() < 0.08
    if not shake:
        assert seen.warning is None
        return
    rms = np.sqrt(np.square(shifts - shifts.mean(axis=0)).sum() / 7)
    assert seen.shift_px == pytest.approx(rms, rel=0.1)
    assert seen.moved_px == seen.shift_px
    assert f"between its 8 frames the picture moved by {seen.shift_px:.2g} px" in seen.warning


def test_a_shift_that_noise_explains_is_not_told_of():
    rng = np.random.default_rng(4)
    corners = [part(frame(rng, 0.3, 0.3), np.arange(4)) for _ in range(4)]
    seen = average(corners, GRID)
    assert seen.shift_px > 0.1
    assert seen.warning is None


def test_points_that_move_against_each_other_are_told_of():
    rng = np.random.default_rng(5)
    frames = [frame(rng) for _ in range(4)]
    turned = [
        replace(each, pixels=(each.pixels - 200) * (1 + 0.01 * (k - 1.5)) + 200)
        for k, each in enumerate(frames)
    ]
    seen = average(turned, GRID)
    assert seen.moved_px == seen.scatter_px
    assert "moved by" in seen.warning


def test_a_point_seen_in_some_frames_is_averaged_over_those():
    rng = np.random.default_rng(6)
    shifts = [(0, 0), (1, 0), (0, 1), (-1, -1)]
    frames = [frame(rng, shift=shift) for shift in shifts]
    parts = [frames[0], frames[1], part(frames[2], np.arange(20)), part(frames[3], np.arange(10, 42))]
    mean = average(parts, GRID).detection
    assert mean.ids.tolist() == list(range(42))
    # Where a point was seen does not matter: the frames' shifts are known by the others.
    assert np.abs(mean.pixels - TRUE).max() < 0.3
    for point, count in ((0, 3), (10, 4), (20, 3)):
        alone = mean.covariances[point, 0, 0] / (4 if point % 2 == 0 else 1)
        assert np.sqrt(alone) == pytest.approx(0.05 / np.sqrt(count), rel=0.12)


def test_frames_with_no_point_in_common_are_joined():
    rng = np.random.default_rng(7)
    halves = [part(frame(rng), np.arange(20)), part(frame(rng), np.arange(20, 42))]
    mean = average(halves, GRID).detection
    assert mean.ids.tolist() == list(range(42))
    assert np.array_equal(mean.pixels, np.concatenate([half.pixels for half in halves]))


def test_a_symmetric_target_is_read_the_same_way_round_in_all_frames():
    """Rolled by 45 degrees, which of two corners is nearer the picture's top left is a matter of noise."""
    rng = np.random.default_rng(8)
    (turn,) = target_symmetries(GRID)
    frames = [frame(rng) for _ in range(4)]
    for k in (1, 3):
        frames[k] = replace(
            frames[k],
            pixels=frames[k].pixels[turn.permutation],
            covariances=frames[k].covariances[turn.permutation],
        )
    mean = average(frames, GRID).detection
    assert np.abs(mean.pixels - TRUE).max() < 0.2


def test_one_frame_is_what_was_found_in_it():
    picture = draw(GRID, tilt=(20, 10), noise=2).picture
    seen, alone = detect_in_all([picture], GRID), detect(picture, GRID)
    assert seen.frames == 1
    assert seen.warning is None
    assert np.array_equal(seen.detection.pixels, alone.pixels)
    assert np.array_equal(seen.detection.covariances, alone.covariances)


@pytest.mark.parametrize("target", [GRID, TAGS], ids=["circle_grid", "aprilgrid"])
def test_frames_without_the_target_do_not_count(target):
    frames = [draw(target, tilt=(20, 10), noise=2, seed=seed).picture for seed in range(3)]
    nothing = np.full_like(frames[0], 120)
    nothing[::2] = 130
    seen = detect_in_all([nothing, *frames, nothing], target)
    assert seen.frames == 3
    assert np.array_equal(seen.detection.pixels, detect_in_all(frames, target).detection.pixels)
    with pytest.raises(DetectionError, match=r"was not found|no tag"):
        detect_in_all([nothing, nothing], target)
    with pytest.raises(DetectionError, match="no picture"):
        detect_in_all([], target)


def test_pictures_of_one_view_average_to_points_that_are_better():
    """Drawn pictures: nothing here but the detector says how noisy a point is."""
    clean = draw(GRID, tilt=(20, 10), fill=0.6)
    rng = np.random.default_rng(9)
    pictures = [
        np.clip(np.rint(clean.picture + 6 * rng.standard_normal(clean.picture.shape)), 0, 255)
        for _ in range(32)
    ]
    groups = [detect_in_all([p.astype(np.uint8) for p in pictures[k : k + 8]], GRID) for k in range(0, 32, 8)]
    alone = detect(pictures[0].astype(np.uint8), GRID)
    means = np.array([group.detection.pixels for group in groups])
    scatter = np.sqrt(np.square(means - means.mean(axis=0)).sum() / (3 * 42 * 2))
    said = np.sqrt(np.mean([np.trace(g.detection.covariances, axis1=1, axis2=2).mean() / 2 for g in groups]))
    assert said == pytest.approx(scatter, rel=0.15)
    claimed = np.sqrt(np.trace(alone.covariances, axis1=1, axis2=2).mean() / 2)
    assert said == pytest.approx(claimed / np.sqrt(8), rel=0.15)
