"""Which function is legal in which mode, as Python and as C: legal_calls.txt (FMI 2.0), legal_calls_fmi3.txt."""

from collections.abc import Mapping
from pathlib import Path

from rov_fmu.io.templates import render

MODEL_EXCHANGE, CO_SIMULATION, WITH_EVENTS = range(3)
"""Kinds of instances; FMI 3.0 alone has Co-Simulation with Event Mode."""
_HERE = Path(__file__).parent
_FILES = {2: "legal_calls.txt", 3: "legal_calls_fmi3.txt"}
_OF_MODEL_EXCHANGE = 5
"""Columns; the others are those of Co-Simulation."""

Columns = Mapping[int, tuple[str, ...]]


def _read(fmi: int) -> tuple[Columns, list[list[str]]]:
    """The columns of each kind of instance, then a row for each function."""
    text = (_HERE / _FILES[fmi]).read_text(encoding="utf-8")
    head, *calls = [line.split() for line in text.splitlines() if not line.startswith("#")]
    columns = {MODEL_EXCHANGE: tuple(head[:_OF_MODEL_EXCHANGE]), CO_SIMULATION: tuple(head[_OF_MODEL_EXCHANGE:])}
    return columns if fmi == 2 else {**columns, WITH_EVENTS: columns[CO_SIMULATION]}, calls


_TABLES = {fmi: _read(fmi) for fmi in _FILES}
MODES = _TABLES[2][0]
"""The columns of the tables of FMI 2.0, by their names in instance.h."""


def table(fmi: int) -> list[list[str]]:
    """A row for each function: its name, then a mark for each column."""
    return _TABLES[fmi][1]


def legal_modes(kind: int, fmi: int = 2) -> Mapping[str, tuple[str, ...]]:
    """The functions of a kind of instance, each with the modes in which it is legal, by their names in instance.h."""
    columns, calls = _TABLES[fmi]
    first = 0 if kind == MODEL_EXCHANGE else _OF_MODEL_EXCHANGE
    without_events = fmi == 3 and kind == CO_SIMULATION
    legal = {}
    for name, *marks in calls:
        legal[name] = tuple(
            mode
            for mode, mark in zip(columns[kind], marks[first : first + len(columns[kind])], strict=True)
            if mark != "." and not (without_events and (mark == "e" or mode == "EVENT"))
        )
    return {name: modes for name, modes in legal.items() if modes}


def legal_header(fmi: int = 2) -> str:
    """legal.h: every function that takes an instance, its name, and its modes by kind of instance."""
    columns, calls = _TABLES[fmi]
    tables = [legal_modes(kind, fmi) for kind in columns]
    return render("legal.h.j2", _HERE / "c", names=[name for name, *_ in calls], tables=tables, source=_FILES[fmi])
