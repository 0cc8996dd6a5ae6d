"""The rig in 3-D, as OpenAPI describes it."""

from typing import Literal, Self

from pydantic import BaseModel, Field

from calib import scene
from daemon.api.pose_documents import Matrix, Vector


class EllipsoidDocument(BaseModel):
    """How surely a point is known."""

    centre: Vector
    axes: list[Vector] = Field(description="Three unit vectors, normal to each other.")
    radii: Vector = Field(description="One standard deviation along each of them (m).")

    @classmethod
    def of(cls, sure: scene.Ellipsoid | None) -> Self | None:
        """Describe an ellipsoid, if it is known."""
        if sure is None:
            return None
        return cls(centre=sure.centre.tolist(), axes=sure.axes.T.tolist(), radii=sure.radii.tolist())


class SceneJointDocument(BaseModel):
    """A joint as a screw, and its link's frame."""

    name: str
    kind: Literal["prismatic", "revolute"]
    axis: Vector = Field(description="Its direction, along growing readings.")
    point: Vector = Field(
        description="Of its axis the point nearest to the camera; a straight axis lies anywhere."
    )
    frame: Matrix = Field(description="The frame of its link, of the D-H model.")
    uncertainty: EllipsoidDocument | None = Field(description="Of the point; null where not known.")


class SceneCameraDocument(BaseModel):
    """A camera, and what it sees."""

    name: str
    pose: Matrix
    corners: list[Vector] | None = Field(
        description="Where the corners of its picture are drawn, from the top left clockwise; null without a lens."
    )
    uncertainty: EllipsoidDocument | None = Field(description="Of its centre; null where not known.")


class SceneTargetDocument(BaseModel):
    """The target."""

    points: list[Vector]
    outline: list[Vector] = Field(description="The corners around its points.")


class SceneDocument(BaseModel):
    """The rig in 3-D, in the world (m)."""

    calibration_id: str
    readings: list[float]
    base: Matrix
    joints: list[SceneJointDocument]
    cameras: list[SceneCameraDocument]
    target: SceneTargetDocument

    @classmethod
    def of(cls, calibration_id: str, readings: list[float], found: scene.Scene) -> Self:
        """Describe a scene."""
        return cls(
            calibration_id=calibration_id,
            readings=readings,
            base=found.base.tolist(),
            joints=[
                SceneJointDocument(
                    name=joint.name,
                    kind=joint.kind,
                    axis=joint.axis.tolist(),
                    point=joint.point.tolist(),
                    frame=joint.frame.tolist(),
                    uncertainty=EllipsoidDocument.of(joint.sure),
                )
                for joint in found.joints
            ],
            cameras=[
                SceneCameraDocument(
                    name=camera.name,
                    pose=camera.pose.tolist(),
                    corners=None if camera.corners is None else camera.corners.tolist(),
                    uncertainty=EllipsoidDocument.of(camera.sure),
                )
                for camera in found.cameras
            ],
            target=SceneTargetDocument(points=found.points.tolist(), outline=found.outline.tolist()),
        )
