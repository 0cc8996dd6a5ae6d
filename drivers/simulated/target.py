"""The target that the profile names, as the simulated world prints it."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

from drivers.errors import OptionsError
from drivers.simulated.grids import AsymmetricCircleGrid, Chessboard, CircleGrid
from drivers.simulated.tags import AprilGrid, Charuco, marker_bits

Target = CircleGrid | AsymmetricCircleGrid | Chessboard | Charuco | AprilGrid


def parse_target(table: Mapping[str, object]) -> Target:
    """Return the target that `[target]` describes, its lengths in metres; raises OptionsError."""
    adapter: TypeAdapter[Target] = TypeAdapter(Annotated[Target, Field(discriminator="kind")])
    try:
        target = adapter.validate_python(dict(table))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:]) or "kind"
        raise OptionsError(f"the simulated world cannot print [target]: '{where}': {first['msg']}") from error
    if isinstance(target, Charuco | AprilGrid):
        marker_bits(target.dictionary, target.marker_count())  # raises where there are not as many
    return target
