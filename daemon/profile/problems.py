"""What is wrong with a profile, each problem at its key and line, so that one check shows them all."""

from collections.abc import Mapping
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from daemon.profile.errors import ProfileError
from daemon.profile.keys import closest_key, known_keys
from daemon.profile.lines import KeyPath, Lines
from daemon.profile.sentences import sentence
from drivers.quantities import RateSuffix, in_reading_unit

Model = TypeVar("Model", bound=BaseModel)


class Problems:
    """The problems found so far in the file called `file`."""

    def __init__(self, file: str, document: Mapping[str, Any], lines: Lines) -> None:
        self._file = file
        self._document = document
        self._lines = lines
        self._found: list[tuple[int, str]] = []

    def add(self, path: KeyPath, message: str) -> None:
        """Note that `message` is wrong with the key at `path`."""
        line = self._lines.of(path)
        where = self._label(path)
        self._found.append((line, f"{self._file}:{line}: {where}: {message}"))

    def raise_any(self) -> None:
        """Raise ProfileError if there are any."""
        if self._found:
            self._raise()

    def validate(self, model: type[Model], table: object, path: KeyPath) -> Model | None:
        """Return the table at `path` as `model`; None after noting what is wrong with it."""
        try:
            return model.model_validate(table)
        except ValidationError as error:
            found = error.errors(include_url=False)
            # A key that is missing because it is misspelt is one problem and not two.
            misspelt = {_meant(model, details) for details in found if details["type"] == "extra_forbidden"}
            for details in found:
                if details["type"] != "missing" or details["loc"] not in misspelt:
                    self._add_details(model, details, table, path)
            return None

    def reading(self, path: KeyPath, text: object, unit: str, suffix: RateSuffix = "") -> float:
        """Return a quantity of an axis in its reading unit.

        After noting a problem it returns nan, of which every comparison is false: the later checks of the
        same quantity then stay silent.
        """
        try:
            return in_reading_unit(text, unit, suffix)
        except ValueError as error:
            self.add(path, str(error))
            return float("nan")

    def _raise(self) -> NoReturn:
        raise ProfileError([message for _, message in sorted(self._found, key=lambda found: found[0])])

    def _add_details(
        self, model: type[BaseModel], details: ErrorDetails, table: object, path: KeyPath
    ) -> None:
        location = details["loc"]
        context = details.get("ctx", {})
        match details["type"]:
            case "missing":
                self.add(path + _written(location[:-1], table) + location[-1:], "is missing")
            case "extra_forbidden":
                self.add(path + _written(location, table), _unknown_key(model, details))
            case "union_tag_not_found":
                key = context["discriminator"].strip("'")
                self.add((*path, *location, key), "is missing")
            case "union_tag_invalid":
                key, tags = context["discriminator"].strip("'"), context["expected_tags"]
                self.add((*path, *location, key), f"must be one of {tags}, not '{context['tag']}'")
            case _:
                self.add(path + _written(location, table), sentence(details))

    def _label(self, path: KeyPath) -> str:
        """Return `axes[1].limits (pan)`: the path as people write it, and what its element is called."""
        label, name = "", ""
        node: Any = self._document
        for step in path:
            label += f"[{step}]" if isinstance(step, int) else f".{step}" if label else step
            node = _child(node, step)
            if isinstance(step, int) and isinstance(node, dict):
                called = node.get("name", node.get("joint"))
                name = f" ({called})" if isinstance(called, str) else ""
        return label + name


def _child(node: object, step: str | int) -> object:
    if isinstance(node, dict):
        return node.get(step)
    if isinstance(node, list) and isinstance(step, int) and step < len(node):
        return node[step]
    return None


def _written(location: KeyPath, table: object) -> KeyPath:
    """Return the steps of pydantic's location that stand in the file, without its unions' tags."""
    path: KeyPath = ()
    for step in location:
        below = _child(table, step)
        if below is not None:
            path += (step,)
            table = below
    return path


def _meant(model: type[BaseModel], unknown: ErrorDetails) -> KeyPath:
    """Return the location of the key that was probably meant by an unknown one, () where none is similar."""
    *table, key = unknown["loc"]
    meant = closest_key(str(key), model, tuple(table))
    return (*table, meant) if meant else ()


def _unknown_key(model: type[BaseModel], unknown: ErrorDetails) -> str:
    meant = _meant(model, unknown)
    if meant:
        return f"there is no such key; did you mean '{meant[-1]}'?"
    known = ", ".join(known_keys(model, unknown["loc"][:-1]))
    return f"there is no such key; its table's keys are {known}" if known else "its table has no keys"
