"""The thinking half of a run: from its session on disk to a calibration, judged on held-out views."""

import asyncio
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from calib import Calibration, load_session
from calib.session_writer import keep_origin
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Solved, Solving, Verified


@dataclass(frozen=True, slots=True)
class Conclusion:
    """A calibration, and what the views that were held out say of it; None where none were."""

    calibration: Calibration
    verification: dict[str, Any] | None

    def verification_json(self) -> str | None:
        """Return the verdict as JSON."""
        return None if self.verification is None else json.dumps(self.verification, allow_nan=False)


async def conclude(folder: Path, log: EventLog) -> Conclusion:
    """Solve the session in `folder` and verify the result, in a worker thread.

    Raises CalibError in a sentence. A solver that is abandoned by a cancellation ends in its thread, unheard.
    """
    loop = asyncio.get_running_loop()

    def tell(message: str) -> None:
        loop.call_soon_threadsafe(log.add, Solving(message=message))

    calibration = await asyncio.to_thread(_solve, folder, tell)
    quality = calibration.quality.model_dump(mode="json", exclude={"views"})
    log.add(Solved(method=calibration.method, quality=quality))
    verification = await asyncio.to_thread(_verify, calibration, folder)
    if verification is not None:
        log.add(Verified(result=verification))
    return Conclusion(calibration, verification)


def _solve(folder: Path, tell: Callable[[str], None]) -> Calibration:
    from calib import solve  # it brings scipy, which a daemon that only serves poses does without

    session = load_session(folder)
    calibration = solve(session, progress=tell)
    keep_origin(session, calibration.origin)
    return calibration


def _verify(calibration: Calibration, folder: Path) -> dict[str, Any] | None:
    from calib import verify

    session = load_session(folder)
    if all(view.use == "fit" for view in session.views):
        return None  # views of the fit would flatter it
    return asdict(verify(calibration, session))
