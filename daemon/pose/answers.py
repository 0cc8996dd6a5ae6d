"""Poses as the JSON of the API's answers, a few at a time: nobody else runs while a long text is written."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from itertools import repeat
from typing import Any, Final

import numpy as np
import orjson

from daemon.pose.active import Poses
from daemon.rig import PastReadings
from daemon.rig.utc import rfc3339

ALL: Final = slice(None)
AT_ONCE: Final = 256
"""Poses that are written at once, in about a millisecond."""

Fields = dict[str, Any]


def fields(poses: Poses, some: slice = ALL) -> list[Fields]:
    """Return `some` poses as the API's `PoseAtReadings`, their numbers in arrays."""
    count = len(poses.readings[some])
    columns = {
        "readings": poses.readings[some],
        "approached": poses.approached[some],
        "world_from_camera": poses.world_from_camera[some],
        "base_from_camera": poses.base_from_camera[some],
        "position": poses.world_from_camera[some, :3, 3],
        "quaternion": poses.quaternion[some],
        "covariance": repeat(None, count) if poses.covariance is None else poses.covariance[some],
        "out_of_range": poses.out_of_range[some],
    }
    return _rows(columns)


def past_fields(
    poses: Poses, past: PastReadings, times: Sequence[datetime], some: slice = ALL
) -> list[Fields]:
    """Return `some` of the poses at past `times` as the API's `PoseAtPastTime`, their numbers in arrays."""
    columns = {
        "timestamp": [rfc3339(time) for time in times[some]],
        "between": [[[rfc3339(time) for time in pair] for pair in pairs] for pairs in past.between[some]],
        "reading_bounds": past.bounds[some],
        "moving": past.moving[some].tolist(),
    }
    return [one | pose for one, pose in zip(_rows(columns), fields(poses, some), strict=True)]


def written(answer: Fields | list[Fields]) -> bytes:
    """Return the JSON of an answer with arrays in it."""
    return orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY)


def written_list(common: Fields, count: int, some_fields: Callable[[slice], list[Fields]]) -> bytes:
    """Return the JSON of what `count` poses have in `common`, and of their list, of which `some_fields` gives parts."""
    parts = (written(some_fields(slice(i, i + AT_ONCE)))[1:-1] for i in range(0, count, AT_ONCE))
    return b'%s,"poses":[%s]}' % (written(common)[:-1], b",".join(parts))


def _rows(columns: Mapping[str, Iterable[Any]]) -> list[Fields]:
    # Arrays are written only where their numbers lie one after the other.
    apart = [
        np.ascontiguousarray(column) if isinstance(column, np.ndarray) else column
        for column in columns.values()
    ]
    return [dict(zip(columns, row, strict=True)) for row in zip(*apart, strict=True)]
