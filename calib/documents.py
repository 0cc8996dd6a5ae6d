"""The two JSON formats: what their parts have in common, reading with errors that name the field, and writing."""

import json
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from calib.durable_files import write_durably
from calib.errors import FormatError

Model = TypeVar("Model", bound=BaseModel)

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Document(BaseModel):
    """A part of a file: unknown keys are kept, a known one must be right."""

    # Parts are built with the whole that is read; most are never read alone.
    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)


def read_json(path: Path) -> Any:
    """Return the JSON value in `path`; raises FormatError with the file's name and where it breaks off."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FormatError(f"{path}: there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise FormatError(f"{path}: cannot be read: {reason}") from None
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        cut = " (the file seems to be cut off)" if error.pos >= len(text.rstrip()) else ""
        raise FormatError(f"{path}: not JSON at line {error.lineno}: {error.msg}{cut}") from None
    except (ValueError, RecursionError):
        raise FormatError(f"{path}: is nested too deeply, or has a number too long, to be read") from None


def validate(model: type[Model], data: object, what: str, fmt: str) -> Model:
    """Return `data` as `model`; raises FormatError in a sentence that names `what` and the first wrong field.

    `fmt` is the only value of the key `format` that is accepted.
    """
    if not isinstance(data, dict):
        raise FormatError(f"{what}: must be a JSON object, not {type(data).__name__}")
    if data.get("format") != fmt:
        found = repr(data["format"]) if "format" in data else "no format"
        raise FormatError(f"{what}: format must be {fmt!r}, but it has {found}")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise FormatError(f"{what}: {first_problem(error)}") from None


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a validation as `field: what is wrong`, and how many more there are."""
    problems = error.errors(include_url=False)
    first = problems[0]
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    where = field_path(first["loc"])
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return (f"{where}: {message}" if where else message) + more


def field_path(location: tuple[int | str, ...]) -> str:
    """Return `views[3].readings[1]` for a location of pydantic's."""
    path = ""
    for step in location:
        path += f"[{step}]" if isinstance(step, int) else f".{step}" if path else step
    return path


def write_json(path: Path, document: BaseModel) -> None:
    """Write a document durably, keeping the unknown keys it was read with and leaving out what is unset."""
    value = document.model_dump(mode="json", exclude_unset=True)
    write_durably(path, (json.dumps(value, indent=1, allow_nan=False) + "\n").encode())
