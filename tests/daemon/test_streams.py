"""Long answers: what comes is passed on, silence shows a sign of life, and a shutdown ends them."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from daemon import streams
from daemon.streams import Streams


async def few(*items: str) -> AsyncIterator[str]:
    for item in items:
        yield item


async def silence() -> AsyncIterator[str]:
    await asyncio.Event().wait()
    yield "never"


async def test_items_are_passed_on_to_their_end() -> None:
    assert [item async for item in Streams().follow(few("a", "b", "c"))] == ["a", "b", "c"]


async def test_silence_shows_a_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "HEARTBEAT", 0.01)
    following = Streams().follow(silence())
    assert await anext(following) is None
    assert await anext(following) is None
    await following.aclose()  # type: ignore[attr-defined]


async def test_closing_ends_what_waits_and_what_comes_later() -> None:
    all_streams = Streams()
    waiting = asyncio.create_task(read(all_streams.follow(silence())))
    await asyncio.sleep(0)
    assert all_streams.open == 1
    all_streams.close()
    assert await waiting == []
    assert all_streams.open == 0
    assert [item async for item in all_streams.follow(few("a"))] == []


async def read(items: AsyncIterator[str | None]) -> list[str | None]:
    return [item async for item in items]
