"""What takes a while to work out, kept for who asks again."""

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """The `most` values that were asked for last. One is worked out at a time, and each once however many ask."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[Key, Value] = OrderedDict()
        self._working = asyncio.Lock()

    async def of(self, key: Key, work: Callable[[], Awaitable[Value]]) -> Value:
        """Return the value of `key`, by `work` where it is not kept; what that raises is raised and not kept."""
        if key not in self._values:
            async with self._working:
                if key not in self._values:
                    self._values[key] = await work()
                    while len(self._values) > self._most:
                        self._values.popitem(last=False)
        self._values.move_to_end(key)
        return self._values[key]
