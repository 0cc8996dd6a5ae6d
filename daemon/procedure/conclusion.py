"""The thinking half of a run: from its session on disk to a calibration, judged on held-out views."""

import asyncio
import json
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from calib import Calibration, load_session
from calib.session import Session
from calib.session_writer import keep_origin
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Solved, Solving, Verified
from daemon.procedure.worker import in_worker


@dataclass(frozen=True, slots=True)
class Conclusion:
    """A calibration, and what the views that were held out say of it; None where none were."""

    calibration: Calibration
    verification: dict[str, Any] | None

    def verification_json(self) -> str | None:
        """Return the verdict as JSON."""
        return None if self.verification is None else json.dumps(self.verification, allow_nan=False)


async def conclude(folder: Path, log: EventLog, left_out: Sequence[int] = ()) -> Conclusion:
    """Solve the session in `folder`, but for the views `left_out`, and verify the result, in a worker thread.

    Raises CalibError in a sentence. A solver that is abandoned by a cancellation ends with its next message.
    """
    loop, abandoned = asyncio.get_running_loop(), threading.Event()

    def tell(message: str) -> None:
        if abandoned.is_set():
            raise _Abandoned
        loop.call_soon_threadsafe(log.add, Solving(message=message))

    try:
        calibration = await in_worker(lambda: _solve(folder, left_out, tell))
    finally:
        abandoned.set()
    quality = calibration.quality.model_dump(mode="json", exclude={"views"})
    log.add(Solved(method=calibration.method, quality=quality))
    verification = await in_worker(lambda: _verify(calibration, folder, left_out))
    if verification is not None:
        log.add(Verified(result=verification))
    return Conclusion(calibration, verification)


class _Abandoned(Exception):  # noqa: N818  it is no error
    """Ends a solver whose result nobody waits for."""


def _solve(folder: Path, left_out: Sequence[int], tell: Callable[[str], None]) -> Calibration:
    from calib import solve  # it brings scipy, which a daemon that only serves poses does without

    session = load_session(folder)
    calibration = solve(session.leaving_out(left_out), progress=tell)
    if _of_all_joints(calibration, session):
        keep_origin(session, calibration.origin)
    return calibration


def _verify(calibration: Calibration, folder: Path, left_out: Sequence[int]) -> dict[str, Any] | None:
    from calib import verify
    from calib.as_solved import as_solved

    session = load_session(folder).leaving_out(left_out)
    if not any(view.use == "verify" for view in session.views):
        return None  # views of the fit would flatter it
    if not _of_all_joints(calibration, session):
        return None  # it cannot tell where the camera was
    return asdict(verify(calibration, as_solved(calibration, session)))


def _of_all_joints(calibration: Calibration, session: Session) -> bool:
    """Return whether the session was cut off only after it had exercised every joint."""
    return len(calibration.joints) == len(session.joints)
