"""The line at which each key of a TOML text stands, which the standard library's parser does not tell."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field

KeyPath = tuple[str | int, ...]
"""Keys and list positions from the document's root, such as ("axes", 1, "limits")."""

_WORD = re.compile(
    r'''
      """(?:\\.|[^\\])*?"""(?!")    # up to two quotes may stand before the closing three
    | \'\'\'.*?\'\'\'(?!\')
    | "(?:\\.|[^"\\])*"
    | '[^'\n]*'
    | \#[^\n]*
    | [\w+-]+
    | \S                            # punctuation, of which brackets, dots and = matter
    | \n
    ''',
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True)
class Lines:
    """Line numbers, from 1, of a text's keys and tables.

    What stands within an inline table or an array has no line of its own, but that of the key before it.
    """

    by_path: dict[KeyPath, int] = field(default_factory=dict)

    def of(self, path: KeyPath) -> int:
        """Return the line of `path`, or of the nearest table above it where the path is not in the file."""
        while path and path not in self.by_path:
            path = path[:-1]
        return self.by_path.get(path, 1)


def scan_lines(text: str) -> Lines:
    """Return where the keys of `text` stand; it must be valid TOML."""
    lines = Lines()
    lengths: dict[KeyPath, int] = {}
    table: KeyPath = ()
    for line, words in _statements(text):
        if words[0] != "[":
            _record(lines, table, _keys(words[: words.index("=")]), line)
            continue
        is_list = words[1] == "["
        keys = _keys([word for word in words if word not in "[]"])
        table = _placed(keys[:-1], lengths) + keys[-1:]
        _record(lines, (), table, line)
        if is_list:
            lengths[table] = lengths.get(table, 0) + 1
            table += (lengths[table] - 1,)
        lines.by_path[table] = line  # the table's own header, which may come after those of its subtables
    return lines


def _statements(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the first line and the words of each header and each `key = value`, without comments."""
    line, first, depth = 1, 1, 0
    words: list[str] = []
    for match in _WORD.finditer(text):
        word = match[0]
        if word == "\n" and depth == 0:
            if words:
                yield first, words
            words = []
        elif word != "\n" and not word.startswith("#"):
            first = first if words else line
            words.append(word)
            depth += (word in ("[", "{")) - (word in ("]", "}"))
        line += word.count("\n")
    if words:
        yield first, words


def _keys(words: list[str]) -> KeyPath:
    return tuple(_unquoted(word) for word in words if word != ".")


def _unquoted(key: str) -> str:
    return str(tomllib.loads(f"key = {key}")["key"]) if key[0] in "\"'" else key


def _placed(keys: KeyPath, lengths: dict[KeyPath, int]) -> KeyPath:
    """Return the path with the last position of every list of tables that it goes through."""
    path: KeyPath = ()
    for key in keys:
        path += (key,)
        if path in lengths:
            path += (lengths[path] - 1,)
    return path


def _record(lines: Lines, table: KeyPath, keys: KeyPath, line: int) -> None:
    """Record keys given in `table`, and the tables that they imply."""
    for count in range(1, len(keys) + 1):
        lines.by_path.setdefault(table + keys[:count], line)
