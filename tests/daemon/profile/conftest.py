"""A small rig's profile, to be broken in one place by each test."""

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import pytest

from daemon.profile import Profile, ProfileError, load_profile
from drivers import registry
from drivers.options import DriverOptions

SMALL_RIG = Path(__file__).with_name("small-rig.toml")

Edit = tuple[str, str]


@pytest.fixture
def rig(tmp_path: Path) -> Callable[..., Path]:
    """Write the small rig's profile with parts of its text replaced."""

    def write(*edits: Edit) -> Path:
        text = SMALL_RIG.read_text(encoding="utf-8")
        for old, new in edits:
            assert text.count(old) >= 1, f"{old!r} does not stand in the profile"
            text = text.replace(old, new, 1)
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def load(rig: Callable[..., Path]) -> Callable[..., Profile]:
    """Load the small rig with parts of its text replaced."""
    return lambda *edits: load_profile(rig(*edits))


@pytest.fixture
def problems(rig: Callable[..., Path]) -> Callable[..., list[str]]:
    """Return what is wrong with the small rig, parts of its text replaced, without the file's name."""

    def find(*edits: Edit) -> list[str]:
        path = rig(*edits)
        with pytest.raises(ProfileError) as caught:
            load_profile(path)
        assert str(caught.value).startswith(caught.value.problems[0])
        assert all(problem.startswith(f"{path}:") for problem in caught.value.problems)
        return [problem.removeprefix(f"{path}:") for problem in caught.value.problems]

    return find


class _AcmeOptions(DriverOptions):
    port: str


class _AcmeAxisOptions(DriverOptions):
    channel: int = 0


class _Acme:
    Options: ClassVar = _AcmeOptions
    AxisOptions: ClassVar = _AcmeAxisOptions

    @classmethod
    def create(cls, *arguments: Any) -> None:
        """Make nothing: a profile is checked without making any device."""


@pytest.fixture
def acme(monkeypatch: pytest.MonkeyPatch) -> None:
    """Install another package's driver, `acme`, for controllers and for cameras."""
    module = ModuleType("acme_activecam")
    module.__dict__["Acme"] = _Acme
    monkeypatch.setitem(sys.modules, "acme_activecam", module)
    monkeypatch.setattr(
        registry,
        "entry_points",
        lambda group: [
            EntryPoint("acme", "acme_activecam:Acme", group),
            EntryPoint("broken", "no_such:X", group),
        ],
    )
