"""Drivers' sentences, each of which names its device itself, within those of the rig: nothing is said twice."""

from collections.abc import Sequence


def because(device: str, what: str, why: str) -> str:
    """Return the sentence that `device`, such as "axis 'pan'", does `what`, because of the sentence `why`.

    The device is named once: what `why` says of it, is said of it here.
    """
    why = why.replace(f"{device}: ", "", 1)
    if why.startswith(f"{device} "):
        why = f"it{why.removeprefix(device)}"
    return f"{device} {what}: {why}"


def unconfirmed(reasons: Sequence[str], said: str = "") -> str:
    """Return the sentence that axes could not be confirmed to stand, and why, where that was not `said` just before."""
    unsaid = [reason for reason in reasons if reason not in said]
    why = f": {'; '.join(unsaid)}" if unsaid else ""
    return f"a stop was sent, but a standstill could not be confirmed{why}; look at the rig before you go near it"
