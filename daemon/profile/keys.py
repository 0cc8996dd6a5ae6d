"""Which keys a pydantic model knows at a place, to suggest one for a key that it does not know."""

from difflib import get_close_matches
from typing import get_args

from pydantic import BaseModel

from daemon.profile.lines import KeyPath


def closest_key(unknown: str, model: type[BaseModel], table: KeyPath) -> str | None:
    """Return the key that may have been meant by `unknown` in the table at `table`."""
    close = get_close_matches(unknown, known_keys(model, table), n=1)
    return close[0] if close else None


def known_keys(model: type[BaseModel], table: KeyPath) -> list[str]:
    """Return the keys of the table at `table`, a location as pydantic gives it, seen from `model`."""
    candidates = [model]
    for step in table:
        below = [inner for outer in candidates for inner in _models_under(outer, step)]
        # A step that is no field is a position, a free name, or the tag that chose one model of a union.
        candidates = below or [one for one in candidates if _is_tagged(one, step)] or candidates
    return list(dict.fromkeys(key for one in candidates for key in _fields(one)))


def _fields(model: type[BaseModel]) -> dict[str, object]:
    return {field.alias or name: field.annotation for name, field in model.model_fields.items()}


def _models_under(model: type[BaseModel], key: str | int) -> list[type[BaseModel]]:
    return _models_in(_fields(model).get(str(key)))


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]


def _is_tagged(model: type[BaseModel], tag: str | int) -> bool:
    return tag in get_args(_fields(model).get("kind"))
