"""Where a request itself may be wrong, for the API's description: where anything in it is more than a mere text."""

from typing import Any

from daemon.api.problems import INVALID


def forget_wrong_requests(document: dict[str, Any]) -> None:
    """Take the answer `invalid_request` from operations of an OpenAPI document with no body, and nothing to check."""
    for operations in document["paths"].values():
        for operation in operations.values():
            if "requestBody" in operation or not all(map(_any_text, operation.get("parameters", []))):
                continue
            wrong = operation["responses"].get("422")
            if wrong is not None and wrong["description"].endswith(f": `{INVALID.code}`"):
                del operation["responses"]["422"]


def _any_text(parameter: dict[str, Any]) -> bool:
    """Return whether a parameter takes every text."""
    schema = parameter["schema"]
    return all(
        option.get("type") in {"string", "null"}
        and not option.keys() & {"pattern", "format", "enum", "const"}
        for option in schema.get("anyOf", [schema])
    )
