"""Quantities as people write them in a profile: a number and its unit, `"30 mm"`.

A field annotated with one of the types below (`Length`, `Angle`, ...) takes such a string and holds a float
in SI (pixels for images). A bare number is refused: it is the commonest way to be wrong by a thousand.
Quantities of an axis stay in that axis's own reading unit: see `in_reading_unit`.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated, Any, Literal, NoReturn

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s*(\S.*?)?\s*", re.ASCII)


@dataclass(frozen=True, eq=False)
class Dimension:
    """A kind of quantity: how it is called, an example, and what its units are worth in the first of them."""

    name: str
    example: str
    units: Mapping[str, Decimal]
    """Decimal, so that "18 mm" is the float nearest to 0.018 and not one beside it."""

    @property
    def si_unit(self) -> str:
        """The unit in which the program holds such a quantity."""
        return next(iter(self.units))

    @property
    def pattern(self) -> str:
        """A regular expression (also valid in JSON Schema) of what may be written."""
        return rf"^\s*{NUMBER}\s*({'|'.join(map(re.escape, self.units))})\s*$"

    def hint(self) -> str:
        """Say what to write."""
        return f"write {self.name} such as '{self.example}' ({', '.join(self.units)})"


_DEGREE = Decimal(math.pi) / 180

LENGTH = Dimension(
    "a length",
    "30 mm",
    {
        "m": Decimal(1),
        "cm": Decimal("1e-2"),
        "mm": Decimal("1e-3"),
        "um": Decimal("1e-6"),
        "in": Decimal("0.0254"),
    },
)
ANGLE = Dimension("an angle", "5 deg", {"rad": Decimal(1), "mrad": Decimal("1e-3"), "deg": _DEGREE})
DURATION = Dimension(
    "a duration",
    "200 ms",
    {"s": Decimal(1), "ms": Decimal("1e-3"), "us": Decimal("1e-6"), "min": Decimal(60)},
)
FREQUENCY = Dimension("a frequency", "10 Hz", {"Hz": Decimal(1), "kHz": Decimal(1000)})
PIXELS = Dimension("a number of pixels", "0.1 px", {"px": Decimal(1)})

RateSuffix = Literal["", "/s", "/s2"]
"""What follows the unit: nothing for a position, `/s` for a velocity, `/s2` for an acceleration."""


def parse_quantity(text: object, dimension: Dimension) -> float:
    """Return in SI what `text` says, such as 0.03 for `"30 mm"`; ValueError says what to write."""
    number, unit = _split(text, dimension.hint())
    if unit not in dimension.units:
        raise ValueError(f"the unit of '{text}' does not fit: {dimension.hint()}")
    return _finite(Decimal(number) * dimension.units[unit], text)


def format_quantity(value: float, dimension: Dimension, unit: str | None = None) -> str:
    """Return the text that `parse_quantity` turns into exactly `value`, in SI or in a decimal unit such as mm."""
    if unit is None:
        return f"{value!r} {dimension.si_unit}"
    number = Decimal(repr(value)) / dimension.units[unit]
    return f"{number.normalize():f} {unit}"


def in_reading_unit(text: object, unit: str, dimension_suffix: RateSuffix = "") -> float:
    """Return a quantity of an axis in its reading unit, such as 30.0 for `"3 cm"` of an axis that reads mm.

    An axis that reads a length or an angle takes any unit of these; one that reads counts or steps only its
    own word. Raises ValueError with a sentence that says which units fit.
    """
    family = next((d.units for d in (LENGTH, ANGLE) if unit in d.units), {unit: Decimal(1)})
    fitting = ", ".join(word + dimension_suffix for word in family)
    hint = f"write a quantity such as '30 {unit}{dimension_suffix}' ({fitting})"
    number, word = _split(text, hint)
    word = word.replace("s^2", "s2").replace("s²", "s2")
    stem = word.removesuffix(dimension_suffix)
    if stem not in family or not word.endswith(dimension_suffix):
        raise ValueError(f"'{word}' in '{text}' does not fit an axis that reads {unit}: {hint}")
    return _finite(Decimal(number) * family[stem] / family[unit], text)


def _split(text: object, hint: str) -> tuple[str, str]:
    match = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        if isinstance(text, int | float) and not isinstance(text, bool):
            _refuse_bare(text, hint)
        raise ValueError(f"'{text}' is not a quantity: {hint}")
    if match[2] is None:
        _refuse_bare(text, hint)
    return match[1], match[2]


def _refuse_bare(number: object, hint: str) -> NoReturn:
    raise ValueError(f"'{number}' has no unit: {hint}")


def _finite(value: Decimal, text: object) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"'{text}' is too large a number")
    return number


@dataclass(frozen=True)
class QuantityType:
    """Annotation that makes a float field of a pydantic model a quantity: text outside, SI inside."""

    dimension: Dimension
    above: float | None = None
    """A bound (SI) that the quantity exceeds."""
    at_least: float | None = None
    """A bound (SI) that it may reach."""

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Take text, hold a float, and write text into JSON."""
        return core_schema.no_info_before_validator_function(
            self._validate,
            core_schema.float_schema(gt=self.above, ge=self.at_least),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda value: format_quantity(value, self.dimension),
                return_schema=core_schema.str_schema(),
                when_used="json",
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the text."""
        return {"type": "string", "pattern": self.dimension.pattern, "examples": [self.dimension.example]}

    def _validate(self, value: object) -> float:
        try:
            return parse_quantity(value, self.dimension)
        except ValueError as error:
            # A custom error keeps pydantic's "Value error," out of the sentence that a person reads.
            raise PydanticCustomError("quantity", "{reason}", {"reason": str(error)}) from error


def written(text: str) -> Any:
    """Return a field's default in the words of a profile, so that its JSON Schema shows it in these words."""
    return Field(default=text, validate_default=True)


Length = Annotated[float, QuantityType(LENGTH)]
"""Metres; written "30 mm"."""
Angle = Annotated[float, QuantityType(ANGLE)]
"""Radians; written "5 deg"."""
Duration = Annotated[float, QuantityType(DURATION)]
"""Seconds; written "200 ms"."""
Frequency = Annotated[float, QuantityType(FREQUENCY)]
"""Hertz; written "10 Hz"."""
Pixels = Annotated[float, QuantityType(PIXELS)]
"""Pixels; written "0.1 px"."""

PositiveLength = Annotated[float, QuantityType(LENGTH, above=0)]
PositiveAngle = Annotated[float, QuantityType(ANGLE, above=0)]
PositiveDuration = Annotated[float, QuantityType(DURATION, above=0)]
PositiveFrequency = Annotated[float, QuantityType(FREQUENCY, above=0)]
PositivePixels = Annotated[float, QuantityType(PIXELS, above=0)]
