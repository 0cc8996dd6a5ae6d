"""Whether a daemon takes at the end what it took at the beginning."""

from collections.abc import Mapping, Sequence

import numpy as np

COUNTS = ("tasks", "threads", "files", "streams")
MOST_GROWTH = 12.0
"""MiB by which the memory may grow from the first to the last sample, by the line through them all.

An allocator that is asked for pictures and solvers' matrices in turn wanders by as much."""


def growth(minutes: Sequence[float], rss: Sequence[float]) -> float:
    """Return by how much memory grows, in the unit of `rss`, from the first to the last sample: of their line."""
    slope = float(np.polyfit(minutes, rss, 1)[0])
    return slope * (minutes[-1] - minutes[0])


def complaints(
    minutes: Sequence[float],
    rss: Sequence[float],
    before: Mapping[str, float],
    after: Mapping[str, float],
) -> list[str]:
    """Return what has grown, in sentences; `before` and `after` are counts while no client is there."""
    grown = [f"{name}: {before[name]} became {after[name]}" for name in COUNTS if after[name] > before[name]]
    if (by := growth(minutes, rss)) > MOST_GROWTH:
        grown.append(f"memory grew by {by:.1f} MiB in {minutes[-1] - minutes[0]:.0f} minutes")
    return grown
