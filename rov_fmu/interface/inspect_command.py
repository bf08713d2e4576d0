"""What the logs of a folder contain, and a draft of rov.toml: `rov-fmu identify --inspect` and `--draft`."""

import errno
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

from rov_fmu.equation.catalogue import ARM, AXES, BODY, EXTERNAL
from rov_fmu.equation.layout import Layout
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import NO_FILE, brief, first_of, one_line
from rov_fmu.io.output import Output, WriteError, write_whole
from rov_fmu.io.templates import render
from rov_fmu.tank.catalogue import NOT_MEASURED, words_of
from rov_fmu.tank.columns import COMMAND
from rov_fmu.tank.description import NO_ROV_FILE, ROV_FILE, read_description
from rov_fmu.tank.findings import SENTENCES, Finding, about, sentences
from rov_fmu.tank.folder import unreadable
from rov_fmu.tank.inspection.headers import TableHeaders, fitting, headers_of_tables, likely_thrusters
from rov_fmu.tank.inspection.inspection import Inspection, inspect, logs_among
from rov_fmu.tank.readers.listing import BAG, NOT_OPENED, Listing, list_files, named
from rov_fmu.tank.readers.parsers import format_of, one_parser
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle


@dataclass(frozen=True)
class Inspected:
    """What the logs of a folder contain, and what rov.toml would be."""

    logs: Sequence[Inspection]
    warnings: Sequence[str]
    """A sentence for each file that cannot be read."""
    notes: Sequence[str]
    """A sentence about the tables in the folder, and one for each reason why others are not read."""
    draft: Path
    """The place of rov.toml."""
    text: str
    """The draft of rov.toml."""

    @property
    def missing(self) -> list[str]:
        """What to do before anything can be identified, besides editing the draft."""
        has_commands = any(one.commands or any(row.name == COMMAND for row in one.channels) for one in self.logs)
        has_names = all(finding.kind != "unnamed table" for one in self.logs for finding in one.findings)
        steps = {"add the commands, or name their columns": has_commands, "rename the tables": has_names}
        return [step for step, is_done in steps.items() if not is_done]


def lacks_description(folder: Path) -> bool:
    """Return True for a folder with logs or tables but without rov.toml."""
    return folder.is_dir() and not (folder / ROV_FILE).exists() and bool(list_files(folder).tests)


@one_parser()
def inspect_logs(path: Path) -> Inspected:
    """Return what a log, or each log in a folder, contains, with a draft of rov.toml.

    If there is a rov.toml already, thrusters and columns have its names, unless its hardware tables have a mistake.
    Files that cannot be read are left out. Raises DataFileError if no file is left, and VehicleFileError if rov.toml is
    not TOML.
    """
    if not path.exists():
        raise DataFileError(f"{path}: {NO_FILE}")
    if not (path.is_dir() or path.is_file()):
        raise DataFileError(f"{path}: {NOT_OPENED}")
    folder = path if path.is_dir() else path.parent
    folder = folder.parent if (folder / BAG).is_file() else folder
    described = read_description(folder / ROV_FILE) if (folder / ROV_FILE).exists() else NO_ROV_FILE
    layouts = {name: load_vehicle(file).layout for name, file in SHIPPED.items()}
    listing = list_files(path) if path.is_dir() else Listing(folder, [path])
    inspections: list[Inspection] = []
    mistakes: list[str] = []
    findings: list[Finding] = listing.findings
    logs = logs_among(listing.tests, described.tables.columns)
    if tables := [test for test in listing.tests if test not in logs]:
        findings.append(about(named(tables), "tank tests"))
    for log in logs:
        try:
            inspections += inspect(log, layouts.values(), described)
        except DataFileError as error:
            mistakes += str(error).splitlines()
            findings.append(unreadable(log, error))
    if not inspections:
        raise DataFileError(*([*mistakes, *listing.lines("unreadable file")] if mistakes else listing.no_tests()))
    headers = headers_of_tables(folder)
    text = _draft(folder, inspections, headers, *_thrusters(inspections, layouts, headers.curves))
    notes = [finding for finding in findings if finding.kind in ("tank tests", "other files")]
    warnings = [finding for finding in findings if finding not in notes]
    return Inspected(inspections, sentences(warnings, SENTENCES), sentences(notes, SENTENCES), folder / ROV_FILE, text)


def _thrusters(
    inspections: Iterable[Inspection], layouts: Mapping[str, Layout], curves: Collection[str]
) -> tuple[list[str], str]:
    """Return the thrusters of the log that has most of them, and the first vehicle that has such ones and the curves.

    Without such a vehicle, its name is empty.
    """
    most = max(inspections, key=lambda one: (len(one.commands), sum(row.low < row.high for row in one.commands)))
    ends = {row.name.removeprefix("thruster "): (row.low, row.high) for row in most.commands}
    thrusters = likely_thrusters(ends, layouts.values()) if _is_bag(most.path) else [*ends]
    fits = fitting(thrusters, layouts.values())
    if fits and not {*curves} <= {curve.name for curve in fits.curves}:
        fits = None
    return thrusters, next((name for name, layout in layouts.items() if layout == fits), "")


def write_draft(path: Path, text: str) -> None:
    """Write a draft of rov.toml. Raises WriteError if the file exists."""
    check_no_description(path)
    write_whole(Output(path, text.encode()))


def check_no_description(path: Path) -> None:
    """Raise WriteError if there is a rov.toml already."""
    if path.exists():
        raise WriteError(errno.EEXIST, "the file there is not replaced by a draft", str(path))


# ---- The draft -------------------------------------------------------------------------------------------------------


def _draft(
    folder: Path, inspections: Sequence[Inspection], tables: TableHeaders, thrusters: Sequence[str], base: str
) -> str:
    """Return a draft, which is a complete rov.toml if a vehicle that ships, `base`, has such thrusters."""
    name = folder.resolve().name or inspections[0].path.stem
    word = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    vehicle = load_vehicle(SHIPPED[base]) if base else None
    columns, headers = _columns([one for one in inspections if not _is_bag(one.path)], tables)
    return render(
        "rov.toml.j2",
        Path(__file__).parent / "templates",
        quoted=_quoted,
        names=one_line(brief(", ".join(dict.fromkeys(one.path.name for one in inspections)))),
        is_own=not base and len(thrusters) > 1,
        is_wrench=not EXTERNAL.isdisjoint(thrusters),
        thrusters=thrusters,
        shipped=SHIPPED,
        base=base,
        name=name,
        identifier=word if word[:1].isalpha() else f"rov_{word}",
        curves=tables.curves or ["all"],
        axes=AXES.values(),
        signals={row.name for one in inspections for row in one.channels},
        body=[*BODY, *ARM],
        vehicle=vehicle,
        columns=columns,
        headers=_questions(headers),
        fields=_questions(_fields(inspections)),
        dives=_dives(inspections),
    )


def _fields(inspections: Iterable[Inspection]) -> dict[str, str]:
    """Return the descriptions of the fields of topics that are not recognised, without those of what is wanted."""
    unread = {name: what for one in inspections if _is_bag(one.path) for name, what in one.unread.items()}
    return {
        name: what
        for name, what in unread.items()
        if any(name[:n] in unread for n, mark in enumerate(name) if mark == ".") and not NOT_MEASURED & words_of(name)
    }


def _is_bag(path: Path) -> bool:
    """Return True for a log with topics, which is no table."""
    return not format_of(path).open


def _questions(names: Mapping[str, str]) -> list[str]:
    """Return a line for each of the first names, with the description of its values."""
    return first_of([one_line(f'{_quoted(name)} = "?"{what and f"   # {what}"}') for name, what in names.items()])


def _dives(inspections: Sequence[Inspection]) -> list[list[str]]:
    """Return the files of each dive of several files: one with commands, and those without commands that belong to it.

    A file without commands belongs to the one whose times overlap most with its own, or, without an overlap, to the
    only one with commands. Where there are several, the user has to decide.
    """
    times = {one.path: _times(one) for one in inspections}
    files = {one.path: [one.path.name] for one in inspections if one.commands}
    undecided = []
    for path, (start, end) in times.items():
        if files and path not in files and isfinite(start):
            overlaps = {other: min(end, times[other][1]) - max(start, times[other][0]) for other in files}
            best = max(files, key=lambda other: overlaps[other])
            if overlaps[best] > 0.0 or len(files) == 1:
                files[best].append(path.name)
            else:
                undecided.append(["?", path.name])
    return [*(names for names in files.values() if len(names) > 1), *undecided]


def _times(inspection: Inspection) -> tuple[float, float]:
    """Return the first and the last time of a log; the first is later if it has no times."""
    rows = [row for row in (*inspection.commands, *inspection.channels) if row.samples]
    return min((row.start for row in rows), default=inf), max((row.end for row in rows), default=-inf)


def _columns(inspections: Iterable[Inspection], tables: TableHeaders) -> tuple[dict[str, str], dict[str, str]]:
    """Return what headers seem to mean, and the descriptions of the others."""
    columns = {title: meant for title, meant in tables.columns.items() if meant}
    others = dict.fromkeys(tables.columns, "")
    for one in inspections:
        columns |= one.columns
        others |= one.unread
    if any(meant.startswith("-depth") for meant in columns.values()):  # z points up, in all files
        turned = {axis.external for axis in AXES.values() if axis.place}
        columns = {title: f"-{meant}" if meant.split()[0] in turned else meant for title, meant in columns.items()}
    return columns, {title: others[title] for title in sorted(others) if title not in columns}


def _quoted(text: str) -> str:
    """Return a text as a basic string of TOML. A byte of a name that is not Unicode becomes a blank."""
    text = re.sub("[\ud800-\udfff]", " ", text)
    characters = (f"\\{c}" if c in '\\"' else c if c.isprintable() else f"\\U{ord(c):08X}" for c in text)
    return f'"{"".join(characters)}"'
