"""What keeps the daemon running is told how it does: systemd's protocol of `sd_notify`, and its watchdog."""

import asyncio
import logging
import os
import socket
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Self

logger = logging.getLogger(__name__)

FEEDS: Final = 3
"""How often the watchdog is fed in the time after which it bites."""


class Supervisor:
    """Whoever listens at `address`, a Unix socket; nobody where it is None. `patience` is its watchdog's (s)."""

    def __init__(self, address: str | None, patience: float | None) -> None:
        self._address = address
        self._patience = patience

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> Self:
        """Return the one that the environment names, as systemd sets it."""
        for_us = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        microseconds = environment.get("WATCHDOG_USEC", "")
        patience = (
            int(microseconds) / 1e6 if for_us and microseconds.isdecimal() and int(microseconds) else None
        )
        return cls(environment.get("NOTIFY_SOCKET") or None, patience)

    def tell(self, **state: str) -> None:
        """Send variables such as READY="1"; it is no error of ours when nobody takes them."""
        if self._address is None:
            return
        # A leading @ means an address that is no file (man 7 unix).
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        message = "\n".join(f"{name}={' '.join(value.splitlines())}" for name, value in state.items())
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            try:
                sender.sendto(message.encode(), address)
            except OSError as error:
                logger.warning("%s does not take what the daemon tells: %s", self._address, error)

    async def feed(self, hung: Callable[[], Sequence[str]]) -> None:
        """Feed the watchdog, if there is one, as long as the event loop comes round and nothing is `hung`."""
        if self._patience is None:
            return
        starving = False
        while True:
            sentences = hung()
            if not sentences:
                self.tell(WATCHDOG="1")
            elif not starving:
                logger.error("the watchdog is not fed any more: %s", "; ".join(sentences))
                self.tell(STATUS="; ".join(sentences))
            starving = bool(sentences)
            await asyncio.sleep(self._patience / FEEDS)
