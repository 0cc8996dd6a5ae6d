"""What is drawn in a report, each panel on axes that it is given, in colours that colour-blind readers tell apart."""

from collections.abc import Callable, Sequence
from math import ceil, log10
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from calib import Calibration
from calib.residual_map import ViewMisses
from calib.stated_quality import CameraCoverage, Quality, ViewQuality
from calib.verification import JointTravel

Array = NDArray[np.float64]
Draw = Callable[[Axes], None]

COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
MARKERS: Final = "osD^vP"
GREY: Final = "#777777"
CELLS: Final = (6, 9)
"""Rows and columns of the picture in which residuals are averaged."""
ALONG: Final = 41


def travel_errors(travels: Sequence[JointTravel], kind: str) -> Draw:
    """Draw method 1 of the joints of one kind: what a travel was predicted too long by, over the travel."""
    unit, coarse = ("mm", 1e3) if kind == "prismatic" else ("deg", np.degrees(1))
    names = list(dict.fromkeys(travel.joint for travel in travels))

    def draw(axes: Axes) -> None:
        for travel in travels:
            if travel.kind == kind:
                way = names.index(travel.joint)
                axes.plot(
                    [coarse * row.measured for row in travel.rows],
                    [1e3 * (row.predicted - row.measured) for row in travel.rows],
                    MARKERS[way % len(MARKERS)],
                    color=COLOURS[way % len(COLOURS)],
                    markersize=3.5,
                    label=travel.joint,
                )
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.set_xlabel(f"travel measured in the pictures ({unit})")
        axes.set_ylabel(f"predicted less measured ({'mm' if kind == 'prismatic' else 'mrad'})")
        _legend(axes)

    return draw


def view_errors(quality: Quality) -> Draw:
    """Draw each view's residual, by what it was used for, beside what noise explains."""

    def value(view: ViewQuality) -> float | None:
        held_out = quality.held_out_by == "leave_one_view_out" and view.held_out_px is not None
        return view.held_out_px if held_out and not view.set_aside else view.rms_px

    def draw(axes: Axes) -> None:
        kinds = {
            "fit": [view for view in quality.views if view.use == "fit" and not view.set_aside],
            "held out": [view for view in quality.views if view.use == "verify"],
            "set aside": [view for view in quality.views if view.set_aside],
        }
        for (name, views), colour, marker in zip(kinds.items(), COLOURS, MARKERS, strict=False):
            seen = [(view.view, value(view)) for view in views if value(view) is not None]
            if seen:
                axes.plot(*zip(*seen, strict=True), marker, color=colour, markersize=3.5, label=name)
        if quality.predicted_px is not None:
            axes.axhline(
                quality.predicted_px, color=GREY, linewidth=0.8, linestyle="--", label="to be expected"
            )
        axes.set_ylim(bottom=0)
        axes.set_xlabel("view")
        axes.set_ylabel("points' rms (px)")
        _legend(axes)

    return draw


def by_direction(views: Sequence[ViewMisses]) -> Draw:
    """Draw all points' residuals as they point: a cloud round the middle, or something that is missing in the model."""
    away = np.concatenate([view.misses for view in views])

    def draw(axes: Axes) -> None:
        reach = _round_up(float(np.quantile(np.abs(away), 0.995)) * 1.15)
        axes.plot(*away.T, ".", color=COLOURS[0], markersize=2, alpha=0.35, rasterized=True)
        rms = float(np.sqrt((away**2).sum(axis=1).mean()))
        turn = np.linspace(0, 2 * np.pi, 120)
        axes.plot(
            rms * np.cos(turn), rms * np.sin(turn), color=COLOURS[1], linewidth=1, label=f"rms, {rms:.3g} px"
        )
        mean = away.mean(axis=0)
        axes.plot(
            *mean, "+", color=COLOURS[1], markersize=7, label=f"mean, {mean[0]:+.2g} and {mean[1]:+.2g} px"
        )
        axes.axhline(0, color=GREY, linewidth=0.5)
        axes.axvline(0, color=GREY, linewidth=0.5)
        axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
        axes.set_xlabel("to the right in the picture (px)")
        axes.set_ylabel("downwards (px)")
        _legend(axes)

    return draw


def by_place(views: Sequence[ViewMisses], size: tuple[int, int]) -> Draw:
    """Draw the mean residual in each cell of a picture of this `size` as an arrow, over its rms as a shade."""
    away = np.concatenate([view.misses for view in views])
    places = np.concatenate([view.pixels for view in views])
    rows, columns = CELLS
    cell = np.floor((places + 0.5) / size * [columns, rows]).astype(int).clip(0, [columns - 1, rows - 1])
    index = cell[:, 1] * columns + cell[:, 0]
    count = np.bincount(index, minlength=rows * columns)
    with np.errstate(invalid="ignore"):
        mean = np.column_stack([np.bincount(index, way, rows * columns) for way in away.T]) / count[:, None]
        rms = np.sqrt(np.bincount(index, (away**2).sum(axis=1), rows * columns) / count)

    def draw(axes: Axes) -> None:
        width, height = size
        shade = axes.imshow(
            np.ma.masked_invalid(rms.reshape(CELLS)),
            extent=(-0.5, width - 0.5, height - 0.5, -0.5),
            cmap="Blues",
            vmin=0,
            vmax=1.6 * np.nanmax(rms),
        )
        down, across = np.divmod(np.arange(rows * columns), columns)
        x, y = (across + 0.5) * width / columns, (down + 0.5) * height / rows
        longest = np.nanmax(np.linalg.norm(mean, axis=1))
        times = 0.8 * width / columns / max(longest, 1e-12)
        some = count > 0
        axes.quiver(
            x[some],
            y[some],
            *(times * mean[some]).T,
            pivot="mid",
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.004,
            color="#222222",
        )
        axes.set_title(f"longest arrow {longest:.2g} px", loc="left")
        axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
        axes.set_xlabel("x (px)")
        axes.set_ylabel("y (px)")
        bar = axes.figure.colorbar(shade, ax=axes, fraction=0.035, pad=0.02)
        bar.set_label("rms (px)")
        bar.outline.set_visible(False)

    return draw


def cells_covered(covered: CameraCoverage) -> Draw:
    """Draw how many points were seen in each cell of the picture."""

    def draw(axes: Axes) -> None:
        cells = np.array(covered.cells)
        axes.imshow(np.log1p(cells), cmap="Greens", vmin=0, vmax=1.6 * np.log1p(cells.max()), aspect="auto")
        for (row, column), count in np.ndenumerate(cells):
            axes.text(column, row, str(count), ha="center", va="center", fontsize=7)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title("points seen in each cell of the picture", loc="left")

    return draw


def views_cover(covered: CameraCoverage) -> Draw:
    """Draw how different the views are, each way as a share of what is enough."""
    shares = {"X": covered.x, "Y": covered.y, "size": covered.size, "skew": covered.skew}

    def draw(axes: Axes) -> None:
        axes.barh(list(shares), [100 * share for share in shares.values()], color=COLOURS[2], height=0.6)
        axes.set(xlim=(0, 100), ylim=(3.6, -0.6))
        axes.set_xlabel("of what is enough (%)")

    return draw


def certainty(calibration: Calibration, part: slice, what: str) -> Draw:
    """Draw how sure the first camera's pose is over each joint's range, the others amid theirs."""
    low, high = np.array(calibration.range, dtype=float).T
    share = np.linspace(0, 1, ALONG)

    def draw(axes: Axes) -> None:
        for way, joint in enumerate(calibration.joints):
            readings = np.tile((low + high) / 2, (ALONG, 1))
            readings[:, way] = low[way] + share * (high - low)[way]
            covariances = calibration.pose_covariance(readings)
            assert covariances is not None
            variances = np.diagonal(covariances, axis1=1, axis2=2)[:, part].sum(axis=1)
            colour = COLOURS[way % len(COLOURS)]
            axes.plot(100 * share, 1e3 * np.sqrt(variances), color=colour, label=joint.name)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("of a joint's calibrated range (%)")
        axes.set_ylabel(what)
        _legend(axes)

    return draw


def _round_up(value: float) -> float:
    """Return a value that is at least as large and has one digit."""
    step = 10.0 ** (ceil(log10(max(value, 1e-9))) - 1)
    return step * ceil(value / step)


def _legend(axes: Axes) -> None:
    """Name what is drawn above the axes, where no data can be, and each name once."""
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    axes.legend(
        once.values(),
        once.keys(),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=len(once),
        borderaxespad=0.3,
        columnspacing=1.2,
        handlelength=1.5,
    )
