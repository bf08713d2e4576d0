"""What is known before the fit: the tests of a folder, the part of the vehicle that they concern, and its prior."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from rov_fmu.equation.catalogue import AXES, PITCH, RESTORING, REVERSE, ROLL, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve
from rov_fmu.identify.given import Tests, narrowed, with_axes_alone, with_unseen_axes
from rov_fmu.identify.likelihood.kinds import ABSENT, PRIORS, USUAL_EXPONENT
from rov_fmu.identify.likelihood.objective import TableRow
from rov_fmu.identify.likelihood.posterior import QUANTILE
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import (
    SampledLog,
    changes,
    driven_axes,
    recorded,
    shown_axes,
    typical,
    velocities,
)
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import first_of, lines_on, only
from rov_fmu.io.toml_file import key_line
from rov_fmu.tank.arrays import Array, Flags, usual_range
from rov_fmu.tank.columns import push_along
from rov_fmu.tank.description import ROV_FILE, Description, Draft
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.tank.folder import Folder, file_hash, read_folder
from rov_fmu.tank.inspection.signs import contradictions
from rov_fmu.tank.log import Log
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.full_thrust import USUAL_SQUARE
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError

_QUADRATIC = 0.7
"""The share of the quadratic drag at a large velocity, where nothing else is known."""
_SAG = 0.03 * 0.9
"""Thrust may depend on a voltage of which nine tenths change by more than this, relatively: 3 % in a steady fall."""
_ADDED = 1.5
"""The effective inertia relative to that of the dry vehicle, where no added mass is known."""
_LEAST_FORCE = 1e-6
"""The smallest force of a thrust curve, N. A fit with less could overflow."""
_NEVER_EXACT = ("white_noise", "coloured_noise")
"""The priors whose deviation must not be 0."""
_MOST_REASONS = 3
"""The most reasons in a line that refuses a log."""
_SHORT, _PUSH, _HOLD = 30.0, 0.04, 0.9
"""Dives that take less than the first number, s, tell nothing if no axis is pushed both ways, by such a part of full
command for such a time, s."""
_UNKNOWN = 1.0
"""The value of a coefficient that is yet to be identified."""
_QUANTITIES = {"thrust": "force", "steady": "V_ss", "time_constant": "Tau"}
"""What the tables of each kind measure."""


def load_tests(
    folder: Path,
    check_inputs: Callable[[Sequence[Path]], None] = lambda _: None,
    base: Path | None = None,
    files: Collection[Path] = (),
    draft: Draft | None = None,
) -> Tests:
    """Read a folder, or some `files` in it. Raises DataFileError or VehicleFileError with a line for every mistake.

    `check_inputs` is called with every file that the identification reads, before any test is read. `base` is the
    vehicle to begin from, in place of that of rov.toml, and `draft` stands in for rov.toml itself.
    """
    contents = read_folder(folder, check_inputs, base, files, draft)
    description = contents.rov_file.description
    # A log that could not be read may test the axis in its name.
    logged = dict.fromkeys(axis for kind, axis in contents.files if kind == "log" and axis and contents.mistakes)
    of_logs, useless = list[Finding](), list[str]()
    for log in contents.logs:
        axes, told = driven_axes(log, layout_of(log, description))
        if not (axes or told or any(finding.kind == "leave out" for finding in log.findings)):
            told = [Finding("nothing measured", file=log.file)]
        logged |= dict.fromkeys(axis.name for axis in axes)
        of_logs += told
        useless.append(_refusal(folder, log, told))
    tested = {*contents.astern("steady"), *contents.astern("time_constant"), *logged}
    useless = [] if tested else useless
    if not contents.astern("thrust"):
        contents.mistakes += useless
    contents.mistakes += _without_force(contents)
    tests = None
    # If no axis was found, it may be in a file that could not be read.
    if description and (tested or not contents.mistakes):
        tests = narrowed(contents, description, [*logged], tested, useless)
    contents.rov_file_mistakes += _wrong_priors(contents)
    if mistakes := [*contents.rov_file_mistakes, *contents.mistakes]:
        raise (DataFileError if contents.mistakes else VehicleFileError)(*mistakes)
    assert tests
    of_base = {tests.description.base_name: file_hash(own)} if (own := tests.description.tables.base) else {}
    of_rov = {name: digest for name, digest in contents.inputs.items() if name == ROV_FILE}
    contents.inputs = of_rov | of_base | contents.inputs
    if not of_base:
        contents.findings[:] = _not_pushed(contents.findings, of_logs)
    contents.findings += [*of_logs, *_driven_together(contents)]
    contents.findings += [*_too_short(tests), *contradictions(contents.logs, tests.description)]
    return tests


def _wrong_priors(folder: Folder) -> list[str]:
    """Return a line for each key of [priors] that no prior has, and for each noise that is said to be exact."""
    lines = []
    for key, deviation in folder.rov_file.tables.priors.items():
        if key not in PRIORS:
            lines.append(key_line(f"priors.{key}", f"unknown{only(key, PRIORS)}"))
        elif key in _NEVER_EXACT and deviation == 0.0:
            reason = "must be above 0: the noise of a sensor is seen in its samples, and never known exactly"
            lines.append(key_line(f"priors.{key} = 0", reason))
    return lines_on(folder.path / ROV_FILE, lines)


def _too_short(tests: Tests) -> Iterator[Finding]:
    """Yield a finding where all that moves the vehicle are short dives, without a push both ways along any axis.

    A free decay is pushed by no thruster, and tells the drag in a short time.
    """
    logs, layout = [log for log in tests.folder.logs if log.commands], tests.layout
    if not logs or any(log.follows_axis for log in logs) or {*tests.axes} != {*tests.logged}:
        return
    rows = [log.commands.rows for log in logs if log.commands]
    commands = [log.commands.in_rows for log in logs if log.commands]
    seconds = sum(float(np.ptp(times)) for times in rows)

    def pushes(axis: Axis, sign: float) -> int:
        along = (sign * push_along(layout, axis, values) > _PUSH for values in commands)
        return sum(_holds(times, on) for times, on in zip(rows, along, strict=True))

    axes = [axis for axis in layout.bare_axes if axis.name in tests.logged]
    counts = [[pushes(axis, sign) for sign in (1.0, -1.0)] for axis in axes]
    if seconds < _SHORT and np.any(counts) and not any(map(all, counts)):
        yield Finding("too short", words={"seconds": f"{seconds:.0f}"})


def _holds(times: Array, on: Flags) -> int:
    """Return how often something is on for at least a second."""
    edges = np.diff(np.concatenate([[0], on, [0]]))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1
    return int(np.sum(times[ends] - times[begins] >= _HOLD))


def _without_force(folder: Folder) -> Iterator[str]:
    """Yield a line for each thrust curve whose largest measured force is 0."""
    for (kind, curve), rows in folder.rows.items():
        largest = max((row.value * np.sign(row.command) for row in rows), default=0.0)
        if kind == "thrust" and largest < _LEAST_FORCE:
            yield f"{folder.path}: thrust_{curve}*.csv: must give a force above 0, not {largest:.3g} N at most"


def _refusal(folder: Path, log: Log, told: Sequence[Finding]) -> str:
    """Return the line that refuses a folder without a better log than one of which this is told."""
    left_out = [finding for finding in log.findings if finding.kind in ("channel left out", "leave out")]
    reasons = [line.removeprefix(f"{log.file}: ") for line in sentences([*left_out, *told])]
    return f"{folder / log.file}: {'; '.join(first_of(reasons, _MOST_REASONS))}: nothing is identifiable"


def _not_pushed(findings: Sequence[Finding], of_logs: Sequence[Finding]) -> Iterator[Finding]:
    """Yield findings, with a warning for each axis that the vehicle lacks because its thrusters cancel.

    That is for a vehicle without a base, which may have axes that the logs do not concern.
    """
    cancelling = {finding.axis for finding in of_logs if finding.kind == "cancelling thrusters"}
    for finding in findings:
        is_one = finding.kind == "axis left out" and finding.axis in cancelling
        yield Finding("axis not pushed", finding.axis) if is_one else finding


def _driven_together(folder: Folder) -> Iterator[Finding]:
    """Yield a finding for each axis that a log measures, but that the thrusters drive only together with others."""
    if folder.layout and folder.logged:
        for log in folder.logs:
            for axis in (axis for axis in folder.layout.bare_axes if not folder.logged.has(axis)):
                is_measured = any(channel.quantity.axis is axis and not channel.unused for channel in log.channels)
                if is_measured and not log.axis and axis not in (ROLL, PITCH):
                    yield Finding("together", axis.name, file=log.file, words={"axis": axis.name})


def layout_of(log: Log, of: Description | Layout | None) -> Layout:
    """Return the part of the vehicle that a log concerns: one axis alone for a test of this axis.

    Of a description, it is that of the largest layout that the vehicle can have. A dive that does not show how the
    vehicle turns concerns only the axes that it shows: turns that nothing corrects would run away and, by the coupling,
    carry the motion along these axes with them. Roll and pitch show how it turns, too: a turn rate changes both where
    the vehicle is tilted, and the heading itself moves nothing but a current.
    """
    assert of
    layout = of if isinstance(of, Layout) else of.layout if log.axis else of.logged
    shown = [log.axis] if log.axis else shown_axes(log, layout)
    is_part = bool(log.axis) or (layout.has(YAW) and not {ROLL, PITCH, YAW} & {*shown})
    return with_axes_alone(layout, shown) if is_part and layout.has(*shown) else layout


# ---- The prior -------------------------------------------------------------------------------------------------------


def begin(tests: Tests) -> tuple[Prior, list[SampledLog], list[TableRow]]:
    """Return what is known before the fit, the logs as the filter reads them, and the rows of all tables."""
    deviations = tests.description.tables.priors
    measured = {name: any(row.command < 0.0 for row in rows) for name, rows in tests.rows("thrust")}
    dives = [log for log in tests.folder.logs if not log.axis]
    shown = {axis for log in dives for axis in shown_axes(log, tests.layout)}
    layout, values = _extended(with_unseen_axes(tests, shown), measured, tests, shown)
    logs = [sampled for log in tests.folder.logs if (sampled := recorded(log, layout_of(log, layout)))]
    fitted = [axis for axis in layout.bare_axes if _is_fitted(axis, tests)]
    moved = {axis for one in logs for axis in one.layout.bare_axes}
    unseen = [axis for axis in layout.bare_axes if axis in moved - {*fitted}]
    driving = {t.curve for axis in fitted for t in layout.thrusters_along(axis)}
    given_thrust = {name for name, quantity in tests.description.known.items() if not quantity.interval}
    curves = [
        c
        for c in layout.curves
        if c.name in measured
        or (c.name in driving and not {c.coefficient("a_t"), c.coefficient("b_t")} <= given_thrust)
    ]
    for name, rows in tests.rows("thrust"):
        rough = _rough_thrust(layout.curves_by_name[name], values, rows)
        values |= {key: value for key, value in rough.items() if key not in tests.known}
    vehicle = Vehicle(layout, values)
    full = {axis.name: vehicle.strongest(axis) for axis in layout.bare_axes}
    guessed = []
    for axis in (*fitted, *unseen):
        if any(axis.coefficient(key) not in tests.base for key in ("a_d", "b_d")):
            guessed.append(axis.name)
            values |= _rough_drag(vehicle, axis, tests, logs)
    logs = [one if one.log.axis else one.with_thrust(values) for one in logs]
    known = Prior(
        layout,
        values,
        fitted,
        curves,
        measured,
        with_lag=any(name.startswith("T_") for name in tests.base),
        guessed=guessed,
        full=full,
        deviations=deviations,
        exact=_exact(tests, layout, measured, moved, shown),
        thrust_errors=_thrust_errors(tests, curves),
        unseen=unseen,
        has_times=bool(tests.folder.astern("time_constant")),
        turned=(tests.description.tables.logs.reversed, tests.description.tables.logs.mounted),
    )
    return known, logs, [row for row, _, counts in table_rows(tests, layout) if counts]


def _exact(
    tests: Tests, layout: Layout, measured: Collection[str], moved: Collection[Axis], shown: Collection[Axis]
) -> frozenset[str]:
    """Return the names of the coefficients that no fit changes: those of rov.toml, and those of a base that its tests
    leave as they are. The curves of a base are uncertain unless their forces were measured, and so are a lag, the drag
    and the inertia of all axes along which a log moves, which by the coupling decide about the other axes, and what
    loads the axes that a dive shows. A thruster that was whole may have lost force."""
    uncertain = {c.coefficient(key) for c in layout.curves for key in c.keys if c.name not in measured or key == "T"}
    keys = ("beta", *(f"{key}{end}" for key in ("a_d", "b_d") for end in ("", REVERSE)))
    uncertain |= {axis.coefficient(key) for axis in moved for key in keys}
    uncertain |= {axis.coefficient("F_0") for axis in shown} | {*_centres(layout, shown)}
    own = tests.description.known
    exact = {n for n in tests.known if n not in uncertain or (n in own and not own[n].interval)}
    return frozenset(exact - {*layout.health.values()})


def _centres(layout: Layout, shown: Collection[Axis]) -> list[str]:
    """Return the coordinates of the centre of buoyancy about which the attitude in a dive tells."""
    needed = {"x_B": {PITCH}, "y_B": {ROLL}, "z_B": {ROLL, PITCH}}
    return [key for key, axes in needed.items() if layout.restoring and axes & {*shown}]


def _thrust_errors(tests: Tests, curves: Sequence[Curve]) -> dict[str, float]:
    """Return the relative standard error of the forces of a curve whose a_t rov.toml gives with an interval."""
    errors = {}
    for curve in curves:
        quantity = tests.description.known.get(curve.coefficient("a_t"))
        if quantity and quantity.interval:
            low, high = quantity.interval
            errors[curve.name] = (high - low) / (2.0 * QUANTILE * abs(quantity.value))
    return errors


def _is_fitted(axis: Axis, tests: Tests) -> bool:
    given, tested = tests.known, tests.axes
    return axis.name in tested and not {axis.coefficient(key) for key in ("a_d", "b_d", "beta")} <= {*given}


def _extended(
    layout: Layout, measured: Mapping[str, bool], tests: Tests, shown: Collection[Axis]
) -> tuple[Layout, dict[str, float]]:
    """Return the layout with every coefficient that a parameter may change, and their values where effects are absent.

    `measured` has the curves whose forces were measured, and whether astern, too. `shown` has the axes that dives show:
    a load along them stays from dive to dive. About roll and pitch, it is that of the centre of buoyancy.
    """
    base, deviations, centres = tests.base, tests.description.tables.priors, _centres(layout, shown)
    restoring = tuple(key for key in RESTORING if key in {*layout.restoring, *centres})
    # Positions at some hertz tell the acceleration too late: what differs would be taken for another geometry.
    told = {c.quantity.name for log in tests.folder.logs for c in log.channels}
    is_uncertain = (
        layout.coupled and {"surge velocity", "sway velocity"} <= told and all(t.position for t in layout.thrusters)
    )
    # a log tells thrusters' commands
    layout = replace(layout, mix={}, restoring=restoring, is_uncertain=is_uncertain and not layout.has_wrench)
    absent = {*centres, "x_T", "y_T"}
    values = {name: base.get(name, 0.0 if name in absent else _UNKNOWN) for name in layout.coefficients}
    layout, of_voltage = _with_voltage(layout, tests)
    values, more = of_voltage | values, dict[str, float]()
    logged, steady = {*tests.logged}, tests.folder.astern("steady")
    for axis in layout.bare_axes:
        is_tested = axis.name in logged or steady.get(axis.name)
        if is_tested:
            more |= {axis.coefficient(f"{key}{REVERSE}"): values[axis.coefficient(key)] for key in ("a_d", "b_d")}
        if (is_tested or axis in shown) and not (centres and axis in (ROLL, PITCH)):
            more[axis.coefficient("F_0")] = ABSENT["F_0"]
    exact = deviations.get("thrust") == 0.0
    for curve in layout.curves:
        if not curve.tables and not exact:
            for key in ("a_t", "b_t"):
                more[curve.name_of(f"{key}{REVERSE}")] = values[curve.coefficient(key)]
            if logged or curve.name in tests.folder.astern("thrust"):
                more[curve.coefficient("c_0")] = ABSENT["c_0"]
            if measured.get(curve.name):
                more[curve.name_of(f"c_0{REVERSE}")] = base.get(curve.coefficient("c_0"), 0.0)
        if logged or tests.folder.astern("time_constant"):
            more[curve.coefficient("T")] = ABSENT["T"]
        if logged and not (layout.has_wrench or curve.tables):
            more[curve.coefficient("d")] = ABSENT["d"]
            if curve.coefficient("d") not in values:
                more[curve.name_of(f"d{REVERSE}")] = ABSENT["d"]
    return layout.extended(more), {name: base.get(name, value) for name, value in more.items()} | values


def _with_voltage(layout: Layout, tests: Tests) -> tuple[Layout, dict[str, float]]:
    """Return a layout whose thrust depends on the voltage, if a logged voltage changes or rov.toml asks for it.

    Its usual voltage is that at which the thrust was measured, if that is known, so that the answers are for it.
    """
    values, base, more = tests.folder.voltages, tests.base, dict[str, float]()
    if not values or layout.voltage is not None:
        return layout, more
    mean = float(np.mean([np.mean(some) for some in values]))
    ranges = [usual_range(some) for some in values]
    if not tests.description.requests.voltage and max(high - low for low, high in ranges) < _SAG * mean:
        return layout, more
    is_exact = tests.description.tables.priors.get("voltage") == 0.0
    curves = [curve for curve in layout.curves if len(curve.tables) < 2]
    told = {c.name: base[c.name_of("V_0")] for c in curves if c.name_of("V_0") in base}
    known = {**tests.description.measured_at, **told}
    for curve in curves:
        more[curve.name_of("V_0")] = known.get(curve.name, mean)
        more[curve.name_of("n_V")] = USUAL_EXPONENT if is_exact else ABSENT["n_V"]
    source = "Voltage of the measured thrust" if known else "Mean voltage of the logs"
    layout = replace(layout, voltage=next(iter(known.values()), round(mean, 3)), voltage_source=source)
    return layout.extended(more), more


def _rough_thrust(curve: Curve, values: Mapping[str, float], rows: Sequence[Row]) -> dict[str, float]:
    """Return the coefficients of a curve that fit its forces roughly, as the centre of their prior.

    Both directions share the ratio of a_t to b_t, which are not negative. What else the forces tell is the shape that
    the likelihood fits.
    """
    astern = f"a_t{REVERSE}" in curve.keys
    c_0 = values.get(curve.coefficient("c_0"), 0.0)
    command, F = (np.array([getattr(row, key) for row in rows]) for key in ("command", "value"))
    c, F, is_back = np.maximum(np.abs(command) - c_0, 0.0), np.abs(F), astern & (command < 0.0)
    largest = float(F.max())

    def force(x: Array) -> Array:
        whole, share, ratio = np.exp(x[0]), x[1], np.exp(x[2])
        return np.asarray(whole * np.where(is_back, ratio, 1.0) * (share * c * c + (1.0 - share) * c))

    def residuals(x: Array) -> Array:
        return np.array([*(force(x) - F) / largest / 0.003, (x[1] - USUAL_SQUARE) / 0.3, x[2] / 0.5])

    start = [np.log(largest / max(float(c.max()), 0.05) ** 1.5), USUAL_SQUARE, 0.0]
    fit = least_squares(residuals, start, bounds=([-np.inf, 0.0, -np.inf], [np.inf, 1.0, np.inf])).x
    ratios, shares = {"": 1.0} | ({REVERSE: np.exp(fit[2])} if astern else {}), {"a_t": fit[1], "b_t": 1.0 - fit[1]}
    return {
        curve.name_of(f"{key}{end}"): float(np.exp(fit[0]) * ratio * share)
        for end, ratio in ratios.items()
        for key, share in shares.items()
    }


def _rough_drag(vehicle: Vehicle, axis: Axis, tests: Tests, logs: Sequence[SampledLog]) -> dict[str, float]:
    """Return drag and β from a large velocity and the thrust in the tests, as the centre of their prior.

    Where no test has thrust, the force is that which slows the vehicle down.
    """
    points = [(abs(row.value), row.command) for name, rows in tests.rows("steady") if name == axis.name for row in rows]
    V = max((value for value, _ in points), default=0.0) or typical(logs, axis) or 1.0
    forces = [abs(vehicle.force(axis, command)) for _, command in points] or [*_forces(vehicle, axis, logs)]
    F = float(np.quantile(forces, 0.9)) if forces else 0.0
    F = F or _drag_force(vehicle, axis, logs) or 0.3 * vehicle.strongest(axis) or 1.0
    a, b = _QUADRATIC * F / V**2, (1.0 - _QUADRATIC) * F / V
    pairs = {"a_d": a, "b_d": b, f"a_d{REVERSE}": a, f"b_d{REVERSE}": b}
    if axis.coefficient("m_a") not in vehicle.coefficients:
        pairs["beta"] = 1.0 / _ADDED
    return {
        name: value
        for key, value in pairs.items()
        if (name := axis.coefficient(key)) in vehicle.layout.coefficients and name not in tests.known
    }


def _forces(vehicle: Vehicle, axis: Axis, logs: Sequence[SampledLog]) -> Iterator[float]:
    """Yield the sizes of the thrust along an axis for some rows of the logs."""
    for sampled in (one for one in logs if axis.name in one.layout.by_name):
        some = sampled.record.inputs[:: max(1, len(sampled.record.inputs) // 100)]
        thrust = sampled.thrust(vehicle.coefficients, some)[:, sampled.layout.bare_axes.index(axis)]
        yield from filter(None, np.abs(thrust).tolist())


def _drag_force(vehicle: Vehicle, axis: Axis, logs: Sequence[SampledLog]) -> float:
    """Return the drag along an axis at a large velocity by how fast the vehicle slows down, N or N m; 0 if unknown."""
    largest = 0.0
    for channel in (m.channel for one in logs for m in one.measured if m.axis is axis):
        time, speeds = velocities(channel)
        if len(speeds):
            slower = -changes(time, np.abs(speeds)) / changes(time, time)
            largest = max(largest, float(np.max(slower, initial=0.0)))
    is_whole = axis.coefficient("m_a") in vehicle.coefficients
    return (1.0 if is_whole else _ADDED) * vehicle.effective_inertia(axis) * largest


def table_rows(tests: Tests, layout: Layout) -> Iterator[tuple[TableRow, str, bool]]:
    """Yield what J reads of the rows of all tables, with their files, and whether they count."""
    for kind, quantity in _QUANTITIES.items():
        for subject, rows in tests.rows(kind):
            largest = max(abs(row.value) for row in rows)
            of = layout.curves_by_name[subject] if kind == "thrust" else AXES[subject]
            for row in rows:
                scale = largest if kind == "thrust" else abs(row.value)
                noise = f"forces of {subject}" if kind == "thrust" else f"tables of {subject}"
                counts = tests.folder.counts(kind, subject, row.command)
                yield TableRow(noise, of, quantity, row.command, row.value, scale), row.file, counts
