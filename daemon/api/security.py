"""What the API's description says of keys and roles."""

from http import HTTPStatus
from typing import Any, Final

from daemon.api.problems import MEDIA_TYPE, PROBLEMS
from daemon.api.rules import PREFIX, ROLES, ROLES_AT_ROOT
from daemon.errors import KeyRequiredError, KeyUnknownError, RoleRequiredError

SCHEMES: Final = {
    "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "An API key, which `activecam key add` prints. Nobody on the daemon's own machine is asked for "
        "one, unless it was told to ask.",
    },
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": "activecam_8080",
        "description": "A browser's session, from `POST /session`; the cookie's name has the daemon's port.",
    },
}
REFUSALS: Final = (KeyRequiredError, KeyUnknownError, RoleRequiredError)


def describe_roles(document: dict[str, Any]) -> None:
    """Add to each operation of an OpenAPI document the role that it needs (`x-role`), and how it is refused."""
    document["components"]["securitySchemes"] = SCHEMES
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            roles = ROLES if path.startswith(PREFIX) else ROLES_AT_ROOT
            role = roles[f"{method.upper()} {path.removeprefix(PREFIX)}"]
            if role is None:
                operation["security"] = []
                continue
            operation["x-role"] = role.value
            operation["security"] = [{name: []} for name in SCHEMES]
            for refusal in REFUSALS:
                _add_refusal(operation["responses"], refusal)


def _add_refusal(responses: dict[str, Any], refusal: type[Exception]) -> None:
    kind = PROBLEMS[refusal]
    answer = responses.setdefault(
        str(kind.status),
        {
            "description": "",
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        },
    )
    said = answer["description"] or f"{HTTPStatus(kind.status).phrase}:"
    answer["description"] = f"{said}{',' if answer['description'] else ''} `{kind.code}`"
