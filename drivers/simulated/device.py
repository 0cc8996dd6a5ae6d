"""The box that a simulated controller talks to: there or not, answering or not, in alarm or not."""

from collections.abc import Callable

from drivers.clock import Clock
from drivers.errors import DeviceLostError
from drivers.simulated.faults import DeviceFault


class Device:
    """State of the link and of the device behind it, shared by the device's axes."""

    def __init__(self, clock: Clock, answer_timeout: float) -> None:
        self.clock = clock
        self.fault: DeviceFault | None = None
        self._answer_timeout = answer_timeout
        self._opened = False
        self._reactions: list[Callable[[], None]] = []

    def on_power_loss(self, react: Callable[[], None]) -> None:
        """Have `react` called when the motors lose their power."""
        self._reactions.append(react)

    def connect(self) -> None:
        """Open the link; raises DeviceLostError where nothing is plugged in."""
        if self.fault == "lost":
            raise DeviceLostError("the simulated controller is not there: plug it in and open it again")
        self._opened = True

    def disconnect(self) -> None:
        """Let go of the link, whatever state it is in."""
        self._opened = False

    @property
    def opened(self) -> bool:
        """Whether there is a link to use."""
        return self._opened

    def fail(self, fault: DeviceFault) -> None:
        """Let the device go wrong until it is repaired."""
        self.fault = fault
        if fault == "lost":
            self._opened = False
        if fault in {"lost", "alarm"}:
            for react in self._reactions:
                react()

    def repair(self) -> None:
        """Undo the fault. A device that was lost has to be opened again."""
        self.fault = None

    def clear_alarm(self) -> None:
        """Leave the alarm, as homing does."""
        if self.fault == "alarm":
            self.fault = None

    async def answer(self, axis: str) -> None:
        """Wait for the device to answer on behalf of `axis`. Raises DeviceLostError when it does not."""
        if self.fault == "mute":
            await self.clock.sleep(self._answer_timeout)
        if self.fault == "late":
            await self.clock.sleep(0.9 * self._answer_timeout)
        if self.fault == "lost":
            raise DeviceLostError(
                f"axis '{axis}': the simulated controller has gone: plug it in and open it again"
            )
        if self.fault == "mute":
            raise DeviceLostError(
                f"axis '{axis}': the simulated controller has not answered for {self._answer_timeout:g} s: "
                "check its power and its cable"
            )
        if not self._opened:
            raise DeviceLostError(f"axis '{axis}': the simulated controller is not open: open it first")
