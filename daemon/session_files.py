"""The files of a session, for whoever copies them while a run adds to it."""

from pathlib import Path


def session_files(folder: Path) -> list[Path]:
    """Return the files of a session, its list of views first: every picture that this names is found after it."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix != ".tmp")
    return sorted(files, key=lambda path: path.name != "session.json")
