import tomllib
from textwrap import dedent
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.profile.lines import KeyPath, scan_lines


@pytest.mark.parametrize(
    ("text", "path", "line"),
    [
        ("a = 1\nb = 2", ("b",), 2),
        ("# b = 0\n\n  b = 2", ("b",), 3),
        ("a = 1\r\nb = 2\r\n", ("b",), 2),
        ("[t]\na = 1", ("t",), 1),
        ("[t]\na = 1", ("t", "a"), 2),
        ("[ t . u ] # x\na = 1", ("t", "u", "a"), 2),
        ("[t.u]\na = 1\n[t]\nb = 1", ("t",), 3),
        ("[t]\n[t.u]\na = 1", ("t",), 1),
        ("[t]\nu.a = 1\nu.b = 1", ("t", "u", "b"), 3),
        ("[t]\nu.a = 1\nu.b = 1", ("t", "u"), 2),
        ("[[t]]\na = 1\n[[t]]\na = 1", ("t", 1, "a"), 4),
        ("[[t]]\na = 1\n[[t]]\na = 1", ("t", 1), 3),
        ("[[t]]\na = 1\n[[t]]\na = 1", ("t",), 1),
        ("[[t]]\n[[t]]\n[t.u]\na = 1", ("t", 1, "u", "a"), 4),
        ("[[t]]\n[[t.u]]\n[[t.u]]\n[[t]]\n[[t.u]]\na = 1", ("t", 1, "u", 0, "a"), 6),
        ("\"a b\" = 1\n'c.d' = 2", ("c.d",), 2),
        ('"a\\u0062" = 1', ("ab",), 1),
        ('["x y".z]\n\na = 1', ("x y", "z", "a"), 3),
        ('a = """\nb = 1\n"""\nb = 2', ("b",), 4),
        ('a = """x"""""\nb = 2', ("b",), 2),
        ('a = """\\"""\n"""\nb = 2', ("b",), 3),
        ("a = '''\n[t]\n'''\nb = 2", ("b",), 4),
        ('a = "#" # "\nb = 2', ("b",), 2),
        ('a = "x\\"]["\nb = 2', ("b",), 2),
        ("a = [\n  'b = 1', # ]\n  [2,\n 3]]\nb = 2", ("b",), 5),
        ("a = { b = 1, c = [1,\n2] }\nd = 2", ("d",), 3),
        ("a = { b = 1 }\nc = 1", ("a", "b"), 1),
        ("a = 1.5\nb = 1979-05-27T07:32:00Z\nc = 1", ("c",), 3),
        ("a.b = 1.5\nc = 1", ("a", "b"), 1),
    ],
)
def test_a_key_is_found_at_its_line(text: str, path: KeyPath, line: int) -> None:
    tomllib.loads(text)
    assert scan_lines(text).of(path) == line


def test_what_is_not_there_is_looked_for_in_the_table_that_lacks_it() -> None:
    lines = scan_lines("a = 1\n\n[t]\nb = 1\n\n[[u]]\nc = 1\n")
    assert lines.of(("t", "missing")) == 3
    assert lines.of(("u", 0, "missing", "deeper")) == 6
    assert lines.of(("missing",)) == 1


_VALUES = st.sampled_from(
    [
        "1",
        "-1.5e3",
        '"a # [b] = "',
        "'[x'",
        "[1, [2]]",
        '[\n  "b = 1", # ]\n  2,\n]',
        '"""\n[t]\n"""',
        "{ x = 1 }",
    ]
)
_KEYS = st.sampled_from(["a", "b-c", '"d e"', "f.g", "h"])
_TABLES = st.dictionaries(_KEYS, _VALUES, max_size=4)


@given(
    root=_TABLES,
    lists=st.lists(st.tuples(_TABLES, _TABLES), max_size=3),
    gap=st.sampled_from(["", "\n", "# x\n"]),
)
def test_every_key_of_a_document_is_found_where_it_was_written(
    root: dict[str, str], lists: list[tuple[dict[str, str], dict[str, str]]], gap: str
) -> None:
    text, written = "", {}

    def write(table: KeyPath, values: dict[str, str]) -> None:
        nonlocal text
        for key, value in values.items():
            text += gap
            written[table + _parts(key)] = text.count("\n") + 1
            text += f"{key} = {value} # {key}\n"

    write((), root)
    for index, (outer, inner) in enumerate(lists):
        text += "[[list]]\n"
        write(("list", index), outer)
        text += "[list.inner]\n"
        write(("list", index, "inner"), inner)
    lines = scan_lines(text)
    assert {path: lines.by_path.get(path) for path in written} == written
    assert {path for path in lines.by_path if not _is_there(tomllib.loads(text), path)} == set()


def _parts(key: str) -> KeyPath:
    return (key.strip('"'),) if key.startswith('"') else tuple(key.split("."))


def _is_there(node: Any, path: KeyPath) -> bool:
    for step in path:
        try:
            node = node[step]
        except (KeyError, IndexError):
            return False
    return True


def test_an_unfinished_array_does_not_swallow_the_next_table() -> None:
    text = dedent(
        """\
        readings = [
          "0 mm", # ["
        ]
        [t]
        """
    )
    assert scan_lines(text).of(("t",)) == 4
