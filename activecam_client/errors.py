"""What goes wrong, as one tree.

ActivecamError
├── ProblemError        the daemon refuses or fails, and says why; go by its `code`
└── UnreachableError    there is no answer
"""

from typing import Any


class ActivecamError(Exception):
    """What was asked could not be done."""


class ProblemError(ActivecamError):
    """The daemon's problem document (RFC 9457): `code` is for programs, and stable; `detail` says what to do."""

    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__(f"{document['detail']} ({document['code']})")
        self.code: str = document["code"]
        self.status: int = document["status"]
        self.title: str = document["title"]
        self.detail: str = document["detail"]


class UnreachableError(ActivecamError):
    """The daemon does not answer, hung up, or something else answers in its place."""
