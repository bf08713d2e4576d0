"""Check that the tests have enough content for a fit, and that their units and signs make sense."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import TankTests
from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.findings import refusals
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.slips.search import slips
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.columns import VELOCITIES
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.readers.tank_tables import Row

_LEAST_PUSH = 1e-6
"""The smallest thrust that counts, N or N m. A fit with less could overflow."""


def is_pushed(axis: Axis, base: Rov, command: float) -> bool:
    """Return True when the thrusters push the vehicle in the direction of the command."""
    return float(np.sign(command)) * base.force(axis, command) >= _LEAST_PUSH


class UnusableError(Exception):
    """Tests of an axis are unusable: some of its recordings, or all of its tests."""

    def __init__(self, line: str, finding: Finding, axis: Axis, recordings: Sequence[Recording] = ()) -> None:
        """`line` is the error message if no other test remains. Otherwise `finding` becomes a finding about each
        recording."""
        super().__init__(line)
        self.finding, self.axis, self.recordings = finding, axis, recordings

    def left_out_of(self, tests: TankTests) -> TankTests:
        """Return the tests without these. Raises DataFileError where nothing is left to learn from."""
        axes = () if self.recordings else (self.axis.name,)
        findings = [replace(self.finding, file=recording.file) for recording in self.recordings] or [self.finding]
        remaining = tests.without(self.recordings, axes, findings)
        if remaining is None:
            raise DataFileError(str(self)) from None
        return remaining


def check_push(folder: Path, axis: Axis, base: Rov, commands: Sequence[float]) -> None:
    """Check that the thrusters push in the direction of at least one command. Raises UnusableError."""
    if commands and not any(is_pushed(axis, base, c) for c in commands):
        curves = join_names(c.name for c in curves_of(base.layout, axis))
        numbers = {"force": base.force(axis, commands[0]), "command": commands[0]}
        names = {"curves": curves, "unit": axis.load}
        finding = Finding("no thrust", axis.name, names=names, numbers=numbers)
        raise UnusableError(
            f"{folder}: the thrust curve of {curves} gives {numbers['force']:.3g} {axis.load} at a command "
            f"of {commands[0]:.0%}, where {axis.name} needs a push that way",
            finding,
            axis,
        )


def check_recording(folder: Path, recording: Recording, base: Rov) -> None:
    """Check that commands and motion change, and that the velocity is possible. Raises UnusableError."""
    path, values = folder / recording.file, recording.values[np.isfinite(recording.values)]
    axis, quantity = recording.axis, recording.quantity
    finding = partial(Finding, axis=axis.name)
    moves = np.ptp(recording.reaching(base.layout), axis=0).any() or recording.reaching(base.layout).any()
    if not moves:
        raise UnusableError(
            f"{path}: the command is always 0, so nothing can be identified",
            finding("constant push"),
            axis,
            [recording],
        )
    if np.ptp(values) == 0.0:
        constant = finding("constant motion", names={"quantity": quantity})
        raise UnusableError(f"{path}: {quantity} never changes: nothing is identifiable", constant, axis, [recording])
    speed, (low, high) = prepare(recording, base).speed, VELOCITIES
    if not low <= speed <= high:
        names, numbers = {"quantity": quantity, "unit": axis.unit}, {"speed": speed, "low": low, "high": high}
        raise UnusableError(
            f"{path}: {quantity} gives a velocity of {speed:.3g} {axis.unit}: must be {low:g} at least and "
            f"{high:g} at most",
            finding("impossible velocity", names=names, numbers=numbers),
            axis,
            [recording],
        )


def check_slips(tests: TankTests, axes: Sequence[Axis], base: Rov) -> list[Finding]:
    """Return findings about doubtful units and signs. Raises DataFileError with a line for each that is certainly
    wrong."""
    axes = [axis for axis in axes if max(base.force(axis, c) for c in (1.0, -1.0)) >= _LEAST_PUSH]  # see check_push
    recordings = {axis.name: tests.recordings.get(axis.name, ()) for axis in axes}
    steady, time_constants = (
        {axis.name: _by_file(rows.get(axis.name, ())) for axis in axes} for rows in (tests.steady, tests.time_constants)
    )
    findings = slips(recordings, base, tests.given.known, steady, time_constants)
    for axis in axes:
        wrong = {finding.file for finding in findings if finding.kind == "wrong scale" and finding.axis == axis.name}
        if wrong == {*(recording.file for recording in recordings[axis.name]), *steady[axis.name]}:
            findings = _with_forces(findings, axis, tests, base)
    if certain := [finding for finding in findings if finding.certain]:
        raise DataFileError(*refusals(certain, tests.folder))
    return list(findings)


def _with_forces(findings: Iterable[Finding], axis: Axis, tests: TankTests, base: Rov) -> tuple[Finding, ...]:
    """Add the files of forces to the findings about an axis, because its files all disagree with them."""
    curves = {thruster.curve for thruster in base.layout.drivers(axis)}
    files = ", ".join(sorted({row.file for curve in curves for row in tests.thrust.get(curve, ())}))
    return tuple(
        replace(f, names={**f.names, "others": files}) if (f.kind, f.axis) == ("wrong scale", axis.name) else f
        for f in findings
    )


def _by_file(rows: Sequence[Row]) -> dict[str, list[tuple[float, float]]]:
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        found.setdefault(row.file, []).append((row.command, row.value))
    return found
