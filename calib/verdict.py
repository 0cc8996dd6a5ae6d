"""Is it good? A judgement in one word, and the sentence that it rests on.

The residual of a fit says how well a model bends to the views that it was bent to, and nothing of any other. So the
verdict goes by views that were held out, by how sure the fit is of the poses that it gives, and by what it cannot tell:

    unknown   nothing was held out, and nothing is known to be wrong either
    poor      a prediction misses by more than 3 times as much as the fit; by more than a pixel and 10 times what the
              noise of points and readings and the fit's own uncertainty explain; by more than 5 pixels, whatever
              explains it; more than a fifth of the views was set aside; something is not determined at all; a joint
              slipped
    usable    more than 1.5 times, more than 3 times, more than a twentieth; something is badly known; fewer than 5
              views were held out; the session was cut off; nobody knows how sure the poses are
    good      none of this

A ratio of a few views' errors is itself not sure: from n views it has to be larger by 1 + sqrt(2 / n), two standard
deviations of it, to count.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Literal

from calib.advice import what_is_weak
from calib.likelihood.weakness import Weakness
from calib.stated_quality import MeanAndMax, Quality, ViewQuality

Judgement = Literal["good", "usable", "poor", "unknown"]

WORSE, MUCH_WORSE = 1.5, 3.0
NOISIER, MUCH_NOISIER = 3.0, 10.0
FAR = 5.0  # px
SOME_ASIDE, MANY_ASIDE = 0.05, 0.2
FEW_VIEWS = 5


def judgement_and_verdict(
    quality: Quality, complete: bool, weaknesses: Sequence[Weakness], slips: Sequence[str] = ()
) -> tuple[Judgement, str]:
    """Return the judgement on a calibration, from all else that its quality says, and the sentence for it.

    `complete` is the session's: whether it took all its views. `slips` are sentences on joints that slipped.
    """
    poor, doubts = _faults(quality, weaknesses)
    poor = [*slips, *poor]
    if quality.held_out_by is None and not poor:
        residual = (
            "" if quality.rms_px is None else f", and the residual of {quality.rms_px:.3g} px says little"
        )
        return "unknown", f"Unknown: no view was held out{residual}; take views to verify with"
    if not complete:
        doubts.append("the session was cut off")
    judgement: Judgement = "poor" if poor else "usable" if doubts else "good"
    return (
        judgement,
        f"{judgement.capitalize()}: {'; '.join([*_figures(quality), *_dropped(quality), *poor, *doubts])}",
    )


def _dropped(quality: Quality) -> list[str]:
    """Return what a person has left out, which says nothing against the calibration by itself."""
    dropped = sum(view.use == "none" for view in quality.views)
    return [f"{dropped} view{'s' if dropped > 1 else ''} left out by hand"] if dropped else []


def _faults(quality: Quality, weaknesses: Sequence[Weakness]) -> tuple[list[str], list[str]]:
    """Return what makes the calibration poor, and what merely keeps it from being good."""
    poor: list[str] = []
    doubts: list[str] = []
    unseen = [view for view in quality.views if _held_out(view, quality)]
    surely = 1 + sqrt(2 / max(len(unseen), 1))
    worse = max(_ratios(quality), default=1.0)
    if worse > WORSE * surely:
        sentence = f"they are missed by {worse:.2g} times as much as those of the fit"
        (poor if worse > MUCH_WORSE * surely else doubts).append(sentence)
    if quality.held_out_rms_px is not None and quality.predicted_px is not None:
        noisier = quality.held_out_rms_px / quality.predicted_px
        if noisier > NOISIER * surely:
            sentence = f"they are missed by {noisier:.2g} times what noise explains"
            much = noisier > MUCH_NOISIER * surely and quality.held_out_rms_px > 1
            (poor if much else doubts).append(sentence)
    if quality.held_out_rms_px is not None and quality.held_out_rms_px > FAR:
        # Noise of readings explains anything: what a slip that was not found looks like, too.
        poor.append("readings tell the pose that badly: look for a joint that slips or is loose")
    fit = [view for view in quality.views if view.use == "fit"]
    aside = sum(view.set_aside for view in fit)
    if aside > SOME_ASIDE * len(fit):
        sentence = f"{aside} of {len(fit)} views were set aside"
        (poor if aside > MANY_ASIDE * len(fit) else doubts).append(sentence)
    for weakness in weaknesses:
        (poor if weakness.undetermined else doubts).append(what_is_weak(weakness))
    if len(unseen) < FEW_VIEWS:
        doubts.append(f"only {len(unseen)} views were held out" if unseen else "no view was held out")
    if quality.position_std_m is None:
        doubts.append("how sure its poses are is not known")
    return poor, doubts


def _held_out(view: ViewQuality, quality: Quality) -> bool:
    if quality.held_out_by == "verify":
        return view.use == "verify"
    return view.held_out_px is not None or view.held_out_position_m is not None


def _ratios(quality: Quality) -> list[float]:
    """Return how many times worse held-out views are predicted than those of the fit are explained."""
    fit = [view for view in quality.views if view.use == "fit" and not view.set_aside]
    positions = [view.position_m for view in fit if view.position_m is not None]
    rotations = [view.rotation_rad for view in fit if view.rotation_rad is not None]
    pairs = [
        (quality.held_out_rms_px, quality.rms_px),
        (quality.held_out_position_m, sum(positions) / max(len(positions), 1)),
        (quality.held_out_rotation_rad, sum(rotations) / max(len(rotations), 1)),
    ]
    return [out / fitted for out, fitted in pairs if out is not None and fitted]


def _figures(quality: Quality) -> list[str]:
    """Return how well held-out views are predicted, beside the fit's own, and how sure the poses are."""
    errors, figures = [], []
    if quality.held_out_rms_px is not None:
        beside = "" if quality.rms_px is None else f" (those of the fit to {quality.rms_px:.3g} px)"
        errors.append(f"{quality.held_out_rms_px:.3g} px{beside}")
    if quality.held_out_position_m is not None and quality.held_out_rotation_rad is not None:
        errors.append(
            f"{1e3 * quality.held_out_position_m:.3g} mm and {1e3 * quality.held_out_rotation_rad:.3g} mrad"
        )
    by = "held-out views are predicted"
    if quality.held_out_by == "leave_one_view_out":
        by = "each view is predicted by all others"
    if errors:
        figures.append(f"{by} to {', '.join(errors)}")
    if quality.position_std_m is not None and quality.rotation_std_rad is not None:
        figures.append(
            f"in the calibrated range the camera's position is known to {_millis(quality.position_std_m, 'mm')}, "
            f"its rotation to {_millis(quality.rotation_std_rad, 'mrad')}"
        )
    return figures


def _millis(spread: MeanAndMax, unit: str) -> str:
    return f"{1e3 * spread.mean:.2g} {unit} (at worst {1e3 * spread.max:.2g} {unit})"
