"""What is kept of a run from its beginning on, and whether it may be taken up again on this rig."""

import json
import secrets
from datetime import UTC, datetime
from typing import Any

from daemon.errors import ProfileChangedError
from daemon.profile import Profile
from daemon.profile_document import ProfileDocument
from daemon.store import RunRecord, RunState


def new_record(profile: Profile, owner: str, note: str) -> RunRecord:
    """Return the record of a run of `profile` that begins now."""
    now = datetime.now(UTC)
    run_id = f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
    return RunRecord(
        id=run_id,
        state=RunState.RUNNING,
        profile_name=profile.name,
        profile=ProfileDocument.of(profile).model_dump_json(),
        session=f"sessions/{run_id}",
        owner=owner,
        note=note,
        created_at=now,
        started_at=now,
    )


def require_same_profile(record: RunRecord, profile: Profile) -> None:
    """Raise ProfileChangedError unless all that was known of the rig when the run began is so in `profile`."""
    now = ProfileDocument.of(profile).model_dump(mode="json")
    changed = [key for key, then in json.loads(record.profile).items() if not _kept(then, now.get(key))]
    if changed:
        raise ProfileChangedError(
            f"run '{record.id}' was taken with another profile ({', '.join(changed)}): "
            "serve that one to resume it, or start another run"
        )


def _kept(then: Any, now: Any) -> bool:
    """Return whether a value is the same but for keys that a later activecam knows."""
    if isinstance(then, dict) and isinstance(now, dict):
        return all(key in now and _kept(value, now[key]) for key, value in then.items())
    if isinstance(then, list) and isinstance(now, list):
        return len(then) == len(now) and all(map(_kept, then, now))
    return bool(then == now)
