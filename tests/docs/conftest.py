"""A daemon of its own for the examples on a page."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.processes import daemon_process
from tests.daemon.rigs import write_profile


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """The address of a daemon of its own, on a small rig whose axes are called as those on the page."""
    with daemon_process(write_profile(tmp_path), tmp_path / "data") as daemon:
        yield daemon.address
