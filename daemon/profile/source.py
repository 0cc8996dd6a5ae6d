"""Where a profile's text comes from: a file, or one of the profiles that are shipped with the package."""

from dataclasses import dataclass
from difflib import get_close_matches
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from daemon.profile.errors import ProfileError

_SUFFIX = ".toml"


@dataclass(frozen=True, slots=True)
class ProfileText:
    """A profile as it was read."""

    text: str
    file: str
    """How the file is called in messages."""
    path: Path | None
    """Where it is; None for a shipped one that does not lie in a folder."""


def shipped_profiles() -> tuple[str, ...]:
    """Return the names of the shipped profiles, in alphabetical order."""
    names = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX)))


def read_profile(path_or_name: str | Path) -> ProfileText:
    """Return the text of a file, or of the shipped profile of that name; raises ProfileError.

    A shipped name means the shipped profile even where a file is called so: write `./turntable` for the file.
    """
    if isinstance(path_or_name, str) and path_or_name in shipped_profiles():
        resource = _folder().joinpath(path_or_name + _SUFFIX)
        path = resource if isinstance(resource, Path) else None
        return ProfileText(resource.read_text(encoding="utf-8"), resource.name, path)
    path = Path(path_or_name)
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ProfileError([f"{path}: there is no such file; {_offer(path)}"]) from None
    except IsADirectoryError:
        raise ProfileError([f"{path}: is a folder: name the profile's file in it"]) from None
    except OSError as error:
        raise ProfileError([f"{path}: cannot be read: {error.strerror}"]) from None
    try:
        text = content.decode("utf-8-sig")  # some editors put a byte order mark first, which tomllib refuses
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ProfileError([f"{path}:{line}: is not UTF-8 text: save the file as UTF-8"]) from None
    return ProfileText(text, str(path), path)


def _folder() -> Traversable:
    return files("hw_profiles")


def _offer(path: Path) -> str:
    shipped = shipped_profiles()
    close = get_close_matches(path.name.removesuffix(_SUFFIX), shipped, n=1)
    if close:
        return f"did you mean the shipped profile '{close[0]}'?"
    return f"give a file's path, or a shipped profile's name: {', '.join(shipped)}"
