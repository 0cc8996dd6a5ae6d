"""docs/reference/openapi.json is the API as it is, and a change of it has a version of its own."""

import json
import re
from typing import Any

from daemon.api.openapi import api_description
from tests.docs.pages import page

WRITE = "write it by 'python -m daemon.api.openapi > docs/reference/openapi.json'"


def complaint(kept: dict[str, Any], now: dict[str, Any]) -> str | None:
    """Return what is wrong with the kept description, None where it is that of today."""
    if kept == now:
        return None
    if kept["info"]["version"] == now["info"]["version"]:
        return (
            "the API has changed, and API_VERSION in daemon/api/app.py has not: raise its first number where clients "
            "have to change, its second where they can do more, its third where only words have changed; then "
            f"{WRITE}"
        )
    return f"docs/reference/openapi.json is of version {kept['info']['version']}: {WRITE}"


def test_the_description_is_that_of_the_api() -> None:
    assert complaint(json.loads(page("reference/openapi.json")), api_description()) is None


def test_a_change_without_a_version_is_complained_of() -> None:
    kept, now = api_description(), json.loads(json.dumps(api_description()))
    now["paths"]["/api/v1/pose"]["get"]["summary"] = "Another"
    assert "API_VERSION in daemon/api/app.py has not" in str(complaint(kept, now))
    now["info"]["version"] = "99.0.0"
    assert "write it by" in str(complaint(kept, now))


def test_generated_clients_get_readable_names() -> None:
    description = api_description()
    assert re.fullmatch(r"\d+\.\d+\.\d+", description["info"]["version"])
    ids = [operation["operationId"] for path in description["paths"].values() for operation in path.values()]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[a-z]+(_[a-z]+)+|stop", name) for name in ids), ids
