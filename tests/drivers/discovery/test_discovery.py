"""Devices are found with their names, identities, permissions and holders."""

import grp
import os
from pathlib import Path

import pytest

from drivers.discovery.cameras import cameras
from drivers.discovery.can_interfaces import CanInterface, can_interfaces
from drivers.discovery.machine import Machine
from drivers.discovery.node import Holder, UsbIdentity
from drivers.discovery.serial_ports import serial_ports
from tests.drivers.discovery.trees import Tree


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path)


def test_a_machine_without_devices_has_none(tree: Tree) -> None:
    assert serial_ports(tree.machine) == []
    assert can_interfaces(tree.machine) == []
    assert cameras(tree.machine) == []


def test_this_machine_can_be_looked_at() -> None:
    here = Machine()
    assert all(port.path.startswith("/dev/") for port in serial_ports(here))
    assert all(camera.node.path.startswith("/dev/video") for camera in cameras(here))
    assert "lo" not in [interface.name for interface in can_interfaces(here)]


def test_a_serial_port_has_its_lasting_name_its_identity_and_its_driver(tree: Tree) -> None:
    tree.serial_port("ttyUSB0", by_id="usb-Acme_Board-if00-port0")
    [port] = serial_ports(tree.machine)
    assert port.path == "/dev/ttyUSB0"
    assert port.names == ("/dev/serial/by-id/usb-Acme_Board-if00-port0",)
    assert port.usb == UsbIdentity("1a86", "7523", "Acme", "Board", None)
    assert port.driver == "ch341-uart"


def test_of_two_adapters_that_share_a_name_by_id_one_has_a_name_by_path_alone(tree: Tree) -> None:
    for name in "ttyUSB0", "ttyUSB1":
        node = tree.serial_port(name)
        tree.link(f"dev/serial/by-path/pci-usb-{name[-1]}", node)
    tree.link(
        "dev/serial/by-id/usb-Acme", tree.root / "dev/ttyUSB1"
    )  # where the later one's link took its place
    first, second = serial_ports(tree.machine)
    assert first.names == ("/dev/serial/by-path/pci-usb-0",)
    assert second.names == ("/dev/serial/by-id/usb-Acme", "/dev/serial/by-path/pci-usb-1")


def test_terminals_and_ports_that_no_mainboard_has_are_none(tree: Tree) -> None:
    tree.write("sys/class/tty/tty0/dev", "4:0")
    tree.node("tty0")
    tree.serial_port("ttyS0")
    tree.write("sys/class/tty/ttyS0/type", "0\n")
    tree.serial_port("ttyS1")
    tree.write("sys/class/tty/ttyS1/type", "4\n")
    assert [port.path for port in serial_ports(tree.machine)] == ["/dev/ttyS1"]


@pytest.mark.parametrize(
    ("mode", "groups", "uid", "may"),
    [
        (0o660, [os.getgid()], 4242, True),
        (0o660, [], 4242, False),
        (0o666, [], 4242, True),
        (0o640, [os.getgid()], 4242, False),
        (0o600, [], os.getuid(), True),
        (0o000, [], 0, True),
    ],
)
def test_who_may_open_a_port(tree: Tree, mode: int, groups: list[int], uid: int, may: bool) -> None:
    tree.serial_port("ttyACM0", mode=mode)
    [port] = serial_ports(Machine(tree.root, uid, frozenset(groups)))
    assert port.may_open == may
    assert port.group == grp.getgrgid(os.getgid()).gr_name


def test_who_holds_a_port_is_named_by_whatever_name_it_was_opened(tree: Tree) -> None:
    node = tree.serial_port("ttyACM0", by_id="usb-Acme")
    other = tree.serial_port("ttyACM1")
    tree.process(12, "brltty", other, tree.root / "dev/serial/by-id/usb-Acme")
    tree.process(34, "bash")
    tree.write("proc/56/comm", "somebody else's")
    tree.write("proc/uptime", "1 1")
    first, second = serial_ports(tree.machine)
    assert first.path == f"/dev/{node.name}"
    assert first.holders == second.holders == (Holder(12, "brltty"),)


def test_can_interfaces_are_told_from_other_networks(tree: Tree) -> None:
    tree.interface("can0", 280, 0x40080, "gs_usb")
    tree.interface("eth0", 1, 0x1003)
    tree.interface("vcan0", 280, 0xC1)
    assert can_interfaces(tree.machine) == [
        CanInterface("can0", False, "gs_usb"),
        CanInterface("vcan0", True, None),
    ]


def test_a_camera_is_its_node_that_gives_pictures(tree: Tree) -> None:
    tree.camera("video0", by_id="usb-Acme_Camera-video-index0")
    tree.camera("video1", index=1)
    tree.write("sys/class/video4linux/v4l-subdev0/index", "0")
    [camera] = cameras(tree.machine)
    assert camera.label == "Acme Camera"
    assert camera.node.path == "/dev/video0"
    assert camera.node.names == ("/dev/v4l/by-id/usb-Acme_Camera-video-index0",)
    assert camera.node.driver == "uvcvideo"
    assert camera.formats == ()  # a file tells none
