"""The figure of `uncertainty`: `python -m benchmarks.uncertainty_figure FILE.svg`."""

import sys
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.uncertainty import ALONG, COMPONENTS, Sampled, sample

DRAWS = 200
COLOURS = ("#0072b2", "#d55e00", "#009e73")
"""Of x, y, z: told apart by colour-blind readers too."""


def draw(found: Sampled, file: Path) -> None:
    """Write the figure: lines for what is claimed, dots with their own error for what many fits scatter by."""
    # Text stays text, and the same figure is the same file.
    settings = {
        "svg.fonttype": "none",
        "svg.hashsalt": "uncertainty",
        "font.family": "sans-serif",
        "font.size": 9,
    }
    with mpl.rc_context(settings):
        figure = Figure(figsize=(7.2, 2.8), layout="constrained")
        position, rotation = figure.subplots(1, 2, sharex=True)
        _draw_panel(position, found, slice(3, 6), "position (mm)")
        _draw_panel(rotation, found, slice(0, 3), "rotation (mrad)")
        figure.savefig(file, metadata={"Date": None, "Creator": None})


def _draw_panel(axes: Axes, found: Sampled, part: slice, title: str) -> None:
    for colour, name, claimed, sampled in zip(
        COLOURS, COMPONENTS[part], found.claimed[:, part].T, found.sampled[:, part].T, strict=True
    ):
        axes.plot(ALONG, 1e3 * claimed, color=colour)
        axes.annotate(name[-1], (1.04, 1e3 * claimed[-1]), color=colour, va="center")
        error = 1e3 * found.sampling_error * sampled
        axes.errorbar(ALONG, 1e3 * sampled, error, color=colour, fmt="o", markersize=3, linewidth=1)
    axes.set_title(f"standard deviation of the {title}", fontsize=9)
    axes.set_xlabel("all joints, from end to end of their sweeps")
    axes.set_ylim(bottom=0)
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    draw(sample(DRAWS), Path(sys.argv[1]))
