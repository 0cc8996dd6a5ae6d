"""Reports and settings as the controller writes them, and what is read from them."""

import pytest

from drivers.axis import AxisSpec
from drivers.errors import OptionsError
from drivers.grbl import words
from drivers.grbl.options import GrblAxisOptions
from drivers.grbl.settings import differences, parse_settings, remarks
from drivers.grbl.status import ReportReader
from tests.drivers.grbl.benches import AXES, PAN, SLIDE, SPECS

RIGHT = {
    1: 255,
    13: 0,
    20: 1,
    22: 1,
    23: 0,
    27: 0.5,
    100: 250,
    101: 80,
    110: 6000,
    111: 7800,
    120: 2000,
    121: 3000,
}
RIGHT |= {130: 60.5, 131: 80.5}


def test_machine_positions_are_taken_as_they_are() -> None:
    report = ReportReader().read("<Jog|MPos:-1.500,0.000,3.000|FS:500,0|Pn:XZ|WCO:1.000,0.000,0.000>")
    assert report is not None
    assert (report.state, report.substate, report.position) == ("Jog", None, (-1.5, 0.0, 3.0))
    assert report.moving


def test_work_positions_need_an_offset_that_only_some_reports_carry() -> None:
    reader = ReportReader()
    without = reader.read("<Idle|WPos:1.000,2.000,3.000|FS:0,0>")
    assert without is not None
    assert without.position is None
    reader.read("<Idle|WPos:1.000,2.000,3.000|FS:0,0|WCO:10.000,0.000,-3.000>")
    later = reader.read("<Run|WPos:2.000,2.000,3.000|FS:0,0|Ov:100,100,100>")
    assert later is not None
    assert later.position == (12.0, 2.0, 0.0)
    reader.forget()
    after_a_reset = reader.read("<Idle|WPos:1.000,2.000,3.000|FS:0,0>")
    assert after_a_reset is not None
    assert after_a_reset.position is None


@pytest.mark.parametrize(
    ("state", "moving"),
    [
        ("Idle", False),
        ("Alarm", False),
        ("Hold:0", False),
        ("Hold:1", True),
        ("Home", True),
        ("Door:0", False),
    ],
)
def test_a_hold_moves_until_it_says_0(state: str, moving: bool) -> None:
    report = ReportReader().read(f"<{state}|MPos:0.000,0.000,0.000|FS:0,0>")
    assert report is not None
    assert report.moving is moving


@pytest.mark.parametrize(
    "line",
    [
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0",
        "<Idle|MPos:0.000,0.0>00,0.000|FS:0,0>",
        "<Idle|MPos:0.000,,0.000|FS:0,0>",
        "<Idle|MPos:0.000,0000,0.000|FS:0,0>",
        "<dle|MPos:0.000,0.000,0.000|FS:0,0>",
        "<Idle|FS:0,0>",
        "<Idle|Mos:0.000,0.000,0.000>",
    ],
)
def test_a_report_that_is_not_whole_says_nothing(line: str) -> None:
    assert ReportReader().read(line) is None


def test_settings_are_numbers_and_whatever_else_there_is_is_passed_over() -> None:
    lines = ["$0=10", "$100=250.000", "$130=-1.5 (x max travel, mm)", "$N0=G54", "[MSG:hello]", "$132=abc"]
    assert parse_settings(lines) == {0: 10, 100: 250, 130: -1.5}


def test_settings_that_fit_the_profile_differ_in_nothing() -> None:
    assert differences(RIGHT, SPECS, AXES) == []
    assert differences({}, SPECS, AXES) == []
    assert remarks(RIGHT) == []


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({22: 0}, "homing is off ($22=0): connect limit switches and set $22=1"),
        ({13: 1}, "it reports inches ($13=1): set $13=0"),
        ({1: 25}, "its motors are let go 25 ms after a motion ($1=25), and the axes with them: set $1=255"),
        (
            {100: 200},
            "axis 'slide' has 200 steps per mm ($100) and the profile says 250: set $100=250, or change 'steps'",
        ),
        (
            {111: 600},
            "axis 'pan' makes at most 10 deg/s ($111=600 a minute) and the profile asks for 130: lower 'velocity', "
            "or set $111=7800",
        ),
        (
            {120: 10},
            "axis 'slide' accelerates by 10 mm/s2 ($120) and the profile says 2000: lower 'acceleration', "
            "or set $120=2000",
        ),
        (
            {130: 50},
            "axis 'slide' travels from 10.5 to 60.5 mm ($130=50) and its limits are 0 to 60 mm: change 'limits' "
            "or 'machine_zero', or set $130",
        ),
    ],
)
def test_each_difference_is_one_sentence_with_what_to_do(changes: dict[int, float], sentence: str) -> None:
    assert differences(RIGHT | changes, SPECS, AXES) == [sentence]


def test_soft_limits_that_are_off_are_remarked_upon() -> None:
    assert remarks(RIGHT | {20: 0}) == [
        "its soft limits are off ($20=0), so that only activecam keeps the axes within theirs: set $20=1"
    ]


@pytest.mark.parametrize(("mask", "stands"), [(0, "60.5"), (1, "-99")])
def test_an_axis_that_homes_outside_its_limits_is_told_of(mask: int, stands: str) -> None:
    settings = RIGHT | {23: mask, 27: 0.0 if mask == 0 else 1.0, 130: 160.5}
    (sentence,) = differences(settings, {"slide": SLIDE}, AXES)
    assert sentence.startswith(f"axis 'slide' stands at {stands} mm after homing ($27) and its limits are")


def test_units_that_grbl_has_not_are_refused() -> None:
    counts = AxisSpec("pan", "revolute", "counts", (0, 1), 1, 1, 1)
    with pytest.raises(OptionsError, match=r"axis 'pan' reads counts and Grbl counts in mm"):
        GrblAxisOptions(letter="X").zero(counts)
    with pytest.raises(OptionsError, match=r"axis 'pan': machine_zero: 'mm' in '3 mm' does not fit"):
        GrblAxisOptions(letter="X", machine_zero="3 mm").zero(PAN)
    assert GrblAxisOptions(letter="X", machine_zero="6 cm").zero(SLIDE) == 60.0


def test_numbers_without_words_are_still_numbers() -> None:
    assert words.alarm(1).startswith("the controller is in alarm 1: a limit switch tripped")
    assert words.alarm(99) == "the controller is in alarm 99: see its manual"
    assert words.alarm(None) == "the controller is in alarm, for a reason that was not heard"
    assert words.refusal(15).startswith("error 15: the target lies outside its travel")
    assert words.refusal(99) == "error 99: see its manual"
