"""A view as files state it: the joints' readings, and what was seen there."""

from pathlib import PurePosixPath
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from calib.documents import Document, Number


def _rigid(rows: list[list[float]]) -> list[list[float]]:
    matrix = np.array(rows, dtype=float) if all(len(row) == 4 for row in rows) else np.zeros((0, 0))
    if matrix.shape != (4, 4) or not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-9):
        raise ValueError("must be a 4 x 4 matrix whose last row is 0 0 0 1")
    rotation = matrix[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise ValueError("must be a rigid transform: its upper left 3 x 3 part is not a rotation")
    return rows


RigidRows = Annotated[list[list[Number]], AfterValidator(_rigid)]


class Points(Document):
    """Target points seen in a view: pictures of the points themselves, or centroids of disks' pictures."""

    ids: list[Annotated[int, Field(ge=0)]]
    pixels: list[Annotated[list[Number], Field(min_length=2, max_length=2)]]
    disk: Literal["centroid"] | None = None

    @model_validator(mode="after")
    def _one_pixel_an_id(self) -> Self:
        if len(self.ids) != len(self.pixels):
            raise ValueError(
                f"has {len(self.ids)} ids but {len(self.pixels)} pixels; give one pixel for each id"
            )
        if len(set(self.ids)) != len(self.ids):
            raise ValueError("an id stands in it twice")
        return self


class View(Document):
    """One measurement: the readings, and a picture, its detected points, or a camera pose.

    `images` are all frames of a view that took several, its `image` first.
    """

    joint: str | None
    readings: list[Number]
    image: str | None = None
    images: list[str] | None = None
    points: Points | None = None
    world_from_camera: RigidRows | None = None
    camera: str | None = None
    use: Literal["fit", "verify", "none"] = "fit"
    approached: list[Literal[-1, 0, 1]] | None = None
    sweep: Annotated[int, Field(ge=0)] | None = None
    """Which sweep of a run's procedure took it, from 0; its free views count as the last."""

    @property
    def frames(self) -> list[str]:
        """The paths of the view's pictures, none where it has no picture."""
        return self.images or ([] if self.image is None else [self.image])

    @field_validator("image")
    @classmethod
    def _inside_the_folder(cls, image: str | None) -> str | None:
        if image is not None and (PurePosixPath(image).is_absolute() or ".." in PurePosixPath(image).parts):
            raise ValueError(f"'{image}' must be a path inside the session's folder")
        return image

    @field_validator("images")
    @classmethod
    def _all_inside_the_folder(cls, images: list[str] | None) -> list[str] | None:
        for image in images or []:
            cls._inside_the_folder(image)
            if (images or []).count(image) > 1:
                raise ValueError(f"'{image}' stands twice: each frame has a picture of its own")
        return images

    @model_validator(mode="after")
    def _one_measurement(self) -> Self:
        given = [key for key in ("image", "points", "world_from_camera") if getattr(self, key) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise ValueError(f"must carry one of image, points or world_from_camera, and has {found}")
        if self.images is not None and self.images[:1] != [self.image]:
            raise ValueError("images must begin with the view's image, and go on with its further frames")
        return self
