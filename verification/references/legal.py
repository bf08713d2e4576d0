"""The FMI functions that are legal in each mode, from legal_calls.txt (FMI 2.0) and legal_calls_fmi3.txt."""

from collections.abc import Mapping
from pathlib import Path

from rov_fmu.io.templates import render

MODEL_EXCHANGE, CO_SIMULATION, WITH_EVENTS = range(3)
"""The kinds of instances. Only FMI 3.0 has Co-Simulation with Event Mode."""
_HERE = Path(__file__).parent
_FILES = {2: "legal_calls.txt", 3: "legal_calls_fmi3.txt"}
_MODEL_EXCHANGE_COLUMNS = 5
"""The number of columns for Model Exchange; the remaining ones are for Co-Simulation."""

Columns = Mapping[int, tuple[str, ...]]


def _read(fmi: int) -> tuple[Columns, list[list[str]]]:
    """Return the columns of each kind of instance, and a row for each function."""
    text = (_HERE / _FILES[fmi]).read_text(encoding="utf-8")
    head, *calls = [line.split() for line in text.splitlines() if not line.startswith("#")]
    columns = {
        MODEL_EXCHANGE: tuple(head[:_MODEL_EXCHANGE_COLUMNS]),
        CO_SIMULATION: tuple(head[_MODEL_EXCHANGE_COLUMNS:]),
    }
    return columns if fmi == 2 else {**columns, WITH_EVENTS: columns[CO_SIMULATION]}, calls


_TABLES = {fmi: _read(fmi) for fmi in _FILES}
MODES = _TABLES[2][0]
"""The modes of FMI 2.0 by kind of instance, with their names in instance.h."""


def table(fmi: int) -> list[list[str]]:
    """Return a row for each function: its name, then a mark for each column."""
    return _TABLES[fmi][1]


def legal_modes(kind: int, fmi: int = 2) -> Mapping[str, tuple[str, ...]]:
    """Return the functions of a kind of instance with the modes in which each is legal (names of instance.h)."""
    return _marked(kind, fmi, "xe+")


def _marked(kind: int, fmi: int, wanted: str) -> Mapping[str, tuple[str, ...]]:
    columns, calls = _TABLES[fmi]
    first = 0 if kind == MODEL_EXCHANGE else _MODEL_EXCHANGE_COLUMNS
    without_events = fmi == 3 and kind == CO_SIMULATION
    legal = {}
    for name, *marks in calls:
        legal[name] = tuple(
            mode
            for mode, mark in zip(columns[kind], marks[first : first + len(columns[kind])], strict=True)
            if mark in wanted and not (without_events and (mark == "e" or mode == "EVENT"))
        )
    return {name: modes for name, modes in legal.items() if modes}


def tolerated_modes(kind: int, fmi: int = 2) -> Mapping[str, tuple[str, ...]]:
    """Return the functions with the modes in which only importers call them (marked +), and the FMU warns once."""
    return _marked(kind, fmi, "+")


def legal_header(fmi: int = 2) -> str:
    """Return legal.h: every function that takes an instance, with its name and its modes by kind of instance."""
    columns, calls = _TABLES[fmi]
    tables = [legal_modes(kind, fmi) for kind in columns]
    return render("legal.h.j2", _HERE / "c", names=[name for name, *_ in calls], tables=tables, source=_FILES[fmi])
