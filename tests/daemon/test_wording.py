"""A device is named once in a sentence on it, whoever else had named it."""

import pytest

from daemon.rig.wording import because, unconfirmed


@pytest.mark.parametrize(
    ("device", "why", "sentence"),
    [
        (
            "camera 'eye'",
            "camera 'eye': /dev/video0 has gone: plug it in again",
            "camera 'eye' is lost: /dev/video0 has gone: plug it in again",
        ),
        (
            "camera 'eye'",
            "camera 'eye' has delivered no new frame for 2 s: check its cable",
            "camera 'eye' is lost: it has delivered no new frame for 2 s: check its cable",
        ),
        (
            "axis 'pan'",
            "controller 'head' is lost: axis 'pan': the drive at node 1 does not answer",
            "axis 'pan' is lost: controller 'head' is lost: the drive at node 1 does not answer",
        ),
        (
            "axis 'pan'",
            "controller 'head' is lost: axis 'tilt': the drive at node 2 does not answer",
            "axis 'pan' is lost: controller 'head' is lost: axis 'tilt': the drive at node 2 does not answer",
        ),
        (
            "controller 'table'",
            "the port /dev/ttyUSB0 is gone: plug it in again",
            "controller 'table' is lost: the port /dev/ttyUSB0 is gone: plug it in again",
        ),
    ],
)
def test_a_device_is_named_once(device: str, why: str, sentence: str) -> None:
    assert because(device, "is lost", why) == sentence


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("", ": the port is gone; axis 'tilt' does not answer"),
        ("axis 'pan' cannot be read: the port is gone", ": axis 'tilt' does not answer"),
        ("the port is gone; axis 'tilt' does not answer", ""),
    ],
)
def test_why_a_standstill_is_not_confirmed_is_said_once(said: str, why: str) -> None:
    assert unconfirmed(["the port is gone", "axis 'tilt' does not answer"], said) == (
        f"a stop was sent, but a standstill could not be confirmed{why}; look at the rig before you go near it"
    )
