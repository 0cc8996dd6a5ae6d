"""A profile's devices emulated: started together, obeying, and let go."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import pytest

from daemon.emulation import emulated
from daemon.profile import Profile, ProfileError, load_profile
from drivers.driver import DriverContext
from drivers.emulators import registry
from drivers.emulators.control import obey
from drivers.emulators.emulator import Emulator, Fault
from drivers.errors import DriverError, OptionsError
from tests.daemon.rigs import small_rig, write_profile


class Toy:
    """A device that does nothing but be there."""

    running: ClassVar[list[Self]] = []
    place: ClassVar[dict[str, object]] = {}

    def __init__(self, context: DriverContext) -> None:
        assert context.world is not None
        self.world = context.world
        self.mute = False
        self.faults: Mapping[str, Fault] = {
            "mute": Fault("it answers nothing", self._fall_silent),
            "lose": Fault("the axis has lost steps", self._lose, "AXIS MM"),
        }

    async def start(self) -> Mapping[str, object]:
        self.running.append(self)
        return self.place

    async def close(self) -> None:
        self.running.remove(self)

    def _fall_silent(self) -> None:
        self.mute = True

    def _lose(self, axis: str, distance: str) -> None:
        float(distance)


class ToyBox(Toy):
    place: ClassVar[dict[str, object]] = {"answer_timeout": "3 s"}

    @classmethod
    def create(cls, specs: Any, options: Any, axis_options: Any, context: DriverContext) -> Self:
        assert list(specs) == list(axis_options)
        return cls(context)


class ToyEye(Toy):
    place: ClassVar[dict[str, object]] = {"options": {"timeout": "4 s"}}

    @classmethod
    def create(cls, spec: Any, options: Any, context: DriverContext) -> Self:
        return cls(context)


TOYS = {
    "controllers": {"simulated": f"{__name__}:ToyBox"},
    "cameras": {"simulated": f"{__name__}:ToyEye"},
}


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "EMULATORS", TOYS)


@pytest.mark.usefixtures("toys")
async def test_all_devices_are_there_in_one_world_and_gone_afterwards(profile: Profile) -> None:
    async with emulated(profile) as rig:
        box, other, eye = Toy.running
        assert box.world is eye.world is other.world
        assert rig.emulators == {"stage": box, "head": other, "camera": eye}
        assert all(isinstance(emulator, Emulator) for emulator in rig.emulators.values())
    assert Toy.running == []


@pytest.mark.usefixtures("toys")
async def test_the_profile_to_serve_differs_in_nothing_but_the_places(
    profile: Profile, tmp_path: Path
) -> None:
    assert profile.source is not None
    text = profile.source.read_text(encoding="utf-8")
    async with emulated(profile) as rig:
        served = tmp_path / "served.toml"
        served.write_text(rig.profile_to_serve(text), encoding="utf-8")
    loaded = load_profile(served)
    assert loaded.controllers["stage"].options.model_dump()["answer_timeout"] == 3.0
    assert loaded.camera.options.model_dump()["timeout"] == 4.0
    added = [
        line for line in served.read_text(encoding="utf-8").splitlines() if line not in text.splitlines()
    ]
    assert added == [
        'answer_timeout = "3 s"',
        'answer_timeout = "3 s"',
        "[camera.options]",
        'timeout = "4 s"',
    ]
    assert (loaded.axes, loaded.procedure, loaded.simulation) == (
        profile.axes,
        profile.procedure,
        profile.simulation,
    )


@pytest.mark.usefixtures("toys")
async def test_a_device_that_cannot_start_takes_none_of_the_others_along(
    profile: Profile, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuse(self: Toy) -> Mapping[str, object]:
        self.running.append(self)
        raise DriverError("no port is free")

    monkeypatch.setattr(ToyEye, "start", refuse)
    with pytest.raises(DriverError, match="no port is free"):
        async with emulated(profile):
            pass
    assert Toy.running == []


async def test_a_device_without_an_emulator_is_named(profile: Profile) -> None:
    with pytest.raises(
        OptionsError, match=r"no emulator for the driver 'simulated' of controllers, .*served as it is"
    ):
        async with emulated(profile):
            pass


async def test_a_rig_whose_truth_is_unknown_is_not_emulated(tmp_path: Path) -> None:

    with pytest.raises(ProfileError, match=r"has no table \[simulation\]"):
        async with emulated(dataclasses.replace(small_rig(tmp_path), simulation=None)):
            pass


@pytest.mark.usefixtures("toys")
async def test_devices_obey_lines(profile: Profile) -> None:
    async with emulated(profile) as rig:
        box = rig.emulators["stage"]
        assert isinstance(box, Toy)
        assert obey(rig.emulators, "stage mute\n") == "stage mute: it answers nothing"
        assert box.mute
        assert obey(rig.emulators, "stage lose slide 3") == "stage lose slide 3: the axis has lost steps"
        assert obey(rig.emulators, "stage lose slide x").startswith("stage lose slide x: could not convert")
        assert obey(rig.emulators, "stage lose slide") == "say 'stage lose AXIS MM'"
        assert obey(rig.emulators, "stage jump") == "say 'stage' and one of mute, lose; or 'help'"
        assert obey(rig.emulators, "sofa mute").startswith(
            "there is no 'sofa': devices are stage, head, camera"
        )
        assert obey(rig.emulators, "help").splitlines()[:2] == [
            "stage mute           it answers nothing",
            "stage lose AXIS MM   the axis has lost steps",
        ]


PROCESS = f"""
import sys
from daemon.cli.main import main
from drivers.emulators import registry
from {__name__} import TOYS
registry.EMULATORS = TOYS
main(["simulate", *sys.argv[1:]])
"""


def test_the_command_prints_the_places_obeys_stdin_and_ends_by_a_signal(tmp_path: Path) -> None:
    profile, served = write_profile(tmp_path), tmp_path / "served.toml"
    process = subprocess.Popen(
        [sys.executable, "-c", PROCESS, str(profile), "-o", str(served), "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    with process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        assert json.loads(process.stdout.readline()) == {
            "controllers": {name: {"answer_timeout": "3 s"} for name in ("stage", "head")},
            "camera": {"options": {"timeout": "4 s"}},
            "profile": str(served),
        }
        assert load_profile(served).controllers["stage"].options.model_dump()["answer_timeout"] == 3.0
        process.stdin.write("stage mute\n")
        process.stdin.flush()
        assert process.stderr.readline() == "stage mute: it answers nothing\n"
        process.stdin.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
