"""What systemd is told, and a watchdog that starves when the daemon hangs."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from daemon.operation.supervisor import Supervisor
from tests.daemon.rigs import write_profile

SECOND = "1000000"


def listen(address: str) -> socket.socket:
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listening.bind(address.replace("@", "\0"))
    listening.settimeout(60)
    return listening


def told(listening: socket.socket) -> dict[str, str]:
    return dict(line.split("=", 1) for line in listening.recv(4096).decode().splitlines())


@pytest.fixture(params=["file", "abstract"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return str(tmp_path / "notify") if request.param == "file" else f"@activecam-{os.getpid()}-{id(request)}"


def test_it_is_told_in_its_own_words(address: str) -> None:
    with listen(address) as listening:
        Supervisor.of({"NOTIFY_SOCKET": address}).tell(READY="1", STATUS="two\nlines")
        assert told(listening) == {"READY": "1", "STATUS": "two lines"}


def test_nobody_need_listen(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    Supervisor.of({}).tell(READY="1")
    assert not caplog.records
    Supervisor.of({"NOTIFY_SOCKET": str(tmp_path / "gone")}).tell(READY="1")
    assert "does not take what the daemon tells" in caplog.text


async def test_the_watchdog_is_fed_until_something_hangs(
    address: str, caplog: pytest.LogCaptureFixture
) -> None:
    environment = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "3000", "WATCHDOG_PID": str(os.getpid())}
    hung: list[str] = []
    with listen(address) as listening:
        feeding = asyncio.create_task(Supervisor.of(environment).feed(lambda: hung))
        for _ in range(3):
            assert await asyncio.to_thread(told, listening) == {"WATCHDOG": "1"}
        hung.append("the driver of controller 'head' has hung for 31 s")
        while (last := await asyncio.to_thread(told, listening)) == {"WATCHDOG": "1"}:
            pass
        assert last == {"STATUS": hung[0]}
        await asyncio.sleep(0.02)  # some feeds' time, in which there is none
        listening.setblocking(False)
        with pytest.raises(BlockingIOError):
            listening.recv(4096)
        listening.settimeout(60)
        hung.clear()
        assert await asyncio.to_thread(told, listening) == {"WATCHDOG": "1"}
        feeding.cancel()
        await asyncio.gather(feeding, return_exceptions=True)
    assert caplog.text.count("the watchdog is not fed any more: the driver of controller 'head'") == 1


@pytest.mark.parametrize(
    "environment",
    [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "x"}, {"WATCHDOG_USEC": "9", "WATCHDOG_PID": "1"}],
)
async def test_there_may_be_no_watchdog_of_ours(environment: dict[str, str]) -> None:
    await asyncio.wait_for(Supervisor.of(environment).feed(list), 60)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_daemon_tells_of_its_beginning_and_its_end(tmp_path: Path, number: signal.Signals) -> None:
    address = str(tmp_path / "notify")
    command = [sys.executable, "-c", "from daemon.cli import main; main()", "serve", "--port", "0"]
    command += ["--profile", str(write_profile(tmp_path)), "--data", str(tmp_path / "data")]
    with listen(address) as listening:
        environment = os.environ | {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": SECOND}
        environment.pop("WATCHDOG_PID", None)
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as daemon:
            states = [told(listening)]
            while states[-1] != {"WATCHDOG": "1"}:
                states.append(told(listening))
            daemon.send_signal(number)
            while "STOPPING" not in states[-1]:
                states.append(told(listening))
            assert daemon.wait() == 0
    assert states[0] == {"STATUS": "opening the devices"}
    assert states[1]["READY"] == "1"
    assert states[1]["STATUS"].startswith("serving 'small-rig' at http://127.0.0.1:")
    assert states[-1] == {"STOPPING": "1", "STATUS": "stopping the axes"}
