"""Servo drives that fail in the course of a run: the run fails with a sentence, and nothing moves afterwards."""

from pathlib import Path

import pytest

from drivers.emulators.cia402.emulator import Cia402Emulator
from tests.daemon.courses import Equipment, Faults, expect_failures

DRIVES = Equipment(
    driver="cia402",
    place="channel",
    options={"interface": "virtual", "heartbeat": "50 ms", "silence": "800 ms"},
    axes={"slide": {"node": 1}, "pan": {"node": 2}},
)
SILENT = r"does not answer|has sent no heartbeat for"
FAULTS: Faults = {
    "mute": (lambda drives: drives.mute("slide"), SILENT),
    "late": (lambda drives: drives.late("2.4"), SILENT),
    "heartbeat gone": (lambda drives: drives.stop_heartbeat("slide"), r"has sent no heartbeat for"),
    "emergency": (lambda drives: drives.fail("slide", "0x4310"), r"is too hot \(0x4310\)"),
    "stalled motor": (lambda drives: drives.stall("slide"), r"following error: the axis does not follow"),
    "bus off": (Cia402Emulator.go_off, r"has gone: its controller went off the bus"),
}


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_of_a_drive_ends_the_run_with_a_sentence(fault: str, tmp_path: Path) -> None:
    await expect_failures(DRIVES, FAULTS[fault], tmp_path)
