"""Which role each route needs. What is not named here is not served: `Gate` answers that there is no such thing."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from starlette.routing import compile_path

from daemon.access.roles import Role

PREFIX: Final = "/api/v1"

VIEWER, OPERATOR, ADMIN = Role

ROLES: Final[dict[str, Role | None]] = {
    "GET /pose": VIEWER,
    "POST /pose": VIEWER,
    "POST /project": VIEWER,
    "POST /rays": VIEWER,
    "WS /pose/stream": VIEWER,
    "GET /health": None,
    "GET /health/live": None,
    "GET /health/ready": None,
    "GET /rig": VIEWER,
    "GET /profile": VIEWER,
    "GET /camera/frame.jpg": VIEWER,
    "GET /camera/detection": VIEWER,
    "GET /camera/stream.mjpg": VIEWER,
    "WS /camera/live": VIEWER,
    "WS /live": VIEWER,
    "POST /stop": OPERATOR,
    "POST /stop/acknowledge": OPERATOR,
    "POST /lease": OPERATOR,
    "DELETE /lease": OPERATOR,
    "POST /axes/move": OPERATOR,
    "POST /axes/{name}/home": OPERATOR,
    "POST /axes/{name}/move": OPERATOR,
    "POST /axes/{name}/jog": OPERATOR,
    "POST /axes/{name}/stop": OPERATOR,
    "GET /runs": VIEWER,
    "POST /runs": OPERATOR,
    "GET /runs/plan": VIEWER,
    "GET /runs/checklist": VIEWER,
    "GET /runs/{run_id}": VIEWER,
    "GET /runs/{run_id}/events": VIEWER,
    "GET /runs/{run_id}/coverage": VIEWER,
    "GET /runs/{run_id}/views": VIEWER,
    "GET /runs/{run_id}/views/{number}/image.jpg": VIEWER,
    "POST /runs/{run_id}/pause": OPERATOR,
    "POST /runs/{run_id}/resume": OPERATOR,
    "POST /runs/{run_id}/solve": OPERATOR,
    "POST /runs/{run_id}/cancel": OPERATOR,
    "GET /calibrations": VIEWER,
    "GET /calibrations/current": VIEWER,
    "GET /calibrations/{calibration_id}": VIEWER,
    "GET /calibrations/{calibration_id}/exports": VIEWER,
    "GET /calibrations/{calibration_id}/exports/{name}": VIEWER,
    "GET /calibrations/{calibration_id}/residuals": VIEWER,
    "GET /calibrations/{calibration_id}/tables": VIEWER,
    "GET /calibrations/{calibration_id}/scene": VIEWER,
    "GET /calibrations/{calibration_id}/compare/{other_id}": VIEWER,
    "POST /calibrations/{calibration_id}/activate": OPERATOR,
    "GET /session": VIEWER,
    "POST /session": VIEWER,
    "DELETE /session": VIEWER,
    "GET /audit": ADMIN,
    "GET /openapi.json": VIEWER,
}
"""By method and path under PREFIX; None lets in who shows no key."""
ROLES_AT_ROOT: Final[dict[str, Role | None]] = {
    "GET /": None,
    "GET /page/{file}": None,
    "GET /metrics": VIEWER,
    "GET /docs": VIEWER,
}


@dataclass(frozen=True, slots=True)
class Rule:
    """The role that a route needs, None where it needs none."""

    role: Role | None
    written: bool
    """Whether it goes into the audit log: whatever needs an operator, but for reading."""


class Rules:
    """The rules by method and path, found as quickly as a request needs."""

    def __init__(self, roles: Mapping[str, Role | None], roles_at_root: Mapping[str, Role | None]) -> None:
        named = {_full(name, PREFIX): role for name, role in roles.items()}
        named |= {_full(name, ""): role for name, role in roles_at_root.items()}
        self._exact: dict[tuple[str, str], Rule] = {}
        self._patterns: list[tuple[str, re.Pattern[str], Rule]] = []
        for (method, path), role in named.items():
            rule = Rule(role, written=method != "GET" and role is not None and role.includes(OPERATOR))
            if "{" in path:
                self._patterns.append((method, compile_path(path)[0], rule))
            else:
                self._exact[method, path] = rule

    def find(self, method: str, path: str) -> Rule | None:
        """Return the rule of a request; None where there is none, and the request is to be refused."""
        exact = self._exact.get((method, path))
        if exact is not None:
            return exact
        matching = (
            rule for known, pattern, rule in self._patterns if known == method and pattern.match(path)
        )
        return next(matching, None)

    def methods(self, path: str) -> list[str]:
        """Return the methods that can be asked of a path."""
        return sorted({method for method, known in self._all(path) if known and method != "WS"})

    def _all(self, path: str) -> Iterator[tuple[str, bool]]:
        yield from ((method, known == path) for method, known in self._exact)
        yield from ((method, pattern.match(path) is not None) for method, pattern, _ in self._patterns)


def _full(name: str, prefix: str) -> tuple[str, str]:
    method, path = name.split(" ")
    return method, prefix + path
