"""The dialogue: a line and its ok, `?` and its report, resets and alarms at any time.

Lines are sent one at a time, each after the answer to the one before: the controller's buffer of 128 bytes
overflows without a word. Real-time bytes go past all of them.
"""

import asyncio
import contextlib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeVar

from drivers.cancellation import finish
from drivers.clock import Clock
from drivers.errors import DeviceLostError, MotionStoppedError
from drivers.grbl import words
from drivers.grbl.options import GrblOptions
from drivers.grbl.status import Report, ReportReader
from drivers.grbl.wire import Wire

RESET: Final = b"\x18"
FEED_HOLD: Final = b"!"
_RETRY: Final = 1.0
"""Seconds between two resets of a controller that does not say who it is; a boot loader hears none."""
_OWN_BANNER: Final = 0.5
"""Seconds in which a controller restarts of itself after an alarm, if it does."""
_SLICES: Final = 20
"""Parts in which a time to wait passes, so that one in which this program was held up is not laid to the controller."""
_BANNER = re.compile(r"Grbl(HAL)? \d", re.ASCII | re.IGNORECASE)

Answer = TypeVar("Answer")


class RefusedError(Exception):
    """The controller answered `error:number` to a line."""

    def __init__(self, line: str, number: int) -> None:
        super().__init__(f"the controller refuses '{line}' with {words.refusal(number)}")
        self.number = number


class RestartedError(Exception):
    """The controller restarted before it answered."""


@dataclass(slots=True)
class _Request:
    line: str
    answered: "asyncio.Future[None]"
    lines: list[str] = field(default_factory=list)


class Link:
    """The line to one controller, from `open` to its loss or `close`.

    `alarmed` is called with the number of an alarm, `restarted` when the controller restarts unasked.
    """

    def __init__(
        self,
        options: GrblOptions,
        clock: Clock,
        alarmed: Callable[[int | None], None],
        restarted: Callable[[], None],
    ) -> None:
        self.halts = 0
        """How often something was told to stop."""
        self._options = options
        self._clock = clock
        self._alarmed = alarmed
        self._restarted = restarted
        self._wire = Wire(options, self._take, self._end)
        self._reader = ReportReader()
        self._opening = False
        self._ready = asyncio.Event()
        """Cleared from a reset or an alarm until the controller has said who it is."""
        self._revival: asyncio.Task[None] | None = None
        self._one_at_a_time = asyncio.Lock()
        self._request: _Request | None = None
        self._asking = asyncio.Lock()
        self._next_report: asyncio.Task[tuple[Report, float]] | None = None
        self._report: asyncio.Future[Report] | None = None
        self._asked_at = -math.inf

    async def open(self) -> None:
        """Open the port, restart the controller and hear who it is. Raises DeviceLostError."""
        await self._wire.open()
        self._opening = True
        self._ready.clear()
        try:
            left = self._options.start_timeout
            while left > 0 and not self._ready.is_set():
                self._wire.write(RESET)
                await self._is_ready_within(min(left, _RETRY))
                left -= _RETRY
        except BaseException:
            await finish(self.close())
            raise
        finally:
            self._opening = False
        if not self._ready.is_set():
            self._wire.lose(
                f"what is at {self._options.port} does not speak as Grbl does: check the port and 'baud_rate'"
                if self._wire.anything_heard
                else f"nothing at {self._options.port} says that it is Grbl: check the controller's power"
            )
        self._wire.require_open()

    async def close(self) -> None:
        """Let the port go."""
        await self._wire.close()

    async def ask(self, line: str, patience: float | None = None, halts: int | None = None) -> list[str]:
        """Send a line and return what the controller said before its ok, for which it has `patience` seconds.

        With `halts` it is not sent any more once something else was told to stop since `self.halts` was that.
        Raises RefusedError, RestartedError, MotionStoppedError and DeviceLostError.
        """
        return await finish(self._exchange(line, patience or self._options.answer_timeout, halts))

    async def status(self) -> tuple[Report, float]:
        """Return a report that was asked for after this was called, and when that was (rig's clock, s).

        Those who wait for the next report share it. Raises DeviceLostError.
        """
        if self._next_report is None:
            self._next_report = asyncio.ensure_future(self._ask_status())
            self._next_report.add_done_callback(_retrieve)
        return await asyncio.shield(self._next_report)

    def halt(self, byte: bytes) -> None:
        """Send a real-time byte that stops something, now; lines that are waiting to be sent are not any more."""
        self.halts += 1
        if byte == RESET:
            self.reset()
        else:
            self._wire.write(byte)

    def reset(self) -> None:
        """Restart the controller; whatever it says before its banner is of the past."""
        self._wire.write(RESET)
        self._fail(RestartedError("the controller has restarted"))
        self._ready.clear()
        self._revive(own=False)

    def give_up_by(self, byte: bytes) -> None:
        """Send this byte if the controller is lost: what stops what it does."""
        self._wire.farewell = byte

    async def settled(self) -> None:
        """Return when the line under way, if any, is answered."""
        async with self._one_at_a_time:
            pass

    async def _exchange(self, line: str, patience: float, halts: int | None) -> list[str]:
        async with self._one_at_a_time:
            await self._wait_until_ready()
            if halts is not None and halts != self.halts:
                raise MotionStoppedError(f"'{line}' was not sent, because of a stop")
            self._wire.write(f"{line}\n".encode())
            request = self._request = _Request(line, asyncio.get_running_loop().create_future())
            try:
                await _within(patience, request.answered)
            except TimeoutError:
                self._is_silent(patience)
            finally:
                self._request = None
            return request.lines

    async def _ask_status(self) -> tuple[Report, float]:
        async with self._asking:
            try:
                await self._clock.sleep(
                    max(0.0, self._asked_at + self._options.report_interval - self._clock.now())
                )
                while True:
                    await self._wait_until_ready()
                    # Whoever asks from here on wants a later one.
                    self._next_report = None
                    with contextlib.suppress(RestartedError):
                        return await self._ask_once()
            finally:
                self._next_report = None

    async def _ask_once(self) -> tuple[Report, float]:
        self._asked_at = self._clock.now()
        self._wire.write(b"?")
        self._report = asyncio.get_running_loop().create_future()
        try:
            return await _within(self._options.answer_timeout, self._report), self._asked_at
        except TimeoutError:
            self._is_silent(self._options.answer_timeout)
            raise
        finally:
            self._report = None

    async def _wait_until_ready(self) -> None:
        self._wire.require_open()
        await self._ready.wait()
        self._wire.require_open()

    def _take(self, line: str) -> None:
        if _BANNER.match(line):
            self._take_banner()
        elif self._opening or not line:
            pass
        elif line.startswith("ALARM:"):
            self._take_alarm(line.removeprefix("ALARM:"))
        elif not self._ready.is_set():
            pass  # a stale ok, or what else there was before the reset
        elif line.startswith("<"):
            report = self._reader.read(line)
            if report is not None and self._report is not None and not self._report.done():
                self._report.set_result(report)
        elif self._request is not None and not self._request.answered.done():
            self._take_answer(self._request, line)

    def _take_answer(self, request: _Request, line: str) -> None:
        if line == "ok":
            request.answered.set_result(None)
        elif re.fullmatch(r"error:\d+", line, re.ASCII):
            request.answered.set_exception(RefusedError(request.line, int(line.removeprefix("error:"))))
        else:
            request.lines.append(line)

    def _take_banner(self) -> None:
        asked = not self._ready.is_set()
        self._reader.forget()
        self._fail(RestartedError("the controller has restarted"))
        self._ready.set()
        if not asked:
            self._restarted()

    def _take_alarm(self, number: str) -> None:
        alarm = int(number) if re.fullmatch(r"\d{1,3}", number, re.ASCII) else None
        self._alarmed(alarm)
        self._fail(RestartedError("the controller is in alarm"))
        self._ready.clear()
        deaf = alarm in {1, 2}
        if deaf:
            self._wire.try_to_write(RESET)
        self._revive(own=not deaf)

    def _revive(self, *, own: bool) -> None:
        """Wait for the banner after a reset; with `own` the controller may restart of itself, or else is reset.

        It is lost where no banner comes after a reset.
        """

        async def wait() -> None:
            if own and not await self._is_ready_within(_OWN_BANNER):
                self._wire.try_to_write(RESET)
            if not await self._is_ready_within(self._options.answer_timeout):
                self._wire.lose(
                    f"the controller at {self._options.port} does not come back from a reset: switch it off and on"
                )

        if self._revival is not None:
            self._revival.cancel()
        self._revival = asyncio.ensure_future(wait())

    async def _is_ready_within(self, seconds: float) -> bool:
        for _ in range(_SLICES):
            if self._ready.is_set():
                break
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(seconds / _SLICES):
                    await self._ready.wait()
        return self._ready.is_set()

    def _fail(self, error: Exception) -> None:
        """End what waits for an answer that will not come."""
        if self._report is not None and not self._report.done():
            self._report.set_exception(error)
        if self._request is not None and not self._request.answered.done():
            self._request.answered.set_exception(error)

    def _end(self, error: DeviceLostError) -> None:
        if self._revival is not None:
            self._revival.cancel()
        self._fail(error)
        self._ready.set()  # whoever waits for it finds that the wire is gone

    def _is_silent(self, seconds: float) -> None:
        """Lose the controller, and raise DeviceLostError."""
        self._wire.lose(
            f"the controller at {self._options.port} has not answered for {seconds:g} s: "
            "check its power and its cable"
        )
        self._wire.require_open()


async def _within(patience: float, answer: "asyncio.Future[Answer]") -> Answer:
    """Return an answer that comes within `patience` seconds, which pass in slices. Raises TimeoutError."""
    for _ in range(_SLICES):
        done, _ = await asyncio.wait([answer], timeout=patience / _SLICES)
        if done:
            break
    else:
        answer.cancel()
        raise TimeoutError
    return answer.result()


def _retrieve(task: "asyncio.Task[tuple[Report, float]]") -> None:
    """Take note of an error that nobody waited for any more."""
    if not task.cancelled():
        task.exception()
