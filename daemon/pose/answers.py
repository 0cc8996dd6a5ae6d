"""Poses as the JSON of the API's answers, a few at a time: nobody else runs while a long text is written."""

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Final

from pydantic_core import to_json

from daemon.pose.active import Poses
from daemon.rig import PastReadings
from daemon.rig.utc import rfc3339

ALL: Final = slice(None)
AT_ONCE: Final = 256
"""Poses that are written at once, in about a millisecond."""

Fields = dict[str, Any]


def fields(poses: Poses, some: slice = ALL) -> list[Fields]:
    """Return `some` poses as the API's `PoseAtReadings`."""
    columns = {
        "readings": poses.readings[some].tolist(),
        "approached": poses.approached[some].tolist(),
        "world_from_camera": poses.world_from_camera[some].tolist(),
        "base_from_camera": poses.base_from_camera[some].tolist(),
        "position": poses.world_from_camera[some, :3, 3].tolist(),
        "quaternion": poses.quaternion[some].tolist(),
        "out_of_range": poses.out_of_range[some],
    }
    covariance = poses.covariance
    columns["covariance"] = (
        [None] * len(columns["readings"]) if covariance is None else covariance[some].tolist()
    )
    return _rows(columns)


def past_fields(
    poses: Poses, past: PastReadings, times: Sequence[datetime], some: slice = ALL
) -> list[Fields]:
    """Return `some` of the poses at past `times` as the API's `PoseAtPastTime`."""
    columns = {
        "timestamp": [rfc3339(time) for time in times[some]],
        "between": [[[rfc3339(time) for time in pair] for pair in pairs] for pairs in past.between[some]],
        "reading_bounds": past.bounds[some].tolist(),
        "moving": past.moving[some].tolist(),
    }
    return [one | pose for one, pose in zip(_rows(columns), fields(poses, some), strict=True)]


def written_list(common: Fields, count: int, some_fields: Callable[[slice], list[Fields]]) -> bytes:
    """Return the JSON of what `count` poses have in `common`, and of their list, of which `some_fields` gives parts."""
    parts = (to_json(some_fields(slice(i, i + AT_ONCE)))[1:-1] for i in range(0, count, AT_ONCE))
    return b'%s,"poses":[%s]}' % (to_json(common)[:-1], b",".join(parts))


def _rows(columns: dict[str, list[Any]]) -> list[Fields]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
