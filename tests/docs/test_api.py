"""docs/reference/api.md has every route, problem, event and answer of the API, and its examples work."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, cast, get_args

import jsonschema
import pytest
from pydantic import BaseModel

from daemon.api import create_app, problems
from daemon.api.rules import ROLES
from daemon.operation.rig_figures import RigFigures
from daemon.procedure import RunEvent
from daemon.service import Service, running_service
from tests.daemon.rigs import small_rig
from tests.docs.pages import blocks, page, table_below, unquoted

PAGE = "reference/api.md"
PREFIX = "/api/v1"
OPENAPI = create_app(cast("Service", None)).openapi()
ANY = {"invalid_request", "key_required", "key_unknown", "role_required"}
"""Problems that the tables leave out."""
SECTIONS = ("Rig", "Lease", "Motion", "Camera", "Runs", "Calibrations", "Pose", "Session", "Audit")


def _rows() -> dict[str, list[str]]:
    rows = [row for section in SECTIONS for row in table_below(page(PAGE), f"## {section}")]
    assert len({row[0] for row in rows}) == len(rows)
    return {unquoted(row[0]): row for row in rows}


def _operations() -> dict[str, dict[str, Any]]:
    return {
        f"{method.upper()} {path.removeprefix(PREFIX)}": operation
        for path, operations in OPENAPI["paths"].items()
        for method, operation in operations.items()
    }


def _codes(cell: str) -> set[str]:
    for name in re.findall(r"\*(\w+)\*", cell):
        cell += page(PAGE).partition(f"\n*{name}*:")[2].partition("\n\n")[0]
    return set(re.findall(r"`(\w+)`", cell))


def test_every_route_is_on_the_page_and_the_other_way_round() -> None:
    assert sorted(_rows()) == sorted([*_operations(), *(name for name in ROLES if name.startswith("WS"))])


@pytest.mark.parametrize("route", _operations())
def test_a_route_is_described_as_it_is(route: str) -> None:
    operation, row = _operations()[route], _rows()[route]
    described = " ".join(answer["description"] for answer in operation["responses"].values())
    documented = set(re.findall(r"`([a-z]+_[a-z_]+)`", described)) - ANY
    assert _codes(row[5]) == documented
    assert row[1] == operation.get("x-role", "none")
    parameters = operation.get("parameters", [])
    if route.startswith(("GET", "WS")):
        for parameter in parameters:
            if parameter["in"] != "path":
                assert parameter["name"] in row[3].lower()
    asks_for_lease = "lease_required" in documented
    assert (row[2] == "yes") == asks_for_lease
    if (row[2] == "no") or asks_for_lease:
        shows = any(parameter["name"] == "X-Lease" for parameter in parameters)
        assert shows == asks_for_lease
    body = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    for key in _properties(body):
        assert f"`{key}`" in row[3]


def _properties(schema: dict[str, Any]) -> set[str]:
    for inner in schema.get("anyOf", []):
        if found := _properties(inner):
            return found
    name = schema.get("$ref", "").rpartition("/")[2]
    return set(OPENAPI["components"]["schemas"][name]["properties"]) if name else set()


def test_every_problem_is_on_the_page_with_its_status() -> None:
    kinds = [
        *problems.PROBLEMS.values(),
        *problems.HTTP_PROBLEMS.values(),
        problems.INVALID,
        problems.INTERNAL,
        problems.BODY_TOO_LARGE,
        problems.TOO_MANY_COMMANDS,
        problems.FOREIGN_PAGE,
        problems.HOST_UNKNOWN,
    ]
    text = page(PAGE).partition("\n## Problems\n")[2]
    rows = re.findall(r"^\| `(\w+)` \| (\d+) \|", text, re.MULTILINE)
    assert sorted((code, int(status)) for code, status in rows) == sorted(
        {(kind.code, kind.status) for kind in kinds}
    )


def test_every_event_is_on_the_page_with_its_fields() -> None:
    events: tuple[type[BaseModel], ...] = get_args(get_args(RunEvent)[0])
    described = {
        unquoted(row[0]): set(re.findall(r"`(\w+)`", row[1])) for row in table_below(page(PAGE), "### Events")
    }
    common = {"run_id", "sequence", "time", "type"}
    assert described == {
        event.model_fields["type"].default: set(event.model_fields) - common for event in events
    }


ANSWERS = re.findall(r"<!-- answer: (\w+) -->\n```json\n(.*?)```", page(PAGE), re.DOTALL)


@pytest.mark.parametrize(("model", "text"), ANSWERS, ids=[model for model, _ in ANSWERS])
def test_an_answer_on_the_page_has_the_form_that_it_has(model: str, text: str) -> None:
    schemas = OPENAPI["components"]["schemas"]
    answer = json.loads(text)
    jsonschema.validate(answer, {"$ref": f"#/components/schemas/{model}", "components": {"schemas": schemas}})
    assert set(answer) == set(schemas[model]["properties"])


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_examples_work_one_after_the_other(served: str, tmp_path: Path) -> None:
    script = 'set -e\ncurl() { command curl --fail-with-body "$@"; echo; }\n'
    script += "\n".join(block.text for block in blocks(PAGE, "sh"))
    script = script.replace("http://localhost:8080", served)
    ran = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-500:]
    assert '"state":"succeeded"' in ran.stdout
    assert (tmp_path / "live.jpg").read_bytes().startswith(b"\xff\xd8")
    stopped, streamed = (_printed(block.text, served) for block in blocks(PAGE, "python"))
    assert stopped == ["200 True"]
    assert len(streamed) == 3


def _printed(program: str, served: str) -> list[str]:
    """Run a program that follows a stream, and return its lines."""
    program = program.replace("ws://localhost:8080", served.replace("http", "ws"))
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.splitlines()


async def test_every_figure_is_on_the_page(tmp_path: Path) -> None:
    async with running_service(small_rig(tmp_path), tmp_path / "data") as service:
        figures = [*service.figures.registry.collect(), *RigFigures(service).collect()]
        families = {family.name: family.type for family in figures}
    described = {
        name for row in table_below(page(PAGE), "### Figures") for name in re.findall(r"`(\w+)`", row[0])
    }
    ours = {name for name in families if name.startswith("activecam_")}
    assert described == {f"{name}_total" if families[name] == "counter" else name for name in ours}
