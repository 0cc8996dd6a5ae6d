"""What keeps a rig from using its devices is said, with what to do about it."""

import json
from pathlib import Path
from typing import Any

import pytest

from daemon.cli import doctor as command
from daemon.cli.main import main
from daemon.doctor import Problem, examine
from daemon.profile import Profile, load_profile
from drivers.discovery.machine import Machine
from tests.drivers.discovery.trees import Tree

PORT = "usb-1a86_USB_Serial-if00-port0"
CAMERA = "usb-Acme_Camera_0123-video-index0"


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path / "machine")


@pytest.fixture
def table() -> Profile:
    return load_profile("grbl-table")


@pytest.fixture
def head() -> Profile:
    return load_profile("cia402-pan-tilt")


def problems(tree: Tree, profile: Profile | None = None) -> list[Problem]:
    return list(examine(tree.machine, profile).problems)


def test_the_shipped_profiles_name_the_devices_that_these_tests_plug_in(table: Profile) -> None:
    wanted = examine(Machine(Path("/nowhere")), table).expected
    assert [(want.device, want.kind, want.address) for want in wanted] == [
        ("controller 'table'", "serial port", f"/dev/serial/by-id/{PORT}"),
        ("camera 'eye'", "camera", f"/dev/v4l/by-id/{CAMERA}"),
    ]


def test_a_rig_whose_devices_are_there_has_no_problems(tree: Tree, table: Profile) -> None:
    tree.serial_port("ttyUSB0", by_id=PORT)
    tree.camera("video0", by_id=CAMERA)
    assert problems(tree, table) == []


def test_devices_that_are_not_there_are_named_beside_those_that_are(tree: Tree, table: Profile) -> None:
    tree.serial_port("ttyUSB0", by_id="usb-Other-if00")
    assert problems(tree, table) == [
        Problem(
            "controller 'table'",
            f"serial port /dev/serial/by-id/{PORT} is not there",
            "plug it in, or name one of /dev/serial/by-id/usb-Other-if00 in the profile",
        ),
        Problem("camera 'eye'", f"camera /dev/v4l/by-id/{CAMERA} is not there", "plug it in"),
    ]


def test_a_port_that_others_may_open_wants_its_group(tree: Tree, table: Profile) -> None:
    tree.serial_port("ttyUSB0", by_id=PORT, mode=0o600)
    tree.camera("video0", by_id=CAMERA)
    [problem] = problems(tree, table)
    assert problem.problem == "/dev/ttyUSB0 may not be opened by this user"
    assert problem.remedy.startswith("sudo usermod -aG ")
    assert [problem.device for problem in problems(tree)] == ["/dev/ttyUSB0"]


def test_a_device_that_is_held_names_its_holder(tree: Tree, table: Profile) -> None:
    tree.process(77, "ModemManager", tree.serial_port("ttyUSB0", by_id=PORT))
    tree.camera("video0", by_id=CAMERA)
    [problem] = problems(tree, table)
    assert problem.device == "controller 'table'"
    assert problem.problem == "/dev/ttyUSB0 is held by 'ModemManager' (process 77)"
    assert problems(tree) == []


def test_a_node_of_another_kind_is_told_of(tree: Tree, table: Profile) -> None:
    tree.serial_port("ttyUSB0", by_id=PORT)
    tree.camera("video1", index=1, by_id=CAMERA)
    [problem] = problems(tree, table)
    assert problem.problem == f"/dev/v4l/by-id/{CAMERA} is no camera"


def test_a_bus_that_is_down_or_missing_is_told_how_to_bring_up(tree: Tree, head: Profile) -> None:
    tree.camera("video0", by_id=CAMERA)
    [missing] = problems(tree, head)
    assert (missing.device, missing.problem) == ("controller 'head'", "CAN interface can0 is not there")
    tree.interface("can0", 280, 0x40080, "gs_usb")
    [down] = problems(tree, head)
    assert down.problem == "CAN interface can0 is down"
    assert down.remedy.startswith("sudo ip link set can0 up type can bitrate ")
    assert [problem.device for problem in problems(tree)] == ["can0"]
    tree.write("sys/class/net/can0/flags", "0x400c1")
    assert problems(tree, head) == []


def run(monkeypatch: pytest.MonkeyPatch, tree: Tree, *arguments: str) -> int:
    monkeypatch.setattr(command, "Machine", lambda: tree.machine)
    with pytest.raises(SystemExit) as end:
        main(["doctor", *arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


def test_without_hardware_there_is_nothing_wrong_and_that_is_said(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, tree) == 0
    assert capsys.readouterr().out.splitlines() == [
        "Serial ports: none",
        "CAN interfaces: none",
        "Cameras: none",
        "No problems were found.",
    ]


def test_the_command_lists_devices_and_problems_in_words_and_as_json(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tree.process(77, "cat", tree.serial_port("ttyUSB0", by_id=PORT))
    tree.interface("can0", 280, 0x41, "gs_usb")
    assert run(monkeypatch, tree, "grbl-table") == 1
    assert capsys.readouterr().out.splitlines() == [
        "Serial ports",
        "  /dev/ttyUSB0, USB 1a86:7523 Acme Board, driver ch341-uart",
        f"      /dev/serial/by-id/{PORT}",
        "      held by 'cat' (process 77)",
        "CAN interfaces",
        "  can0 (gs_usb), up",
        "Cameras: none",
        "The profile wants",
        f"  controller 'table': serial port /dev/serial/by-id/{PORT}",
        f"  camera 'eye': camera /dev/v4l/by-id/{CAMERA}",
        "controller 'table': /dev/ttyUSB0 is held by 'cat' (process 77)",
        "  end it, unless it is the daemon that serves this profile",
        f"camera 'eye': camera /dev/v4l/by-id/{CAMERA} is not there",
        "  plug it in",
    ]
    assert run(monkeypatch, tree, "grbl-table", "--json") == 1
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert document["serial_ports"][0]["holders"] == [{"pid": 77, "name": "cat"}]
    assert document["can_interfaces"] == [{"name": "can0", "up": True, "driver": "gs_usb"}]
    assert document["cameras"] == []
    assert [problem["device"] for problem in document["problems"]] == ["controller 'table'", "camera 'eye'"]


def test_a_simulated_rig_wants_nothing_of_this_machine(tree: Tree) -> None:
    assert examine(tree.machine, load_profile("paper-table")).expected == []
