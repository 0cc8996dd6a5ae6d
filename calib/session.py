"""The session: what was measured, as a folder that can be solved again offline for ever.

`session.json` lists joints, cameras, target and views; pictures lie beside it. Units are SI except for
readings, which are in each joint's own reading unit. Unknown keys are kept.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    PlainSerializer,
    PlainValidator,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from calib.documents import Document, NotNegative, Number, Positive, read_json, validate
from calib.errors import FormatError
from calib.intrinsics import Intrinsics, IntrinsicsStd, problem_of_std
from calib.parameters import Held, held_value, held_values
from calib.targets import Target, target_points
from calib.units import nominal_scale
from calib.views import Points, RigidRows, View

__all__ = [
    "SESSION_FORMAT",
    "Camera",
    "DhRow",
    "Intrinsics",
    "IntrinsicsStd",
    "Joint",
    "JointKind",
    "Nominal",
    "NominalStd",
    "Points",
    "RigidRows",
    "Session",
    "StoredTarget",
    "View",
    "WorldOrigin",
    "load_session",
    "problem_of_std",
]

SESSION_FORMAT = "activecam.session/1"

JointKind = Literal["revolute", "prismatic"]


def _with_kind(target: Target) -> dict[str, Any]:
    return {"kind": target.kind} | target.model_dump(mode="json", exclude_unset=True)


StoredTarget = Annotated[Target, PlainSerializer(_with_kind)]
"""A target that is written with its kind, whether or not that was said when it was made."""


class Joint(Document):
    """A joint of the chain, in chain order."""

    name: Annotated[str, Field(min_length=1)]
    kind: JointKind
    reading_unit: str
    reading_std: NotNegative | None = None
    """How noisy its readings are (standard deviation, in its reading unit); found out where not given."""
    unit_trusted: bool = False
    """Whether the encoder's own unit is to be believed as a measure to verify against."""
    scale_std: Positive | None = None
    """How well that unit says the scale beforehand: a standard deviation, relative to it."""

    @field_validator("scale_std")
    @classmethod
    def _unit_has_a_scale(cls, std: float | None, info: ValidationInfo) -> float | None:
        kind, unit = info.data.get("kind"), info.data.get("reading_unit")
        if std is not None and kind and unit and nominal_scale(kind, unit) is None:
            raise ValueError(f"'{unit}' is no measure of a {kind} joint by itself: leave it out")
        return std


class Camera(Document):
    """A camera of the head; `link` is the joint it rides on, the last where not given."""

    name: Annotated[str, Field(min_length=1)]
    width: Annotated[int, Field(gt=0)] | None = None
    height: Annotated[int, Field(gt=0)] | None = None
    intrinsics: Intrinsics | None = None
    intrinsics_std: IntrinsicsStd | None = None
    link: str | None = None

    @field_validator("intrinsics_std")
    @classmethod
    def _std_fits_intrinsics(cls, std: IntrinsicsStd | None, info: ValidationInfo) -> IntrinsicsStd | None:
        problem = problem_of_std(info.data.get("intrinsics"), std)
        if problem:
            raise ValueError(problem)
        return std

    def lens_std(self) -> dict[str, float]:
        """Return how well each number of its known intrinsics is known; 0 for exactly."""
        if self.intrinsics is None:
            return {}
        known = self.intrinsics_std or IntrinsicsStd()
        return {name: getattr(known, name) for name in self.intrinsics.numbers()}


class DhRow(Document):
    """A row of a nominal D-H model (m, rad); `theta` and `d` are offsets added to the scaled reading."""

    a: Number
    alpha: Number
    d: Number
    theta: Number
    scale: Number = 1.0


class NominalStd(Document):
    """How well a nominal model is known: standard deviations of its lengths (m), angles (rad) and scales."""

    length: Positive
    angle: Positive
    scale: Positive


class Nominal(Document):
    """A kinematic model from a drawing, to start from and as prior knowledge."""

    convention: Literal["standard_dh", "modified_dh"]
    dh: list[DhRow]
    std: NominalStd


class WorldOrigin(Document):
    """Where the world's origin is seen at given readings: which way round a symmetric target is taken."""

    camera: str
    readings: list[Number]
    pixel: Annotated[list[Number], Field(min_length=2, max_length=2)]


class Session(Document):
    """A session; `folder` is where its pictures are."""

    format: Literal["activecam.session/1"]
    joints: list[Joint]
    cameras: Annotated[list[Camera], Field(min_length=1)]
    target: StoredTarget
    views: list[View]
    nominal: Nominal | None = None
    held: dict[str, Annotated[Held | None, PlainValidator(held_value)]] = Field(default_factory=dict)
    """Parameters that are not found but held at a value, by name; null for what its unit or lens says."""
    origin: WorldOrigin | None = None
    complete: bool = True
    """False while a run adds views, and ever after it was cut off: then it is solved as far as it goes."""
    sweeps_done: Annotated[int, Field(ge=0)] = 0
    """How many sweeps of a run's procedure are finished: it is resumed after them."""
    starts: dict[str, list[Number]] = Field(default_factory=dict)
    """Where all axes stood as the sweep of a joint began, by joint, where a person said from where."""
    set_aside: list[View] = Field(default_factory=list)
    """Views of a sweep that was cut off, which the run took again when it was resumed; they are not used."""

    _folder: Path = PrivateAttr(default=Path())

    @property
    def folder(self) -> Path:
        """The folder that the views' `image` paths start from."""
        return self._folder

    def at(self, folder: Path) -> Self:
        """Return this session with its pictures in `folder`."""
        placed = self.model_copy()
        placed._folder = folder
        return placed

    def with_views(self, views: list[View]) -> Self:
        """Return this session with other views."""
        changed = self.model_copy(update={"views": views})
        changed._folder = self._folder
        return changed

    def leaving_out(self, places: Collection[int]) -> Self:
        """Return this session with the views at these places not used; raises FormatError for one that there is not."""
        for place in places:
            if not 0 <= place < len(self.views):
                raise FormatError(
                    f"there is no view {place}: the session has {len(self.views)}, counted from 0"
                )
        unused = set(places)
        return self.with_views(
            [
                view.model_copy(update={"use": "none"}) if place in unused else view
                for place, view in enumerate(self.views)
            ]
        )

    def holding(self, held: Mapping[str, Held | None]) -> Self:
        """Return this session with more parameters held; raises FormatError for one that there is not."""
        try:
            values = {name: held_value(value) for name, value in held.items()}
            changed = self.model_copy(update={"held": {**self.held, **values}})
            held_values(changed)
        except ValueError as error:
            raise FormatError(f"held: {error}") from None
        changed._folder = self._folder
        return changed

    def joint_index(self, name: str) -> int:
        """Return the place in the chain of the joint called `name`."""
        return [joint.name for joint in self.joints].index(name)

    def camera_index(self, view: View) -> int:
        """Return which camera took `view`."""
        return 0 if view.camera is None else [camera.name for camera in self.cameras].index(view.camera)

    def camera_link(self, camera: int) -> int:
        """Return how many joints move `camera`: its link's place in the chain, counted from 1."""
        link = self.cameras[camera].link
        return len(self.joints) if link is None else self.joint_index(link) + 1

    def readings(self) -> NDArray[np.float64]:
        """Return the readings of all views (n, m)."""
        values = [view.readings for view in self.views]
        return np.array(values, dtype=float).reshape(len(self.views), len(self.joints))

    def read_as(self, readings: NDArray[np.float64]) -> Self:
        """Return this session with other `readings` (n, m)."""
        return self.with_views(
            [
                view.model_copy(update={"readings": row})
                for view, row in zip(self.views, readings.tolist(), strict=True)
            ]
        )

    def approached_from(self, sides: NDArray[np.float64] | None) -> Self:
        """Return this session with `sides` (n, m) as of `sides`, as it was for None."""
        if sides is None:
            return self
        return self.with_views(
            [
                view.model_copy(update={"approached": row})
                for view, row in zip(self.views, sides.astype(int).tolist(), strict=True)
            ]
        )

    def sides(self) -> NDArray[np.float64]:
        """Return from which side each joint came to each view's readings (n, m): +1, -1, or 0 where not known."""
        nowhere = [0] * len(self.joints)
        sides = np.array([view.approached or nowhere for view in self.views], dtype=float)
        return sides.reshape(len(self.views), len(self.joints))

    @model_validator(mode="after")
    def _names_and_sizes_agree(self) -> Self:
        joints = [joint.name for joint in self.joints]
        cameras = [camera.name for camera in self.cameras]
        for field, names in (("joints", joints), ("cameras", cameras)):
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{field}: the name '{name}' stands twice")
        for index, camera in enumerate(self.cameras):
            if camera.link is not None and camera.link not in joints:
                raise ValueError(f"cameras[{index}].link: '{camera.link}' is not a joint of this session")
        if self.nominal is not None and len(self.nominal.dh) != len(joints):
            raise ValueError(f"nominal.dh: has {len(self.nominal.dh)} rows for {len(joints)} joints")
        if self.origin is not None and self.origin.camera not in cameras:
            raise ValueError(f"origin.camera: '{self.origin.camera}' is not a camera of this session")
        if self.origin is not None and len(self.origin.readings) != len(joints):
            raise ValueError(
                f"origin.readings: has {len(self.origin.readings)} numbers for {len(joints)} joints"
            )
        points = len(target_points(self.target))
        for index, view in enumerate(self.views):
            problem = _problem_of_view(view, joints, cameras, points)
            if problem:
                raise ValueError(f"views[{index}].{problem}")
        return self

    @model_validator(mode="after")
    def _known_beforehand(self) -> Self:
        for index, joint in enumerate(self.joints):
            if self.nominal is not None and joint.scale_std is not None:
                raise ValueError(f"joints[{index}].scale_std: the nominal model's std says it already")
        try:
            held_values(self)
        except ValueError as error:
            raise ValueError(f"held: {error}") from None
        return self


def _problem_of_view(  # noqa: PLR0911 one return a problem
    view: View, joints: list[str], cameras: list[str], points: int
) -> str | None:
    if len(view.readings) != len(joints):
        return f"readings: has {len(view.readings)} numbers for {len(joints)} joints"
    if view.joint is not None and view.joint not in joints:
        return (
            f"joint: '{view.joint}' is not a joint of this session; those are {', '.join(joints) or 'none'}"
        )
    if view.camera is not None and view.camera not in cameras:
        return f"camera: '{view.camera}' is not a camera of this session; those are {', '.join(cameras)}"
    if view.approached is not None and len(view.approached) != len(joints):
        return f"approached: has {len(view.approached)} numbers for {len(joints)} joints"
    if view.points is not None and view.points.ids and max(view.points.ids) >= points:
        return f"points.ids: {max(view.points.ids)} is not a point of the target, which has {points}"
    if view.image is not None and points == 0:
        return "image: the target's kind is 'none', so a picture says nothing; give world_from_camera"
    return None


def load_session(path: str | Path) -> Session:
    """Read a session from its folder, or from its `session.json`.

    Raises FormatError with a sentence that names the field. A missing picture is found when it is needed.
    """
    path = Path(path)
    file = path / "session.json" if path.is_dir() else path
    if not file.exists() and not path.exists():
        raise FormatError(f"{path}: there is no such session")
    return validate(Session, read_json(file), str(file), SESSION_FORMAT).at(file.parent)
