"""What is on disk after a crash, told by the order in which the system is asked for it."""

import errno
import os
from pathlib import Path

import pytest

from calib.durable_files import make_folder_durably, write_durably


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the system is asked for, in order: `flush NAME` and `NAME becomes NAME`."""
    told: list[str] = []
    flush, replace = os.fsync, Path.replace

    def fsync(descriptor: int) -> None:
        told.append(f"flush {Path(f'/proc/self/fd/{descriptor}').readlink().name}")
        flush(descriptor)

    def rename(path: Path, target: Path) -> Path:
        told.append(f"{path.name} becomes {target.name}")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", rename)
    return told


def test_a_file_is_flushed_before_its_name_is_and_its_folder_after(tmp_path: Path, asked: list[str]) -> None:
    write_durably(tmp_path / "a.json", b"text")
    assert asked == ["flush .a.json.tmp", ".a.json.tmp becomes a.json", f"flush {tmp_path.name}"]
    assert (tmp_path / "a.json").read_bytes() == b"text"


def test_each_folder_that_is_made_is_flushed_into_the_one_above(tmp_path: Path, asked: list[str]) -> None:
    make_folder_durably(tmp_path / "sessions" / "monday" / "frames")
    assert asked == [f"flush {tmp_path.name}", "flush sessions", "flush monday"]
    make_folder_durably(tmp_path / "sessions" / "monday" / "frames")
    assert len(asked) == 3


def test_a_disk_that_takes_no_more_keeps_what_there_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    write_durably(tmp_path / "a.json", b"before")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_durably(tmp_path / "a.json", b"after")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_bytes() == b"before"
