"""Write the experiments, the expected results and the evidence in an FMU, in the form of the standard FMI-LS-REF.

The experiments are a step of each axis from rest to its largest command, with and without the vehicle's tuning, and a
manoeuvre of all axes, which begins tilted if the vehicle rolls or pitches. A vehicle with a surface begins deep under
water. The expected results are computed in plain Python, and not with the C code that they prove.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt

from rov_fmu.equation.attitude import QUATERNION, start_formulas
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis, Declaration
from rov_fmu.equation.expression import compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.fmu.archive import FOLDER, MANIFEST
from rov_fmu.fmu.related import Related, documents, manifest, origin
from rov_fmu.io.messages import listed
from rov_fmu.io.templates import render
from rov_fmu.vehicle.vehicle import Vehicle

TOLERANCE = 1e-9
"""The tolerance relative to the largest value of a variable in an experiment; expected values have 11 digits."""

_MULTIPLES = (1, 2, 4, 8)
"""The times at which a step response is compared, in multiples of Tau."""
_STEPS = 10
"""The number of communication steps in Tau, and in a phase of the manoeuvre."""
_LONGEST_TAU = 10.0
"""The longest Tau that an experiment uses (s)."""
_HORIZON = 20.0
"""The longest Tau and the longest phase of an experiment, in shortest times: see `_fastest_rate`."""
_NEGLIGIBLE = 1e-8
"""A variable that stays below this share of its nominal value does not move."""
_PHASE = 2.0
"""The longest phase of the manoeuvre (s)."""
_PHASES: tuple[tuple[Mapping[Axis, float], float], ...] = (
    ({SURGE: 0.8, HEAVE: 0.5, ROLL: 0.1}, 0.0),
    ({SURGE: 0.4, SWAY: 0.3, PITCH: 0.2, YAW: 0.3}, 1.0),
    ({SURGE: -0.5, HEAVE: -0.4, ROLL: -0.2, PITCH: -0.1, YAW: -0.2}, 1.0),
    ({}, 0.0),
)
"""The phases of the manoeuvre: shares of the largest command by axis, and of loads and current."""
_ATTITUDE = {"phi_0": 0.6, "theta_0": -0.4, "psi_0": 1.0}
"""The Euler angles at the start of the manoeuvre."""
_DEEP = {"z": 100.0}
"""The depth at the start, m, from which no experiment reaches a surface."""

Values = Mapping[str, float]
_Row = tuple[float, Values]


@dataclass(frozen=True)
class ExpectedRun:
    """An experiment with phases, in each of which the inputs are held: a motion of a vehicle."""

    name: str
    description: str
    vehicle: Vehicle
    unit: float
    """The time of _STEPS communication steps, s."""
    phases: Sequence[tuple[Values, Sequence[float]]]
    """The inputs of each phase, and the times at which results are compared; the last is the end of the phase, s."""
    inputs: Mapping[str, Declaration]
    """The inputs that the stimuli may contain."""
    compared: Mapping[str, Declaration]
    """The variables that the expected results may contain."""
    parameters: tuple[str, Values] | None = None
    """The name and the values of the parameters that are set; None for those of the vehicle."""

    @property
    def stop(self) -> float:
        """The time at the end, s."""
        return self.phases[-1][1][-1]

    def stimuli(self) -> list[_Row]:
        """Return the inputs at the beginning and the end of each phase."""
        starts = [0.0, *(times[-1] for _, times in self.phases)]
        return [
            (t, inputs) for start, (inputs, times) in zip(starts, self.phases, strict=False) for t in (start, times[-1])
        ]

    def references(self) -> list[_Row]:
        """Return the states and the Euler angles from the start to the end."""
        vehicle, memory = self.vehicle, self.vehicle.memory()
        _, given = self.parameters or ("", {})
        state = {name: given.get(name, at_rest) for name, at_rest in vehicle.layout.at_rest.items()}
        if vehicle.layout.has_attitude:
            angles = {**dict.fromkeys(vehicle.layout.initial, 0.0), **given}
            attitude = compiled(start_formulas())(angles)
            state = state | {name: attitude[name] for name in QUATERNION} | {"psi": angles["psi_0"]}
        before = 0.0
        rows: list[_Row] = [(before, {**state, **vehicle.calculated(self.phases[0][0], state)})]
        for inputs, times in self.phases:
            for t in times:
                state = memory.step(vehicle, inputs, state, before, t - before)
                rows.append((t, {**state, **vehicle.calculated({**inputs, **memory.delayed}, state)}))
                before = t
        return rows


def reference_results(vehicle: Vehicle, *, native: bool = True) -> dict[str, bytes]:
    """Return the files of the standard's folder by their path in the FMU. Raises FileError.

    `native` is False for an FMU in pure Python, which has the solver that computes the results.
    """
    experiments = [*map(_deep, (*_steps(vehicle), _manoeuvre(vehicle)))]
    sets = dict(one.parameters for one in experiments if one.parameters)
    text = {
        f"{name}.ssv": render(
            "parameters.ssv.j2", name=name, values={key: repr(value) for key, value in values.items()}
        )
        for name, values in sets.items()
    }
    related = [
        Related(f"{name}.ssv", "parameter", "application/x-ssp-parameter-set", words)
        for name, words in _SETS.items()
        if name in sets
    ]
    for one in experiments:
        text[f"{one.name}.csv"] = _csv(one.stimuli(), one.inputs)
        text[f"{one.name}_expected.csv"] = _csv(one.references(), one.compared)
        related.append(Related(f"{one.name}_expected.csv", "result", "text/csv", f"Expected: {one.description}"))
    title = "Expected results"
    text["experiments.exp"] = render(
        "experiments.exp.j2",
        experiments=experiments,
        title=title,
        tolerance=f"{TOLERANCE:g}",
        steps=_STEPS,
        seconds=_text,
        description=f"{vehicle.name}: {_SECOND_SOLVER if native else _SAME_SOLVER}",
    )
    related.append(Related("experiments.exp", "experiment/validation", "application/x-ma-hs-experiments", title))
    of_origin, roles = origin(vehicle)
    files = {f"{FOLDER}/{name}": content.encode() for name, content in text.items()}
    return {**files, **of_origin, MANIFEST: manifest([*related, *roles, *documents(vehicle)])}


_SECOND_SOLVER = (
    "they come from a second solver of the same equation: an explicit Runge-Kutta method of order 8 (DOP853) in "
    "Python, run when the FMU was built, and not the Taylor series in C that the FMU runs. So they test the "
    "integration and the compiled code, and not the physics"
)
_SAME_SOLVER = (
    "they come from the solver in Python that the FMU runs, too, run when the FMU was built. So they test the interface"
)
_SETS = {
    "tuned": "alpha and beta as identified",
    "untuned": "alpha = beta = 1: without tuning",
    "attitude": "Euler angles at the start",
    "deep": "Depth at the start",
}
"""The parameter sets of the experiments, in words."""


def _deep(experiment: ExpectedRun) -> ExpectedRun:
    """Let an experiment of a vehicle with a surface begin deep under water."""
    if not experiment.vehicle.layout.surface:
        return experiment
    name, given = experiment.parameters or ("deep", {})
    return replace(experiment, parameters=(name, {**given, **_DEEP}))


# ---- Steps from rest -------------------------------------------------------------------------------------------------


def _steps(vehicle: Vehicle) -> Iterator[ExpectedRun]:
    """Yield the experiments in which one axis steps to its largest command from rest.

    A vehicle that is tuned takes each step with its tuning and without, so that the tunable parameters have an effect.
    """
    is_tuned = any(vehicle[name] != 1.0 for name in vehicle.layout.tuning)
    for axis in filter(vehicle.layout.signs, vehicle.layout.bare_axes):
        percent = round(100.0 * _strongest(vehicle, axis), 6)
        for name, model in {"tuned": vehicle, "untuned": vehicle.untuned}.items() if is_tuned else [("", vehicle)]:
            yield _step(model, axis, percent, name)


def _strongest(vehicle: Vehicle, axis: Axis) -> float:
    """Return the strongest tested command ahead, or that of all thrusters where no test of the axis drives it ahead."""
    return vehicle.tested_along(axis)[1] or vehicle.command_range[1]


def _step(vehicle: Vehicle, axis: Axis, percent: float, tuning: str) -> ExpectedRun:
    """Return a step to a command in %, with its V_ss and Tau in words."""
    layout, inputs = vehicle.layout, vehicle.held_inputs(axis, percent / 100.0)
    V_ss, Tau = vehicle.response(axis, percent / 100.0)
    lag = max((vehicle[curve.coefficient("T")] for curve in layout.curves if curve.has_lag), default=0.0)
    unit = float(f"{min(Tau + lag, _LONGEST_TAU, _HORIZON / _fastest_rate(vehicle, inputs)):.3g}")
    neglected = ["the lag"] if layout.lagging else []
    neglected += ["the dead time"] if layout.has_dead_time else []
    neglected += ["righting moments"] if layout.has_attitude and layout.restoring else []
    description = (
        f"{axis.name}, {percent:g} % from rest{', ' * bool(tuning)}{tuning}: "
        f"V_ss = {V_ss:.4g} {axis.unit}, Tau = {Tau:.4g} s{', without ' * bool(neglected)}{listed(neglected)}"
    )
    tunable = {name: vehicle[name] for name in layout.tuning}
    return ExpectedRun(
        f"{axis.name}_{percent:g}{'_' * bool(tuning)}{tuning}",
        description,
        vehicle,
        unit,
        [(inputs, [n * unit for n in _MULTIPLES])],
        layout.commands,
        layout.velocities | _pose(layout),
        (tuning, tunable) if tuning else None,
    )


def _fastest_rate(vehicle: Vehicle, inputs: Values) -> float:
    """Return how fast anything changes in a motion that begins at rest (1/s).

    Errors grow with the time in units of this rate. It is the largest of: how velocities near the steady ones change
    each other, by drag and by coupling; the oscillation by restoring forces; the lags; and the turning. Velocities are
    multiplied by the roots of their effective masses, as in the kinetic energy, to compare all axes.
    """
    layout, root, steady, rates = vehicle.layout, dict[str, float](), dict[str, float](), [1.0 / _LONGEST_TAU]
    for part, motion in zip(layout.axes, vehicle.motions(inputs), strict=True):
        v, V = part.axis.velocity, motion.steady_velocity()
        root[v], steady[v] = sqrt(vehicle.effective_inertia(part.axis)), V if isfinite(V) else 0.0
        if part.axis.is_rotation:
            rates += [sqrt(abs(motion.C)), abs(steady[v])]
    state = {**layout.at_rest, **steady}
    before = vehicle.derivatives(inputs, state)

    def change(of: str, by: str) -> float:
        step = 1e-6 * max(abs(state[by]), 1e-3)
        return (vehicle.derivatives(inputs, {**state, by: state[by] + step})[of] - before[of]) / step

    rates.append(hypot(*(change(v, by) * root[v] / root[by] for v in root for by in root)))
    if layout.has_attitude:
        rates.append(2.0 * rates[-1])
        rates += [sqrt(abs(change(v, q))) for v in root for q in QUATERNION]
    rates += [1.0 / vehicle[curve.coefficient("T")] for curve in layout.curves if curve.has_lag]
    return max(filter(isfinite, rates))


# ---- A manoeuvre -----------------------------------------------------------------------------------------------------


def _manoeuvre(vehicle: Vehicle) -> ExpectedRun:
    """Return an experiment in which all axes move, with loads, a current and reversals, until all inputs are zero."""
    layout = vehicle.layout
    phases = []
    for shares, load in _PHASES:
        fractions = dict.fromkeys(layout.commands, 0.0)
        for axis in filter(layout.has, shares):
            for name, sign in layout.signs(axis).items():
                fractions[name] = round(fractions[name] + shares[axis] * sign * _strongest(vehicle, axis), 6)
        commands = {name: layout.command_of(max(-1.0, min(1.0, x))) for name, x in fractions.items()}
        others = {name: declaration for name, declaration in layout.inputs.items() if name not in commands}
        phases.append(
            commands
            | {name: declaration.start + 0.05 * load * declaration.nominal for name, declaration in others.items()}
        )
    length = float(f"{min(_PHASE, *(_HORIZON / _fastest_rate(vehicle, inputs) for inputs in phases)):.1g}")
    tilted = layout.has_attitude
    return ExpectedRun(
        "manoeuvre",
        f"All axes at once{', tilted at the start' * tilted}, with loads, a current and reversals, then all off",
        vehicle,
        length,
        [(inputs, [(n + 0.5) * length, (n + 1.0) * length]) for n, inputs in enumerate(phases)],
        layout.inputs,
        layout.velocities | _pose(layout) | layout.lagging | layout.angles,
        ("attitude", _ATTITUDE) if tilted else None,
    )


def _pose(layout: Layout) -> dict[str, Declaration]:
    """Return the pose without the quaternion, both of whose signs mean the same attitude."""
    return {name: declaration for name, declaration in layout.pose.items() if name not in QUATERNION}


# ---- Files -----------------------------------------------------------------------------------------------------------


def _csv(rows: Sequence[_Row], variables: Mapping[str, Declaration]) -> str:
    """Return a table of the variables that move. The others are 0 except for rounding."""
    names = [
        name
        for name, declaration in variables.items()
        if max(abs(values[name]) for _, values in rows) > _NEGLIGIBLE * declaration.nominal
    ]
    lines = [["time", *names], *([_text(t), *(_text(values[name]) for name in names)] for t, values in rows)]
    return "".join(",".join(line) + "\n" for line in lines)


def _text(value: float) -> str:
    return format(value, ".11g")


def as_written(value: float) -> float:
    """Return a number with the digits that stand in the files."""
    return float(_text(value))
