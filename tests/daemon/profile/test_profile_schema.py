"""The JSON Schema that editors read beside the shipped profiles."""

import json
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from daemon.profile import shipped_profiles
from daemon.profile.schema import profile_schema

SMALL_RIG = Path(__file__).with_name("small-rig.toml")


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    return Draft202012Validator(profile_schema())


def test_the_shipped_schema_is_the_models() -> None:
    shipped = json.loads(files("hw_profiles").joinpath("profile.schema.json").read_text(encoding="utf-8"))
    assert shipped == profile_schema(), (
        "run `python -m daemon.profile.schema > hw_profiles/profile.schema.json` and commit the result"
    )


def test_it_is_a_schema() -> None:
    Draft202012Validator.check_schema(profile_schema())


@pytest.mark.parametrize("name", shipped_profiles())
def test_shipped_profiles_fit_it_and_name_it_to_editors(name: str, validator: Draft202012Validator) -> None:
    text = files("hw_profiles").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema ./profile.schema.json\n")
    assert [error.message for error in validator.iter_errors(tomllib.loads(text))] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('velocity = "50 deg/s"', 'velocty = "50 deg/s"'),
        ('velocity = "50 deg/s"', 'velocity = "50 deg"'),
        ('velocity = "50 deg/s"', "velocity = 50"),
        ('kind = "revolute"', 'kind = "round"'),
        ('kind = "circle_grid"\n', ""),
        ('disk_diameter = "18 mm"', 'marker = "18 mm"'),
        ("positions = 11", ""),
        ("positions = 11", 'positions = 11\nreadings = ["0 mm", "1 mm"]'),
        ("answer_timeout", "anser_timeout"),
        ('answer_timeout = "2 s"', 'answer_timeout = "2 mm"'),
        ("height = 960", "height = 960\noptions = { fps = 3 }"),
        ("scale = 0.0174", "scael = 0.0174"),
    ],
)
def test_an_editor_sees_the_mistake(old: str, new: str, validator: Draft202012Validator) -> None:
    text = SMALL_RIG.read_text(encoding="utf-8")
    assert validator.is_valid(tomllib.loads(text))
    assert not validator.is_valid(tomllib.loads(text.replace(old, new, 1)))


def test_other_packages_drivers_may_have_any_key(validator: Draft202012Validator) -> None:
    document: dict[str, Any] = tomllib.loads(SMALL_RIG.read_text(encoding="utf-8"))
    document["controllers"]["table"] = {"driver": "acme", "port": "ttyS0"}
    document["axes"][1]["options"] = {"channel": 2}
    document["camera"] |= {"driver": "acme", "options": {"port": "video0"}}
    assert [error.message for error in validator.iter_errors(document)] == []


def test_it_offers_no_null_which_toml_cannot_write() -> None:
    assert "null" not in json.dumps(profile_schema())
