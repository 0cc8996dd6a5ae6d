"""The command line in this process, and what routes there are."""

import pytest

from daemon.api.rules import PREFIX, ROLES, ROLES_AT_ROOT
from daemon.cli import main

ALL = {f"{method} {PREFIX}{path}": role for name, role in ROLES.items() for method, path in [name.split()]}
ALL |= ROLES_AT_ROOT
"""The roles of all routes, by method and whole path."""


def command(*arguments: object) -> int:
    """Run `activecam` with these arguments, and return its exit status."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code
