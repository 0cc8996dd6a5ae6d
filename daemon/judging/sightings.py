"""The target in the pictures of runs, looked for once however often it is asked for."""

import asyncio
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from calib.errors import CalibError, UnsolvableError
from calib.observations import Observation, Observed, observe
from calib.session import Session
from daemon.errors import SessionUnreadableError
from daemon.procedure.worker import in_worker

KEPT: Final = 4
"""Runs whose observations are kept in memory."""

Seen = Observation | str
"""What a picture shows, or why it shows nothing."""


class Sightings:
    """What the views of runs show. One thread looks at a time, and leaves the other cores to the daemon.

    A picture is known by its name, which a run never gives twice.
    """

    def __init__(self) -> None:
        self._runs: OrderedDict[str, dict[str, Seen]] = OrderedDict()
        self._looking = asyncio.Lock()

    def note(self, run_id: str, picture: str, seen: Observation) -> None:
        """Know what a run that is under way has found in a picture, as it would be found there again."""
        self._of_run(run_id)[picture] = seen

    async def of(self, run_id: str, session: Session) -> Observed:
        """Return what the views of `session`, of the run `run_id`, show; raises SessionUnreadableError."""
        async with self._looking:
            known = self._of_run(run_id)
            new = [number for number, view in enumerate(session.views) if view.image not in known]
            if new:
                known |= await in_worker(lambda: _look(session, new))
        observed = Observed([], {}, {})
        for number, view in enumerate(session.views):
            seen = known[view.image or ""]
            if isinstance(seen, str):
                observed.unseen[number] = seen
            else:
                observed.observations.append(replace(seen, view=number))
        return observed

    def _of_run(self, run_id: str) -> dict[str, Seen]:
        """Return what is known of a run's pictures, and forget the runs that nobody has asked of for longest."""
        known = self._runs.setdefault(run_id, {})
        self._runs.move_to_end(run_id)
        while len(self._runs) > KEPT:
            self._runs.popitem(last=False)
        return known


def _look(session: Session, numbers: Sequence[int]) -> dict[str, Seen]:
    """Return what the views of these numbers show, by their pictures' names."""
    names = {number: session.views[number].image or "" for number in numbers}
    try:
        observed = observe(session, only=numbers)
    except UnsolvableError as error:  # none of them shows the target
        return dict.fromkeys(names.values(), str(error))
    except (CalibError, OSError) as error:
        raise SessionUnreadableError(f"the run's views cannot be read: {error}") from error
    found: dict[str, Seen] = {names[o.view]: o for o in observed.observations}
    return found | {names[number]: why for number, why in observed.unseen.items()}
