"""A run's events in order: kept, written beside its session, and followed by any number of readers."""

from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Self

from pydantic import ValidationError

from calib.durable_files import make_folder_durably, write_durably
from daemon.broadcast import Broadcast
from daemon.procedure.event_file import EventFile
from daemon.procedure.events import EVENT, Finished, RunEvent
from daemon.store import RunRecord

Told = Callable[[RunEvent], None]

FILE_NAME = "events.jsonl"


class EventLog:
    """The events of the run `run_id`; `folder` is its session's. `earlier` are those that it goes on from."""

    def __init__(self, run_id: str, folder: Path, earlier: Sequence[RunEvent] = ()) -> None:
        self.run_id = run_id
        self._events = list(earlier)
        self._file = EventFile(folder / FILE_NAME)
        self._changed = Broadcast()
        self._ended = False
        self._listener: Told | None = None

    @classmethod
    def reopen(cls, run: RunRecord, folder: Path, told: "EventLog | None" = None) -> Self:
        """Go on with the events of a run that is over; raises OSError.

        `told` is their log where this daemon told them: a full disk may have kept some of them from the file.
        """
        earlier = past_events(run, folder) if told is None else told._events
        # The last line may be cut off, and an end may be missing that readers were told of.
        lines = "".join(event.model_dump_json() + "\n" for event in earlier)
        make_folder_durably(folder)
        write_durably(folder / FILE_NAME, lines.encode())
        return cls(run.id, folder, earlier)

    @property
    def events(self) -> Sequence[RunEvent]:
        """All events so far."""
        return tuple(self._events)

    def listen(self, listener: Told) -> None:
        """Call `listener` with each event from now on."""
        self._listener = listener

    def add(self, event: RunEvent) -> None:
        """Tell an event under the next number; what a solver says of a run that is over is dropped."""
        if self._ended:
            return
        self._ended = event.type == "finished"
        numbered = event.model_copy(update={"run_id": self.run_id, "sequence": len(self._events) + 1})
        self._events.append(numbered)
        self._file.append(numbered.model_dump_json())
        if self._listener is not None:
            self._listener(numbered)
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


def past_events(run: RunRecord, folder: Path) -> list[RunEvent]:
    """Return the events of a run that is over, with an end even if its daemon was killed before it told one."""
    events = read_events(folder)
    if not events or events[-1].type != "finished":
        end = Finished(
            run_id=run.id,
            sequence=len(events) + 1,
            time=run.ended_at or run.created_at,
            state=run.state,
            error=run.error,
            calibration_id=run.calibration_id,
        )
        events.append(end)
    return events


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
