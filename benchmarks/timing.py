"""Timing two things in turns, so that what slows the machine down slows both, and what is said of the result.

Only the standard library is imported here: the threads of numpy's libraries are chosen before they load.
"""

import gc
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final, Self

THREAD_VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Spread:
    """The median of several measurements, and the smallest and the largest."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """Return the spread of one or more values."""
        return cls(median(values), min(values), max(values))


@dataclass(frozen=True, slots=True)
class Pairs:
    """Measurements of A and of B taken in turns, pair by pair."""

    a: list[float]
    b: list[float]

    @property
    def ratio(self) -> Spread:
        """A over B, each pair for itself: the two of a pair have met the same machine."""
        return Spread.of([a / b for a, b in zip(self.a, self.b, strict=True)])


def in_turns(a: Callable[[], float], b: Callable[[], float], pairs: int) -> Pairs:
    """Measure A B A B ... `pairs` times, after a warm-up of each that does not count."""
    a()
    b()
    measured: Pairs = Pairs([], [])
    for _ in range(pairs):
        measured.a.append(a())
        measured.b.append(b())
    return measured


def seconds(work: Callable[[], object]) -> float:
    """Return how long `work` takes; the rubbish of what ran before it is cleared away first."""
    gc.collect()
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def threads() -> str:
    """Say how many threads the mathematics may use, for a benchmark to print with its figures."""
    import cv2

    chosen = [f"{variable}={os.environ.get(variable, 'not set')}" for variable in THREAD_VARIABLES]
    return f"threads: OpenCV {cv2.getNumThreads()}, {', '.join(chosen)}"
