"""The line protocol: a line and its ok, `?` and its report, resets and alarms at any time.

Lines are sent one at a time, each after the answer to the one before: the controller's buffer of 128 bytes
overflows without a word. Real-time bytes go past all of them.
"""

import asyncio
import contextlib
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeVar

from drivers.cancellation import finish
from drivers.clock import Clock
from drivers.errors import DeviceLostError, DriverError, MotionStoppedError
from drivers.grbl import words
from drivers.grbl.options import GrblOptions
from drivers.grbl.port import SerialPort
from drivers.grbl.status import Report, ReportReader

RESET: Final = b"\x18"
JOG_CANCEL: Final = b"\x85"
FEED_HOLD: Final = b"!"
_RETRY: Final = 1.0
"""Seconds between two resets of a controller that does not say who it is; a boot loader hears none."""
_OWN_BANNER: Final = 0.5
"""Seconds in which a controller restarts of itself after an alarm, if it does."""
_SLICES: Final = 20
_LONGEST: Final = 1024
"""Bytes without an end of line after which they are noise."""
Answer = TypeVar("Answer")
_BANNER = re.compile(r"Grbl(HAL)? \d", re.ASCII | re.IGNORECASE)


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
        self.farewell = JOG_CANCEL
        """What is sent when the link is given up, in case that the controller still listens."""
        self._options = options
        self._clock = clock
        self._alarmed = alarmed
        self._restarted = restarted
        self._reader = ReportReader()
        self._port: SerialPort | None = None
        self._lost = f"the controller at {options.port} is not open: open it first"
        self._release: asyncio.Task[None] | None = None
        """Closes a port that was lost."""
        self._unread = bytearray()
        self._heard_any = False
        self._opening = False
        self._ready = asyncio.Event()
        """Cleared from a reset or an alarm until the controller has said who it is."""
        self._revival: asyncio.Task[None] | None = None
        self._one_at_a_time = asyncio.Lock()
        self._request: _Request | None = None
        self._asking = asyncio.Lock()
        self._next_report: asyncio.Task[tuple[Report, float]] | None = None
        self._report: asyncio.Future[Report] | None = None
        self._asked_at = -float("inf")

    async def open(self) -> None:
        """Open the port, restart the controller and hear who it is. Raises DeviceLostError."""
        await self.close()
        port = SerialPort(self._options.port, self._options.baud_rate, self._hear, self._lose)
        await port.open()
        self._port, self._opening, self._heard_any = port, True, False
        self._unread.clear()
        self._ready.clear()
        try:
            async with asyncio.timeout(self._options.start_timeout):
                while not self._ready.is_set():
                    self._write(RESET)
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(_RETRY):
                            await self._ready.wait()
        except TimeoutError:
            self._lose(
                f"what is at {self._options.port} does not speak as Grbl does: check the port and 'baud_rate'"
                if self._heard_any
                else f"nothing at {self._options.port} says that it is Grbl: check the controller's power"
            )
        except BaseException:
            await finish(self.close())
            raise
        finally:
            self._opening = False
        self._require_open()

    async def close(self) -> None:
        """Let the port go."""
        if self._port is not None:
            self._lose(f"the controller at {self._options.port} is not open: open it first")
        if self._release is not None:
            await asyncio.wait([self._release])

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
            self._write(byte)

    def reset(self) -> None:
        """Restart the controller; whatever it says before its banner is of the past."""
        self._write(RESET)
        self._interrupt()
        self._ready.clear()
        self._revive(self._options.answer_timeout, "does not come back from a reset")

    async def settled(self) -> None:
        """Return when the line under way, if any, is answered."""
        async with self._one_at_a_time:
            pass

    async def _exchange(self, line: str, patience: float, halts: int | None) -> list[str]:
        async with self._one_at_a_time:
            await self._wait_until_ready()
            if halts is not None and halts != self.halts:
                raise MotionStoppedError(f"'{line}' was not sent, because of a stop")
            request = self._request = _Request(line, asyncio.get_running_loop().create_future())
            try:
                self._write(f"{line}\n".encode())
                await _within(patience, request.answered)
            except TimeoutError:
                self._lose(self._silent(patience))
                self._require_open()
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
        self._report = asyncio.get_running_loop().create_future()
        self._asked_at = self._clock.now()
        try:
            self._write(b"?")
            return await _within(self._options.answer_timeout, self._report), self._asked_at
        except TimeoutError:
            self._lose(self._silent(self._options.answer_timeout))
            raise self._gone() from None
        finally:
            self._report = None

    async def _wait_until_ready(self) -> None:
        self._require_open()
        await self._ready.wait()
        self._require_open()

    def _write(self, data: bytes) -> None:
        self._require_open()
        assert self._port is not None
        try:
            self._port.write(data)
        except DeviceLostError as error:
            self._lose(str(error))
            raise

    def _hear(self, data: bytes) -> None:
        self._heard_any = True
        self._unread.extend(data)
        *lines, rest = self._unread.split(b"\n")
        self._unread[:] = rest if len(rest) < _LONGEST else b""
        for line in lines:
            self._take(line.decode("ascii", "replace").strip())

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
        self._interrupt()
        self._ready.set()
        if not asked:
            self._restarted()

    def _take_alarm(self, number: str) -> None:
        alarm = int(number) if re.fullmatch(r"\d{1,3}", number, re.ASCII) else None
        self._alarmed(alarm)
        self._interrupt()
        self._ready.clear()
        if alarm in {1, 2}:
            self._quietly_write(RESET)  # it is deaf to everything else
            self._revive(self._options.answer_timeout, "does not come back from an alarm")
        else:
            self._revive(_OWN_BANNER, None)

    def _revive(self, patience: float, otherwise: str | None) -> None:
        """Wait for the banner; reset the controller where it does not come, and lose it after a reset."""

        async def wait() -> None:
            for again in (otherwise is None, False):
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(patience):
                        await self._ready.wait()
                        return
                if not again:
                    break
                self._quietly_write(RESET)
            self._lose(
                f"the controller at {self._options.port} {otherwise or 'does not come back from an alarm'}: "
                "switch it off and on"
            )

        if self._revival is not None:
            self._revival.cancel()
        self._revival = asyncio.ensure_future(wait())

    def _interrupt(self) -> None:
        """End whatever waits for an answer that will not come."""
        self._fail(RestartedError("the controller has restarted"))

    def _fail(self, error: Exception) -> None:
        if self._report is not None and not self._report.done():
            self._report.set_exception(error)
        if self._request is not None and not self._request.answered.done():
            self._request.answered.set_exception(error)

    def _lose(self, reason: str) -> None:
        """Believe nothing any more."""
        port, self._port = self._port, None
        if port is None:
            return
        self._lost = reason
        with contextlib.suppress(DriverError):
            port.write(self.farewell)
        if self._revival is not None:
            self._revival.cancel()
        self._fail(self._gone())
        self._ready.set()  # whoever waits for it finds that the link is gone
        self._release = asyncio.ensure_future(port.close())

    def _quietly_write(self, data: bytes) -> None:
        with contextlib.suppress(DriverError):
            self._write(data)

    def _silent(self, seconds: float) -> str:
        return (
            f"the controller at {self._options.port} has not answered for {seconds:g} s: "
            "check its power and its cable"
        )

    def _require_open(self) -> None:
        if self._port is None:
            raise self._gone()

    def _gone(self) -> DeviceLostError:
        return DeviceLostError(self._lost)


async def _within(patience: float, answer: "asyncio.Future[Answer]") -> Answer:
    """Return an answer that comes within `patience` seconds. Raises TimeoutError.

    They pass in slices, so that a time in which this program itself was held up is not laid to the controller.
    """
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
