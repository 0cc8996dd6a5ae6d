"""The corrections as a calibration states them: by joint names, with standard deviations, in reading units."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from calib.corrections import Backlash, Corrections, Coupling, OncePerTurn
from calib.session import Document, Joint, Number, Positive
from calib.warp import warp_shapes

Shape = Annotated[str, Field(pattern="^x*y*$", min_length=2, max_length=4)]


class StatedBacklash(Document):
    """Half the play of a joint: added to readings approached from below, subtracted from those from above."""

    joint: str
    half_gap: Number
    half_gap_std: Number | None = None

    def model(self, joints: Sequence[str]) -> Backlash:
        """Return what it does to the readings of these joints."""
        return Backlash(joints.index(self.joint))


class StatedOncePerTurn(Document):
    """What is added to a joint's reading v: cosine (cos a - 1) + sine sin a, with a = 2 pi v / turn."""

    joint: str
    turn: Positive
    cosine: Number
    sine: Number
    cosine_std: Number | None = None
    sine_std: Number | None = None

    def model(self, joints: Sequence[str]) -> OncePerTurn:
        """Return what it does to the readings of these joints."""
        return OncePerTurn(joints.index(self.joint), self.turn)


class StatedCoupling(Document):
    """What part of the reading of the joint `by` is added to a joint's own."""

    joint: str
    by: str
    factor: Number
    factor_std: Number | None = None

    def model(self, joints: Sequence[str]) -> Coupling:
        """Return what it does to the readings of these joints."""
        return Coupling(joints.index(self.joint), joints.index(self.by))


class TargetWarp(Document):
    """How far the target's points lie out of its mean plane, along the world's Z: `heights` (m) of unit `shapes`."""

    shapes: list[Shape]
    heights: list[Number]
    heights_std: list[Number] | None = None

    @model_validator(mode="after")
    def _one_height_a_shape(self) -> Self:
        if len(self.heights) != len(self.shapes):
            raise ValueError(f"has {len(self.heights)} heights for {len(self.shapes)} shapes")
        return self

    def bulge(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far each of the target's `points` (t, 3) lies out of the plane (t,)."""
        return np.asarray(warp_shapes(points, self.shapes) @ np.array(self.heights, dtype=float))


class StatedAspect(Document):
    """By how much a camera's given poses have the target too far out in y, in its frame, as a part of it."""

    camera: str
    aspect: Number
    aspect_std: Number | None = None


class StatedCorrections(Document):
    """What the data supported beyond perfect joints, a flat target and straight sensors; empty where it was nothing."""

    backlash: list[StatedBacklash] = Field(default_factory=list)
    once_per_turn: list[StatedOncePerTurn] = Field(default_factory=list)
    coupling: list[StatedCoupling] = Field(default_factory=list)
    target_warp: TargetWarp | None = None
    aspect: list[StatedAspect] = Field(default_factory=list)

    @model_serializer(mode="wrap")
    def _what_there_is(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        written: dict[str, Any] = handler(self)
        return {key: value for key, value in written.items() if value not in ([], None)}

    def aspect_of(self, camera: str) -> float:
        """Return by how much the camera's given poses have the target too far out in y, as a part of it."""
        return next((one.aspect for one in self.aspect if one.camera == camera), 0.0)

    def joint_names(self) -> list[str]:
        """Return the names of the joints that these speak of."""
        own = [one.joint for part in (self.backlash, self.once_per_turn, self.coupling) for one in part]
        return own + [one.by for one in self.coupling]

    def joint_corrections(self, joints: Sequence[str]) -> Corrections:
        """Return what these do to the readings of `joints`; raises ValueError for a name that is not among them."""
        stated: list[StatedBacklash | StatedOncePerTurn | StatedCoupling] = [
            *self.backlash,
            *self.once_per_turn,
            *self.coupling,
        ]
        models = tuple(one.model(joints) for one in stated)
        values = [
            getattr(one, name)
            for one, model in zip(stated, models, strict=True)
            for name in model.coefficients
        ]
        return Corrections(models, np.array(values, dtype=float))


def stated_corrections(
    joints: Sequence[str],
    corrections: Corrections,
    warp: Mapping[str, float],
    aspects: Mapping[str, float],
    deviations: Mapping[str, float],
) -> StatedCorrections:
    """Return what a calibration states of `corrections`, `warp` and `aspects`.

    `warp` is the height (m) of each of the target's shapes, `aspects` those of the poses given for each camera,
    `deviations` are the standard deviations of the calibration's numbers by their paths.
    """
    stated: dict[str, Any] = {}
    values, paths = iter(corrections.coefficients.tolist()), iter(corrections.paths())
    for model in corrections.models:
        entry: dict[str, Any] = {"joint": joints[model.joint]}
        if isinstance(model, OncePerTurn):
            entry["turn"] = model.turn
        if isinstance(model, Coupling):
            entry["by"] = joints[model.by]
        for name in model.coefficients:
            entry |= {name: next(values), f"{name}_std": deviations.get(next(paths))}
        stated.setdefault(model.kind, []).append(entry)
    if warp:
        stated["target_warp"] = {
            "shapes": list(warp),
            "heights": list(warp.values()),
            "heights_std": [deviations[path] for path in warp_paths(len(warp)) if path in deviations] or None,
        }
    stated["aspect"] = [
        {"camera": camera, "aspect": aspect, "aspect_std": deviations.get(path)}
        for (camera, aspect), path in zip(aspects.items(), aspect_paths(len(aspects)), strict=True)
    ]
    return StatedCorrections.model_validate(stated)


def warp_paths(count: int) -> list[str]:
    """Return the dotted paths in a calibration of the warp's heights."""
    return [f"corrections.target_warp.heights.{index}" for index in range(count)]


def aspect_paths(count: int) -> list[str]:
    """Return the dotted paths in a calibration of sensors' aspects."""
    return [f"corrections.aspect.{index}.aspect" for index in range(count)]


def corrections_in_words(
    stated: StatedCorrections, joints: Sequence[Joint], points: NDArray[np.float64]
) -> list[str]:
    """Return a sentence for each correction; `points` (t, 3) are the flat target's."""
    units, sentences = {joint.name: joint.reading_unit for joint in joints}, []
    for gap in stated.backlash:
        size = _size(2 * abs(gap.half_gap), 2 * (gap.half_gap_std or 0), units[gap.joint])
        sentences.append(
            f"{gap.joint}: backlash of {size} between the directions of approach, taken into account"
        )
    for wave in stated.once_per_turn:
        height = float(np.hypot(wave.cosine, wave.sine))
        deviation = float(np.hypot(wave.cosine_std or 0, wave.sine_std or 0))
        size = _size(height, deviation, units[wave.joint])
        sentences.append(
            f"{wave.joint}: an error of up to {size} that returns every turn, taken into account"
        )
    for share in stated.coupling:
        size = _size(share.factor, share.factor_std or 0, units[share.joint])
        sentences.append(
            f"{share.joint}: moves by {size} with each {units[share.by]} of {share.by}, taken into account"
        )
    if stated.target_warp is not None:
        bulge = 1e3 * float(np.ptp(stated.target_warp.bulge(points)))
        deviation = 1e3 * max(stated.target_warp.heights_std or [0.0])
        sentences.append(f"the target is {_size(bulge, deviation, 'mm')} from flat, taken into account")
    for one in stated.aspect:
        size = _size(1e2 * one.aspect, 1e2 * (one.aspect_std or 0), "%")
        sentences.append(
            f"{one.camera}: the poses given for it have the target too far out in y by {size}, taken into account"
        )
    return sentences


FLAT = "the target's warp: the data do not tell it from a flat one, and it is taken for flat"


def unused_warp_in_words(warp: Mapping[str, float], points: NDArray[np.float64]) -> list[str]:
    """Return a sentence where a warp, by the height (m) of each shape, would explain much and was not asked for."""
    if not warp:
        return []
    seems = TargetWarp(shapes=list(warp), heights=list(warp.values()))
    bulge = 1e3 * float(np.ptp(seems.bulge(points)))
    return [
        f"the target seems to be {bulge:.2g} mm from flat: "
        "mount it on something flat, or solve again with --target-warp"
    ]


def _size(value: float, deviation: float, unit: str) -> str:
    """Return a value with its standard deviation, as many digits of either as mean anything."""
    if deviation <= 0:
        return f"{value:.3g} {unit}"
    decimals = max(0, 1 - int(np.floor(np.log10(deviation))))
    return f"{value:.{decimals}f} {unit} (+-{deviation:.{decimals}f})"
