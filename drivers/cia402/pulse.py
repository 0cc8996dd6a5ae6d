"""Whether a drive lives: a dead node stays "operational" in the library, so that its heartbeat is timed here."""

from typing import Final

from drivers.clock import Clock

_SECOND_LOOK: Final = 0.1
"""Seconds from the first look that finds a node silent to the one that counts: a program that was held up has its
frames still to hear."""
_BOOT_UP: Final = 0
_OPERATIONAL: Final = 5


class Pulse:
    """The heartbeat of one node, from its boot-up on. `hear` is called in the thread that receives."""

    def __init__(self, clock: Clock, silence: float) -> None:
        """`silence` (s): without a heartbeat for that long, a node is lost."""
        self._clock = clock
        self._silence = silence
        self._lost: str | None = None
        self._started = False
        self._beats = False
        self._heard_at = 0.0
        self._missed_at: float | None = None

    @property
    def beats(self) -> bool:
        """Whether the node has said that it works, since it was told to."""
        return self._beats

    @property
    def lost(self) -> str | None:
        """What became of the node, as the end of a sentence; None while all is well."""
        if self._lost is not None:
            return self._lost
        now = self._clock.now()
        silent = now - self._heard_at
        if not self._beats or silent <= self._silence:
            return None
        if self._missed_at is None:
            self._missed_at = now
        if now - self._missed_at < _SECOND_LOOK:
            return None
        return f"has sent no heartbeat for {silent:.1f} s: check its power and its cable"

    def start(self) -> None:
        """Expect the node to work from now on; what it said before is of before."""
        self._heard_at, self._started = self._clock.now(), True

    def hear(self, state: int) -> None:
        """Take in a heartbeat with the node's NMT state."""
        self._heard_at, self._missed_at = self._clock.now(), None
        if state == _BOOT_UP:
            self._lost = "was switched on or reset, and no longer knows where it is: home it again"
        elif state == _OPERATIONAL:
            self._beats = self._started
        elif self._beats and self._lost is None:
            self._lost = f"has left the operational state (it is in NMT state {state}): open it again"
