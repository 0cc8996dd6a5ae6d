"""Recorded pictures as a camera."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.camera import CameraSpec
from drivers.clock import SystemClock
from drivers.contract import CameraBench, CameraContract
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, OptionsError
from drivers.video.options import ReplayOptions
from drivers.video.replay import ReplayCamera

SPEC = CameraSpec("eye", 64, 48)


def shade(number: int) -> Any:
    return np.full((48, 64), 20 * number + 10, np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in range(5):
        cv2.imwrite(str(tmp_path / f"{number:04}.png"), shade(number))
    (tmp_path / ".hidden").write_text("no picture")
    return tmp_path


def replay(path: Path, **options: Any) -> ReplayCamera:
    whole = {"path": str(path), "frame_rate": "50 Hz"} | options
    return ReplayCamera.create(SPEC, ReplayOptions.model_validate(whole), DriverContext(SystemClock()))


class TestReplayContract(CameraContract):
    @pytest.fixture(autouse=True)
    def recorded(self, folder: Path) -> None:
        self.folder = folder

    def bench(self) -> CameraBench:
        def unplug() -> None:
            for path in self.folder.glob("*.png"):
                path.unlink()

        return CameraBench(replay(self.folder), SystemClock(), unplug)


async def order(camera: ReplayCamera, count: int) -> list[tuple[int, int]]:
    """Return what `count` frames show, and their numbers, by which those that were missed are told."""
    await camera.open()
    seen = []
    frame = None
    for _ in range(count):
        frame = await camera.frame(None if frame is None else float(np.nextafter(frame.timestamp, np.inf)))
        seen.append((round((float(frame.image.mean()) - 10) / 20), frame.sequence))
    await camera.close()
    return seen


async def test_a_folder_is_shown_in_the_order_of_its_names_again_and_again(folder: Path) -> None:
    seen = await order(replay(folder), 8)
    assert [shown for shown, _ in seen] == [number % 5 for _, number in seen]


async def test_pictures_are_grey_or_coloured_of_8_or_16_bits_as_they_were_recorded(folder: Path) -> None:
    for number in range(5):
        cv2.imwrite(str(folder / f"{number:04}.png"), np.full((48, 64), 40_000, np.uint16))
    camera = replay(folder)
    await camera.open()
    image = (await camera.frame()).image
    await camera.close()
    assert image.dtype == np.uint16
    assert image.shape == (48, 64)


async def test_a_video_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 48))
    for number in range(5):
        writer.write(cv2.cvtColor(shade(number), cv2.COLOR_GRAY2BGR))
    writer.release()
    seen = await order(replay(path), 8)
    assert [shown for shown, _ in seen] == [number % 5 for _, number in seen]


async def test_without_a_loop_it_ends(folder: Path) -> None:
    camera = replay(folder, loop=False)
    await camera.open()
    with pytest.raises(DeviceLostError, match=r"has ended"):
        await camera.frame(after=SystemClock().now() + 60)
    await camera.close()


async def test_a_picture_of_another_size_is_named(folder: Path) -> None:
    cv2.imwrite(str(folder / "0000.png"), np.zeros((10, 20), np.uint8))
    with pytest.raises(OptionsError, match=r"0000.png is 20 x 10 and the profile says 64 x 48"):
        await replay(folder).open()


@pytest.mark.parametrize("name", ["", "nothing"])
async def test_where_there_are_no_pictures_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(DeviceLostError, match=r"there are no pictures in"):
        await replay(tmp_path / name).open()


async def test_a_file_that_is_no_picture_is_named(folder: Path) -> None:
    (folder / "0000.png").write_text("nothing to see")
    with pytest.raises(DeviceLostError, match=r"0000.png is not a picture that OpenCV reads"):
        await replay(folder).open()
