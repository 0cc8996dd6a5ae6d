"""Damage to JSON documents, seeded."""

import random
from collections.abc import Iterator
from typing import Any

WRONG: tuple[Any, ...] = (None, "", "no", 0, -1, 1e300, 7.5, [], {}, [[]], True)


def spoil(document: Any, rng: random.Random) -> str:
    """Leave one of the places of `document` out or put something wrong there, and return the name of the place."""
    # Evenly by name: a covariance has thousands of numbers, a camera one link.
    places: dict[str, list[tuple[Any, Any]]] = {}
    for name, holder, key in _places(document):
        places.setdefault(name, []).append((holder, key))
    name = rng.choice(sorted(places))
    holder, key = rng.choice(places[name])
    if rng.random() < 0.2:
        del holder[key]
    else:
        holder[key] = rng.choice(WRONG)
    return name


def _places(value: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            name = f"{path}.{key}" if path else key
            yield name, value, key
            yield from _places(inner, name)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield f"{path}[]", value, index
            yield from _places(inner, f"{path}[]")
