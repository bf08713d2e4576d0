"""The tested curves and the likely meaning of headers of tables, before a vehicle is known."""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby, takewhile
from pathlib import Path

from rov_fmu.io.csv_table import Column, DataFileError, find_column, read_header
from rov_fmu.model.layout import AXES
from rov_fmu.tank.tables import TABLES, columns_of

_CURVE = re.compile(r"[a-z][a-z0-9_]{0,29}")
_HEADER = re.compile(r"(?P<name>[^\[(]*?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*")
_WORDS = {
    "command": {"command", "commands", "cmd", "throttle", "duty", "setpoint", "input", "output"},
    "force": {"force", "thrust", "pull", "push", "bollard", "load"},
    "velocity": {"velocity", "vel", "speed", "rate"},
    "time constant": {"tau", "constant", "time"},
}
"""The words by which the column of a table is recognised."""


@dataclass(frozen=True)
class TableHeaders:
    """The information in the names and headers of tables."""

    curves: tuple[str, ...] = ()
    """The thrust curves that are tested."""
    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers of columns that seem to be meant, by the headers of the files."""
    unknown: tuple[str, ...] = ()
    """The headers that are not recognised."""


def header_parts(title: str) -> tuple[str, str]:
    """Return the name and the unit in a header with brackets of any kind."""
    match = _HEADER.fullmatch(title)
    return (match["name"], match["unit"]) if match else (title, "")


def headers_of_tables(folder: Path) -> TableHeaders:
    """Return the information in the tables of a folder. Of a table that cannot be read, only the name is used."""
    columns: dict[str, str] = {}
    unknown: dict[str, None] = {}
    tested = []
    for path in sorted(folder.glob("*.[cC][sS][vV]")):
        stem = path.stem.lower()
        kind = next((kind for kind in TABLES if stem.startswith(f"{kind}_")), "")
        if not kind:
            continue
        subject = stem.removeprefix(f"{kind}_")
        if kind == "thrust":
            tested.append(subject)
        of_table = columns_of(kind, AXES.get(subject.partition("_")[0]))
        with suppress(DataFileError):
            for title in read_header(path):
                if not _is_known(title, of_table):
                    meant = _meant(title, of_table)
                    columns |= {title: meant} if meant else {}
                    unknown |= {} if meant else {title: None}
    return TableHeaders(tuple(_curves(tested)), columns, tuple(title for title in unknown if title not in columns))


def _curves(tested: Iterable[str]) -> Iterator[str]:
    """Yield the name of a curve for all names of files that begin with the same word: main for main_1 and main_2."""
    for _, group in groupby(sorted({*tested}), lambda name: name.partition("_")[0]):
        parts = zip(*(name.split("_") for name in group), strict=False)
        name = "_".join(words[0] for words in takewhile(lambda words: len({*words}) == 1, parts))
        if _CURVE.fullmatch(name):
            yield name


def _is_known(title: str, columns: Mapping[str, Column]) -> bool:
    try:
        return find_column(title, columns, others=True) is not None
    except ValueError:  # without a known unit
        return False


def _meant(title: str, columns: Mapping[str, Column]) -> str:
    """Return the header that an unknown header with a known unit seems to mean, or an empty text."""
    name, unit = header_parts(title)
    words = {*re.findall("[a-z]+", name.casefold())}
    return next(
        (f"{key} [{unit}]" for key in columns if _WORDS[key] & words and _is_known(f"{key} [{unit}]", columns)), ""
    )
