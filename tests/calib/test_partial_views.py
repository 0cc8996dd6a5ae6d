"""Grids without numbers that are partly out of the picture: measured where the readings predict them, or not at all."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib import Calibration, solve, verify
from calib.observations import Observation, Observed, observe
from calib.prediction import predicted_by_views
from calib.second_look import second_look
from calib.session import Session
from calib.targets import disk_diameter, target_symmetries
from calib.transforms import pose_error
from drivers.clock import SystemClock
from drivers.simulated.exposure import Exposure
from drivers.simulated.world import SimulatedWorld
from tests.daemon.rigs import small_rig

WIDTH, HEIGHT = 480, 360
DISKS = {"kind": "circle_grid", "rows": 4, "columns": 5, "pitch": 0.03, "disk_diameter": 0.018}
SHIFTED = {"kind": "asymmetric_circle_grid", "rows": 6, "columns": 3, "pitch": 0.045, "disk_diameter": 0.018}
BOARD = {"kind": "chessboard", "rows": 4, "columns": 6, "pitch": 0.025}
RIGHT = 0.3
"""Pixels; a neighbour is 20 or more away."""

SLIDE = [{"joint": "slide", "readings": [at, 0.0]} for at in np.linspace(-60, 160, 7)]
WIDE_PAN = [{"joint": "pan", "readings": [50.0, at]} for at in np.linspace(-24, 24, 11)]
"""From a third of the grid to all of it and to a third again."""
NARROW_PAN = WIDE_PAN[3:-3]


class Rig:
    """The small simulated rig before a target, with pictures in a folder."""

    def __init__(self, folder: Path, target: dict[str, Any]) -> None:
        self.folder, self.target, self.profile = folder, target, small_rig(folder)
        assert self.profile.simulation is not None
        axes = [axis.spec for axis in self.profile.axes]
        self.world = SimulatedWorld(self.profile.simulation, axes, target, SystemClock())
        self._exposure = Exposure(self.world, WIDTH, HEIGHT)
        self._taken = 0

    def picture(self, readings: list[float]) -> np.ndarray:
        rng = np.random.default_rng(self._taken)
        return self._exposure.picture([self.world.world_from_camera(readings)], rng)

    def view(self, view: dict[str, Any], picture: np.ndarray | None = None) -> dict[str, Any]:
        """Return the view with its picture, or another one, on disk."""
        name, self._taken = f"{self._taken:04d}.png", self._taken + 1
        cv2.imwrite(str(self.folder / name), self.picture(view["readings"]) if picture is None else picture)
        return {**view, "image": name}

    def session(self, views: list[dict[str, Any]]) -> Session:
        empty = self.profile.empty_session().model_dump(mode="json", exclude_unset=True)
        document = empty | {"target": self.target, "complete": True, "views": views}
        return Session.model_validate(document).at(self.folder)

    def inside(self, readings: list[float]) -> int:
        """Return how many points are in the picture."""
        pixels = self.world.project(self.world.target_points(), readings)
        return int(((pixels > 0) & (pixels < [WIDTH - 1, HEIGHT - 1])).all(axis=1).sum())

    def misses(self, session: Session, observation: Observation) -> np.ndarray:
        """Return how far (px) a view's points are from the truth, read the way round that is nearer to it."""
        seen = self.world.project(self.world.target_points(), session.views[observation.view].readings)
        ways = [observation, *(observation.turned(way) for way in target_symmetries(session.target))]
        away = [np.linalg.norm(seen[way.ids] - way.pixels, axis=1) for way in ways]
        return min(away, key=lambda misses: float(misses.max()))


def looked_again(session: Session, first: Observed) -> Observed:
    return second_look(session, first, lambda seen, view: predicted_by_views(session, seen, view.readings))


def assert_true(rig: Rig, session: Session, calibration: Calibration) -> None:
    """The camera's poses are right, the target turned as a whole or not."""
    readings = np.array([[50.0, pan] for pan in np.linspace(-20, 20, 5)])
    true = np.array([rig.world.world_from_camera(at) for at in readings])
    turns = [np.eye(4), *(way.turned_from_world for way in target_symmetries(session.target))]
    found = calibration.world_from_camera(readings)
    assert min(pose_error(turn @ found, true)[1].max() for turn in turns) < 5e-3


@pytest.mark.parametrize("target", [DISKS, SHIFTED, BOARD])
def test_views_of_a_part_of_the_grid_count_with_the_points_they_show(
    tmp_path: Path, target: dict[str, Any]
) -> None:
    rig = Rig(tmp_path, target)
    session = rig.session([rig.view(view) for view in [*SLIDE, *WIDE_PAN]])
    whole = observe(session)
    observed = looked_again(session, whole)
    cut_off = [
        index
        for index, view in enumerate(session.views)
        if rig.inside(view.readings) < len(rig.world.target_points())
    ]
    assert len(cut_off) >= 4
    assert set(cut_off) <= set(whole.unseen)
    # A single row or column, or less, is no view of a plane.
    assert len(observed.unseen) <= 2
    assert [o.view for o in observed.observations] == sorted(set(range(18)) - set(observed.unseen))
    for view, remark in observed.remarks.items():
        (observation,) = observed.of({view})
        assert 4 <= len(observation.ids) <= rig.inside(session.views[view].readings)
        assert rig.misses(session, observation).max() < RIGHT
        assert observation.covariances is not None
        assert observation.disk == (disk_diameter(session.target) is not None)
        assert remark.startswith(
            f"{len(observation.ids)} of the target's {len(rig.world.target_points())} points"
        )

    calibration = solve(session)
    assert [view.view for view in calibration.quality.views] == [o.view for o in observed.observations]
    for view in observed.remarks:
        assert any(
            warning.startswith(f"view {view} (00{view:02d}.png): ")
            for warning in calibration.quality.warnings
        )
    assert calibration.quality.rms_px is not None
    assert calibration.quality.rms_px < 0.2
    assert_true(rig, session, calibration)


def test_a_grid_that_is_partly_covered_is_measured_where_it_is_not(tmp_path: Path) -> None:
    rig = Rig(tmp_path, DISKS)
    views = [rig.view(view) for view in [*SLIDE, *NARROW_PAN]]
    covered = rig.picture(SLIDE[2]["readings"])
    x, y = rig.world.project(rig.world.target_points()[:1], SLIDE[2]["readings"])[0].astype(int)
    covered[max(y - 40, 0) : y + 25, max(x - 40, 0) : x + 60] = 90
    session = rig.session([*views[:2], rig.view(SLIDE[2], covered), *views[3:]])
    first = observe(session)
    assert list(first.unseen) == [2]
    observed = looked_again(session, first)
    (observation,) = observed.of({2})
    assert 14 <= len(observation.ids) < 20
    assert rig.misses(session, observation).max() < RIGHT


@pytest.mark.parametrize("what", ["nothing", "elsewhere", "turned"])
def test_a_picture_of_something_else_stays_unseen(tmp_path: Path, what: str) -> None:
    """No wrong target: a wall, a grid that does not stand where the readings say, a grid turned by some degrees."""
    rig = Rig(tmp_path, DISKS)
    views = [rig.view(view) for view in [*SLIDE, *NARROW_PAN]]
    readings = WIDE_PAN[1]["readings"]
    if what == "nothing":
        picture = np.random.default_rng(0).normal(120, 3, (HEIGHT, WIDTH)).astype(np.uint8)
    elif what == "elsewhere":
        picture = rig.picture([50.0 - 12.0, readings[1]])
    else:
        turn = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 8, 1)
        picture = cv2.warpAffine(rig.picture(readings), turn, (WIDTH, HEIGHT), borderValue=(120.0,))
    session = rig.session([*views, rig.view(WIDE_PAN[1], picture)])
    observed = looked_again(session, observe(session))
    assert list(observed.unseen) == [len(views)]
    assert observed.remarks == {}
    (warning,) = [w for w in solve(session).quality.warnings if w.startswith(f"view {len(views)} ")]
    assert "the 4 x 5 circle grid was not found" in warning


def test_views_held_out_are_looked_at_where_the_calibration_has_the_target(tmp_path: Path) -> None:
    rig = Rig(tmp_path, DISKS)
    fitted = rig.session([rig.view(view) for view in [*SLIDE, *NARROW_PAN]])
    calibration = solve(fitted)
    held_out = rig.session(
        [rig.view({**view, "use": "verify"}) for view in [WIDE_PAN[1], *NARROW_PAN, WIDE_PAN[-2]]]
    )
    verification = verify(calibration, held_out)
    points = [view.points for view in verification.per_view]
    assert points[1:-1] == [20] * len(NARROW_PAN)
    assert 8 <= points[0] < 20
    assert 8 <= points[-1] < 20
    assert len(verification.warnings) == 2
    assert verification.max_px is not None
    assert verification.max_px < 1.5
