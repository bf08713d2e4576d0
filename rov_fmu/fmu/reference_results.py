"""Write the experiments and the expected results in an FMU. Their format is the layered standard FMI-LS-REF.

The experiments are steps of each axis from rest, with and without the vehicle's tuning, at the commands of the
published tables if the vehicle has them; and a manoeuvre of all axes. The expected results are computed in plain
Python, and not with the C code that they prove.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, isfinite, sqrt

from rov_fmu.equation.attitude import QUATERNION, start_formulas
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis, Declaration
from rov_fmu.equation.expression import Name, compiled
from rov_fmu.equation.forces import COUPLING, LIFT, RESTORING, Effect
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.terms import Term, equation_of
from rov_fmu.fmu.experiments import FOLDER, NAME
from rov_fmu.io.templates import render
from rov_fmu.vehicle.published import Cell, ResponseRow, ResponseTable, load_tables, untuned
from rov_fmu.vehicle.vehicle import Vehicle

NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
VERSION = "1.0.0-beta.1"
EXPERIMENTS = "application/x-ma-hs-experiments"
PARAMETERS = "application/x-ssp-parameter-set"
TOLERANCE = 1e-9
"""The tolerance relative to the largest value of a variable in an experiment; expected values have 11 digits."""

_DIGITS = ".11g"
_MULTIPLES = (1, 2, 4, 8)
"""The times at which a step response is compared, in multiples of Tau."""
_STEPS = 10
"""The number of communication steps in Tau, and in a phase of the manoeuvre."""
_LONGEST_TAU = 10.0
"""The longest Tau that an experiment uses (s)."""
_HORIZON = 40.0
"""The longest experiment, in time constants. In this time a vehicle turns by at most this number of radians.

With an attitude, half of this number is used."""
_COUPLING_FACTOR = 4.0
"""The weight of the coupling in `_horizon`: small differences grow in coupled motion, so experiments are shorter."""
_NEGLIGIBLE = 1e-8
"""A variable that stays below this share of its nominal value does not move."""
_PHASE = 2.0
"""The longest phase of the manoeuvre (s)."""

Values = Mapping[str, float]
_Row = tuple[float, Values]


@dataclass(frozen=True)
class ExperimentFiles:
    """An experiment and the names of its files."""

    name: str
    description: str
    stop: str
    step: str
    parameters: str | None
    stimuli: str
    references: str


def reference_results(vehicle: Vehicle) -> dict[str, bytes]:
    """Return the files by their path in the FMU. Raises DataFileError."""
    sets = {"tuned": vehicle}
    if any(vehicle[name] != 1.0 for name in vehicle.layout.tuning):
        sets["untuned"] = untuned(vehicle)
    files: dict[str, str] = {}
    experiments = [*_step_responses(vehicle, sets, files), *_manoeuvre(vehicle, files), *_attitude(vehicle, files)]
    descriptions = {"tuned": "alpha and beta as identified", "untuned": "alpha = beta = 1: without tuning"}
    related = []
    if len(sets) > 1:
        for name, rov in sets.items():
            files[f"{name}.ssv"] = render(
                "parameters.ssv.j2", name=name, values={key: repr(rov[key]) for key in rov.layout.tuning}
            )
            related.append(_related(f"{name}.ssv", PARAMETERS, "parameter", descriptions[name]))
    if "attitude.ssv" in files:
        related.append(_related("attitude.ssv", PARAMETERS, "parameter", "Euler angles at the start"))
    files["experiments.exp"] = render(
        "experiments.exp.j2",
        experiments=experiments,
        tolerance=f"{TOLERANCE:g}",
        description=f"{vehicle.name}: velocities and pose that the FMU must reproduce, "
        f"within {TOLERANCE:g} of the largest value of each variable",
    )
    related.append(_related("experiments.exp", EXPERIMENTS, "experiment", "Expected results"))
    related.append(_related("../../documentation/index.html", "text/html", "document", "Documentation"))
    files["fmi-ls-manifest.xml"] = render(
        "fmi-ls-manifest.xml.j2",
        namespace=NAMESPACE,
        related=related,
        manifest={
            "fmi-ls:fmi-ls-name": NAME,
            "fmi-ls:fmi-ls-version": VERSION,
            "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
        },
    )
    return {f"{FOLDER}/{name}": text.encode() for name, text in files.items()}


def _related(source: str, kind: str, role: str, description: str) -> dict[str, str]:
    return {"type": kind, "source": source, "role": role, "description": description}


# ---- Steps from rest -------------------------------------------------------------------------------------------------


def _step_responses(vehicle: Vehicle, sets: Mapping[str, Vehicle], files: dict[str, str]) -> Iterator[ExperimentFiles]:
    """Write the experiments in which one axis steps to a constant command from rest."""
    tables = {table.axis.name: table for table in load_tables(vehicle)} if vehicle.data else {}
    for axis in (form.axis for form in vehicle.layout.axes if vehicle.layout.signs(form.axis)):
        table = tables.get(axis.name)
        rows: Mapping[float, ResponseRow | None] = dict.fromkeys(_commands(vehicle))
        if table:
            rows = {float(row.command): row for row in table.rows}
        for percent, row in rows.items():
            stem = f"{axis.name}_{percent:g}".replace("-", "minus_")
            inputs = vehicle.held_inputs(axis, percent / 100.0)
            time_units = {name: _time_unit(rov, axis, percent / 100.0, inputs) for name, rov in sets.items()}
            longest = max(time_units.values()) * _MULTIPLES[-1]
            for name, rov in sets.items():
                experiment = f"{stem}_{name}" if len(sets) > 1 else stem
                references = f"{experiment}_expected.csv"
                times = [time_units[name] * n for n in _MULTIPLES]
                trajectory = _trajectory(rov, [(inputs, times)])
                files[f"{stem}.csv"] = _csv([(t, _commanded(vehicle, inputs)) for t in (0.0, longest)])
                pose = _pose_without_quaternion(rov.layout)
                files[references] = _csv(_moving(trajectory, rov.layout.velocities | pose))
                yield ExperimentFiles(
                    experiment,
                    _description(rov, axis, percent, name if len(sets) > 1 else "", table, row),
                    _text(times[-1]),
                    _text(time_units[name] / _STEPS),
                    name if len(sets) > 1 else None,
                    f"{stem}.csv",
                    references,
                )


def _commands(vehicle: Vehicle) -> list[float]:
    """Return commands in %: the largest for which the vehicle was identified, in both directions, and a smaller one."""
    largest = 100.0 * min(1.0, vehicle.command_range[1])
    return [round(share * largest, 6) for share in (0.4, 1.0, -1.0)]


def _time_unit(vehicle: Vehicle, axis: Axis, command: float, inputs: Values) -> float:
    """Return Tau plus the longest lag, but at most _LONGEST_TAU and `_horizon`, to three digits (s)."""
    lag = max((vehicle[curve.coefficient("T")] for curve in vehicle.layout.curves if curve.has_lag), default=0.0)
    Tau = min(vehicle.response(axis, command)[1] + lag, _LONGEST_TAU, _horizon(vehicle, inputs))
    return float(f"{Tau:.3g}")


def _horizon(vehicle: Vehicle, inputs: Values) -> float:
    """Return the longest time of an experiment, s.

    It is _HORIZON times the shortest time constant, or the time in which the vehicle turns by _HORIZON radians if that
    is less.

    The time constant of a restoring force is that of the oscillation that follows from it.
    """
    rates = _swings(vehicle)
    rates += [1.0 / vehicle[c.coefficient("T")] for c in vehicle.layout.curves if c.has_lag]
    for form, motion in zip(vehicle.layout.axes, vehicle.motions(inputs), strict=True):
        A, B = motion.drag(motion.C)
        turning = sqrt(abs(motion.C)) if form.axis.is_rotation else 0.0
        rates.append(B + 2.0 * sqrt(A * abs(motion.C)) + turning)
        V = motion.steady_velocity()
        if form.axis.is_rotation and isfinite(V):
            rates.append(abs(V))
        if vehicle.layout.coupled and isfinite(V) and not vehicle.layout.has_attitude:
            couplings = (abs(k) for _, k in _terms(vehicle, vehicle.layout.velocities, COUPLING))
            rates.append(_COUPLING_FACTOR * sum(couplings) * abs(V))
    if vehicle.layout.has_attitude:
        rates.append(_coupling_rate(vehicle, inputs))
    horizon = 0.5 * _HORIZON if vehicle.layout.has_attitude else _HORIZON
    return horizon / max(rates) if any(rates) else _LONGEST_TAU


def _swings(vehicle: Vehicle) -> list[float]:
    """Return the angular frequencies of the oscillations by restoring forces (1/s)."""
    rotations = [form.axis.velocity for form in vehicle.layout.axes if form.axis.is_rotation]
    return [sqrt(abs(k)) for _, k in _terms(vehicle, rotations, RESTORING)]


def _terms(vehicle: Vehicle, velocities: Iterable[str], *effects: Effect) -> Iterator[tuple[Term, float]]:
    """Yield the terms of some effects in the accelerations along axes, and the values of their coefficients."""
    rows = equation_of(vehicle.layout).rows
    for term in (term for v in velocities for term in rows[v]):
        if term.effect in effects and isinstance(term.coefficient, Name):
            yield term, vehicle.parameters[term.coefficient.identifier]


def _coupling_rate(vehicle: Vehicle, inputs: Values) -> float:
    """Return how fast axes of a vehicle with an attitude change each other's velocities near the steady ones (1/s).

    Velocities are multiplied by the roots of their effective masses, as in the kinetic energy, to compare all axes.
    """
    root, size = {}, {}
    for form, motion in zip(vehicle.layout.axes, vehicle.motions(inputs), strict=True):
        v, V = form.axis.velocity, motion.steady_velocity()
        root[v] = sqrt(vehicle.effective_inertia(form))
        size[v] = root[v] * abs(V) if isfinite(root[v] * V) else 0.0
    changes = []
    for v in vehicle.layout.velocities:
        for term, value in _terms(vehicle, [v], COUPLING, LIFT):
            a, b = term.factors
            k = value * root[v] / (root[a] * root[b])
            changes += [k * size[a], k * size[b]]
    return hypot(*(x for x in changes if isfinite(x)))


def _description(
    vehicle: Vehicle, axis: Axis, percent: float, name: str, table: ResponseTable | None, row: ResponseRow | None
) -> str:
    """Describe an experiment, with its V_ss and Tau beside those of the tables."""
    V_ss, Tau = vehicle.response(axis, percent / 100.0)
    model = row and (row.scaled if name == "tuned" else row.non_linear)

    def published(cell: Cell | None) -> str:
        values = {"printed": cell.printed, "measured": cell.measured} if cell else {}
        found = ", ".join(f"{origin} {value}" for origin, value in values.items() if value is not None)
        return f" ({found})" if found else ""

    neglected = ["the lag"] if vehicle.layout.lagging else []
    neglected += ["the dead time"] if vehicle.layout.has_dead_time else []
    neglected += ["righting moments"] if vehicle.layout.has_attitude and vehicle.layout.restoring else []
    without = f", without {' and '.join(neglected)}" if neglected else ""
    return (
        f"{f'Table {table.number}: ' if table else ''}{axis.name}, {percent:g} % from rest{', ' * bool(name)}{name}: "
        f"V_ss = {V_ss:.4g} {axis.unit}{published(model.V_ss if model else None)}, "
        f"Tau = {Tau:.4g} s{published(model.Tau if model else None)}{without}"
    )


# ---- A manoeuvre -----------------------------------------------------------------------------------------------------

_PHASES: tuple[tuple[Mapping[Axis, float], float], ...] = (
    ({SURGE: 0.8, HEAVE: 0.5, ROLL: 0.1}, 0.0),
    ({SURGE: 0.4, SWAY: 0.3, PITCH: 0.2, YAW: 0.3}, 1.0),
    ({SURGE: -0.5, HEAVE: -0.4, ROLL: -0.2, PITCH: -0.1, YAW: -0.2}, 1.0),
    ({}, 0.0),
)
"""The phases of the manoeuvre: shares of the largest command by axis, and of loads and current."""


def _manoeuvre(vehicle: Vehicle, files: dict[str, str]) -> Iterator[ExperimentFiles]:
    """Write an experiment in which all axes move, with loads, a current and reversals, until all inputs are zero."""
    layout = vehicle.layout
    phases = []
    for shares, load in _PHASES:
        fractions = dict.fromkeys(layout.commands, 0.0)
        for axis in filter(layout.has, shares):
            for name, sign in layout.signs(axis).items():
                fractions[name] = round(fractions[name] + shares[axis] * sign * vehicle.command_range[1], 6)
        commands = {name: layout.command_of(max(-1.0, min(1.0, x))) for name, x in fractions.items()}
        others = {name: declaration for name, declaration in layout.inputs.items() if name not in commands}
        phases.append(
            commands
            | {name: declaration.start + 0.05 * load * declaration.nominal for name, declaration in others.items()}
        )
    length = float(f"{min(_PHASE, *(_horizon(vehicle, inputs) for inputs in phases)):.1g}")
    ends = [length * n for n in range(len(phases) + 1)]
    stimuli = [(t, inputs) for n, inputs in enumerate(phases) for t in ends[n : n + 2]]
    held = [(inputs, [end - 0.5 * length, end]) for inputs, end in zip(phases, ends[1:], strict=True)]
    trajectory = _trajectory(vehicle, held)
    files["manoeuvre.csv"] = _csv(_moving(stimuli, layout.inputs))
    compared = layout.velocities | _pose_without_quaternion(layout) | layout.lagging
    files["manoeuvre_expected.csv"] = _csv(_moving(trajectory, compared))
    yield ExperimentFiles(
        "manoeuvre",
        "All axes at once, with loads, a current and reversals, then all off",
        _text(ends[-1]),
        _text(length / _STEPS),
        None,
        "manoeuvre.csv",
        "manoeuvre_expected.csv",
    )


# ---- An attitude ----------------------------------------------------------------------------------------------------

_ATTITUDE = {"phi_0": 0.6, "theta_0": -0.4, "psi_0": 1.0}
"""The Euler angles at the start of an experiment. They stay far from a vertical nose, where they are undetermined."""


def _attitude(vehicle: Vehicle, files: dict[str, str]) -> Iterator[ExperimentFiles]:
    """Write an experiment in which a vehicle with roll or pitch starts tilted and turned, with all inputs zero."""
    layout = vehicle.layout
    if not layout.has_attitude:
        return
    still = layout.usual_inputs
    loads = (sqrt(abs(x.C)) for f, x in zip(layout.axes, vehicle.motions(still), strict=True) if f.axis.is_rotation)
    length = float(f"{0.5 / max(0.5 / _PHASE, *loads, *_swings(vehicle)):.1g}")
    start = compiled(start_formulas())(_ATTITUDE)
    state = layout.at_rest | {name: start[name] for name in QUATERNION} | {"psi": _ATTITUDE["psi_0"]}
    rows = []
    for t in (0.0, 0.5 * length, length):
        after = vehicle.step(still, state, t) if t else state
        rows.append((t, after | {name: vehicle.calculated(still, after)[name] for name in layout.angles}))
    files["attitude.ssv"] = render(
        "parameters.ssv.j2", name="attitude", values={name: repr(angle) for name, angle in _ATTITUDE.items()}
    )
    files["attitude.csv"] = _csv([(t, _commanded(vehicle, still)) for t in (0.0, length)])
    files["attitude_expected.csv"] = _csv(_moving(rows, layout.velocities | layout.pose | layout.angles))
    yield ExperimentFiles(
        "attitude",
        "Tilted and turned at the start, then free, with all inputs zero",
        _text(length),
        _text(length / _STEPS),
        "attitude",
        "attitude.csv",
        "attitude_expected.csv",
    )


# ---- Trajectories ----------------------------------------------------------------------------------------------------


def _trajectory(vehicle: Vehicle, phases: Sequence[tuple[Values, Sequence[float]]]) -> list[_Row]:
    """Return the states from rest at the times of each phase, during which the inputs are held."""
    line = vehicle.delay_line()
    found: list[_Row] = [(0.0, vehicle.layout.at_rest)]
    for inputs, times in phases:
        for t in times:
            before, state = found[-1]
            found.append((t, line.step(vehicle, inputs, state, before, t - before)))
    return found


def _pose_without_quaternion(layout: Layout) -> dict[str, Declaration]:
    """Return the position, and the heading where it is a state.

    The quaternion is left out, because both of its signs mean the same attitude.
    """
    return {name: declaration for name, declaration in layout.pose.items() if name not in QUATERNION}


def _moving(rows: Sequence[_Row], variables: Mapping[str, Declaration]) -> list[_Row]:
    """Keep the variables that move. The others are 0 except for rounding."""
    names = [
        name
        for name, declaration in variables.items()
        if max(abs(values[name]) for _, values in rows) > _NEGLIGIBLE * declaration.nominal
    ]
    return [(t, {name: values[name] for name in names}) for t, values in rows]


def _commanded(vehicle: Vehicle, inputs: Values) -> Values:
    """Return the inputs that are commands."""
    return {name: inputs[name] for name in vehicle.layout.commands}


def _csv(rows: Sequence[_Row]) -> str:
    lines = [["time", *rows[0][1]], *([_text(t), *map(_text, values.values())] for t, values in rows)]
    return "".join(",".join(line) + "\n" for line in lines)


def _text(value: float) -> str:
    return format(value, _DIGITS)
