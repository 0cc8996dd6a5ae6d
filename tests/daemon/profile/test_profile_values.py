"""What a right profile says."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from calib import targets
from calib.parameters import LENS_NAMES
from calib.session import load_session
from daemon.profile import PlannedView, Profile
from drivers.axis import AxisSpec
from drivers.camera import CameraSpec

Load = Callable[..., Profile]

LENS = """
[camera.intrinsics]
model = "opencv"
fx = 2000.0
fy = 2000.0
cx = 640.0
cy = 480.0
distortion = [0, 0, 0, 0, 0]

[target]"""


def test_axes_are_in_their_reading_units(load: Load) -> None:
    slide, pan = load().axes
    assert slide.spec == AxisSpec("slide", "prismatic", "mm", (0.0, 1000.0), 250.0, 1000.0, 0.02)
    assert pan.spec == AxisSpec("pan", "revolute", "deg", (-90.0, 90.0), 50.0, 100.0, 0.02)
    assert (slide.reading_std, pan.reading_std) == (0.005, None)
    assert (slide.unit_trusted, pan.unit_trusted) == (True, False)


def test_everything_else_is_in_si(load: Load) -> None:
    profile = load()
    assert profile.target == targets.CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018)
    procedure = profile.procedure
    assert (procedure.settle, procedure.max_reading_age, procedure.frame_timeout) == (0.3, 1.0, 5.0)
    assert profile.camera.spec == CameraSpec("main", 1280, 960)


def test_options_are_the_drivers_own(load: Load) -> None:
    profile = load()
    slide, pan = profile.axes
    assert pan.options.model_dump()["home_position"] == "-5 deg"
    assert slide.options.model_dump()["home_position"] is None
    controller = profile.controllers["table"]
    assert (controller.driver, controller.options.model_dump()["answer_timeout"]) == ("simulated", 2.0)


@pytest.mark.usefixtures("acme")
def test_another_packages_driver_takes_its_own_keys(load: Load, rig: Callable[..., Path]) -> None:
    text = rig().read_text(encoding="utf-8")
    profile = load(
        ('driver = "simulated"\nanswer_timeout = "2 s"', 'driver = "acme"\nport = "ttyS0"'),
        ('home_position = "-5 deg"', "channel = 2"),
        ('driver = "simulated"\nwidth', 'driver = "acme"\noptions = { port = "video0" }\nwidth'),
        (text[text.index("[simulation]") :], ""),
    )
    assert profile.controllers["table"].options.model_dump() == {"port": "ttyS0"}
    assert [axis.options.model_dump() for axis in profile.axes] == [{"channel": 0}, {"channel": 2}]
    assert profile.camera.options.model_dump() == {"port": "video0"}
    assert profile.simulation is None


def test_a_sweep_is_spaced_evenly_or_as_listed(load: Load) -> None:
    slide, pan = load().procedure.sweeps
    assert slide.readings == tuple(float(100 * i) for i in range(11))
    assert pan.readings == (-10.0, 10.0)
    assert (slide.use, pan.use) == ("fit", "verify")


def test_a_sweep_may_go_downwards(load: Load) -> None:
    slide, _ = load(('from = "0 mm"\nto = "1000 mm"', 'from = "1 m"\nto = "0 mm"')).procedure.sweeps
    assert slide.readings[:2] == (1000.0, 900.0)
    assert dict(slide.start) == {"slide": 1000.0, "pan": 0.0}


def test_a_sweep_may_come_back_the_other_way(load: Load) -> None:
    slide, _ = load(("positions = 11", "positions = 3\nboth_ways = true")).procedure.sweeps
    assert slide.readings == (0.0, 500.0, 1000.0, 500.0, 0.0)


def test_a_start_is_completed_in_chain_order(load: Load) -> None:
    profile = load()
    slide, pan = profile.procedure.sweeps
    assert list(slide.start.items()) == [("slide", 0.0), ("pan", 0.0)]
    assert list(pan.start.items()) == [("slide", 500.0), ("pan", -10.0)]
    assert list(profile.procedure.views[0].readings.items()) == [("slide", 450.0), ("pan", 0.0)]


def test_a_start_may_differ_from_the_first_reading(load: Load) -> None:
    _, pan = load(('{ slide = "500 mm" }', '{ slide = "500 mm", pan = "-20 deg" }')).procedure.sweeps
    assert dict(pan.start) == {"slide": 500.0, "pan": -20.0}


def test_all_views_are_planned_in_their_order(load: Load) -> None:
    views = list(load().procedure.planned_views())
    assert len(views) == 14
    assert views[1] == PlannedView("slide", {"slide": 100.0, "pan": 0.0}, "fit")
    assert views[12] == PlannedView("pan", {"slide": 500.0, "pan": 10.0}, "verify")
    assert views[13] == PlannedView(None, {"slide": 450.0, "pan": 0.0}, "verify")
    assert all(list(view.readings) == ["slide", "pan"] for view in views)


def test_nothing_of_it_can_be_changed(load: Load) -> None:
    profile = load()
    for change in (
        lambda: setattr(profile, "name", "x"),
        lambda: setattr(profile.axes[0], "controller", "x"),
        lambda: setattr(profile.procedure, "settle", 0.0),
        lambda: profile.controllers.__setitem__("x", profile.controllers["table"]),  # type: ignore[index]
        lambda: profile.procedure.sweeps[0].start.__setitem__("pan", 1.0),  # type: ignore[index]
    ):
        with pytest.raises((AttributeError, TypeError)):
            change()


def test_an_empty_session_is_read_back_as_it_was_written(load: Load, tmp_path: Path) -> None:
    session = load(("\n[target]", LENS), ("height = 960", 'height = 960\nlink = "pan"')).empty_session()
    (tmp_path / "session.json").write_text(session.model_dump_json(exclude_unset=True))
    assert load_session(tmp_path).model_dump() == session.model_dump()


def test_an_empty_session_describes_the_rig_and_not_the_simulation(load: Load) -> None:
    session = load(("\n[target]", LENS), ("height = 960", 'height = 960\nlink = "pan"')).empty_session()
    assert json.loads(session.model_dump_json(exclude_unset=True)) == {
        "format": "activecam.session/1",
        "complete": False,
        "profile": "A small rig",
        "joints": [
            {
                "name": "slide",
                "kind": "prismatic",
                "reading_unit": "mm",
                "unit_trusted": True,
                "reading_std": 0.005,
            },
            {"name": "pan", "kind": "revolute", "reading_unit": "deg", "unit_trusted": False},
        ],
        "cameras": [
            {
                "name": "main",
                "width": 1280,
                "height": 960,
                "link": "pan",
                "intrinsics": {
                    "model": "opencv",
                    "fx": 2000.0,
                    "fy": 2000.0,
                    "cx": 640.0,
                    "cy": 480.0,
                    "distortion": [0.0] * 5,
                },
            }
        ],
        "target": {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018},
        "views": [],
    }


def test_what_is_about_known_goes_into_the_session(load: Load) -> None:
    about = LENS.replace("[target]", "[camera.intrinsics_std]\nfx = 3\nfy = 3\n\n[target]")
    session = load(("\n[target]", about), ("unit_trusted = true", "scale_std = 1e-4")).empty_session()
    assert [joint.scale_std for joint in session.joints] == [1e-4, None]
    assert session.cameras[0].lens_std() == dict.fromkeys(LENS_NAMES["opencv"], 0.0) | {"fx": 3.0, "fy": 3.0}


@pytest.mark.parametrize(
    ("table", "target"),
    [
        (
            'kind = "asymmetric_circle_grid"\nrows = 5\ncolumns = 4\npitch = "4 cm"\ndisk_diameter = "12 mm"',
            targets.AsymmetricCircleGrid(rows=5, columns=4, pitch=0.04, disk_diameter=0.012),
        ),
        (
            'kind = "chessboard"\nrows = 5\ncolumns = 4\npitch = "4 cm"\npitch_std = "10 um"',
            targets.Chessboard(rows=5, columns=4, pitch=0.04, pitch_std=1e-5),
        ),
        (
            'kind = "charuco"\nrows = 5\ncolumns = 4\npitch = "4 cm"\nmarker = "3 cm"\n'
            'dictionary = "DICT_4X4_50"',
            targets.Charuco(rows=5, columns=4, pitch=0.04, marker=0.03, dictionary="DICT_4X4_50"),
        ),
        (
            'kind = "aprilgrid"\nrows = 5\ncolumns = 4\ntag = "40 mm"\nspacing = "8 mm"',
            targets.AprilGrid(rows=5, columns=4, tag=0.04, spacing=0.008),
        ),
    ],
)
def test_every_target_is_the_sessions(load: Load, table: str, target: targets.Target) -> None:
    grid = 'kind = "circle_grid"\nrows = 6\ncolumns = 7\npitch = "30 mm"\ndisk_diameter = "18 mm"'
    assert load((grid, table)).target == target


@pytest.mark.parametrize("size", ["width = 1280", "height = 960"])
def test_a_lens_known_at_another_size_is_refused(problems: Callable[..., list[str]], size: str) -> None:
    key, number = size.split(" = ")
    (found,) = problems(("\n[target]", LENS.replace("fx", f"{key} = 640\nfx", 1)))
    assert found == (
        f"40: camera.intrinsics.{key}: is 640 and the camera's pictures have {number}: "
        "give the lens as calibrated at the camera's own size"
    )


def test_importing_it_loads_no_heavy_library_of_its_own() -> None:
    code = """\
import calib.session, sys
before = set(sys.modules)
import daemon.profile
print(*set(sys.modules) - before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"cv2", "scipy", "sqlalchemy", "fastapi"} & set(done.stdout.split())
