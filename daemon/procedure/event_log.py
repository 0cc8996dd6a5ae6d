"""A run's events in order: kept, written beside its session, and followed by any number of readers."""

import logging
from collections.abc import AsyncIterator
from pathlib import Path

from pydantic import ValidationError

from daemon.broadcast import Broadcast
from daemon.procedure.events import EVENT, RunEvent

logger = logging.getLogger(__name__)

FILE_NAME = "events.jsonl"


class EventLog:
    """The events of the run `run_id`; `folder` is its session's."""

    def __init__(self, run_id: str, folder: Path) -> None:
        self.run_id = run_id
        self._events: list[RunEvent] = []
        self._file = folder / FILE_NAME
        self._changed = Broadcast()
        self._ended = False

    def add(self, event: RunEvent) -> None:
        """Tell an event under the next number; what a solver says of a run that is over is dropped."""
        if self._ended:
            return
        self._ended = event.type == "finished"
        numbered = event.model_copy(update={"run_id": self.run_id, "sequence": len(self._events) + 1})
        self._events.append(numbered)
        try:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(numbered.model_dump_json() + "\n")
        except OSError as error:
            # The session and the store are what counts; a run does not end for want of its diary.
            logger.warning("%s: an event could not be written: %s", self._file, error.strerror)
        self._changed.fire()

    async def follow(self, after: int = 0) -> AsyncIterator[RunEvent]:
        """Yield the events whose sequence is greater than `after`: those there are, then each new one."""
        while True:
            for event in self._events[after:]:
                yield event
                after = event.sequence
            if self._ended:
                return
            await self._changed.wait()


def read_events(folder: Path) -> list[RunEvent]:
    """Return the events of a run that is over, from its session's folder, up to a line cut off by a crash."""
    try:
        # Bytes: a crash may cut a letter in two, and a line of text may hold more than one kind of line end.
        lines = (folder / FILE_NAME).read_bytes().split(b"\n")
    except FileNotFoundError:
        return []
    events: list[RunEvent] = []
    for line in lines:
        try:
            events.append(EVENT.validate_json(line))
        except ValidationError:
            break
    return events
