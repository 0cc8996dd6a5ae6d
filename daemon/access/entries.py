"""What is written down of each thing that somebody did."""

from dataclasses import dataclass
from datetime import datetime

from daemon.access.roles import Role


@dataclass(eq=False, slots=True)
class AuditEntry:
    """Who asked for what, when, and what came of it."""

    time: datetime
    who: str | None
    """The name of the key; None where nobody is asked for one."""
    role: Role
    address: str
    """Where from."""
    method: str
    path: str
    asked: str = ""
    """The request's body, as much of it as is kept."""
    status: int | None = None
    """HTTP's; None while it goes on, and for good where the daemon was killed meanwhile."""
    code: str | None = None
    """The problem's, where there was one."""
    id: int | None = None
    """Its number in the store, greater than that of every older one; None before it is there."""
