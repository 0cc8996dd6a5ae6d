"""What counts as grown."""

from tests.daemon.soak.verdict import COUNTS, complaints

MINUTES = [float(minute) for minute in range(60)]
BEFORE = dict.fromkeys(COUNTS, 5.0)


def test_memory_that_wanders_has_not_grown_and_what_leaks_a_little_has() -> None:
    wandering = [230.0 + 8 * (minute % 3 - 1) for minute in range(60)]
    assert complaints(MINUTES, wandering, BEFORE, BEFORE) == []
    leaking = [rss + 0.25 * minute for minute, rss in enumerate(wandering)]
    (grown,) = complaints(MINUTES, leaking, BEFORE, BEFORE)
    assert grown.startswith("memory grew by 1")


def test_a_single_task_or_file_that_is_left_over_is_told() -> None:
    flat = [230.0] * len(MINUTES)
    assert complaints(MINUTES, flat, BEFORE, BEFORE | {"files": 6.0}) == ["files: 5.0 became 6.0"]
    assert complaints(MINUTES, flat, BEFORE, BEFORE | {"tasks": 4.0}) == []
