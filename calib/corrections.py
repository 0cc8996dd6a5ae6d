"""What imperfect joints add to their readings: backlash, a once-per-turn error, coupling to another joint. numpy alone.

The chain is evaluated at corrected readings, v + sum of coefficient x regressor: every model is linear in its
coefficients, and its regressors depend on the readings and the sides of approach alone. The fit, the
served pose and its covariance all take their corrections from here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.errors import ReadingsError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Backlash:
    """Half the play: added to readings of `joint` approached from below, subtracted from those from above."""

    joint: int

    kind: ClassVar[str] = "backlash"
    coefficients: ClassVar[tuple[str, ...]] = ("half_gap",)

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, 1)."""
        del readings
        return sides[:, self.joint, None]


@dataclass(frozen=True)
class OncePerTurn:
    """A wave of one period each `turn` of the readings of `joint`, zero at reading 0: an eccentric dial or gear."""

    joint: int
    turn: float

    kind: ClassVar[str] = "once_per_turn"
    coefficients: ClassVar[tuple[str, ...]] = ("cosine", "sine")

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, 2)."""
        del sides
        angle = 2 * np.pi / self.turn * readings[:, self.joint]
        return np.column_stack([np.cos(angle) - 1, np.sin(angle)])


@dataclass(frozen=True)
class Coupling:
    """A part of the readings of the joint `by`, added to those of `joint`: a cable or gear that turns along."""

    joint: int
    by: int

    kind: ClassVar[str] = "coupling"
    coefficients: ClassVar[tuple[str, ...]] = ("factor",)

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, 1)."""
        del sides
        return readings[:, self.by, None]


Correction = Backlash | OncePerTurn | Coupling


class Model(Protocol):
    """What adds to the readings of one joint."""

    @property
    def joint(self) -> int:
        """Whose readings it adds to."""

    @property
    def coefficients(self) -> tuple[str, ...]:
        """What its coefficients are called."""

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, k)."""


def regressors(models: Sequence[Model], readings: Array, sides: Array) -> Array:
    """Return how much of each of the models' k coefficients is added to each reading (n, m, k).

    `readings` (n, m); `sides` (n, m) from which each was approached: +1 from below, -1 from above, 0 not known.
    """
    parts = np.zeros((*readings.shape, sum(len(model.coefficients) for model in models)))
    column = 0
    for model in models:
        end = column + len(model.coefficients)
        parts[:, model.joint, column:end] = model.regressors(readings, sides)
        column = end
    return parts


def coefficient_paths(models: Sequence[Correction]) -> list[str]:
    """Return the dotted path in a calibration of each of the models' coefficients."""
    paths = []
    for index, model in enumerate(models):
        place = sum(earlier.kind == model.kind for earlier in models[:index])
        paths += [f"corrections.{model.kind}.{place}.{name}" for name in model.coefficients]
    return paths


@dataclass(frozen=True, eq=False)
class Corrections:
    """The models that the data supported, with their coefficients (k,)."""

    models: tuple[Correction, ...]
    coefficients: Array

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to each reading (n, m, k)."""
        return regressors(self.models, readings, sides)

    def paths(self) -> list[str]:
        """Return the dotted path in a calibration of each coefficient."""
        return coefficient_paths(self.models)

    def applied(self, readings: Array, sides: Array) -> Array:
        """Return the corrected readings (n, m)."""
        if not self.models:
            return readings
        return readings + self.regressors(readings, sides) @ self.coefficients

    def unknown_side_std(self, sides: Array) -> Array:
        """Return the standard deviations (n, m) of corrected readings from not knowing the side of approach.

        A reading is then off by half the play to one side or the other: a distribution of two points.
        """
        deviations = np.zeros(sides.shape)
        for model, half_gap in zip(self.models, self._first_coefficients(), strict=True):
            if isinstance(model, Backlash):
                deviations[:, model.joint] = np.where(sides[:, model.joint] == 0, abs(half_gap), 0.0)
        return deviations

    def _first_coefficients(self) -> Array:
        sizes = [len(model.coefficients) for model in self.models]
        return self.coefficients[np.cumsum([0, *sizes[:-1]])] if sizes else np.zeros(0)


NO_CORRECTIONS = Corrections((), np.zeros(0))


def checked_sides(approached: ArrayLike | None, readings: Array) -> Array:
    """Return sides (n, m) for `readings` (n, m): those given for all (m,) or each (n, m), 0 where not known.

    Raises ReadingsError unless they are -1, 0 or 1 for each joint.
    """
    sides = np.zeros(readings.shape) if approached is None else np.asarray(approached, dtype=float)
    if sides.shape not in (readings.shape, readings.shape[1:]) or not np.isin(sides, (-1, 0, 1)).all():
        raise ReadingsError(
            "approached must be -1, 0 or 1 for each joint: from which side it came to its reading, 0 if unknown"
        )
    return np.broadcast_to(sides, readings.shape)
