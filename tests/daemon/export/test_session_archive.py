"""A session as an archive: all of it, in little memory, and whole wherever it is unpacked."""

import io
import shutil
import subprocess
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from daemon.export.session_archive import CHUNK, archive_of


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "monday"
    (folder / "frames").mkdir(parents=True)
    rng = np.random.default_rng(0)
    (folder / "session.json").write_text('{"views": []}' * 100)
    for number in range(4):
        (folder / "frames" / f"{number:04d}.png").write_bytes(rng.bytes(3 * CHUNK + 17))
    (folder / "frames" / "0004.png").write_bytes(b"")
    (folder / "frames" / ".0005.png.tmp").write_bytes(b"half a picture")
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {
        f"{folder.name}/{path.relative_to(folder).as_posix()}": path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".tmp"
    }


def test_all_of_it_is_there_the_list_of_views_first(session: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(b"".join(archive_of(session)))) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == content(session)
        assert archive.namelist()[0] == "monday/session.json"


@pytest.mark.skipif(shutil.which("unzip") is None, reason="unzip is not installed")
def test_other_programs_unpack_it(session: Path, tmp_path: Path) -> None:
    file = tmp_path / "session.zip"
    file.write_bytes(b"".join(archive_of(session)))
    subprocess.run(["unzip", "-q", str(file), "-d", str(tmp_path / "out")], check=True, timeout=60)
    assert content(tmp_path / "out" / "monday") == content(session)


def test_it_is_never_whole_in_memory(session: Path) -> None:
    with (session / "frames" / "0006.png").open("wb") as file:
        file.truncate(200 * CHUNK)
    sum(len(piece) for piece in archive_of(session))  # what is imported at first
    tracemalloc.start()
    try:
        largest = max(len(piece) for piece in archive_of(session))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert largest < 2 * CHUNK
    assert peak < 10 * CHUNK


def test_a_reader_who_goes_away_leaves_no_file_open(session: Path) -> None:
    pieces = archive_of(session)
    next(pieces)
    pieces.close()  # an open file left behind is a warning, and so a failure
