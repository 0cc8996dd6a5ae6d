"""A calibration run, from its first event to its last."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from activecam_client.connection import Connection
from activecam_client.documents import Event, RunRecord, View
from activecam_client.lease import Lease


class Run:
    """A run that goes on in the daemon, whether anybody listens or not."""

    def __init__(self, connection: Connection, run_id: str) -> None:
        self.id = run_id
        self._connection = connection

    def record(self) -> RunRecord:
        """Return what the daemon keeps of it, as it stands."""
        return RunRecord.model_validate(self._connection.ask("GET", f"/runs/{self.id}"))

    def events(self, after: int = 0) -> Iterator[Event]:
        """Yield its events after the one numbered `after`, as they happen, to the last one, which is `finished`."""
        finished = False
        while not finished:
            for document in self._connection.events(f"/runs/{self.id}/events", after):
                event = Event.model_validate(document)
                yield event
                after, finished = event.sequence, event.type == "finished"

    def wait(self) -> RunRecord:
        """Return when it is over."""
        for _ in self.events():
            pass
        return self.record()

    def resume(self, lease: Lease | None = None) -> RunRecord:
        """Let it go on where it rests, or take it up where it was cut off; whoever holds the lease hands it over."""
        headers = None if lease is None else lease.headers
        return self._asked("resume", headers=headers)

    def solve(self, leave_out: Sequence[int] = ()) -> RunRecord:
        """Solve its views anew once it is over, without those numbered `leave_out`; see `wait` for what comes of it.

        What is found is the record's `calibration_id` then, and is not activated.
        """
        return self._asked("solve", {"leave_out": list(leave_out)})

    def views(self, calibration_id: str | None = None) -> list[View]:
        """Return its views, as a calibration of it says of them; its latest, or before there is one each by itself."""
        query = None if calibration_id is None else {"calibration": calibration_id}
        answer = self._connection.ask("GET", f"/runs/{self.id}/views", query=query)
        return [View.model_validate(view) for view in answer["views"]]

    def cancel(self) -> RunRecord:
        """Stop it, and return when the axes stand."""
        return self._asked("cancel")

    def _asked(
        self, what: str, body: Mapping[str, Any] | None = None, headers: Mapping[str, str] | None = None
    ) -> RunRecord:
        path = f"/runs/{self.id}/{what}"
        answer = self._connection.ask("POST", path, body, headers=headers, patience=None)
        return RunRecord.model_validate(answer)
