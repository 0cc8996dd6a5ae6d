"""What is known of a lens before anything is seen: some of its numbers exactly, some about, some not at all."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.errors import UnsolvableError
from calib.likelihood.lens_terms import lens_vector
from calib.parameters import LENS_NAMES, held_values
from calib.session import Intrinsics, Session

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LensPrior:
    """What is known of a lens's numbers, in the order of `LENS_NAMES`.

    `mean` (l,) is known to `std` (l,): 0 for what is held there, infinite where nothing is known. `aspect` is fx / fy
    where that is held: then fx follows fy.
    """

    mean: Array
    std: Array
    aspect: float | None = None

    @classmethod
    def exactly(cls, lens: Intrinsics) -> "LensPrior":
        """Return the knowledge of all of a lens."""
        values = lens_vector(lens)
        return cls(values, np.zeros_like(values))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which numbers may move by themselves (l,)."""
        free = self.std > 0
        free[0] &= self.aspect is None
        return free

    def by_step(self) -> Array:
        """Return how the numbers change with a step of those that move by themselves (l, l)."""
        change = np.diag(self.free.astype(float))
        if self.aspect is not None:
            change[0, 1] = self.aspect * change[1, 1]
        return change

    def told_aspect(self) -> float | None:
        """Return fx / fy where it is held, or where both are."""
        both = bool(np.all(self.std[:2] == 0))
        return float(self.mean[0] / self.mean[1]) if both else self.aspect

    def with_aspect(self, aspect: float) -> "LensPrior":
        """Return the knowledge with fx / fy held at `aspect`: where either is held, both are."""
        mean, std = self.mean.copy(), self.std.copy()
        if std[0] == 0:
            mean[1], std[1] = mean[0] / aspect, 0.0
        return LensPrior(mean, std, aspect)

    def imposed(self, values: Array) -> Array:
        """Return `values` (l,) with what is held at its value."""
        kept = np.where(self.std == 0, self.mean, values)
        if self.aspect is not None and self.std[0] > 0:
            kept[0] = self.aspect * kept[1]
        return kept

    def at_first(self, values: Array, told: NDArray[np.bool_]) -> "LensPrior":
        """Return the knowledge for a fit that cannot tell numbers but those `told` (l,): they stay at `values`."""
        unknown = np.isinf(self.std)
        return replace(
            self, mean=np.where(unknown, values, self.mean), std=np.where(unknown & ~told, 0.0, self.std)
        )

    def root(self) -> Array:
        """Return W (l, l) with |W (values - mean)|^2 the misfit of what is known about; 0 for the rest."""
        about = (self.std > 0) & np.isfinite(self.std)
        return np.diag(np.where(about, 1 / np.where(about, self.std, 1.0), 0.0))

    def information(self) -> Array:
        """Return the information (l, l) of what is known about."""
        return self.root() ** 2

    def misfit(self, values: Array) -> float:
        """Return how unlikely `values` (l,) are: twice minus the log of their probability."""
        return float(((self.root() @ (values - self.mean)) ** 2).sum())


def lens_prior(session: Session, camera: int, model: str) -> LensPrior:
    """Return what the session knows of a camera's lens, which is of `model`.

    Raises UnsolvableError where it holds a number that the model does not have.
    """
    known, names = session.cameras[camera], LENS_NAMES[model]
    mean, std = np.zeros(len(names)), np.full(len(names), np.inf)
    if known.intrinsics is not None:
        mean = lens_vector(known.intrinsics)
        std = np.array([*known.lens_std().values()])
    aspect = None
    for path, value in held_values(session).items():
        owner, _, entry = path.rpartition(".")
        if owner != known.name or isinstance(value, list) or entry == "scale":
            continue
        if entry == "aspect":
            aspect = value
        elif entry in names:
            mean[names.index(entry)], std[names.index(entry)] = value, 0.0
        else:
            raise UnsolvableError(
                f"a single view gives the lens model '{model}', which has no {entry} to hold: "
                "take several views, or give known intrinsics"
            )
    prior = LensPrior(mean, std)
    return prior if aspect is None else prior.with_aspect(aspect)
