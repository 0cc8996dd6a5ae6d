"""What pydantic finds wrong with a value, in the words of somebody who writes TOML."""

from pydantic_core import ErrorDetails

_LONGEST_SHOWN = 40
"""Characters of a wrong value that are repeated in the message."""


def sentence(details: ErrorDetails) -> str:
    """Return what is wrong with a value, to be read after its key."""
    context, value = details.get("ctx", {}), details["input"]
    match details["type"]:
        case "value_error":
            return str(context["error"])
        case "too_short":
            return f"must hold at least {context['min_length']}, not {context['actual_length']}"
        case "too_long":
            return f"must hold at most {context['max_length']}, not {context['actual_length']}"
        case "list_type" | "tuple_type":
            return _no_list(value)
        case "dict_type" | "model_type" | "model_attributes_type":
            return _no_table(value)
        case _:
            message = details["msg"].replace("Input should be", "must be")
            found = _found(value) if message.startswith("must be") else ""
            return message[:1].lower() + message[1:] + found


def _no_list(value: object) -> str:
    if isinstance(value, dict):
        return "must be a list of tables: write its header in double brackets"
    return "must be a list in brackets" + _found(value)


def _no_table(value: object) -> str:
    if isinstance(value, list):
        return "must be one table: write its header in single brackets"
    return "must be a table" + _found(value)


def _found(value: object) -> str:
    shown = f"'{value}'" if isinstance(value, str) else repr(value)
    return f", not {shown}" if len(shown) <= _LONGEST_SHOWN else ""
