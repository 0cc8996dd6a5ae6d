"""How figures look, on paper and on screen."""

from collections.abc import Sequence
from typing import Any, Final

from matplotlib.figure import Figure

from daemon.export.report.document import Drawing

WIDTH: Final = 174.0
"""Of all that is laid out (mm): A4, less its margins."""
MM_AN_INCH: Final = 25.4
LEFT, TOP, BOTTOM = 15.0, 6.0, 11.0
"""Around a panel (mm), for what is written along its axes."""

SETTINGS: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 7,
    "axes.labelsize": 7,
    "axes.titlesize": 7,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "activecam",
}
"""As of `matplotlib.rc_context`. The fonts come with matplotlib, so that the same report is the same file; those of a
PDF can be searched."""


def draw(drawing: Drawing, page: Figure, left: float, top: float, size: tuple[float, float]) -> None:
    """Draw panels side by side on a page of this `size`, from its left and its top edge on; all in mm."""
    width, height = size
    for (start, share), panel in zip(_places(drawing), drawing.panels, strict=True):
        across, down = share * WIDTH - LEFT - panel.right, drawing.height - TOP - BOTTOM
        axes = page.add_axes(
            (
                (left + start * WIDTH + LEFT) / width,
                1 - (top + TOP + down) / height,
                across / width,
                down / height,
            )
        )
        panel.draw(axes)


def _places(drawing: Drawing) -> Sequence[tuple[float, float]]:
    """Return where each panel begins, and how wide it is, as shares of the width."""
    total = sum(panel.share for panel in drawing.panels)
    shares = [panel.share / total for panel in drawing.panels]
    return [(sum(shares[:number]), share) for number, share in enumerate(shares)]
