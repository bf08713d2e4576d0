"""The console that the commands print on, its tables, and the printout of a proof."""

import os
import re
import shlex
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from decimal import Decimal
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from rov_fmu.io.messages import listed, one_line, wrapped

if TYPE_CHECKING:
    from rov_fmu.prove.proof import ProofFinding

DEVIATION = "+.1%"
"""The format of a relative deviation."""
_WIDE = 110
"""The width of tables in a pipe or a file, in columns."""


class _Console(Console):
    """A console on which every string is one line: line breaks and control characters in it are escaped.

    Rich lays out each string that this method returns, in tables and outside them, so none of a stranger's can forge a
    line. Text of more than one line is a `Text`.
    """

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a string as Rich's text."""
        return super().render_str(one_line(text), **options)


def console(*, stderr: bool = False) -> Console:
    """Return a console that prints text without markup, as wide as the terminal."""
    found = _Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not found.is_terminal:
        found.width = max(found.width, _WIDE)  # Rich assumes 80 columns
    return found


def paragraph(out: Console, words: str, indent: str | None = None) -> None:
    """Print a paragraph. A terminal gets lines that end between words; a pipe or a file gets one line.

    Lines after the first have the indent; without one, those of an item of a list or of an indented line have two
    blanks.
    """
    words = one_line(words)
    if indent is None:
        indent = "  " if words.startswith(("- ", "  ")) else ""
    out.print(Text(wrapped(words, out.width, indent) if out.is_terminal else words), soft_wrap=not out.is_terminal)


def shell_words(*words: str | Path) -> str:
    """Return the words of a command line for people, quoted for a shell."""
    clean = [one_line(str(word)) for word in words]
    return subprocess.list2cmdline(clean) if os.name == "nt" else shlex.join(clean)


def print_end(files: Mapping[Path, str], following: str = "") -> None:
    """Print which files a command wrote and what each replaced, and what to do next: a command line, or words."""
    out = console()
    paths = [shell_words(path) + (f" (replaced {old})" if old else "") for path, old in files.items()]
    sentences = [f"Wrote {listed(paths)}."] if files else []
    sentences += [f"Next: {following}"] if following else []
    if out.is_terminal and len(" ".join(sentences)) > out.width:
        for sentence in sentences:
            paragraph(out, sentence)
    elif sentences:
        paragraph(out, " ".join(sentences))


def print_table(found: Table, out: Console | None = None) -> None:
    """Print a table with its title and its caption. A pipe or a file gets whole lines. A terminal that is too narrow
    for the numbers gets several tables, each with the first column, and wraps the cells of texts."""
    out = out or console()
    if out.is_terminal:
        for part in _narrowed(found, out):
            out.print(part)
        return
    if found.title:  # a table would break a long path to its own width
        out.print(found.title, soft_wrap=True)
    found = copy(found)
    found.title = None
    out.width = max(out.width, _width(found, out))
    for line in out.render_lines(found, pad=False):
        out.print("".join(segment.text for segment in line).rstrip(), soft_wrap=True)


def _narrowed(found: Table, out: Console) -> Iterator[Table]:
    """Yield tables with as many columns of numbers as fit beside the first column; the last one has the texts, too."""
    first, *others = found.columns
    texts = [column for column in others if column.justify != "right"]
    groups: list[list[Column]] = [[]]
    for column in others:
        if column not in texts:
            if groups[-1] and _width(_with_columns(found, [first, *groups[-1], column]), out) > out.width:
                groups.append([])
            groups[-1].append(column)
    for n, group in enumerate(groups):
        is_last = n == len(groups) - 1
        part = _with_columns(found, [first, *group, *(texts if is_last else [])])
        part.title = found.title if n == 0 else None
        part.caption = found.caption if is_last else None
        yield part


def _with_columns(found: Table, columns: Sequence[Column]) -> Table:
    """Return a table with some of its columns."""
    part = copy(found)
    part.columns = [replace(column, _index=n) for n, column in enumerate(columns)]
    return part


def _width(found: Table, out: Console) -> int:
    """Return the width of a table in which no cell is wrapped."""
    return out.measure(found, options=out.options.update(max_width=10_000)).maximum


def print_proof(findings: "Sequence[ProofFinding]") -> None:
    """Print how many results are as expected, then the largest deviation of each experiment and each failed result."""
    out = console()
    experiments = [*dict.fromkeys(f.experiment for f in findings)]
    number = f"{len(experiments)} experiment{'s' if len(experiments) > 1 else ''}"
    passed = f"{sum(f.passed for f in findings)} of {len(findings)} pass"
    counted = f"{number}, {len(findings)} result{'s' if len(findings) > 1 else ''}: {passed}."
    paragraph(out, f"{counted} A deviation is the largest one, relative to the largest expected value.")
    out.print()
    found = table("", "experiment", ("deviation", "tolerance"), ("result", "of"))
    for experiment in experiments:
        own = [f for f in findings if f.experiment == experiment]
        if good := [f for f in own if f.passed]:
            worst = max(good, key=lambda f: f.deviation)
            found.add_row(experiment, *_deviation(worst), "pass", ", ".join(f.variable for f in good))
        for f in own:
            if not f.passed:
                found.add_row(experiment, *_deviation(f), "FAIL", f.error or f.variable)
    print_table(found, out)


def _deviation(f: "ProofFinding") -> tuple[str, str]:
    return text(f.deviation, ".1e"), text(f.tolerance, ".1e")


def table(title: str, first: str, numbers: Iterable[str], texts: Iterable[str] = ()) -> Table:
    """Return an empty table with a first column, then columns of numbers, then columns of texts."""
    result = Table(title=title or None, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    result.title_style = result.caption_style = ""
    result.title_justify = result.caption_justify = "left"
    result.add_column(Text(first), overflow="fold")
    for header in numbers:
        result.add_column(Text(header), justify="right", overflow="fold")
    for header in texts:
        result.add_column(header)
    return result


def text(value: float | Decimal | None, form: str = "") -> str:
    """Return a number in a format, or a dash for None and NaN. A number that is rounded to 0 has no minus sign."""
    if value is None or isnan(value):
        return "-"
    shown = format(value, form)
    is_zero = not re.search("[1-9]|inf", shown)
    return shown.replace("-", "+" if form.startswith("+") else "") if is_zero else shown
