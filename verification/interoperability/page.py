"""The table of docs/importers.md: what every importer gave in one run of all of them."""

import re
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from rov_fmu.io.output import Output, write_whole

from .run import Outcome, Verdict

_TABLE = re.compile(r"(?<=<!-- matrix -->\n).*?(?=<!-- end -->)", re.DOTALL)


class PageError(Exception):
    """A page that cannot have the table, in one line."""


def write_table(outcomes: Sequence[Outcome], page: Path) -> None:
    """Put the table of a run between `<!-- matrix -->` and `<!-- end -->` of a page. Raises PageError.

    Every importer has to have run and to agree, so that no row of the table is of another day.
    """
    if bad := [one for one in outcomes if not one.verdict.is_good]:
        raise PageError(f"{page}: {bad[0].importer.name} {bad[0].verdict.value}, so the table is not written")
    read_table(page)
    text = page.read_text(encoding="utf-8")
    heads, *rows = matrix(outcomes, by_vehicle=False)
    head, *lines = [f"| {' | '.join(line)} |" for line in (heads, *rows)]
    content = "\n".join(["", head, f"|{'---|' * len(heads)}", *lines, "", f"Run on {date.today()}.", "", ""])
    write_whole(Output(page, _TABLE.sub(lambda _: content, text).encode()), force=True)


def read_table(page: Path) -> str:
    """Return the table of a page, with the day of the run. Raises PageError."""
    table = _TABLE.search(page.read_text(encoding="utf-8"))
    if not table:
        raise PageError(f"{page}: there is no <!-- matrix --> with an <!-- end --> after it")
    return table[0]


def matrix(outcomes: Sequence[Outcome], *, by_vehicle: bool = True) -> list[list[str]]:
    """Return the headings, and a row for an importer in one mode, with the larger difference of both FMIs.

    Each vehicle has a column, or the last column has the largest difference of all, and how many vehicles flew.
    """
    vehicles = [*dict.fromkeys(one.vehicle for one in outcomes)]
    rows: dict[tuple[str, str], list[Outcome]] = {}
    for one in outcomes:
        title = f"{one.importer.title} {one.importer.version}"
        rows.setdefault((title, one.importer.interface), []).append(one)
    lines = [["importer", "FMI", "interface", *(vehicles if by_vehicle else ["largest difference"])]]
    for (title, interface), row in rows.items():
        versions = ", ".join(f"{n}.0" for n in sorted({one.importer.fmi for one in row}))
        cells = [_cell([one for one in row if one.vehicle == vehicle]) for vehicle in vehicles]
        if not by_vehicle:
            flown = len({one.vehicle for one in row})
            cells = [_cell(row) + (f" ({flown} vehicles)" if flown < len(vehicles) else "")]
        lines.append([title, versions, interface, *cells])
    return lines


def _cell(outcomes: Sequence[Outcome]) -> str:
    """Return what an importer gave for a vehicle: the difference, and the verdict where it is another than agrees."""
    differences = [one.difference for one in outcomes if one.difference is not None]
    verdicts = dict.fromkeys(one.verdict.value for one in outcomes if one.verdict is not Verdict.AGREES)
    return " ".join([*([f"{max(differences):.0e}"] if differences else []), *verdicts]) or "–"
