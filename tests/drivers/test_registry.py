import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from drivers import registry
from drivers.errors import OptionsError


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package of somebody else's on the path, with drivers good and bad."""
    (tmp_path / "acme_activecam.py").write_text(
        "from pydantic import BaseModel\n"
        "class AcmeController:\n"
        "    class Options(BaseModel): pass\n"
        "    class AxisOptions(BaseModel): pass\n"
        "    @classmethod\n"
        "    def create(cls, specs, options, axis_options, context): return cls()\n"
        "class NoOptions:\n"
        "    @classmethod\n"
        "    def create(cls, spec, options, context): return cls()\n"
        "class NoCreate:\n"
        "    class Options(BaseModel): pass\n"
    )
    (tmp_path / "broken_activecam.py").write_text("raise RuntimeError('no vendor library')\n")
    info = tmp_path / "acme_activecam-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-activecam\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[activecam.controllers]\n"
        "acme = acme_activecam:AcmeController\n"
        "broken = broken_activecam:Anything\n"
        "simulated = acme_activecam:AcmeController\n"
        "[activecam.cameras]\n"
        "bare = acme_activecam:NoOptions\n"
        "unmade = acme_activecam:NoCreate\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield tmp_path
    sys.modules.pop("acme_activecam", None)


def test_the_built_in_drivers_are_found() -> None:
    controller, camera = registry.controller_driver("simulated"), registry.camera_driver("simulated")
    assert controller.__name__ == "SimulatedController"
    assert camera.__name__ == "SimulatedCamera"
    assert issubclass(controller.Options, BaseModel)
    assert all(info.error is None for kind in registry.BUILT_IN for info in registry.list_drivers(kind))


def test_another_package_adds_a_driver_by_its_entry_point(installed: Path) -> None:
    assert "acme" in registry.names("controllers")
    assert registry.controller_driver("acme").__name__ == "AcmeController"
    info = next(info for info in registry.list_drivers("controllers") if info.name == "acme")
    assert (info.package, info.target, info.error) == (
        "acme-activecam",
        "acme_activecam:AcmeController",
        None,
    )


def test_another_package_cannot_take_a_built_in_name(installed: Path) -> None:
    assert registry.controller_driver("simulated").__name__ == "SimulatedController"


def test_a_broken_package_is_listed_with_its_error(installed: Path) -> None:
    infos = {info.name: info for info in registry.list_drivers("controllers")}
    assert infos["simulated"].error is None
    assert infos["broken"].error is not None
    assert "no vendor library" in infos["broken"].error
    with pytest.raises(
        OptionsError, match=r"'broken' .* of acme-activecam.* cannot be imported: RuntimeError"
    ):
        registry.controller_driver("broken")


def test_a_class_that_is_no_driver_is_refused_with_what_it_lacks(installed: Path) -> None:
    with pytest.raises(OptionsError, match=r"'bare' .* lacks the pydantic model 'Options'"):
        registry.camera_driver("bare")
    with pytest.raises(OptionsError, match=r"'unmade' .* lacks the class method 'create'"):
        registry.camera_driver("unmade")


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(OptionsError, match=r"no driver 'simulatd' for cameras: choose one of .*simulated"):
        registry.camera_driver("simulatd")


def test_reading_the_registry_imports_no_heavy_library() -> None:
    program = (
        "import sys; from drivers import registry; registry.names('cameras');"
        "from drivers.simulated.options import SimulationOptions; registry.controller_driver('simulated');"
        "print([name for name in ('cv2', 'scipy') if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
