"""What a profile may say of a controller that speaks Grbl, and of its axes."""

from typing import Annotated, Literal

from pydantic import Field

from drivers.axis import AxisSpec
from drivers.errors import OptionsError
from drivers.options import DriverOptions
from drivers.quantities import NUMBER, PositiveDuration, in_reading_unit, written

Letter = Literal["X", "Y", "Z", "A", "B", "C"]
LETTERS = "XYZABC"
"""The axes in the order of Grbl's positions and settings."""
UNITS = ("mm", "deg")
"""What Grbl's numbers may mean: it says mm of all axes, and means degrees of a rotary one."""


class GrblOptions(DriverOptions):
    """Keys of `[controllers.NAME]` with `driver = "grbl"`."""

    port: str
    """The serial port, best by its name in /dev/serial/by-id, which stays the same."""
    baud_rate: Annotated[int, Field(gt=0)] = 115200
    answer_timeout: PositiveDuration = written("1 s")
    """How long the controller may keep silent before it counts as lost."""
    start_timeout: PositiveDuration = written("6 s")
    """How long it may take to report after its port was opened, which restarts many boards."""
    report_interval: PositiveDuration = written("100 ms")
    """The time between two questions for its state."""
    homing_timeout: PositiveDuration = written("2 min")


class GrblAxisOptions(DriverOptions):
    """The driver's own keys of one axis."""

    letter: Letter
    machine_zero: Annotated[str, Field(pattern=rf"^\s*{NUMBER}\s*[A-Za-z]+\s*$")] | None = None
    """The reading at the controller's machine zero; 0 where not given."""
    steps: Annotated[float, Field(gt=0)] | None = None
    """Steps per mm or degree that the controller has to be set to; not checked where not given."""

    def zero(self, spec: AxisSpec) -> float:
        """Return the reading at machine zero. Raises OptionsError where it does not fit the axis."""
        if spec.unit not in UNITS:
            raise OptionsError(
                f"axis '{spec.name}' reads {spec.unit} and Grbl counts in mm, or in degrees where an axis turns: "
                "give it reading_unit = 'mm' or 'deg'"
            )
        try:
            return 0.0 if self.machine_zero is None else in_reading_unit(self.machine_zero, spec.unit)
        except ValueError as error:
            raise OptionsError(f"axis '{spec.name}': machine_zero: {error}") from error
