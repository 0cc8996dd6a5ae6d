"""API keys: a secret that its holder shows, and of which the daemon keeps a hash alone.

The hash is SHA-256 without salt or rounds. Those slow down whoever guesses passwords; a key is 256 bits from the
operating system's generator, which nobody guesses, and is looked up with every request.
"""

import hashlib
import re
import secrets
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from daemon.access.roles import Role
from daemon.errors import KeyNameError

PREFIX: Final = "activecam_"
"""What every key begins with, so that one is known for what it is wherever it turns up."""
_NAME: Final = re.compile(r"[\w.@-]{1,64}")


@dataclass(frozen=True, slots=True)
class ApiKey:
    """A key as it is kept: `digest` is its SHA-256, in hexadecimal digits."""

    name: str
    role: Role
    digest: str
    created_at: datetime
    last_used_at: datetime | None = None


def make_key(name: str, role: Role) -> tuple[str, ApiKey]:
    """Return a new key, which is not to be had again, and what is kept of it; raises KeyNameError."""
    if _NAME.fullmatch(name) is None:
        raise KeyNameError(
            f"'{name}' cannot be a key's name: use letters, digits, '.', '_', '-' and '@', 64 at most"
        )
    key = PREFIX + secrets.token_urlsafe(32)
    return key, ApiKey(name, role, digest_of(key.encode()), datetime.now(UTC))


def digest_of(secret: bytes) -> str:
    """Return the hash under which `secret` is known."""
    return hashlib.sha256(secret).hexdigest()
