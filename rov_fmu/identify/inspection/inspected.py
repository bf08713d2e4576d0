"""What logs contain, what they cannot determine, and a draft of rov.toml."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import tomlkit

from rov_fmu.equation.catalogue import EXTERNAL
from rov_fmu.identify.inspection.undetermined import possible_headers, undetermined
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import listed
from rov_fmu.io.output import Output
from rov_fmu.io.reading import read_text
from rov_fmu.tank.columns import COMMAND
from rov_fmu.tank.description import NO_ROV_FILE, ROV_FILE, Description, Draft, read_rov_file
from rov_fmu.tank.findings import Finding, about, sentences
from rov_fmu.tank.folder import folder_and_files, together, unreadable
from rov_fmu.tank.inspection.draft import (
    LikelyVehicle,
    completed,
    dives,
    draft,
    lacking,
    likely_vehicle,
)
from rov_fmu.tank.inspection.headers import TableHeaders, headers_of_tables
from rov_fmu.tank.inspection.inspection import Inspection, inspect, logs_among
from rov_fmu.tank.inspection.outputs import NOTHING_MOVED, moved
from rov_fmu.tank.log import Log
from rov_fmu.tank.readers.listing import Listing, list_files, named
from rov_fmu.tank.readers.parsers import one_parser
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle


@dataclass(frozen=True)
class Inspected:
    """What logs contain, what they cannot determine, and what rov.toml would be."""

    logs: Sequence[Inspection]
    warnings: Sequence[str]
    """A sentence for each file that cannot be read."""
    notes: Sequence[str]
    """A sentence about the tables in the folder, and one for each reason why others are not read."""
    path: Path
    """The path of rov.toml."""
    own: str
    """The text of rov.toml; empty without one."""
    text: str
    """The draft of rov.toml, or the tables and keys that it lacks; empty if it lacks nothing."""
    description: Description | None
    """The vehicle by rov.toml, or by the draft; None where neither tells its hardware."""
    likely: LikelyVehicle
    """The vehicle that the logs seem to be of."""
    headers: TableHeaders
    name: str
    """The name of the draft's vehicle."""
    is_refused: bool = False
    """True if `identify` refuses the logs, or rov.toml; the warnings say why."""

    @property
    def missing(self) -> list[str]:
        """What to do before anything can be identified, besides editing the draft."""
        has_commands = any(one.commands or any(row.name == COMMAND for row in one.channels) for one in self.logs)
        has_names = all(finding.kind != "unnamed table" for one in self.logs for finding in one.findings)
        steps = {"add the commands, or name their columns": has_commands, "rename the tables": has_names}
        return [step for step, is_done in steps.items() if not is_done] or ["correct this"] * self.is_refused

    @property
    def unknown(self) -> list[str]:
        """The first unknown headers that may measure the motion along an axis of which no log has any."""
        logs = [log for one in self.logs if (log := one.log)]
        shown = {
            channel.quantity.axis for log in logs for channel in log.channels if channel.count and not channel.unused
        }
        axes = [axis for axis in self.description.layout.bare_axes if axis not in shown] if self.description else []
        unread = [title for one in self.logs for title in one.unread]
        return [*dict.fromkeys(title for axis in axes for title in possible_headers(axis, unread))]

    @property
    def is_enough(self) -> bool:
        """True if `identify` needs no draft: there is a rov.toml, or a vehicle that ships can stand in for it."""
        return bool(self.own or self.likely.base)

    @property
    def completed(self) -> Output:
        """The file rov.toml: the draft, or the one that is there with what it lacks."""
        return Output(self.path, completed(self.own, self.text).encode())

    @property
    def undetermined(self) -> list[str]:
        """A sentence for everything that the logs cannot determine, whatever a fit finds."""
        if not self.description:
            return []
        dives = _dives(self.path, self.logs)
        if self.description.layout.has_wrench:
            dives = [replace(log, commands=c.relative_to(c.largest)) for log in dives if (c := log.commands)]
        unread = [title for one in self.logs for title in one.unread]
        return [*undetermined(dives, self.description, self.headers.curves, unread)] if dives else []

    def draft_for(self, base: Path | None) -> Draft:
        """Return a rov.toml that nobody has to complete, with the vehicle that the logs seem to be of, or with a given
        one. Raises VehicleFileError if no vehicle that ships has such thrusters, and none is given."""
        if not (base or self.likely.base):
            own, instead = listed(self.likely.thrusters), "name a vehicle file by --base, or "
            why = f"no vehicle that ships has the thrusters {own}" if own else "no log has commands of thrusters"
            if not EXTERNAL.isdisjoint(self.likely.thrusters):
                why, instead = "the logs have forces on the body, and none tells the mass", ""
            raise VehicleFileError(
                f"{self.path}: there is no such file, and {why}: {instead}describe the vehicle: `rov-fmu inspect "
                '--draft` writes the file with a "?" wherever you have to decide'
            )
        text = draft(self.name, self.logs, self.headers, self.likely, asks=False)
        return Draft(text, "" if base else self.likely.reason)


@one_parser()
def inspect_paths(paths: Sequence[Path]) -> Inspected:
    """Return what logs contain, or each log in a folder, with a draft of rov.toml, or with what it lacks.

    If there is a rov.toml already, thrusters and columns have its names, unless its hardware tables have a mistake.
    Files that cannot be read are left out. Raises DataFileError if no file is left, and VehicleFileError if rov.toml is
    not TOML.
    """
    folder, files = folder_and_files(paths)
    path = folder / ROV_FILE
    described = read_rov_file(path) if path.exists() else NO_ROV_FILE
    is_described = bool(described.tables.base or described.tables.thruster or described.tables.has_wrench)
    layouts = [load_vehicle(file).layout for file in SHIPPED.values()]
    listing = Listing(folder, files) if files else list_files(folder)
    inspections: list[Inspection] = []
    mistakes: list[str] = []
    findings: list[Finding] = listing.findings
    logs = logs_among(listing.tests, described.tables.columns)
    if tables := [test for test in listing.tests if test not in logs]:
        findings.append(about(named(tables), "tank tests"))
    for log in logs:
        try:
            inspections += inspect(log, layouts, described if is_described else replace(described, description=None))
        except DataFileError as error:
            mistakes += str(error).splitlines()
            findings.append(unreadable(log, error))
    if not inspections:
        raise DataFileError(*([*mistakes, *listing.lines("unreadable file")] if mistakes else listing.no_tests()))
    headers = headers_of_tables(folder)
    likely = likely_vehicle(inspections, headers.curves)
    own = read_text(path, VehicleFileError).strip() if path.exists() else ""
    there = tomlkit.parse(own)
    if "thruster" in there or ("vehicle" in there and "base" not in there):  # its owner removed the drafted base
        likely = replace(likely, base="")
    name = (files[0].stem if files else folder.resolve().name) or inspections[0].path.stem
    is_known = own or likely.base or not EXTERNAL.isdisjoint(likely.thrusters)
    text = draft(name, inspections, headers, likely, NOTHING_MOVED if is_known else moved(_dives(path, inspections)))
    lacks = lacking(own, text) if own else text
    if lacks and path.exists():  # what is told is about the file that it will be
        described = read_rov_file(path, draft=Draft(completed(own, lacks), ""))
    notes = [finding for finding in findings if finding.kind in ("tank tests", "other files")]
    warnings = [finding for finding in findings if finding not in notes]
    inspected = Inspected(
        logs=inspections,
        warnings=[*sentences(warnings), *described.mistakes],
        notes=sentences(notes),
        path=path,
        own=own,
        text=lacks,
        description=described.description,
        likely=likely,
        headers=headers,
        name=name,
    )
    if own:
        return inspected
    drafted = inspected.draft_for(None) if likely.base else Draft(lacks, "")
    return replace(inspected, description=read_rov_file(path, draft=drafted).description)


def _dives(path: Path, inspections: Sequence[Inspection]) -> list[Log]:
    """Return the logs with commands, each with the channels of the files without commands that belong to it. `path` is
    that of rov.toml."""
    by_name = {one.path.name: one.log for one in inspections if one.log}
    joined = {files[0]: files for files in dives(inspections)}
    logs = []
    for log in (log for log in (inspection.log for inspection in inspections) if log and log.commands):
        parts = [by_name[name] for name in joined.get(log.file, ()) if by_name.get(name)]
        logs.append(together(path.with_name(log.file), parts) if len(parts) > 1 else log)
    return logs
