"""Which FMI 2.0 function is legal in which mode, as Python and as C: legal_calls.txt."""

from collections.abc import Mapping
from pathlib import Path

from rov_fmu.files.templates import render

MODEL_EXCHANGE, CO_SIMULATION = range(2)
_HERE = Path(__file__).parent
_HEAD, *_CALLS = [
    line.split()
    for line in (_HERE / "legal_calls.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
]
MODES = {MODEL_EXCHANGE: tuple(_HEAD[:5]), CO_SIMULATION: tuple(_HEAD[5:])}
"""The columns of the tables, by their names in fmi2_instance.h."""


def legal_modes(kind: int) -> Mapping[str, tuple[str, ...]]:
    """The functions of an interface, each with the modes in which it is legal."""
    rows = ((name, marks[5 * kind : 5 * kind + 5]) for name, *marks in _CALLS)
    legal = {
        name: tuple(mode for mode, mark in zip(MODES[kind], marks, strict=True) if mark != ".") for name, marks in rows
    }
    return {name: modes for name, modes in legal.items() if modes}


def legal_header() -> str:
    """legal.h: every function that takes an instance, its name, and its modes by interface."""
    tables = {"fmi2ModelExchange": legal_modes(MODEL_EXCHANGE), "fmi2CoSimulation": legal_modes(CO_SIMULATION)}
    return render("legal.h.j2", _HERE / "c", names=[name for name, *_ in _CALLS], tables=tables)
