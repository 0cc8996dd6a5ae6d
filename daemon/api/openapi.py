"""The API's description for programs, as it is kept in docs: `python -m daemon.api.openapi`.

What is generated from it calls operations by their ids, which are the names of the functions that answer.
"""

import json
import sys
from typing import Any, cast

from daemon.api.app import create_app
from daemon.service import Service


def api_description() -> dict[str, Any]:
    """Return the OpenAPI document."""
    return create_app(cast("Service", None)).openapi()  # describing asks nothing of the service


if __name__ == "__main__":
    json.dump(api_description(), sys.stdout, indent=1, ensure_ascii=False)
    sys.stdout.write("\n")
