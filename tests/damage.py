"""Damaged files for fuzzing: Hypothesis changes bytes, values of TOML files and cells of CSV files."""

import random
from collections.abc import Callable
from copy import deepcopy
from datetime import date, datetime
from functools import cache
from typing import Any

import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

TEXTS = st.one_of(
    st.sampled_from(
        [
            "",
            " ",
            "x" * 300,
            "x" * 100_000,
            "a\nb",
            "\x00",
            "\x1b[31mred",
            "\u202e",
            "\ufffe",
            "\x85",
            "Röv 4 κ",
            "潜水艇",
        ]
    ),
    st.sampled_from(
        ["nowhere", ".", "..", "/", "/dev/null", "videoray", "videoray.toml", "a/b", "class", "9x", "[/red]"]
    ),
    st.text(max_size=20),
)
NUMBERS = st.one_of(
    st.sampled_from([0.0, -0.0, 1.0, -1.0, 5e-324, 1e-300, 1e-9, 1e6, 1e308, -1e308, float("nan"), float("inf")]),
    st.sampled_from([0, 1, -1, 2**63, 10**400]),
    st.floats(),
    st.integers(),
)
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.one_of(TEXTS, NUMBERS, st.booleans(), st.dates(), st.datetimes(), st.sampled_from([date.min, datetime.max])),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(TEXTS, inner, max_size=3)),
    max_leaves=4,
)


def fuzz(check: Callable[[st.DataObject], None], examples: int) -> None:
    """Run a check with a given number of examples."""
    settings(max_examples=examples, suppress_health_check=list(HealthCheck))(given(data=st.data())(check))()


def changed_bytes(content: bytes, data: st.DataObject) -> bytes:
    """Return the content cut, with other bytes, repeated, or in another encoding."""
    at = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(at, min(at + 50, len(content))))
    put = data.draw(
        st.one_of(
            st.sampled_from(
                [b"", b"\0", b"\xff", b"\xef\xbb\xbf", b'"', b"'''", b"\n", b"\r", b"[" * 5000, b"," * 5000]
            ),
            st.sampled_from([b"{a=" * 5000, b"a." * 5000, b"0x" + b"f" * 5000, b"9" * 5000, b"#" + b"x" * 10_000]),
            st.binary(max_size=20),
        )
    )
    changes: dict[str, bytes] = {
        "cut": content[:at],
        "put": content[:at] + put + content[at:],
        "replaced": content[:at] + put + content[end:],
        "twice": content + content,
        "UTF-16": content.decode().encode("utf-16"),
        "BOM": b"\xef\xbb\xbf" + content,
        "Windows": content.replace(b"\n", b"\r\n"),
        "old Mac": content.replace(b"\n", b"\r"),
        "garbage": (put * 10_000)[:20_000],
    }
    return changes[data.draw(st.sampled_from(sorted(changes)))]


def changed_lines(content: bytes, data: st.DataObject) -> bytes:
    """Return the content with a line removed, repeated or moved."""
    lines = content.splitlines(keepends=True)
    n, to = data.draw(st.integers(0, len(lines) - 1)), data.draw(st.integers(0, len(lines) - 1))
    line = lines[n]
    if data.draw(st.booleans()):
        del lines[n]
    if data.draw(st.booleans()):
        lines.insert(to, line)
    return b"".join(lines)


@cache
def _parsed(text: str) -> Any:
    return tomlkit.parse(text).unwrap()


def toml_of(text: str) -> Any:
    """Return a new copy of the data of a TOML file, which is parsed once."""
    return deepcopy(_parsed(text))


def changed_toml(content: bytes, data: st.DataObject) -> bytes:
    """Return a TOML file with keys changed, removed, renamed or added."""
    document = toml_of(content.decode())
    for _ in range(data.draw(st.integers(1, 2))):
        table = document
        while inner := [key for key, value in table.items() if isinstance(value, dict)]:
            if (key := data.draw(st.sampled_from([None, *inner]))) is None:
                break
            table = table[key]
        keys = list(table)
        match data.draw(st.sampled_from(["replace", "replace", "replace", "drop", "rename", "add"])) if keys else "add":
            case "replace":
                table[data.draw(st.sampled_from(keys))] = data.draw(VALUES)
            case "drop":
                del table[data.draw(st.sampled_from(keys))]
            case "rename":
                table[data.draw(TEXTS)] = table.pop(data.draw(st.sampled_from(keys)))
            case _:
                table[data.draw(TEXTS)] = data.draw(VALUES)
    return tomlkit.dumps(document).encode()


def changed_numbers(content: bytes, data: st.DataObject) -> bytes:
    """Return a TOML file with other numbers in place of some of its numbers."""
    document = toml_of(content.decode())
    numbers: list[tuple[Any, Any, float]] = []
    tables: list[Any] = [document]
    while tables:
        table = tables.pop()
        for key, value in table.items() if isinstance(table, dict) else enumerate(table):
            if isinstance(value, dict | list):
                tables.append(value)
            elif type(value) in (int, float):
                numbers.append((table, key, value))
    for _ in range(data.draw(st.integers(1, 3))):
        table, key, value = data.draw(st.sampled_from(numbers))
        table[key] = value * data.draw(SIZES) if data.draw(st.booleans()) else data.draw(NUMBERS)
    return tomlkit.dumps(document).encode()


def changed_cells(content: bytes, data: st.DataObject) -> bytes:
    """Return a CSV file with other texts in some cells, including cells of the header."""
    rows = [line.split(",") for line in content.decode().splitlines()]
    for _ in range(data.draw(st.integers(1, 3))):
        row = data.draw(st.sampled_from(rows[1:])) if data.draw(st.integers(0, 5)) else rows[0]
        row[data.draw(st.integers(0, len(row) - 1))] = data.draw(CELLS)
    return "\n".join(map(",".join, rows)).encode()


CELLS = st.one_of(
    st.sampled_from(
        ["", "0", "-0", "nan", "inf", "1e400", "1e308", "-1e308", "5e-324", "1e-320", "1e-9", "1e-6", "1e6"]
    ),
    st.sampled_from(
        ["100", "-100", "20", "30", "0.3", "0,31", '"', '"a\nb"', "=1+1", "٣", "1_0", "0x10", "20;0.3", "\0"]
    ),
    st.sampled_from(["command [%]", "velocity [m/s]", "command [1]", "velocity", "force [N]", "x" * 10_000]),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-100, 100).map(str),
)


def changed_course(content: bytes, data: st.DataObject) -> bytes:
    """Return a table of numbers with some columns scaled, shifted, constant or noisy, or with only some rows."""
    header, *lines = content.decode().splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    for _ in range(data.draw(st.integers(1, 2))):
        column, size = data.draw(st.integers(0, len(rows[0]) - 1)), data.draw(SIZES)
        start = data.draw(st.integers(0, len(rows) - 1))
        end = data.draw(st.integers(start + 1, len(rows)))
        noise = random.Random(data.draw(st.integers(0, 99)))
        kind = data.draw(
            st.sampled_from(["scaled", "shifted", "constant", "noisy", "jumping", "stepped", "few", "ramp"])
        )
        if kind == "few":
            rows = rows[start:end]
            continue
        for n, row in enumerate(rows[start:end]):
            row[column] = {
                "scaled": size * row[column],
                "shifted": row[column] + size,
                "constant": size,
                "noisy": row[column] + size * noise.gauss(0.0, 1.0),
                "jumping": size * (-1.0) ** n,
                "stepped": row[column] + size * (n > 0),
                "ramp": size * n,
            }[kind]
    return "\n".join([header, *(",".join(map(repr, row)) for row in rows)]).encode()


SIZES = st.sampled_from([0.0, 1e-200, 1e-9, 1e-3, 0.1, 10.0, 1e3, 1e6, 1e9, 1e300, -1.0])
