"""What somebody may do: each role all that the ones before it may."""

from enum import StrEnum


class Role(StrEnum):
    """Viewers read; operators move, stop, run and activate as well; admins also see who did."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"

    def includes(self, other: "Role") -> bool:
        """Whether who has this role may what `other` may."""
        return _RANK[self] >= _RANK[other]


_RANK = {role: rank for rank, role in enumerate(Role)}
