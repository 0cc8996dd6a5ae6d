"""The corrections as a calibration states them: by joint names, with standard deviations, in reading units."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from calib.corrections import Backlash, Corrections, Coupling, OncePerTurn
from calib.documents import Document, Number, Positive
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
