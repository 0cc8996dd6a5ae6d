"""What docs/reference/files.md says of the three files is what the code reads and writes."""

import json
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from calib import Calibration, load_calibration, load_session, solve, stated_corrections, stated_quality
from calib import calibration as calib_file
from calib import session as calib_session
from daemon.profile import load_profile, tables
from drivers.cia402.options import Cia402AxisOptions, Cia402Options
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from drivers.quantities import QuantityType, parse_quantity
from drivers.simulated import options
from drivers.simulated.camera import SimulatedCameraOptions
from drivers.simulated.controller import SimulatedAxisOptions, SimulatedControllerOptions
from drivers.video.options import ReplayOptions, StreamOptions, V4l2Options
from tests.docs.pages import Block, blocks, page, pages, table_below, unquoted

PAGE = "reference/files.md"

MODELS: dict[str, type[BaseModel]] = {
    "### The head": tables.ProfileTable,
    "### `[[axes]]`": tables.AxisTable,
    "### `[controllers.NAME]`": tables.ControllerTable,
    "### `[camera]`": tables.CameraTable,
    "### `[camera.intrinsics]`": tables.IntrinsicsTable,
    "### `[camera.intrinsics_std]`": tables.IntrinsicsStdTable,
    "### `[procedure]`": tables.ProcedureTable,
    "### `[[procedure.sweeps]]`": tables.SweepTable,
    "### `[[procedure.views]]`": tables.ViewTable,
    "### `[simulation]`": options.SimulationOptions,
    "### `[[simulation.joints]]`": options.JointOptions,
    "### `[simulation.camera]`": options.CameraTruth,
    "### `[simulation.camera.lens]`": options.LensOptions,
    "### `[simulation.camera.picture]`": options.PictureOptions,
    "### `[simulation.plate]`": options.PlateOptions,
    "In `[controllers.NAME]`:": SimulatedControllerOptions,
    "In an axis's `options`:": SimulatedAxisOptions,
    "In the camera's `options`:": SimulatedCameraOptions,
    "### The keys of a CAN bus": Cia402Options,
    "### The keys of a CAN servo": Cia402AxisOptions,
    "### The keys of a Grbl controller": GrblOptions,
    "### The keys of a Grbl axis": GrblAxisOptions,
    "### The keys of a V4L2 camera": V4l2Options,
    "### The keys of a stream": StreamOptions,
    "### The keys of a replay": ReplayOptions,
    "### The session": calib_session.Session,
    "### A joint": calib_session.Joint,
    "### A camera": calib_session.Camera,
    "### A view": calib_session.View,
    "### Points": calib_session.Points,
    "### An origin": calib_session.WorldOrigin,
    "### A nominal model": calib_session.Nominal,
    "### The calibration": calib_file.Calibration,
    "### A joint's screw": calib_file.JointScrew,
    "### A D-H row": calib_file.DhLink,
    "### A calibrated camera": calib_file.CalibratedCamera,
    "### Corrections": stated_corrections.StatedCorrections,
    "### Backlash": stated_corrections.StatedBacklash,
    "### Once per turn": stated_corrections.StatedOncePerTurn,
    "### Coupling": stated_corrections.StatedCoupling,
    "### Target warp": stated_corrections.TargetWarp,
    "### Covariance": calib_file.Covariance,
    "### Quality": stated_quality.Quality,
    "### A joint's quality": stated_quality.JointQuality,
    "### A camera's coverage": stated_quality.CameraCoverage,
    "### A mean and a maximum": stated_quality.MeanAndMax,
    "### A view's quality": stated_quality.ViewQuality,
    "### A slip": stated_quality.Slip,
}


@pytest.mark.parametrize("lead", MODELS)
def test_a_table_lists_its_keys_with_their_defaults(lead: str) -> None:
    described = {unquoted(row[0]): row[2] for row in table_below(page(PAGE), lead)}
    fields = {field.alias or name: field for name, field in MODELS[lead].model_fields.items()}
    assert sorted(described) == sorted(fields), f"{PAGE}, {lead}: other keys than {MODELS[lead].__name__}"
    for key, field in fields.items():
        assert _says(described[key], field), f"{PAGE}, {lead}: the default of '{key}' is {field.default!r}"


def _says(cell: str, field: FieldInfo) -> bool:
    if field.is_required():
        return cell == ""
    default: Any = field.get_default(call_default_factory=True)
    if default is None:
        return cell.startswith("none")
    if not cell.startswith("`"):
        return False
    said: Any = json.loads(unquoted(cell))
    if isinstance(default, BaseModel):
        return said == {} and default == type(default)()
    if isinstance(said, str) and not isinstance(default, str):
        return parse_quantity(said, _dimension(field)) == default
    return said == (list(default) if isinstance(default, tuple) else default)


def _dimension(field: FieldInfo) -> Any:
    found = [one for one in (*field.metadata, *get_args(field.annotation)) if isinstance(one, QuantityType)]
    return found[0].dimension


def test_the_targets_are_described_with_their_keys() -> None:
    described = {unquoted(row[0]): row for row in table_below(page(PAGE), "### `[target]`")}
    models = {get_args(model.model_fields["kind"].annotation)[0]: model for model in _target_tables()}
    assert sorted(described) == sorted(models)
    for kind, model in models.items():
        fields = {name: field for name, field in model.model_fields.items() if name != "kind"}
        required = [name for name, field in fields.items() if field.is_required()]
        assert sorted(described[kind][1].replace("`", "").split()) == sorted(required)
        optional = described[kind][2].replace("`", "").replace(",", "").split()
        assert sorted(optional) == sorted(set(fields) - set(required))
    in_sessions = {unquoted(row[0]) for row in table_below(page(PAGE), "### A target")}
    assert in_sessions == set(models) | {"none"}


def _target_tables() -> list[type[BaseModel]]:
    union: Any = tables.ProfileTable.model_fields["target"].annotation
    return list(get_args(union))


def _whole(language: str, begins: str) -> list[Block]:
    found = [block for name in pages() for block in blocks(name, language)]
    return [block for block in found if block.text.lstrip().startswith(begins)]


@pytest.mark.parametrize("block", _whole("toml", "format = "), ids=str)
def test_a_whole_profile_has_no_problems(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(block.text)
    load_profile(file)


@pytest.mark.parametrize("block", _whole("json", '{"format": "activecam.'), ids=str)
def test_a_whole_document_is_read(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "session.json"
    file.write_text(block.text)
    if json.loads(block.text)["format"].startswith("activecam.session/"):
        load_session(tmp_path)
    else:
        load_calibration(file)


def test_there_is_a_whole_example_of_each_file() -> None:
    assert [block.page for block in _whole("toml", "format = ")].count(PAGE) == 1
    assert [block.page for block in _whole("json", '{"format": "activecam.')].count(PAGE) == 3


def test_the_calibration_is_the_solution_of_the_session(tmp_path: Path) -> None:
    documents = [block.text for block in _whole("json", '{"format": "activecam.') if block.page == PAGE]
    (tmp_path / "session.json").write_text(documents[0])
    session = load_session(tmp_path)
    solved, described = solve(session, "closed_form"), Calibration.model_validate_json(documents[-1])
    for view in session.views:
        expected = np.array(view.world_from_camera)
        for calibration in (solved, described):
            np.testing.assert_allclose(calibration.world_from_camera(view.readings), expected, atol=1e-12)
    for key in ("joints", "dh", "world_from_base", "cameras", "range"):
        _expect_close(getattr(solved, key), getattr(described, key), key)
    mounted = described.cameras[0].model_copy(update={"world_from_camera": None})
    by_dh = described.model_copy(update={"cameras": [mounted]})
    np.testing.assert_allclose(by_dh.world_from_camera([100, 90]), expected, atol=1e-12)


def _expect_close(found: Any, described: Any, where: str) -> None:
    if isinstance(found, BaseModel):
        found, described = found.model_dump(), described.model_dump()
    if isinstance(found, dict):
        for key, value in found.items():
            _expect_close(value, described[key], f"{where}.{key}")
    elif isinstance(found, list):
        assert len(found) == len(described), where
        for index, (one, other) in enumerate(zip(found, described, strict=True)):
            _expect_close(one, other, f"{where}[{index}]")
    elif isinstance(found, float):
        assert found == pytest.approx(described, abs=1e-9), where
    else:
        assert found == described, where
