"""Positions at which the target was not found, looked at once more where the other views predict it.

A grid without numbers that is partly out of the picture is not found otherwise.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from calib.errors import CalibError
from calib.observations import Observation as ViewObservation
from calib.observations import observe
from calib.second_look import partly_seen
from calib.session import Session
from calib.session_writer import SessionWriter
from daemon.procedure.observation import Observation, Taken, find_where_predicted
from daemon.procedure.remarks import Remarks, Spot

MOST_KEPT = 8
"""Positions of a sweep whose frames are kept to be looked at again at its end."""

StoreView = Callable[[Observation, Spot], Awaitable[object]]
"""Puts a view on disk."""


@dataclass(frozen=True, slots=True)
class _Unseen:
    """Frames in which the target was not found, and why."""

    spot: Spot
    taken: Taken
    problem: str


class Unseen:
    """The positions of a sweep at which the target was not found, and what was seen at all others of the run."""

    def __init__(self, writer: SessionWriter, remarks: Remarks) -> None:
        self._writer = writer
        self._remarks = remarks
        self._seen: list[ViewObservation] = []
        self._forgotten = bool(writer.session.views)  # what an earlier part of the run saw
        self._kept: list[_Unseen] = []

    def know(self, seen: ViewObservation) -> None:
        """Predict by this view, too."""
        self._seen.append(seen)

    def keep(self, spot: Spot, taken: Taken, problem: str) -> None:
        """Look at these frames again at the end of the sweep; the earliest of too many is left out."""
        self._kept.append(_Unseen(spot, taken, problem))
        if len(self._kept) > MOST_KEPT:
            self._leave_out_first()

    async def look_again(self, store: StoreView) -> int:
        """Look for the target where it should be, `store` what is found, leave out the rest; return how many are found.

        `store` lets the view be known, so that what is found tells where to look in others.
        """
        if self._kept and self._forgotten:
            self._seen = await asyncio.to_thread(_observed_on_disk, self._writer.session)
            self._forgotten = False
        count, found = 0, True
        while found:
            found = False
            for unseen in list(self._kept):
                session, seen = self._writer.session, list(self._seen)
                try:
                    observation = await asyncio.to_thread(_where_predicted, unseen.taken, session, seen)
                except CalibError:
                    continue
                self._kept.remove(unseen)
                await store(observation, unseen.spot)
                self._remarks.tell(unseen.spot, partly_seen(observation.seen.detection, session.target))
                self._remarks.warn(observation, unseen.spot)
                count, found = count + 1, True
        while self._kept:
            self._leave_out_first()
        return count

    def _leave_out_first(self) -> None:
        unseen = self._kept.pop(0)
        self._remarks.leave_out(unseen.spot, unseen.problem)


def _observed_on_disk(session: Session) -> list[ViewObservation]:
    """Return what is seen in the pictures of all views, those of an earlier part of the run among them."""
    try:
        return observe(session).observations
    except CalibError:
        return []


def _where_predicted(taken: Taken, session: Session, seen: list[ViewObservation]) -> Observation:
    """Find the target where the views `seen` of `session` predict it; raises CalibError."""
    # It brings scipy, which a daemon that only serves poses does without.
    from calib.prediction import predicted_by_views

    predicted = predicted_by_views(session, seen, taken.readings)
    return find_where_predicted(taken, session.target, predicted)
