"""The shipped rigs: every picture of their procedures shows the whole target, large enough to measure."""

from itertools import islice

import numpy as np
import pytest
from numpy.typing import NDArray

from calib.detection import detect
from daemon.profile import PlannedView, Profile, load_profile, shipped_profiles
from drivers.clock import SystemClock
from drivers.simulated import SimulatedWorld
from drivers.simulated.exposure import Exposure

MARGIN = 15.0
"""Pixels around the paper: rigs of the simulation hit their targets to much less than one."""
APART = 5
"""Views from one that is rendered to the next."""
DISKS = "paper-table"
"""Whose points are no corners: what is seen of a disk's centre is not the centre's own picture."""
SPACING = 15.0
"""Pixels between neighbouring points, below which detectors become unsure."""


@pytest.fixture(scope="module", params=shipped_profiles())
def profile(request: pytest.FixtureRequest) -> Profile:
    return load_profile(request.param)


@pytest.fixture(scope="module")
def world(profile: Profile) -> SimulatedWorld:
    return _world(profile)


def _world(profile: Profile) -> SimulatedWorld:
    assert profile.simulation is not None
    specs = [axis.spec for axis in profile.axes]
    return SimulatedWorld(profile.simulation, specs, profile.target.model_dump(), SystemClock())


def _readings(view: PlannedView) -> list[float]:
    return list(view.readings.values())


def _nearest(points: NDArray[np.float64]) -> float:
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min())


def test_all_of_them_are_there() -> None:
    assert shipped_profiles() == (
        "cia402-pan-tilt",
        "grbl-table",
        "pan-tilt",
        "paper-table",
        "six-axis-arm",
        "turntable",
    )


def test_the_whole_paper_is_in_every_picture(profile: Profile, world: SimulatedWorld) -> None:
    size = np.array([profile.camera.spec.width, profile.camera.spec.height])
    for view in profile.procedure.planned_views():
        paper = world.project(world.plate.outline(), _readings(view))
        assert np.all(paper > MARGIN), view
        assert np.all(paper < size - 1 - MARGIN), view


def test_the_target_is_large_enough_to_measure(profile: Profile, world: SimulatedWorld) -> None:
    for view in profile.procedure.planned_views():
        assert _nearest(world.project(world.target_points(), _readings(view))) > SPACING, view


def test_the_target_is_tilted_enough_to_tell_focal_length_from_distance(
    profile: Profile, world: SimulatedWorld
) -> None:
    tilts = [
        np.degrees(np.arccos(world.world_from_camera(_readings(view))[2, 2]))
        for view in profile.procedure.planned_views()
    ]
    assert np.median(tilts) > 20
    assert max(tilts) < 60


@pytest.mark.parametrize("name", [name for name in shipped_profiles() if name != DISKS])
def test_corners_in_the_pictures_lie_where_they_are_and_are_as_sure_as_is_claimed(name: str) -> None:
    profile = load_profile(name)
    world, camera = _world(profile), profile.camera.spec
    exposure, noise = Exposure(world, camera.width, camera.height), np.random.default_rng(7)
    misses, claims = [], []
    for view in islice(profile.procedure.planned_views(), None, None, APART):
        pose = world.world_from_camera(_readings(view))
        found = detect(exposure.picture([pose], noise), profile.target)
        misses.append(found.pixels - world.project_from(world.target_points(), pose)[found.ids])
        claims.append(found.covariances)
    miss, claim = np.concatenate(misses), np.concatenate(claims)
    assert np.sqrt(np.square(miss).sum(axis=1).mean()) < 0.007
    weighed = np.linalg.solve(claim, miss[..., None])[..., 0]
    assert 0.5 < (miss * weighed).sum(axis=1).mean() / 2 < 1.3


def test_each_joint_is_exercised_alone_by_at_least_nine_positions(profile: Profile) -> None:
    for axis in profile.axes:
        fitted = [s for s in profile.procedure.sweeps if s.joint == axis.spec.name and s.use == "fit"]
        assert sum(len(sweep.readings) for sweep in fitted) >= 9


def test_each_joint_is_exercised_far_enough(profile: Profile, world: SimulatedWorld) -> None:
    for index, axis in enumerate(profile.axes):
        for sweep in profile.procedure.sweeps:
            if sweep.joint != axis.spec.name or sweep.use != "fit":
                continue
            ends = [
                {**sweep.start, sweep.joint: reading} for reading in (sweep.readings[0], sweep.readings[-1])
            ]
            first, last = (world.displacements(list(end.values()))[index] for end in ends)
            assert last - first > (np.radians(15) if axis.spec.kind == "revolute" else 0.1)


def test_held_out_views_are_not_those_of_the_fit(profile: Profile) -> None:
    views = list(profile.procedure.planned_views())
    fitted = {tuple(_readings(view)) for view in views if view.use == "fit"}
    held_out = [tuple(_readings(view)) for view in views if view.use == "verify"]
    assert held_out
    assert not fitted & set(held_out)


def test_no_scale_is_the_nominal_one(profile: Profile) -> None:
    assert profile.simulation is not None
    for axis, joint in zip(profile.axes, profile.simulation.joints, strict=True):
        nominal = {"mm": 1e-3, "deg": np.pi / 180}.get(axis.spec.unit)
        if nominal is not None:
            assert 2e-5 < abs(joint.scale / nominal - 1) < 5e-3


def test_the_papers_table_is_the_papers() -> None:
    profile = load_profile("paper-table")
    assert [(axis.spec.kind, axis.spec.unit) for axis in profile.axes] == [
        ("prismatic", "mm"),
        ("revolute", "deg"),
    ]
    assert profile.target.kind == "circle_grid"
    assert profile.target.rows * profile.target.columns == 42
    assert [(s.joint, len(s.readings), s.use) for s in profile.procedure.sweeps] == [
        ("slide", 6, "fit"),
        ("slide", 5, "fit"),
        ("pan", 11, "fit"),
        ("slide", 11, "verify"),
        ("pan", 11, "verify"),
    ]


def test_the_papers_travels_are_those_of_its_tables_1_and_2() -> None:
    slide, pan = [sweep for sweep in load_profile("paper-table").procedure.sweeps if sweep.use == "verify"]
    assert [reading - slide.readings[0] for reading in slide.readings[1:]] == list(range(100, 1001, 100))
    turns = [3, 6, 9, 12, 15, 20, 30, 40, 50, 60]
    assert [reading - pan.readings[0] for reading in pan.readings[1:]] == turns


def test_held_out_positions_lie_within_those_of_the_fit(profile: Profile) -> None:
    views = list(profile.procedure.planned_views())
    for axis in profile.axes:
        fitted, held_out = (
            [view.readings[axis.spec.name] for view in views if view.use == use] for use in ("fit", "verify")
        )
        assert min(fitted) <= min(held_out)
        assert max(held_out) <= max(fitted)


def test_the_papers_disks_are_about_19_pixels_across_where_they_are_farthest() -> None:
    profile = load_profile("paper-table")
    world = _world(profile)
    assert profile.target.kind == "circle_grid"
    # The diameter along a row, which the plate's tilt does not foreshorten much.
    radius = np.array([profile.target.disk_diameter / 2, 0, 0])
    centres = world.target_points()
    for view in profile.procedure.planned_views():
        left, right = (world.project(centres + side * radius, _readings(view)) for side in (-1, 1))
        assert np.linalg.norm(right - left, axis=1).min() > 18.5, view
