"""The table of results: sections that share five columns, and the format of their numbers."""

import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rov_fmu.c.compile import compiler

_WIDTH = 118

Section = Sequence[Sequence[str]]
"""A title with the headings of up to four columns, then rows with a name and cells."""


def print_sections(sections: Iterable[Section]) -> None:
    """Print the table. Without a terminal it is 118 characters wide."""
    table = Table(show_header=False, show_edge=False, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(min_width=46)
    for _ in range(4):
        table.add_column(justify="right", min_width=15)
    for headings, *rows in sections:
        if table.row_count:
            table.add_row()
        table.add_row(*(f"[bold]{escape(text)}[/]" for text in headings))
        for row in rows:
            table.add_row(*map(escape, row))
    console = Console()
    (console if console.is_terminal else Console(width=_WIDTH)).print(table, highlight=False)


def digits(value: float, count: int = 3) -> str:
    """Return a number with `count` significant digits and commas between thousands."""
    if value == 0.0:
        return "0"
    exponent = int(f"{value:.{count - 1}e}".partition("e")[2])
    return f"{value:,.{max(0, count - 1 - exponent)}f}"


def duration(seconds: float) -> str:
    """Return a duration in ns, µs, ms or s."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{digits(seconds / size)} {unit}"
    return f"{digits(seconds / 1e-9)} ns"


def error(value: float) -> str:
    """Return an error as one digit and a power of ten."""
    return f"{value:.0e}".replace("e-0", "e-") if value else "0"


def machine() -> str:
    """Return two lines about the machine and its software."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    clang = subprocess.run([*compiler(), "--version"], check=True, capture_output=True, text=True).stdout.split("\n")[0]
    tools = f"Python {platform.python_version()}, FMPy {version('fmpy')}, ziglang {version('ziglang')} ({clang})"
    return f"{model}, {os.cpu_count()} cores{load}; {platform.system()} {platform.release()}\n{tools}"
