"""Daemons that are killed at random lose nothing but the view in flight; `make test-kill` kills many more."""

from pathlib import Path

from tests.daemon.kills import Kills


async def test_what_killed_daemons_told_is_found_by_the_next(tmp_path: Path) -> None:
    kills = Kills(tmp_path, seed=4)
    found = [kills.once() for _ in range(5)]
    assert any("found unfinished at the start: 2" in sentence for sentence in found), found
    assert "was resumed to its end" in await kills.finish()
