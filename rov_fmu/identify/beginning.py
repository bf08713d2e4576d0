"""What is known before the fit: the tests of a folder, the part of the vehicle that they concern, and its prior."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rov_fmu.identify.given import Given, Narrowed, Tested, narrowed, with_axis_alone
from rov_fmu.identify.objective import TableRow
from rov_fmu.identify.parameters import LEAST_LAG, PRIORS, Beginning
from rov_fmu.identify.records import Recorded, recorded, typical
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import did_you_mean, lines_on
from rov_fmu.io.toml_file import key_line
from rov_fmu.model.layout import AXES, REVERSE, Axis, Curve, Layout, coefficient_name
from rov_fmu.model.rov import Rov
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.folder import KINDS, Folder, file_hash, read_folder
from rov_fmu.tank.log import Log
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.vehicle import VehicleFileError

_QUADRATIC = 0.7
"""The share of the quadratic drag at a large velocity, where nothing else is known."""
_SAG = 0.03
"""Thrust is taken to depend on the voltage if it changes by more than this, relatively."""
_ADDED = 1.5
"""The effective inertia relative to that of the dry vehicle, where no added mass is known."""


@dataclass(frozen=True, eq=False)
class Tests:
    """All tests of a folder, and the vehicle that they concern."""

    folder: Folder
    given: Given
    tested: Tested
    inputs: Mapping[str, str]
    """The SHA-256 hash of every file that was read, by its name."""
    findings: tuple[Finding, ...]
    """What was left out of the vehicle and of the files."""

    def rows(self, kind: str) -> Iterator[tuple[str, Sequence[Row]]]:
        """Yield the curves or axes of the vehicle that have a table of this kind, with its rows."""
        layout = self.given.rov.layout
        names = {curve.name for curve in layout.curves} if kind == "thrust" else {*layout.kinds}
        for (other, subject), some in self.folder.rows.items():
            if other == kind and subject in names:
                yield subject, some

    def counts(self, kind: str, subject: str, command: float) -> bool:
        """Return True if a command is inside the window of rov.toml."""
        window = f"thrust_{subject}" if kind == "thrust" else subject
        low, high = self.given.description.tables.windows.get(window, (-1.0, 1.0))
        return low <= command <= high


def load_tests(folder: Path, check_inputs: Callable[[Sequence[Path]], None] = lambda _: None) -> Tests:
    """Read a folder. Raises DataFileError or VehicleFileError with a line for every mistake.

    `check_inputs` is called with every file that the identification reads, before any test is read.
    """
    found = read_folder(folder, check_inputs)
    description = found.rov_file.description
    tested, unused = _tested(found), [*_unused(found)]
    vehicle = Narrowed(None)
    # If no axis was found, it may be in a file that could not be read.
    if description and (tested.axes or not found.mistakes):
        vehicle = narrowed(description, tested, folder)
    found.rov_file_mistakes += _wrong_priors(found)
    in_tests = [*found.mistakes, *vehicle.test_mistakes]
    mistakes = [*found.rov_file_mistakes, *found.mistakes, *vehicle.rov_file_mistakes, *vehicle.test_mistakes]
    if mistakes:
        raise (DataFileError if in_tests else VehicleFileError)(*mistakes)
    assert vehicle.given
    path = vehicle.given.description.tables.base
    base = {vehicle.given.description.base_name: file_hash(path)} if path else {}
    inputs = {ROV_FILE: found.inputs[ROV_FILE]} | base | found.inputs
    return Tests(found, vehicle.given, tested, inputs, (*vehicle.findings, *found.findings, *unused))


def _wrong_priors(found: Folder) -> list[str]:
    """Return a line for each key of [priors] that no prior has."""
    keys = found.rov_file.tables.priors
    lines = [key_line(f"priors.{key}", f"unknown{did_you_mean(key, PRIORS)}") for key in keys if key not in PRIORS]
    return lines_on(found.path / ROV_FILE, lines)


def _axes_of(log: Log, layout: Layout) -> list[str]:
    one = recorded(log, _layout_of(log, layout))
    return [*dict.fromkeys(sensor.axis.name for sensor in one.record.sensors)] if one else []


def _unused(found: Folder) -> Iterator[Finding]:
    """Yield a finding about each log that has nothing for the filter."""
    if found.logged:
        for log in found.logs:
            if log.commands and not _axes_of(log, found.logged):
                yield Finding("nothing measured", file=log.file)


def _tested(found: Folder) -> Tested:
    """Return what the files test."""
    description = found.rov_file.description
    windows = description.tables.windows if description else {}

    def subjects(kind: str) -> list[str]:
        return [subject for other, subject in found.files if other == kind]

    def has_backward_rows(kind: str, subject: str) -> bool:
        low, _ = windows.get(f"thrust_{subject}" if kind == "thrust" else subject, (-1.0, 1.0))
        return any(low <= row.command < 0.0 for row in found.rows.get((kind, subject), ()))

    logged = [name for log in found.logs if found.logged for name in _axes_of(log, found.logged)]
    return Tested(
        {name: (found.files["thrust", name][0], has_backward_rows("thrust", name)) for name in subjects("thrust")},
        {name: has_backward_rows("steady", name) for name in subjects("steady")},
        subjects("time_constant"),
        list(dict.fromkeys([*filter(None, subjects("log")), *logged])),
    )


def _layout_of(log: Log, layout: Layout) -> Layout:
    """Return the part of a layout that a log concerns: one axis alone for a test of this axis."""
    return with_axis_alone(layout, log.axis) if log.axis and log.axis.name in layout.kinds else layout


# ---- The prior -------------------------------------------------------------------------------------------------------


def begin(tests: Tests) -> tuple[Beginning, list[Recorded], list[TableRow]]:
    """Return what is known before the fit, the logs as the filter reads them, and the rows of all tables."""
    given = tests.given
    deviations = given.description.tables.priors
    rov = _extended(given.rov, given.base, tests, deviations)
    logs = [one for log in tests.folder.logs if (one := recorded(log, _layout_of(log, rov.layout)))]
    fitted = [form.axis for form in rov.layout.axes if _is_fitted(form.axis, tests)]
    driving = {t.curve for axis in fitted for t in rov.layout.drivers(axis)}
    given_thrust = {name for name in given.known if name in given.description.known}
    measured = [name for name, _ in tests.rows("thrust")]
    driving = {c.name for c in rov.layout.curves if c.name in driving or c.name in measured}
    curves = [
        curve
        for curve in rov.layout.curves
        if curve.name in driving
        and (curve.name in measured or not {curve.coefficient("a_t"), curve.coefficient("b_t")} <= given_thrust)
    ]
    values = dict(rov.coefficients)
    for name, rows in tests.rows("thrust"):
        values |= _rough_thrust(rov.layout, next(c for c in rov.layout.curves if c.name == name), rows)
    rov = Rov(rov.layout, values)
    full = {form.axis.name: rov.strongest(form.axis) for form in rov.layout.axes}
    guessed = []
    for axis in fitted:
        if any(axis.coefficient(key) not in given.base for key in ("a_d", "b_d")):
            guessed.append(axis.name)
            values |= _rough_drag(rov, axis, tests, logs)
    has_lag = any(name.startswith("T_") for name in given.base)
    given_inertia = [axis.name for axis in fitted if axis.coefficient("beta") in given.description.known]
    known = Beginning(rov.layout, values, fitted, curves, measured, has_lag, guessed, full, deviations, given_inertia)
    return known, logs, [*_table_rows(tests, rov)]


def _is_fitted(axis: Axis, tests: Tests) -> bool:
    given, tested = tests.given.known, tests.tested.axes
    return axis.name in tested and not {axis.coefficient(key) for key in ("a_d", "b_d", "beta")} <= {*given}


def _extended(rov: Rov, base: Mapping[str, float], tests: Tests, deviations: Mapping[str, float]) -> Rov:
    """Return the vehicle with every coefficient that a parameter may change, where each effect is absent."""
    values = {name: base.get(name, value) for name, value in rov.coefficients.items()}
    rov = Rov(
        replace(rov.layout, mix={}, pulse=None, has_dead_time=False), rov.coefficients
    )  # a log tells thrusters' commands
    layout = rov.layout
    more: dict[str, float] = {}
    logged = {*tests.tested.logs}
    for form in layout.axes:
        axis = form.axis
        if axis.name in logged:
            more |= {axis.coefficient(f"{key}{REVERSE}"): values[axis.coefficient(key)] for key in ("a_d", "b_d")}
            more[axis.coefficient("F_0")] = base.get(axis.coefficient("F_0"), 0.0)
    rov = _with_voltage(rov, base, tests)
    layout = rov.layout
    values = {**rov.coefficients, **values}
    exact = deviations.get("thrust") == 0.0
    for curve in layout.curves:
        if not curve.tables and not exact:
            for key in ("a_t", "b_t"):
                more[coefficient_name(f"{key}{REVERSE}", curve.name)] = values[curve.coefficient(key)]
            if logged:
                more[curve.coefficient("c_0")] = 0.0
        if logged:
            more[curve.coefficient("T")] = LEAST_LAG
    more = {name: base.get(name, value) for name, value in more.items()}
    return rov.extended(more | values)


def _with_voltage(rov: Rov, base: Mapping[str, float], tests: Tests) -> Rov:
    """Return a vehicle whose thrust depends on the voltage, if a logged voltage changes or rov.toml asks for it."""
    requests = tests.given.requests
    values = [c.values[c.there] for log in tests.folder.logs if (c := log.used("voltage")) and c.count]
    if not values or rov.layout.voltage is not None:
        return rov
    mean = float(np.mean([np.mean(some) for some in values]))
    if not requests.voltage and max(float(np.ptp(some)) for some in values) < _SAG * mean:
        return rov
    more = {}
    for curve in rov.layout.curves:
        if len(curve.tables) < 2:
            measured_at = requests.measured_at.get(curve.name, mean)
            more[coefficient_name("V_0", curve.name)] = base.get(coefficient_name("V_0", curve.name), measured_at)
            more[coefficient_name("n_V", curve.name)] = 0.0
    powered = Rov(replace(rov.layout, voltage=round(mean, 3)), rov.coefficients)
    return powered.extended(more)


def _rough_thrust(layout: Layout, curve: Curve, rows: Sequence[Row]) -> dict[str, float]:
    """Return the coefficients of a curve by least squares of its forces, as the centre of their prior."""
    found: dict[str, float] = {}
    for end, sign in (("", 1.0), (REVERSE, -1.0)):
        names = [coefficient_name(f"{key}{end}", curve.name) for key in ("a_t", "b_t")]
        some = [row for row in rows if row.command * sign > 0.0]
        if names[0] not in layout.coefficients or not (some or not end):
            continue
        some = some or [*rows]
        c, F = (np.abs([getattr(row, key) for row in some]) for key in ("command", "value"))
        a, b = np.linalg.lstsq(np.column_stack([c * c, c]), F, rcond=None)[0] if len(some) > 1 else (F[0] / c[0], 0.0)
        found |= dict(zip(names, (float(a), float(b)), strict=True))
    return found


def _rough_drag(rov: Rov, axis: Axis, tests: Tests, logs: Sequence[Recorded]) -> dict[str, float]:
    """Return drag and β from a large velocity and the thrust in the tests, as the centre of their prior."""
    points = [(abs(row.value), row.command) for name, rows in tests.rows("steady") if name == axis.name for row in rows]
    V = max((value for value, _ in points), default=0.0) or typical(logs, axis) or 1.0
    forces = [abs(rov.force(axis, command)) for _, command in points] or [*_forces(rov, axis, logs)]
    F = float(np.quantile(forces, 0.9)) if forces else 0.0
    F = F or 0.3 * rov.strongest(axis) or 1.0
    a, b = _QUADRATIC * F / V**2, (1.0 - _QUADRATIC) * F / V
    pairs = {"a_d": a, "b_d": b, f"a_d{REVERSE}": a, f"b_d{REVERSE}": b}
    if axis.coefficient("m_a") not in rov.coefficients:
        pairs["beta"] = 1.0 / _ADDED
    return {
        name: value
        for key, value in pairs.items()
        if (name := axis.coefficient(key)) in rov.layout.coefficients and name not in tests.given.known
    }


def _forces(rov: Rov, axis: Axis, logs: Sequence[Recorded]) -> Iterator[float]:
    """Yield the sizes of the thrust along an axis for some rows of the logs."""
    for one in logs:
        if axis.name not in one.layout.kinds:
            continue
        names = [*one.layout.inputs]
        part = Rov(one.layout, {name: rov[name] for name in one.layout.coefficients})
        for row in one.record.inputs[:: max(1, len(one.record.inputs) // 100)]:
            thrust = part.commanded(one.layout.usual_inputs | dict(zip(names, row.tolist(), strict=True)))
            force = sum(part.effect(t, axis) * thrust[t.name] for t in one.layout.drivers(axis))
            if force:
                yield abs(force)


def _table_rows(tests: Tests, rov: Rov) -> Iterator[TableRow]:
    """Yield all rows of tables that count."""
    curves = {curve.name: curve for curve in rov.layout.curves}
    for kind in KINDS:
        if kind == "log":
            continue
        quantity = {"thrust": "force", "steady": "V_ss", "time_constant": "Tau"}[kind]
        for subject, rows in tests.rows(kind):
            largest = max(abs(row.value) for row in rows)
            for row in rows:
                if not tests.counts(kind, subject, row.command):
                    continue
                of = curves[subject] if kind == "thrust" else AXES[subject]
                scale = largest if kind == "thrust" else abs(row.value)
                noise = f"forces of {subject}" if kind == "thrust" else f"tables of {subject}"
                yield TableRow(noise, of, quantity, row.command, row.value, scale)
