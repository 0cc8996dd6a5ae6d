"""What is set on a V4L2 camera is read back; what it does not obey is told of, or refused."""

from collections.abc import Mapping

import pytest

from drivers.camera import CameraSpec
from drivers.driver import Cautious
from drivers.errors import OptionsError
from drivers.video.v4l2_node import Control
from tests.drivers.video.captures import WEBCAM, FakeNode
from tests.drivers.video.v4l2_rigs import Rig


async def test_a_width_alone_does_nothing_so_that_the_height_is_set_after_it() -> None:
    rig = Rig(spec=CameraSpec("eye", 1280, 720))
    async with rig.open() as camera:
        assert (await camera.frame()).image.shape == (720, 1280, 3)


async def test_a_size_that_the_camera_does_not_have_is_an_error() -> None:
    rig = Rig(spec=CameraSpec("eye", 999, 720))
    with pytest.raises(OptionsError, match=r"gives pictures of 1280 x 720 and was asked for 999 x 720"):
        await rig.camera.open()


async def test_rate_format_and_buffers_that_are_not_obeyed_are_told_of() -> None:
    rig = Rig(frame_rate="50 Hz", pixel_format="MJPG", buffers=1)
    rig.capture.obeys_rate = rig.capture.obeys_format = rig.capture.obeys_buffers = False
    async with rig.open() as camera:
        warnings = list(camera.warnings)
    assert [warning.split(": ")[0] for warning in warnings] == [
        "camera 'eye' gives pictures as YUYV and was asked for MJPG",
        "camera 'eye' gives 100 frames a second and was asked for 50",
        "camera 'eye' keeps 4 frames waiting and was asked for 1",
    ]


async def test_nothing_is_told_of_a_camera_that_obeys() -> None:
    rig = Rig(frame_rate="50 Hz", pixel_format="MJPG", buffers=1, controls={"gain": 12})
    async with rig.open() as camera:
        assert isinstance(camera, Cautious)
        assert list(camera.warnings) == []
    assert rig.capture.rate == 50.0
    assert rig.node.values["gain"] == 12


async def test_what_the_camera_does_by_itself_is_switched_off_before_anything_is_set() -> None:
    rig = Rig(exposure="8 ms", controls={"focus_absolute": 40})
    async with rig.open() as camera:
        assert (await camera.frame()).exposure == pytest.approx(0.008)
    values = rig.node.values
    assert values["auto_exposure"] == 1
    assert values["exposure_time_absolute"] == 80
    assert values["focus_automatic_continuous"] == values["white_balance_automatic"] == 0
    assert values["focus_absolute"] == 40
    switches = ("auto_exposure", "focus_automatic_continuous", "white_balance_automatic")
    assert sorted(rig.node.order[:3]) == sorted(switches)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("auto_exposure", "sets its exposure by itself"),
        ("focus_automatic_continuous", "focuses by itself, which moves the lens that is being calibrated"),
        ("white_balance_automatic", "sets its white balance by itself"),
    ],
)
async def test_what_cannot_be_switched_off_is_told_of(name: str, sentence: str) -> None:
    rig = Rig()
    rig.node.stuck.add(name)
    async with rig.open() as camera:
        warnings = list(camera.warnings)
    assert len(warnings) == 1
    assert sentence in warnings[0]
    assert f"cannot be kept from it ({name})" in warnings[0]


async def test_automatic_gain_cannot_be_switched_off() -> None:
    gain = {"gain_automatic": (Control(0x00980912, "gain_automatic", 0, 1, 1), 1)}
    rig = Rig(node=FakeNode(gain | WEBCAM))
    rig.node.failing.add("gain_automatic")
    async with rig.open() as camera:
        assert ["gain by itself" in warning for warning in camera.warnings] == [True]


async def test_what_the_profile_leaves_on_is_told_of() -> None:
    rig = Rig(exposure=None, controls={"auto_exposure": 3})
    async with rig.open() as camera:
        assert list(camera.warnings) == [
            "camera 'eye' sets its exposure by itself, so that pictures are blurred and bright as it likes, "
            "as the profile asks (auto_exposure)"
        ]


async def test_a_control_that_is_not_obeyed_is_told_of() -> None:
    rig = Rig(controls={"gain": 12})
    rig.node.stuck.add("gain")
    async with rig.open() as camera:
        assert "camera 'eye' has gain at 30 and was asked for 12" in camera.warnings[0]


@pytest.mark.parametrize(
    ("controls", "message"),
    [
        ({"gain": 300}, r"cannot have gain at 300: its range is 0 to 255"),
        ({"zoom": 1}, r"has no control 'zoom': it has auto_exposure, exposure_time_absolute, gain"),
    ],
)
async def test_a_control_that_would_be_clamped_or_is_not_there_is_an_error(
    controls: Mapping[str, int], message: str
) -> None:
    rig = Rig(controls=controls)
    with pytest.raises(OptionsError, match=message):
        await rig.camera.open()
    assert rig.capture.released == rig.node.closed == 1
