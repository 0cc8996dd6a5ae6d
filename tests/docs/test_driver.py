"""The driver of docs/how-to/write-a-driver.md, taken from the page, passes the contract suite."""

import importlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from daemon.profile import ProfileError, load_profile
from drivers import registry
from tests.docs.pages import blocks, page

PAGE = "how-to/write-a-driver.md"
_FILE = re.compile(r"^\*\*(\S+)\*\*\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The page's files in a folder, installed as far as an entry point goes."""
    for name, text in _FILE.findall(page(PAGE)):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text())["project"]
    info = tmp_path / "acme_activecam-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = [
        line
        for group, entries in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {target}" for name, target in entries.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield tmp_path
    for name in [name for name in sys.modules if name.split(".")[0] == "acme_activecam"]:
        del sys.modules[name]


def test_the_driver_passes_the_contract_suite(package: Path) -> None:
    command = [sys.executable, "-W", "error", "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
    ran = subprocess.run(command, cwd=package, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert re.search(r"^1[5-9] passed", ran.stdout, re.MULTILINE), ran.stdout


def test_the_driver_is_well_written(package: Path) -> None:
    settings = Path(__file__).parents[2] / "pyproject.toml"
    # Here `drivers` is not first-party, which only sorts its imports elsewhere.
    command = ["ruff", "check", "--no-cache", "--config", settings, "--ignore", "I", "acme_activecam"]
    ran = subprocess.run(
        [sys.executable, "-m", *command], cwd=package, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_a_profile_names_the_driver(package: Path, tmp_path: Path) -> None:
    assert "acme" in registry.names("controllers")
    assert all(info.error is None for info in registry.list_drivers("controllers"))
    snippet = next(block.text for block in blocks(PAGE, "toml") if block.text.startswith("[[axes]]"))
    whole = next(block.text for block in blocks("reference/files.md", "toml"))
    head, _, rest = whole.partition("[[axes]]")
    rest = (
        rest.partition("[camera]")[2]
        .replace("time_scale = 20.0\n", "")
        .replace("40 deg", "1 mm")
        .replace("-1 mm", "0 mm")
    )
    rest = re.sub(r"readings = .*", 'readings = ["0.5 mm", "1.5 mm"]', rest)
    rest = rest.replace("time_scale = 20.0\n", "")  # what is real keeps the pace of life
    rig = tmp_path / "rig.toml"
    rig.write_text(head + snippet + "[camera]" + rest.replace('joint = "table"', 'joint = "slide"'))
    profile = load_profile(rig)
    assert profile.controllers["box"].driver == "acme"
    rig.write_text(rig.read_text().replace("channel = 1", "channel = 9"))
    with pytest.raises(ProfileError, match=r"axes\[0\].*channel"):
        load_profile(rig)
