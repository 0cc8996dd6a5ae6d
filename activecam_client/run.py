"""A calibration run, from its first event to its last."""

from collections.abc import Iterator

from activecam_client.connection import Connection
from activecam_client.documents import Event, RunRecord


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

    def cancel(self) -> RunRecord:
        """Stop it, and return when the axes stand."""
        return RunRecord.model_validate(
            self._connection.ask("POST", f"/runs/{self.id}/cancel", patience=None)
        )
