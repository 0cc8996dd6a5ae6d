import dataclasses
import math

import pytest

from drivers.axis import AxisSpec
from drivers.cia402.units import DriveUnits, scales
from drivers.errors import OptionsError

DEG = AxisSpec("pan", "revolute", "deg", (-10.0, 10.0), 5.0, 20.0, 0.01)
MM = AxisSpec("slide", "prismatic", "mm", (-10.0, 10.0), 5.0, 20.0, 0.01)
COUNTS = AxisSpec("tilt", "revolute", "counts", (-10.0, 10.0), 5.0, 20.0, 0.01)

MICROMETRE, INCREMENTS, TENTH_DEGREE = 0xFA010000, 0x00B50000, 0xFF410000
RPM, MILLI_RPM, MM_PER_S, MM_PER_S2 = 0x00B44700, 0xFDB44700, 0xFD010300, 0xFD015700


@pytest.mark.parametrize(
    ("spec", "units", "position", "velocity"),
    [
        (MM, DriveUnits(MICROMETRE), 1000.0, 1000.0),
        (MM, DriveUnits(MICROMETRE, MM_PER_S), 1000.0, 1.0),
        (DEG, DriveUnits(TENTH_DEGREE), 10.0, 10.0),
        (DEG, DriveUnits(turn=36000.0), 100.0, 100.0),
        (DEG, DriveUnits(INCREMENTS, RPM, turn=36000.0), 100.0, 1 / 6),
        (DEG, DriveUnits(INCREMENTS, MILLI_RPM, turn=36000.0), 100.0, 1000 / 6),
        (DEG, DriveUnits(0, 0, 0, 36000.0), 100.0, 100.0),
        (COUNTS, DriveUnits(), 1.0, 1.0),
        (COUNTS, DriveUnits(INCREMENTS, RPM, turn=36000.0), 1.0, 60 / 36000),
        (COUNTS, DriveUnits(velocity=0x00B54700), 1.0, 60.0),
    ],
)
def test_the_drive_s_own_objects_tell_its_units(
    spec: AxisSpec, units: DriveUnits, position: float, velocity: float
) -> None:
    found = scales(spec, units)
    assert (found.position, found.velocity) == pytest.approx((position, velocity))


def test_an_acceleration_has_units_of_its_own() -> None:
    found = scales(MM, DriveUnits(MICROMETRE, MM_PER_S, MM_PER_S2))
    assert found.acceleration == pytest.approx(1.0)


def test_radians_are_worth_what_they_are() -> None:
    spec = dataclasses.replace(DEG, unit="rad")
    assert scales(spec, DriveUnits(turn=2000.0)).position == pytest.approx(2000 / (2 * math.pi))


def test_the_profile_has_the_last_word() -> None:
    found = scales(MM, DriveUnits(MICROMETRE, MM_PER_S), -2048.0, 4.0, 5.0)
    assert (found.position, found.velocity, found.acceleration) == (-2048.0, 4.0, 5.0)
    assert scales(MM, DriveUnits(), -2048.0).velocity == 2048.0


@pytest.mark.parametrize(
    ("spec", "units", "sentence"),
    [
        (MM, DriveUnits(), "give 'counts_per_unit', the drive's position units for 1 mm"),
        (MM, DriveUnits(TENTH_DEGREE, turn=3600.0), "give 'counts_per_unit'"),
        (DEG, DriveUnits(MICROMETRE), "give 'counts_per_unit'"),
        (MM, DriveUnits(MICROMETRE, RPM), r"its velocity units \(0x00B44700\).* give 'velocity_per_unit'"),
        (COUNTS, DriveUnits(velocity=0x00994700), "give 'velocity_per_unit'"),
        (COUNTS, DriveUnits(acceleration=0x00C00300), "give 'acceleration_per_unit'"),
    ],
)
def test_what_nobody_says_is_asked_for(spec: AxisSpec, units: DriveUnits, sentence: str) -> None:
    with pytest.raises(OptionsError, match=sentence):
        scales(spec, units)
