"""What everybody who has the page open is told of the rig: made and encoded once for all of them."""

import asyncio
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from typing import Final, Literal, Self

from pydantic import BaseModel, Field

from daemon.api.rig_documents import RigDocument
from daemon.api.runs import RunDocument
from daemon.service import Service

PERIOD: Final = 0.1
"""Seconds between two looks at the rig."""
SILENCE: Final = 10
"""Looks without a change after which the state is sent all the same: who hears nothing for longer knows that the
daemon is gone."""


class StateDocument(BaseModel):
    """All that changes while nobody does anything."""

    type: Literal["state"] = "state"
    time: datetime = Field(description="Now, by the daemon's clock.")
    version: str = Field(examples=["0.1.0"])
    rig: RigDocument
    run: RunDocument | None = Field(description="The run under way, or the last one since the daemon began.")
    problems: list[str] = Field(description="Sentences on what keeps the daemon from doing all of its work.")

    @classmethod
    def of(cls, service: Service) -> Self:
        """Describe what is now."""
        run = service.runs.latest
        return cls(
            time=datetime.now(UTC),
            version=service.version,
            rig=RigDocument.of(service),
            run=None if run is None else RunDocument.of(run.record),
            problems=service.problems,
        )


class LiveState:
    """The states of one service. Whoever follows them is served by the same look at the same moment."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._look = -SILENCE
        self._sent = -SILENCE
        self._state: StateDocument | None = None
        self._text = ""

    async def follow(self) -> AsyncIterator[str]:
        """Yield the state now, and whenever it has changed; who asks for the next one late gets the newest."""
        loop, told = asyncio.get_running_loop(), None
        while True:
            text = self._at(int(loop.time() / PERIOD))
            if text is not told:
                told = text
                yield text
            await asyncio.sleep(PERIOD - loop.time() % PERIOD)

    def _at(self, look: int) -> str:
        """Return the state to be told at this look, which is the same text for all who ask."""
        if look != self._look:
            self._look = look
            state = StateDocument.of(self._service)
            if look - self._sent >= SILENCE or self._differs(state):
                self._sent, self._state, self._text = look, state, state.model_dump_json()
        return self._text

    def _differs(self, state: StateDocument) -> bool:
        """Whether more has changed than the time."""
        before = self._state
        if before is None:
            return True
        rig = state.rig.model_copy(update={"age_s": before.rig.age_s})
        return state.model_copy(update={"time": before.time, "rig": rig}) != before
