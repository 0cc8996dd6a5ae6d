"""Runs in whose pictures the target is hard to see, or not to be seen."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from calib import load_calibration, load_session
from calib.detection import Averaged, detect_in_all
from calib.errors import DetectionError
from calib.targets import Target
from calib.transforms import pose_error
from daemon.profile import Profile
from daemon.service import Service, running_service
from daemon.store import RunState
from tests.daemon.rigs import LOOKING_AWAY, small_rig
from tests.daemon.runs import finish, of


class TestATargetHardToSee:
    """Pictures in which the target is not found."""

    @pytest.fixture
    def blind(self, monkeypatch: pytest.MonkeyPatch) -> Callable[[set[int]], None]:
        """Let the n-th looks, counted from 1, find nothing."""

        def be_blind(at: set[int]) -> None:
            looks = iter(range(1, 1000))

            def look(images: Iterable[NDArray[Any]], target: Target) -> Averaged:
                if next(looks) in at:
                    raise DetectionError("somebody stood in front of it")
                return detect_in_all(images, target)

            monkeypatch.setattr("daemon.procedure.observation.detect_in_all", look)

        return be_blind

    async def test_a_second_look_is_taken(self, service: Service, blind: Callable[[set[int]], None]) -> None:
        blind({2})
        run, events = await finish(service, await service.runs.start())
        assert run.state is RunState.SUCCEEDED
        assert of(events, "warning") == []
        assert len(of(events, "view")) == 10

    async def test_a_position_is_left_out_after_two(
        self,
        service: Service,
        blind: Callable[[set[int]], None],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        blind({2, 3})

        def track(*_: object) -> None:
            raise DetectionError("not where it should be either")

        monkeypatch.setattr("daemon.procedure.observation.track_in_all", track)
        run, events = await finish(service, await service.runs.start())
        assert run.state is RunState.SUCCEEDED
        (warning,) = of(events, "warning")
        assert warning.message == "position 2 of 10 is left out: somebody stood in front of it"
        session = load_session(service.store.session_folder(run))
        assert len(session.views) == 9
        assert [view.image for view in session.views] == [f"frames/{index:04d}.png" for index in range(9)]

    async def test_a_position_is_looked_at_again_where_the_others_of_its_sweep_predict_the_target(
        self, service: Service, blind: Callable[[set[int]], None]
    ) -> None:
        blind({2, 3})
        run, events = await finish(service, await service.runs.start())
        assert run.state is RunState.SUCCEEDED
        (warning,) = of(events, "warning")
        assert warning.message == (
            "position 2 of 10 is measured all the same: "
            "20 of the target's 20 points are seen, and measured where they are predicted"
        )
        # It is told of when the sweep is done, and keeps its position's readings.
        assert [event.position for event in of(events, "view")][:5] == [1, 3, 4, 2, 5]
        session = load_session(service.store.session_folder(run))
        assert session.views[3].readings[0] == pytest.approx(100 / 3, abs=0.05)
        assert [view.joint for view in session.views[:5]] == ["slide"] * 4 + ["pan"]

    async def test_only_so_many_frames_are_kept_to_be_looked_at_again(
        self, tmp_path: Path, blind: Callable[[set[int]], None], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        blind({2, 3, 4, 5})
        monkeypatch.setattr("daemon.procedure.unseen.MOST_KEPT", 1)
        profile = small_rig(tmp_path, positions=6)
        async with running_service(profile, tmp_path / "data") as service:
            _, events = await finish(service, await service.runs.start())
        left_out, measured = of(events, "warning")
        assert left_out.message.startswith("position 2 of 14 is left out: ")
        assert measured.message.startswith("position 3 of 14 is measured all the same: ")
        # The one that is given up is told of at once.
        assert left_out.sequence < of(events, "moving")[3].sequence < measured.sequence

    async def test_a_target_that_is_partly_out_of_the_picture_counts_with_the_points_that_are_in_it(
        self, tmp_path: Path
    ) -> None:
        """At the ends of the pan's sweep columns of disks are missing, and then the grid is not found as a whole."""
        profile = small_rig(tmp_path, positions=7, reach=19.5)
        async with running_service(profile, tmp_path / "data") as service:
            run, events = await finish(service, await service.runs.start())
            assert run.state is RunState.SUCCEEDED, run.error
            world, folder = service.rig.world, service.store.session_folder(run)
            assert world is not None
            partial = {event.position: event.points for event in of(events, "view") if event.points < 20}
            assert sorted(partial) == [8, 14]
            told = [event.message for event in of(events, "warning")]
            for position, points in partial.items():
                assert (
                    f"position {position} of 16 is measured all the same: {points} of the target's 20 points "
                    "are seen, and measured where they are predicted"
                ) in told
            session, calibration = load_session(folder), load_calibration(folder / "calibration.json")
            assert len(session.views) == 16
            assert [view.view for view in calibration.quality.views] == list(range(16))
            readings = np.array([[50.0, pan] for pan in np.linspace(-19, 19, 9)])
            true = np.array([world.world_from_camera(at) for at in readings])
            _, angle = pose_error(calibration.world_from_camera(readings), true)
            assert angle.max() < 2e-3

    async def test_a_sweep_with_one_view_fails_the_run(
        self, service: Service, blind: Callable[[set[int]], None]
    ) -> None:
        blind(set(range(2, 9)))
        run, _ = await finish(service, await service.runs.start())
        assert run.state is RunState.FAILED
        assert "found at 1 of 4 positions of 'slide'" in (run.error or "")

    @pytest.mark.parametrize("profile", [LOOKING_AWAY], indirect=True)
    async def test_a_target_never_seen_fails_the_run(self, service: Service) -> None:
        run, events = await finish(service, await service.runs.start())
        assert run.state is RunState.FAILED
        assert "found at 0 of 4 positions of 'slide'" in (run.error or "")
        assert len(of(events, "warning")) == 4
        assert events[-1].type == "finished"
        assert events[-1].error == run.error

    @pytest.fixture
    def profile(self, tmp_path: Path, request: pytest.FixtureRequest) -> Profile:
        if hasattr(request, "param"):
            return small_rig(tmp_path, look_at=request.param)
        return small_rig(tmp_path)
