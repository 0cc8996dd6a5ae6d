"""What can be asked of a daemon."""

import ssl
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from activecam_client.connection import Connection
from activecam_client.documents import (
    CalibrationEntry,
    Check,
    Comparison,
    PastPose,
    Pose,
    PoseAtReadings,
    Rays,
    Rig,
    RunRecord,
    Stop,
    StreamedPose,
)
from activecam_client.errors import ProblemError
from activecam_client.lease import Lease
from activecam_client.run import Run

Array = NDArray[np.float64]


class Client:
    """One daemon. Everything raises ProblemError where the daemon refuses, UnreachableError where none answers.

    `camera` is the first one where left out. `readings` are vectors of one number an axis, in chain order.
    """

    def __init__(self, address: str, key: str | None = None, tls: ssl.SSLContext | None = None) -> None:
        """`address` as `http://host:port`; `key` where the daemon asks for one; `tls` for certificates of your own."""
        self._connection = Connection(address, key, tls)

    def __enter__(self) -> Self:
        """Return the client itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Hang up."""
        self.close()

    def close(self) -> None:
        """Hang up."""
        self._connection.close()

    def rig(self) -> Rig:
        """Return the state of the axes and devices."""
        return Rig.model_validate(self._connection.ask("GET", "/rig"))

    def pose(self, camera: str | None = None) -> Pose:
        """Return the camera's pose now."""
        return Pose.model_validate(self._connection.ask("GET", "/pose", query=_given(camera=camera)))

    def pose_at(self, time: datetime, camera: str | None = None) -> PastPose:
        """Return the camera's pose at a `time` (with its zone) of the last minute."""
        asked = _given(camera=camera, at=_zoned(time))
        return PastPose.model_validate(self._connection.ask("GET", "/pose", query=asked))

    def poses_at(self, times: Sequence[datetime], camera: str | None = None) -> list[PastPose]:
        """Return the camera's poses at up to 1000 such times."""
        body = {"times": [_zoned(time) for time in times], "camera": camera}
        return [
            PastPose.model_validate(pose) for pose in self._connection.ask("POST", "/pose", body)["poses"]
        ]

    def poses(
        self, readings: ArrayLike, camera: str | None = None, approached: ArrayLike | None = None
    ) -> list[PoseAtReadings]:
        """Return the poses at up to 10000 `readings` (n, m).

        Each was `approached` (n, m) from below, 1, or from above, -1; 0, the default, where that is not known.
        """
        body = {"readings": _rows(readings), "camera": camera}
        if approached is not None:
            body["approached"] = np.asarray(approached, dtype=int).tolist()
        return [
            PoseAtReadings.model_validate(pose)
            for pose in self._connection.ask("POST", "/pose", body)["poses"]
        ]

    def project(
        self, points: ArrayLike, readings: ArrayLike | None = None, camera: str | None = None
    ) -> Array:
        """Return the pixels (n, k, 2) at which world points (k, 3; m) are seen; nan where the lens sees none.

        At `readings` (n, m), or the latest ones (n = 1).
        """
        answer = self._connection.ask(
            "POST", "/project", _asked(points=points, readings=readings, camera=camera)
        )
        return np.array([_filled(row, 2) for row in answer["pixels"]])

    def rays(self, pixels: ArrayLike, readings: ArrayLike | None = None, camera: str | None = None) -> Rays:
        """Return along which rays in the world pixels (k, 2) look, at `readings` (n, m) or the latest (n = 1)."""
        rays = self._connection.ask("POST", "/rays", _asked(pixels=pixels, readings=readings, camera=camera))[
            "rays"
        ]
        return Rays(
            origins=[bundle["origin"] for bundle in rays],
            directions=[_filled(bundle["directions"], 3) for bundle in rays],
        )

    def stream(self, camera: str | None = None, rate: float | None = None) -> Iterator[StreamedPose]:
        """Yield a pose at each new reading, or `rate` a second at most; the newest, however long the last one took.

        Ends with the daemon. Raises ProblemError when a problem comes in the way; call it again to go on.
        """
        for message in self._connection.messages(
            "/pose/stream", _given(camera=camera, rate=rate, ask="true")
        ):
            if "code" in message:
                raise ProblemError(message)
            yield StreamedPose.model_validate(message)

    def lease(self, owner: str, note: str = "", ttl: float = 30.0) -> Lease:
        """Return the right to move, for a `with` block. Without a sign of life it ends after `ttl` seconds."""
        return Lease(self._connection, owner, note, ttl)

    def run(
        self, owner: str = "", note: str = "", lease: Lease | None = None, from_here: Sequence[str] = ()
    ) -> Run:
        """Start a calibration run; whoever holds the lease hands it over.

        The first sweep of each of the joints `from_here` starts from where the axes stand, and so do its others that
        would start from the same place.
        """
        headers = None if lease is None else lease.headers
        body = {"owner": owner, "note": note, "from_here": list(from_here)}
        started = self._connection.ask("POST", "/runs", body, headers=headers)
        return Run(self._connection, started["id"])

    def runs(self) -> list[RunRecord]:
        """Return all runs, the newest first."""
        return [RunRecord.model_validate(run) for run in self._connection.ask("GET", "/runs")]

    def run_of(self, run_id: str) -> Run:
        """Return a run that was started before, by its id: to follow it, to resume it, or to solve it anew."""
        return Run(self._connection, run_id)

    def checklist(self, from_here: Sequence[str] = ()) -> list[Check]:
        """Return what stands for and against a run, `from_here` as for one."""
        answer = self._connection.ask("GET", "/runs/checklist", query={"from_here": list(from_here)})
        return [Check.model_validate(check) for check in answer["checks"]]

    def calibrations(self) -> list[CalibrationEntry]:
        """Return all calibrations, the newest first."""
        answer = self._connection.ask("GET", "/calibrations")
        return [CalibrationEntry.model_validate(calibration) for calibration in answer]

    def activate(self, calibration_id: str) -> CalibrationEntry:
        """Have poses computed from a calibration, from now on and after every restart."""
        answer = self._connection.ask("POST", f"/calibrations/{calibration_id}/activate")
        return CalibrationEntry.model_validate(answer)

    def compare(self, calibration_id: str, other_id: str) -> Comparison:
        """Return whether two calibrations of this rig say the same."""
        answer = self._connection.ask("GET", f"/calibrations/{calibration_id}/compare/{other_id}")
        return Comparison.model_validate(answer)

    def stop(self) -> Stop:
        """Stop everything at once, and return when all axes stand; nothing moves before it is acknowledged."""
        return Stop.model_validate(self._connection.ask("POST", "/stop", patience=None))

    def acknowledge_stop(self) -> Stop:
        """Let the rig move again after a stop."""
        return Stop.model_validate(self._connection.ask("POST", "/stop/acknowledge"))


def _given(**query: Any) -> dict[str, str]:
    return {name: str(value) for name, value in query.items() if value is not None}


def _asked(camera: str | None, **arrays: ArrayLike | None) -> dict[str, Any]:
    return {"camera": camera} | {name: _rows(array) for name, array in arrays.items() if array is not None}


def _rows(values: ArrayLike) -> Any:
    return np.asarray(values, dtype=float).tolist()


def _filled(rows: list[list[float] | None], width: int) -> list[list[float]]:
    return [[np.nan] * width if row is None else row for row in rows]


def _zoned(time: datetime) -> str:
    if time.tzinfo is None:
        raise ValueError(f"{time} has no zone: make it with datetime.now(UTC), or time.astimezone()")
    return time.isoformat()
