"""Whose eyes devices are looked for with."""

import os
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Machine:
    """A file system with /dev, /proc and /sys, and a user who wants to open what is there."""

    root: Path = Path("/")
    uid: int = field(default_factory=os.geteuid)
    groups: frozenset[int] = field(default_factory=lambda: frozenset([os.getegid(), *os.getgroups()]))

    def entries(self, folder: str) -> list[Path]:
        """Return what is in a folder such as "sys/class/tty", in the order of its names; nothing where it is not."""
        path = self.root / folder
        return sorted(path.iterdir()) if path.is_dir() else []

    def path(self, name: str) -> Path:
        """Return where an absolute path such as "/dev/ttyUSB0" is for us."""
        return self.root / name.lstrip("/")

    def name(self, path: Path) -> str:
        """Return the absolute path that others know `path` by."""
        return f"/{path.relative_to(self.root)}"


def text_of(path: Path) -> str | None:
    """Return what a file of the kernel's says, None where there is none or it does not answer."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None
