"""The right to move, renewed in the background until it is given back."""

import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Self

from activecam_client.connection import Connection
from activecam_client.documents import Axis
from activecam_client.errors import ActivecamError, ProblemError


class Lease:
    """The motion lease, inside a `with` block; what it has set in motion is stopped at the block's end.

    A program that dies renews it no more, and is stopped when its time to live is over. Positions and distances are in
    each axis's reading unit. A motion returns when the axis stands at its target, and raises ProblemError where it does
    not get there.
    """

    def __init__(self, connection: Connection, owner: str, note: str, ttl: float) -> None:
        self._connection = connection
        self._request = {"owner": owner, "note": note, "ttl_s": ttl}
        self._period = ttl / 3
        self._token: str | None = None
        self._over = threading.Event()
        self._renewing = threading.Thread(target=self._renew, name="lease", daemon=True)

    def __enter__(self) -> Self:
        """Take the lease; raises ProblemError (`lease_held`) while somebody else has it."""
        self._token = self._connection.ask("POST", "/lease", self._request)["token"]
        self._renewing.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give it back, unless it is over or was handed to a run."""
        self._over.set()
        self._renewing.join()
        try:
            self._connection.ask("DELETE", "/lease", headers=self.headers)
        except ProblemError as problem:
            if problem.code not in {"lease_ended", "lease_held"}:
                raise

    @property
    def headers(self) -> dict[str, str]:
        """What a request shows to be allowed to move."""
        if self._token is None:
            raise RuntimeError("a lease is taken by `with`")
        return {"X-Lease": self._token}

    def home(self, axis: str) -> Axis:
        """Let an axis find its zero."""
        return Axis.model_validate(self._move(f"/axes/{axis}/home"))

    def move(self, targets: Mapping[str, float]) -> list[Axis]:
        """Move axes, by their names, to their targets all at once; none moves where one may not."""
        moved = self._move("/axes/move", {"targets": dict(targets)})
        return [Axis.model_validate(axis) for axis in moved]

    def jog(self, axis: str, distance: float) -> Axis:
        """Move an axis by a distance, homed or not."""
        return Axis.model_validate(self._move(f"/axes/{axis}/jog", {"distance": distance}))

    def _move(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        return self._connection.ask(
            "POST", path, body, query={"wait": "true"}, headers=self.headers, patience=None
        )

    def _renew(self) -> None:
        while not self._over.wait(self._period):
            # A lease that could not be renewed is told of by the next motion.
            with suppress(ActivecamError):
                self._connection.ask("POST", "/lease", self._request, headers=self.headers)
