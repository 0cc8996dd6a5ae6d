"""Every way to get a profile wrong: one sentence at the right key and line."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from daemon.profile import ProfileError, load_profile

Problems = Callable[..., list[str]]

MISTAKES = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))["mistake"]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake["says"].split(": ")[1])
def test_one_mistake_is_one_sentence_at_its_line(problems: Problems, mistake: dict[str, str]) -> None:
    assert problems((mistake["old"], mistake["new"])) == [mistake["says"]]


def test_all_mistakes_are_told_in_the_order_of_their_lines(rig: Callable[..., Path]) -> None:
    path = rig(
        ('settle = "300 ms"', "settle = 3"), ("rows = 6", "rows = true"), ('kind = "revolute"', "kind = 1")
    )
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    lines = [problem.removeprefix(f"{path}:").split(":")[0] for problem in caught.value.problems]
    assert lines == ["18", "40", "46"]
    assert str(caught.value) == f"{caught.value.problems[0]} (and 2 more problems)"


def test_a_unit_that_does_not_measure_its_axis_cannot_be_trusted(problems: Problems) -> None:
    found = problems(('kind = "prismatic"', 'kind = "revolute"'))
    assert found == [
        "8: axes[0].unit_trusted (slide): mm do not measure a revolute axis by themselves: "
        "only rad, mrad, deg can be trusted; set it to false"
    ]


def test_a_unit_that_does_not_measure_its_axis_says_no_scale(problems: Problems) -> None:
    found = problems(
        ('kind = "prismatic"', 'kind = "revolute"'), ("unit_trusted = true", "scale_std = 0.001")
    )
    assert found == [
        "8: axes[0].scale_std (slide): mm do not measure a revolute axis by themselves: "
        "only rad, mrad, deg can be trusted; leave it out"
    ]


def test_how_well_a_lens_is_known_wants_a_lens(problems: Problems) -> None:
    found = problems(("[target]", "[camera.intrinsics_std]\nfx = 3\n\n[target]"))
    assert [problem.partition(": ")[2] for problem in found] == [
        "camera.intrinsics_std: says how well intrinsics are known, and there are none"
    ]


def test_an_axis_whose_zero_is_out_of_reach_must_be_told_where_to_stand(problems: Problems) -> None:
    found = problems(('limits = ["0 mm", "1 m"]', 'limits = ["1 mm", "1 m"]'), ('{ slide = "500 mm" }', "{}"))
    assert found == [
        "50: procedure.sweeps[0].from (slide): 0 mm is outside the limits of axis 'slide', 1 to 1000 mm",
        "56: procedure.sweeps[1].start (pan): is incomplete: say where axis 'slide' stands, "
        "since its 0 mm is outside its limits 1 to 1000 mm",
    ]


def test_a_procedure_takes_pictures(problems: Problems, rig: Callable[..., Path]) -> None:
    text = rig().read_text(encoding="utf-8")
    pictures = text[text.index("[[procedure.sweeps]]") : text.index("[simulation]")]
    assert problems((pictures, "")) == [
        "45: procedure: takes no picture: add [[procedure.sweeps]], one for each axis"
    ]


def test_a_simulated_device_needs_a_simulation(problems: Problems, rig: Callable[..., Path]) -> None:
    text = rig().read_text(encoding="utf-8")
    assert problems((text[text.index("[simulation]") :], "")) == [
        "29: controllers.table.driver: a simulated device needs the table [simulation]"
    ]


@pytest.mark.usefixtures("acme")
class TestOtherPackagesDrivers:
    CONTROLLER = ('driver = "simulated"\nanswer_timeout = "2 s"', 'driver = "acme"\nport = "ttyS0"')
    CAMERA = ('driver = "simulated"\nwidth', 'driver = "acme"\noptions = { port = "video0" }\nwidth')
    AXIS = ('home_position = "-5 deg"', "channel = 2")

    def test_a_simulation_needs_a_simulated_device(self, problems: Problems) -> None:
        assert problems(self.CONTROLLER, self.AXIS, self.CAMERA) == [
            "68: simulation: no device is simulated, or has an emulator: remove the table, "
            "or use driver = 'simulated'"
        ]

    def test_real_devices_keep_the_pace_of_life(self, problems: Problems) -> None:
        assert problems(self.CONTROLLER, self.AXIS, ("[simulation]", "[simulation]\ntime_scale = 2.0")) == [
            "68: simulation.time_scale: real drivers keep the pace of life, and so do emulators: remove it"
        ]

    def test_their_options_are_checked_by_themselves(self, problems: Problems) -> None:
        assert problems((self.CONTROLLER[0], 'driver = "acme"'), self.CAMERA) == [
            "26: axes[1].options.home_position (pan): there is no such key; its table's keys are channel",
            "28: controllers.table.port: is missing",
        ]

    def test_one_that_cannot_be_imported_says_so(self, problems: Problems) -> None:
        (found,) = problems(('driver = "simulated"', 'driver = "broken"'))
        assert found.startswith("29: controllers.table.driver: driver 'broken' (no_such:X")
        assert "cannot be imported" in found
