"""A solution written down as a calibration."""

from dataclasses import asdict, replace
from typing import Literal

import numpy as np

from calib.calibration import (
    CALIBRATION_FORMAT,
    CalibratedCamera,
    Calibration,
    Covariance,
    DhLink,
    DhStd,
    JointScrew,
)
from calib.chain import Chain
from calib.dh_covariance import dh_covariance
from calib.links import Links, based, links_of
from calib.parameters import held_values
from calib.session import Session
from calib.solution import Solution
from calib.stated_corrections import stated_corrections
from calib.stated_quality import Quality
from calib.transforms import inverse

Method = Literal["ml", "closed_form"]


def document(session: Session, method: Method, solution: Solution, quality: Quality) -> Calibration:
    """Return the solution as a calibration document."""
    chain = _with_conventional_points(solution)
    links = links_of(chain)
    if solution.world_from_base is not None:
        links = based(links, solution.world_from_base)
    deviations, names = _deviations(solution), [joint.name for joint in session.joints]
    ranges = session.with_views([view for view in session.views if view.use == "fit"]).readings()
    return Calibration(
        format=CALIBRATION_FORMAT,
        method=method,
        joints=[
            JointScrew(
                name=joint.name,
                kind=joint.kind,
                reading_unit=joint.reading_unit,
                scale=float(chain.scales[i]),
                scale_std=deviations.get(f"joints.{i}.scale"),
                axis=chain.axes[i].tolist(),
                point=chain.points[i].tolist(),
            )
            for i, joint in enumerate(session.joints)
        ],
        dh=[
            DhLink(**asdict(row), scale=float(scale), std=std)
            for row, scale, std in zip(links.rows, chain.scales, _dh_std(solution, chain, links), strict=True)
        ],
        world_from_base=links.world_from_base.tolist(),
        cameras=[_camera(session, index, solution, links) for index in range(len(session.cameras))],
        corrections=stated_corrections(
            names, solution.corrections, solution.warp, solution.aspects, deviations
        ),
        range=[[float(lo), float(hi)] for lo, hi in zip(ranges.min(axis=0), ranges.max(axis=0), strict=True)],
        covariance=_covariance(solution),
        quality=quality,
        target=session.target,
        origin=solution.origin,
        held=held_values(session),
    )


def _with_conventional_points(solution: Solution) -> Chain:
    """Return the chain with the points of its axes that the format asks for; any other would do as well."""
    chain = solution.chain
    if solution.mounts is None:
        return chain
    feet = chain.points - (chain.points * chain.axes).sum(axis=1, keepdims=True) * chain.axes
    return replace(chain, points=np.where(chain.revolute[:, None], feet, solution.mounts[0, :3, 3]))


def _dh_std(solution: Solution, chain: Chain, links: Links) -> list[DhStd | None]:
    if solution.covariance is None:
        return [None] * len(chain)
    return [DhStd(**row) for row in dh_covariance(chain, links.world_from_base, *solution.covariance).std()]


def _camera(session: Session, index: int, solution: Solution, links: Links) -> CalibratedCamera:
    name, lens, link = session.cameras[index].name, solution.lenses[index], session.camera_link(index)
    if solution.mounts is None:
        return CalibratedCamera(
            name=name, link=None, link_from_camera=None, intrinsics=lens, world_from_camera=None
        )
    mount = solution.mounts[index]
    return CalibratedCamera(
        name=name,
        link=session.joints[link - 1].name,
        link_from_camera=(inverse(links.world_from_link[link - 1]) @ mount).tolist(),
        intrinsics=lens,
        world_from_camera=mount.tolist(),
    )


def _covariance(solution: Solution) -> Covariance | None:
    if solution.covariance is None:
        return None
    names, matrix = solution.covariance
    return Covariance(parameters=names, matrix=matrix.tolist())


def _deviations(solution: Solution) -> dict[str, float]:
    """Return the standard deviation of each of the document's numbers that has one."""
    if solution.covariance is None:
        return {}
    names, matrix = solution.covariance
    return dict(zip(names, np.sqrt(np.maximum(np.diag(matrix), 0)).tolist(), strict=True))
