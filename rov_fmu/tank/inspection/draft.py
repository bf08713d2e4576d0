"""A draft of rov.toml from what logs and tables contain, and what an incomplete rov.toml lacks of it."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import atan2, degrees, inf, isfinite
from pathlib import Path

import tomlkit

from rov_fmu.equation.catalogue import ARM, AXES, BODY, EXTERNAL
from rov_fmu.equation.parts import SourcedVector
from rov_fmu.io.messages import brief, first_of, listed, one_line
from rov_fmu.io.templates import render
from rov_fmu.tank.catalogue import NOT_MEASURED, words_of
from rov_fmu.tank.description import DRAFTED, vectored
from rov_fmu.tank.inspection.headers import TableHeaders, fitting, likely_thrusters, meant_by_field
from rov_fmu.tank.inspection.inspection import Inspection
from rov_fmu.tank.inspection.outputs import GUESSED, NOTHING_MOVED, RADIUS, Moved
from rov_fmu.tank.readers.ardusub_frames import config_of, fitting_frames
from rov_fmu.tank.readers.parsers import format_of
from rov_fmu.vehicle.description import why_no_identifier
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

_HARDWARE = ("base", "body", "arm", "curves", "thruster", "axes", "geometry", "known")
"""The tables and keys of a draft that describe the vehicle. A rov.toml that has a vehicle needs none of them."""


@dataclass(frozen=True)
class LikelyVehicle:
    """The vehicle that logs seem to be of."""

    thrusters: Sequence[str]
    base: str
    """The vehicle that ships with such thrusters, or an empty text."""
    reason: str
    """Why it is this one, such as `it is the first with 6 thrusters`."""


def likely_vehicle(inspections: Sequence[Inspection], curves: Collection[str]) -> LikelyVehicle:
    """Return the thrusters of the log that has most of them, and the first vehicle that ships with such thrusters, with
    the thrust curves of the tables, and with the frame of ArduSub that the logs tell."""
    layouts = {name: load_vehicle(file).layout for name, file in SHIPPED.items()}
    most = max(inspections, key=lambda one: (len(one.commands), sum(row.low < row.high for row in one.commands)))
    ends = {row.name.removeprefix("thruster "): (row.low, row.high) for row in most.commands}
    is_named = not _is_bag(most.path) or not EXTERNAL.isdisjoint(ends)
    thrusters = [*ends] if is_named else likely_thrusters(ends, layouts.values())
    frames = {one.log.frame for one in inspections if one.log and one.log.frame}
    possible = [layout for layout in layouts.values() if frames <= {*fitting_frames(layout)} or not frames]
    fits = fitting(thrusters, possible)
    if fits and not {*curves} <= {curve.name for curve in fits.curves}:
        fits = None
    base = next((name for name, layout in layouts.items() if layout == fits), "")
    reason = f"the log has {listed(map(config_of, sorted(frames)))}" if frames else ""
    return LikelyVehicle(thrusters, base, reason or f"it is the first that ships with {len(thrusters)} thrusters")


def draft(
    name: str,
    inspections: Sequence[Inspection],
    tables: TableHeaders,
    likely: LikelyVehicle,
    found: Moved = NOTHING_MOVED,
    *,
    asks: bool = True,
) -> str:
    """Return a draft of rov.toml, with `"?"` for what an owner has to decide.

    It asks nothing if `asks` is false. It is a complete rov.toml then if a vehicle that ships has such thrusters. It
    marks what is a guess.
    """
    word = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    vehicle = load_vehicle(SHIPPED[likely.base]) if likely.base else None
    some = vectored(vehicle.layout) if vehicle else []
    names = one_line(brief(", ".join(dict.fromkeys(one.path.name for one in inspections))))
    columns, headers = _columns([one for one in inspections if not _is_bag(one.path)], tables)
    fields = _fields(inspections)
    return render(
        "rov.toml.j2",
        Path(__file__).parent,
        quoted=_quoted,
        asks=asks,
        names=names,
        description=DRAFTED.format(names),
        is_own=asks and not likely.base and len(likely.thrusters) > 1,
        is_wrench=asks and not EXTERNAL.isdisjoint(likely.thrusters),
        likely=likely,
        shipped=SHIPPED,
        name=name,
        identifier=f"rov_{word}".rstrip("_") if why_no_identifier(word) else word,
        curves=tables.curves or ["all"],
        tables=tables,
        moved=found,
        vector=_vector,
        usual=GUESSED,
        radius=RADIUS,
        signals={row.name for one in inspections for row in one.channels},
        body=[*BODY, *ARM],
        vehicle=vehicle,
        vectored=some,
        angle=degrees(atan2(*map(abs, some[0].direction.value[1::-1]))) if some else 0.0,
        columns=columns,
        headers=_questions(headers),
        fields=_questions(fields, partial(meant_by_field, fields=fields)),
        dives=[files for files in dives(inspections) if asks or "?" not in files],
    )


def lacking(own: str, draft: str) -> str:
    """Return the tables of a draft that a rov.toml lacks, as TOML; of those about the vehicle, only a base if the draft
    has one, and none if rov.toml has any."""
    there, drafted, told = tomlkit.parse(own), tomlkit.parse(draft), tomlkit.document()
    hardware = {"base"} if "base" in drafted else {*_HARDWARE}
    left_out = {*there, *_HARDWARE} - (hardware if there.keys().isdisjoint(_HARDWARE) else {*()})
    for name, table in drafted.items():
        if name not in left_out:
            told.add(name, table)
    return tomlkit.dumps(told).strip()


def completed(own: str, lacks: str) -> str:
    """Return a rov.toml, which stays as it is, with the keys that it lacks before it, and the tables behind it."""
    if not own:
        return lacks
    keys, mark, tables = f"\n{lacks}".partition("\n[")
    return f"{keys}\n{own}\n{mark}{tables}".strip() + "\n"


def _vector(vector: SourcedVector | None) -> str:
    """Return a direction or a position as an array of TOML, with "?" in place of one that is not known."""
    numbers = [f"{number:g}" for number in vector.value] if vector else ['"?"'] * 3
    return f"[{', '.join(numbers)}]"


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


def _questions(names: Mapping[str, str], meant: Callable[[str], str] = lambda _: "") -> list[str]:
    """Return a line for each of the first names, with what it seems to mean and the description of its values."""
    told = ((f"{_quoted(name)} = {_quoted(meant(name) or '?')}", what) for name, what in names.items())
    return first_of([one_line(f"{line}{what and f'   # {what}'}") for line, what in told])


def dives(inspections: Sequence[Inspection]) -> list[list[str]]:
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
    for inspection in inspections:
        columns |= inspection.columns
        others |= inspection.unread
    if any(meant.startswith("-depth") for meant in columns.values()):  # z points up, in all files
        turned = {axis.external for axis in AXES.values() if axis.place}
        columns = {title: f"-{meant}" if meant.split()[0] in turned else meant for title, meant in columns.items()}
    return columns, {title: others[title] for title in sorted(others) if title not in columns}


def _quoted(text: str) -> str:
    """Return a text as a basic string of TOML. A byte of a name that is not Unicode becomes a blank."""
    text = re.sub("[\ud800-\udfff]", " ", text)
    characters = (f"\\{c}" if c in '\\"' else c if c.isprintable() else f"\\U{ord(c):08X}" for c in text)
    return f'"{"".join(characters)}"'
