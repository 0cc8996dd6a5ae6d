import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from drivers import quantities as q

DIMENSIONS = [q.LENGTH, q.ANGLE, q.DURATION, q.FREQUENCY, q.PIXELS]
numbers = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)


class Plate(BaseModel):
    pitch: q.PositiveLength
    tilt: q.Angle = q.written("90 deg")
    point: tuple[q.Length, q.Length] | None = None
    exposure: q.PositiveDuration | None = None
    width: q.PositiveLength = q.written("20 cm")


@given(value=numbers, dimension=st.sampled_from(DIMENSIONS))
def test_what_is_written_is_read_back_exactly(value: float, dimension: q.Dimension) -> None:
    text = q.format_quantity(value, dimension)
    assert q.parse_quantity(text, dimension) == value
    assert re.search(dimension.pattern, text)


@given(value=numbers, unit=st.sampled_from(["m", "cm", "mm", "um"]))
def test_what_is_written_in_a_unit_is_read_back_exactly(value: float, unit: str) -> None:
    text = q.format_quantity(value, q.LENGTH, unit)
    assert q.parse_quantity(text, q.LENGTH) == value
    assert text.endswith(f" {unit}")


@pytest.mark.parametrize(
    ("value", "text"), [(0.03, "30 mm"), (0.0221, "22.1 mm"), (1.2, "1200 mm"), (0.0, "0 mm")]
)
def test_lengths_in_millimetres_read_as_people_write_them(value: float, text: str) -> None:
    assert q.format_quantity(value, q.LENGTH, "mm") == text


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("30 mm", q.LENGTH, 0.03),
        ("18mm", q.LENGTH, 0.018),
        ("-2.5e1 cm", q.LENGTH, -0.25),
        ("1 in", q.LENGTH, 0.0254),
        ("7 um", q.LENGTH, 7e-6),
        ("180 deg", q.ANGLE, math.pi),
        ("5 mrad", q.ANGLE, 0.005),
        ("200 ms", q.DURATION, 0.2),
        ("2 min", q.DURATION, 120.0),
        ("2.5 kHz", q.FREQUENCY, 2500.0),
        ("0.1 px", q.PIXELS, 0.1),
    ],
)
def test_units_are_turned_into_si(text: str, dimension: q.Dimension, value: float) -> None:
    assert q.parse_quantity(text, dimension) == value


@pytest.mark.parametrize("bare", ["30", 30, 30.0])
def test_a_bare_number_is_refused_with_the_units_that_fit(bare: object) -> None:
    with pytest.raises(ValueError) as caught:
        q.parse_quantity(bare, q.LENGTH)
    assert str(caught.value).endswith("has no unit: write a length such as '30 mm' (m, cm, mm, um, in)")


@pytest.mark.parametrize(
    "text", ["", "mm", "3 0 mm", "nan m", "inf m", "1e999 m", "30 deg", "٣ mm", True, None, [1]]
)
def test_what_is_no_length_is_refused(text: object) -> None:
    with pytest.raises(ValueError):
        q.parse_quantity(text, q.LENGTH)


def test_a_unit_that_does_not_fit_is_refused_with_those_that_do() -> None:
    with pytest.raises(ValueError, match="the unit of '5 mm' does not fit: write an angle such as '5 deg'"):
        q.parse_quantity("5 mm", q.ANGLE)


@pytest.mark.parametrize(
    ("text", "unit", "suffix", "value"),
    [
        ("30 mm", "mm", "", 30.0),
        ("3 cm", "mm", "", 30.0),
        ("0.03 m", "mm", "", 30.0),
        ("30 mm", "m", "", 0.03),
        ("50 mm/s", "mm", "/s", 50.0),
        ("0.5 m/s2", "mm", "/s2", 500.0),
        ("0.5 m/s^2", "mm", "/s2", 500.0),
        ("0.5 m/s²", "mm", "/s2", 500.0),
        ("5 deg", "deg", "", 5.0),
        ("12000 steps", "steps", "", 12000.0),
        ("12000 counts/s", "counts", "/s", 12000.0),
    ],
)
def test_an_axis_takes_the_units_of_its_reading(
    text: str, unit: str, suffix: q.RateSuffix, value: float
) -> None:
    assert q.in_reading_unit(text, unit, suffix) == value


def test_an_axis_in_degrees_takes_radians() -> None:
    assert q.in_reading_unit(f"{math.pi / 2!r} rad", "deg") == pytest.approx(90.0, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "suffix"),
    [
        ("5 deg", "mm", ""),
        ("5 mm", "mm", "/s"),
        ("5 mm/s", "mm", ""),
        ("5 mm/s", "mm", "/s2"),
        ("5 mm", "counts", ""),
        ("5 steps", "counts", ""),
        ("5", "deg", ""),
    ],
)
def test_an_axis_refuses_other_units_and_says_which_fit(text: str, unit: str, suffix: q.RateSuffix) -> None:
    with pytest.raises(ValueError) as caught:
        q.in_reading_unit(text, unit, suffix)
    assert f"write a quantity such as '30 {unit}{suffix}' (" in str(caught.value)


def test_a_model_holds_si_and_writes_text() -> None:
    plate = Plate.model_validate({"pitch": "30 mm"})
    assert plate.pitch == 0.03
    assert plate.model_dump(exclude_none=True) == {"pitch": 0.03, "tilt": math.pi / 2, "width": 0.2}
    written = plate.model_dump(mode="json", exclude_none=True)
    assert written == {"pitch": "0.03 m", "tilt": f"{math.pi / 2!r} rad", "width": "0.2 m"}
    assert Plate.model_validate_json(plate.model_dump_json()) == plate


def test_quantities_may_be_optional_and_nested() -> None:
    plate = Plate.model_validate({"pitch": "30 mm", "point": ["1 cm", "2 cm"], "exposure": "10 ms"})
    assert plate.point == (0.01, 0.02)
    assert plate.exposure == 0.01
    assert Plate.model_validate_json(plate.model_dump_json()) == plate


def test_a_model_refuses_with_the_plain_sentence() -> None:
    with pytest.raises(ValidationError) as caught:
        Plate.model_validate({"pitch": 30})
    assert caught.value.errors()[0]["msg"].startswith("'30' has no unit: write a length")
    with pytest.raises(ValidationError, match="greater than 0"):
        Plate.model_validate({"pitch": "0 mm"})


def test_the_json_schema_has_the_pattern() -> None:
    properties = Plate.model_json_schema()["properties"]
    pitch = properties["pitch"]
    assert pitch["type"] == "string"
    assert re.search(pitch["pattern"], "30 mm")
    assert not re.search(pitch["pattern"], "30 deg")
    assert not re.search(pitch["pattern"], "30")
    assert properties["tilt"]["default"] == "90 deg"
    assert properties["width"]["default"] == "20 cm"
