"""What a run has measured, read back from disk."""

from collections.abc import Sequence
from pathlib import Path

from calib import Session, load_session
from calib.errors import CalibError
from daemon.errors import SessionUnreadableError, UnknownViewError
from daemon.store import RunRecord


def session_of(run: RunRecord, folder: Path) -> Session | None:
    """Return the session of `run`, in `folder`; None where it has measured nothing (yet).

    Raises SessionUnreadableError.
    """
    if not (folder / "session.json").exists() and (folder.is_dir() or not run.state.over):
        return None
    try:
        return load_session(folder)
    except (CalibError, OSError) as error:
        raise SessionUnreadableError(f"the run's views cannot be read: {error}") from error


def require_views(run: RunRecord, folder: Path, numbers: Sequence[int]) -> None:
    """Raise UnknownViewError unless `run`, in `folder`, has these views, and what `session_of` raises."""
    session = session_of(run, folder)
    count = 0 if session is None else len(session.views)
    for number in numbers:
        if not 0 <= number < count:
            raise UnknownViewError(f"there is no view {number}: this run has {count}, counted from 0")
