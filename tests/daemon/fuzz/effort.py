"""How much is tried: little, and the same each time, in the gate; much, and new each time, by `make test-fuzz`."""

import os

from hypothesis import HealthCheck, settings

_EXAMPLES = os.environ.get("FUZZ_EXAMPLES")


def effort(gate: int) -> settings:
    """Return the settings of a test that tries `gate` examples in the gate."""
    return settings(
        max_examples=gate if _EXAMPLES is None else int(_EXAMPLES),
        derandomize=_EXAMPLES is None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
