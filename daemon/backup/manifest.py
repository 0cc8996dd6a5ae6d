"""What is in a backup: a ZIP file of the database, the sessions' files, and this list of them."""

from datetime import datetime
from pathlib import PurePosixPath
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BaseModel

from daemon.store.database import DATABASE

NAME: Final = "manifest.json"
SESSIONS: Final = "sessions"


def _safe(path: str) -> str:
    """Return a path that leads into a data folder, and there to what belongs into it."""
    parts = PurePosixPath(path).parts
    belongs = path == DATABASE or (parts[:1] == (SESSIONS,) and len(parts) > 1)
    if not belongs or ".." in parts or path != "/".join(parts) or "\\" in path or "\0" in path:
        raise ValueError(f"{path!r} is not a path of a data folder")
    return path


class Manifest(BaseModel):
    """The files of a backup and the SHA-256 of each, by its path in the data folder."""

    format: Literal["activecam.backup/1"] = "activecam.backup/1"
    version: str
    """The activecam that made it."""
    made_at: datetime
    files: dict[Annotated[str, AfterValidator(_safe)], str]
