"""Where a camera sees the target is predicted well enough to measure there, and how well is said."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.paper_rig import paper_world
from calib import solve
from calib.detection import Prediction
from calib.errors import UnsolvableError
from calib.observations import Observation, observe
from calib.prediction import predicted_by_calibration, predicted_by_views
from calib.session import SESSION_FORMAT, Session
from calib.targets import target_points, target_symmetries
from daemon.profile import Profile, load_profile

NOISE_PX, JITTER = 0.05, 0.001
A_TENTH = 0.1
"""Of the distance to the next point."""


class Planned:
    """The views of a shipped profile's whole procedure, each with all points of the target and a little noise."""

    def __init__(self, profile: str) -> None:
        self.profile: Profile = load_profile(profile)
        self.world, self.points = paper_world(self.profile), target_points(self.profile.target)
        rng, views = np.random.default_rng(0), []
        for planned in self.profile.procedure.planned_views():
            at = [planned.readings.get(axis.spec.name, 0.0) for axis in self.profile.axes]
            pixels = self.world.project(self.points, at)
            views.append(
                {
                    "joint": planned.joint,
                    "use": planned.use,
                    "readings": [reading + rng.normal(0, JITTER) for reading in at],
                    "points": {
                        "ids": list(range(len(pixels))),
                        "pixels": (pixels + rng.normal(0, NOISE_PX, pixels.shape)).tolist(),
                    },
                }
            )
        empty = self.profile.empty_session().model_dump(mode="json", exclude_unset=True)
        self.session = Session.model_validate(empty | {"format": SESSION_FORMAT, "views": views})
        self.observations = observe(self.session).observations

    def sweeps(self) -> list[list[int]]:
        """Return the places of the views of each sweep to fit."""
        sweeps, first = [], 0
        for sweep in self.profile.procedure.sweeps:
            if sweep.use == "fit":
                sweeps.append(list(range(first, first + len(sweep.readings))))
            first += len(sweep.readings)
        return sweeps

    def seen(self, views: Sequence[int]) -> list[Observation]:
        return [self.observations[view] for view in views]

    def misses(self, view: int, predicted: Prediction) -> tuple[float, float]:
        """Return how far off a prediction is at worst, read as the truth is: in px, and as part of the spacing."""
        pixels = self.world.project(self.points, self.session.views[view].readings)
        ways = [
            pixels,
            *(pixels[np.argsort(way.permutation)] for way in target_symmetries(self.session.target)),
        ]
        away = min(float(np.linalg.norm(way[predicted.ids] - predicted.pixels, axis=1).max()) for way in ways)
        apart = np.linalg.norm(pixels[:, None] - pixels, axis=2)
        return away, away / float(apart[apart > 0].min())


@pytest.mark.parametrize("profile", ["paper-table", "turntable", "pan-tilt", "six-axis-arm"])
def test_the_ends_of_sweeps_are_predicted_by_the_rest(profile: str) -> None:
    planned = Planned(profile)
    ends = [end for sweep in planned.sweeps() for end in (sweep[0], sweep[-1])]
    rest = planned.seen([o.view for o in planned.observations if o.view not in ends])
    for view in ends:
        predicted = predicted_by_views(planned.session, rest, planned.session.views[view].readings)
        away, part = planned.misses(view, predicted)
        assert away <= predicted.off
        assert part < A_TENTH


@pytest.mark.parametrize("profile", ["paper-table", "turntable", "pan-tilt", "six-axis-arm"])
def test_during_a_run_what_is_predicted_is_as_near_as_it_says(profile: str) -> None:
    """Each sweep's ends by its other views and the sweeps before; where that is not enough, none is predicted."""
    planned, done, told, ends = Planned(profile), [], 0, 0
    for sweep in planned.sweeps():
        for end in (sweep[0], sweep[-1]):
            seen, ends = planned.seen([*done, *sweep[1:-1]]), ends + 1
            with suppress(UnsolvableError):
                predicted = predicted_by_views(planned.session, seen, planned.session.views[end].readings)
                away, part = planned.misses(end, predicted)
                assert away <= predicted.off
                assert part < 1 / 3
                told += 1
        done += sweep
    assert told >= ends / 2


def test_views_held_out_do_not_tell() -> None:
    """What a calibration is judged by has no part in it."""
    planned = Planned("paper-table")
    fit = [o.view for o in planned.observations if planned.session.views[o.view].use == "fit"]
    at = planned.session.views[-1].readings
    all_of_them = predicted_by_views(planned.session, planned.observations, at)
    of_the_fit = predicted_by_views(planned.session, planned.seen(fit), at)
    assert np.array_equal(all_of_them.pixels, of_the_fit.pixels)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_views_tell_nothing(count: int) -> None:
    """Two views tell a motion, and none that it could be checked by."""
    planned = Planned("paper-table")
    with pytest.raises(UnsolvableError):
        predicted_by_views(planned.session, planned.seen(range(count)), planned.session.views[3].readings)
    assert planned.misses(
        4, predicted_by_views(planned.session, planned.seen(range(4)), planned.session.views[4].readings)
    )


def test_a_joint_that_was_not_exercised_tells_nothing_of_other_places_of_its() -> None:
    planned = Planned("paper-table")
    first, second, _ = planned.sweeps()
    with pytest.raises(UnsolvableError, match="no joint has been exercised yet from where"):
        predicted_by_views(planned.session, planned.seen(first), planned.session.views[second[0]].readings)


def test_a_target_out_of_the_picture_is_not_predicted_in_it() -> None:
    planned = Planned("paper-table")
    away = [2000.0, -80.0]
    assert (planned.world.project(planned.points, away)[:, 0] > 1280).all()
    with pytest.raises(UnsolvableError, match="out of the picture"):
        predicted_by_views(planned.session, planned.observations, away)
    session = planned.session.model_copy(update={"complete": True})
    calibration = solve(session, "closed_form")
    (camera,) = calibration.cameras
    assert camera.intrinsics is not None
    # Such a distortion bends what is 60 degrees aside back to the middle.
    folding = camera.intrinsics.model_copy(update={"distortion": [-0.3, 0.0, 0.0, 0.0, 0.0]})
    bent = calibration.model_copy(update={"cameras": [camera.model_copy(update={"intrinsics": folding})]})
    pixels = bent.project(planned.points, away)
    assert ((pixels > 0) & (pixels < [1280, 960])).all(axis=1).any()
    with pytest.raises(UnsolvableError, match="out of the picture"):
        predicted_by_calibration(bent, session.target, away)


def test_views_that_determine_nothing_are_no_error_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError

    planned = Planned("paper-table")
    monkeypatch.setattr("calib.prediction.camera_views", singular)
    with pytest.raises(UnsolvableError, match="do not determine lens and chain"):
        predicted_by_views(planned.session, planned.observations, planned.session.views[3].readings)


def test_views_that_contradict_each_other_predict_nothing() -> None:
    """The nearest view's readings are wrong by a lot: what is predicted might be, too."""
    planned = Planned("paper-table")
    *_, pan = planned.sweeps()
    seen = planned.seen([o for sweep in planned.sweeps() for o in sweep[1:]])
    knocked = [
        replace(observation, pixels=observation.pixels + np.array([60.0, 0.0]))
        if observation.view == pan[1]
        else observation
        for observation in seen
    ]
    with pytest.raises(UnsolvableError, match=r"is predicted to within \S+ px, and they are \S+ px apart"):
        predicted_by_views(planned.session, knocked, planned.session.views[pan[0]].readings)


@pytest.mark.parametrize("profile", ["paper-table", "pan-tilt"])
@pytest.mark.parametrize("method", ["ml", "closed_form"])
def test_a_calibration_predicts_views_that_it_has_not_seen(profile: str, method: str) -> None:
    planned = Planned(profile)
    session = planned.session.model_copy(update={"complete": True})
    calibration = solve(session, method)
    for view in session.views:
        if view.use == "verify":
            predicted = predicted_by_calibration(calibration, session.target, view.readings)
            away, part = planned.misses(session.views.index(view), predicted)
            assert part < A_TENTH
            assert away <= predicted.off
    if method == "ml":
        near, far = (
            predicted_by_calibration(calibration, session.target, at).off
            for at in (session.views[0].readings, [1.5 * reading for reading in session.views[0].readings])
        )
        assert near <= far
