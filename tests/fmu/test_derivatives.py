"""Derivatives are those of the values, and the model structure declares exactly those that can be non-zero."""

import random
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import pytest
from mpmath import mp

from checks.equations import effect, equations, steady_forces
from rov_fmu.motion.layout import YAW
from rov_fmu.motion.rov import Rov
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.fmi2 import (
    CO_SIMULATION,
    EVERY_MODE,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    MODES,
    OK,
    STEP,
    Fmu,
    Instance,
    integers,
    reals,
    references,
)
from tests.vehicles import EVERYTHING, HEAVY, VIDEORAY, State, Values

ROVS = {"videoray_dir": VIDEORAY, "heavy_dir": HEAVY, "everything_dir": load_vehicle(EVERYTHING).rov}


@pytest.fixture(scope="module", params=ROVS)
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """Of a vehicle of the paper, of one with sway, lag, coupling and dead band, and of one that has everything."""
    return Fmu(request.getfixturevalue(request.param))


@pytest.fixture
def rov(fmu: Fmu) -> Rov:
    """The same vehicle."""
    return next(rov for rov in ROVS.values() if set(rov.layout.inputs) == set(fmu.inputs))


def commands(fmu: Fmu) -> list[str]:
    return [name for name in fmu.inputs if fmu.variables[name].min is not None]


def random_motion(fmu: Fmu, rng: random.Random) -> dict[str, float]:
    """Inputs and states of either sign, zeros, and commands beyond full, none on the corner."""
    values = {name: rng.uniform(-3.0, 3.0) for name in fmu.inputs + fmu.states}
    for name in commands(fmu):
        values[name] = rng.choice([rng.uniform(-0.99, 0.99), rng.choice([-1, 1]) * rng.uniform(1.01, 2.0)])
    for name in (*commands(fmu), *(velocity for velocity in "uvwr" if velocity in values)):
        values[name] = rng.choice([values[name], values[name], 0.0])
    return values


def random_parameters(
    fmu: Fmu, rng: random.Random, variability: Sequence[str] = ("fixed", "tunable")
) -> dict[str, float]:
    chosen = [name for name in fmu.parameters if fmu.variables[name].variability in variability]
    return {name: (float(fmu.variables[name].start) or 1.0) * rng.uniform(0.7, 1.3) for name in chosen}


def points(fmu: Fmu, n: int, seed: int) -> list[dict[str, float]]:
    rng = random.Random(seed)  # no zeros: beside an input that saturates they put the mix on the corner
    motions = ({name: x or rng.uniform(-0.9, 0.9) for name, x in random_motion(fmu, rng).items()} for _ in range(n))
    return [motion | random_parameters(fmu, rng) for motion in motions]


def at_point(fmu: Fmu, kind: int, mode: str, point: dict[str, float]) -> Instance:
    rov = fmu.instance(kind)
    assert rov.set(point) == OK
    rov.reach(mode)
    return rov


# ---- Directional derivatives ----


def exact(rov: Rov, point: Values) -> dict[str, Any]:
    """Every output and derivative, by the equations written out again."""
    k = Rov(rov.layout, {name: point[name] for name in rov.coefficients})
    rates = equations(k, point).rates({name: mp.mpf(point[name]) for name in rov.layout.state}, point)
    forces = steady_forces(k, point) | {n.removeprefix("F_"): mp.mpf(point[n]) for n in rov.layout.lagging}
    found = {name: mp.mpf(point[name]) for name in rov.layout.state} | {f"F_{n}": F for n, F in forces.items()}
    for curve in rov.layout.curves:
        turning = (effect(k, t, "r") * forces[t.name] for t in rov.layout.thrusters if t.curve == curve.name)
        found[f"tau_{curve.name}"] = mp.fsum(turning) if rov.layout.has(YAW) else mp.zero
    return found | {f"der({name})": rate for name, rate in rates.items()}


def slopes(rov: Rov, point: Values, known: str, side: int = 1) -> dict[str, float]:
    """Of every output and derivative by one known, from one side: in 50 digits all that a double has."""
    with mp.workdps(50):
        h = side * mp.mpf(10) ** -18
        here, near, far = (exact(rov, {**point, known: mp.mpf(point[known]) + n * h}) for n in range(3))
        return {name: float((4 * near[name] - far[name] - 3 * here[name]) / (2 * h)) for name in here}


def check_slopes(rov: Rov, instance: Instance, point: Values, known: str, side: int = 1) -> None:
    unknowns = instance.fmu.outputs + instance.fmu.derivatives
    found, expected = instance.derivatives(unknowns, known), slopes(rov, point, known, side)
    size = max(1.0, *map(abs, expected.values()))  # what a sum of large terms leaves
    for name, d in zip(unknowns, found, strict=True):
        assert d == pytest.approx(expected[name], rel=1e-12, abs=1e-14 * size), (name, known, side, point)


@pytest.mark.parametrize("number", [3, pytest.param(60, marks=pytest.mark.long)])
def test_directional_derivatives_are_the_slopes_of_the_equations(fmu: Fmu, rov: Rov, number: int) -> None:
    """By every input, state and coefficient, of all that is calculated."""
    for point in points(fmu, number, seed=1):
        with at_point(fmu, CO_SIMULATION, INITIALIZATION, point) as instance:
            for known in point:
                check_slopes(rov, instance, point, known)


def kinks(rov: Rov, point: Values) -> Iterator[tuple[State, str, int]]:
    """Points on the edge of saturation, of a dead band and at rest; what crosses it there, and where its inside is."""
    layout = rov.layout
    still = {**point, **dict.fromkeys(layout.commands, 0.0)}
    for command, sign in product(layout.commands, (1, -1)):
        yield {**still, command: sign}, command, -sign
        for thruster in (t for t in layout.thrusters if command in layout.gains[t.name]):
            gain, curve = layout.gains[thruster.name][command], layout.curve_of[thruster.name]
            if "c_0" in curve.keys:
                dead_band = curve.coefficient("c_0" if sign * gain > 0.0 else "c_0_reverse")
                edge = {**still, command: sign * point[dead_band] / abs(gain)}
                yield edge, command, -sign
                yield edge, dead_band, 1
    for velocity in layout.velocities:
        yield {**point, velocity: 0.0}, velocity, 1


def test_at_a_kink_the_derivative_is_that_of_the_inside(fmu: Fmu, rov: Rov) -> None:
    """Of commands within ±1, and of the dead band; a velocity at rest is about to go ahead."""
    for kink, known, inside in kinks(rov, *points(fmu, 1, seed=9)):
        with at_point(fmu, CO_SIMULATION, INITIALIZATION, kink) as instance:
            check_slopes(rov, instance, kink, known, inside)


@pytest.mark.parametrize(
    ("kind", "mode"), [c for c in EVERY_MODE if c[1] not in (INSTANTIATED, INITIALIZATION)], ids=str
)
def test_directional_derivatives_are_the_same_in_every_mode(fmu: Fmu, kind: int, mode: str) -> None:
    unknowns = fmu.outputs + fmu.derivatives
    for point in points(fmu, 5, seed=2):
        with at_point(fmu, kind, INITIALIZATION, point) as rov, at_point(fmu, kind, mode, point) as later:
            for known in fmu.inputs + fmu.states:
                assert later.derivatives(unknowns, known) == rov.derivatives(unknowns, known)


def test_a_directional_derivative_adds_up_its_seeds(fmu: Fmu) -> None:
    rng = random.Random(3)
    unknowns, (point,) = fmu.outputs + fmu.derivatives, points(fmu, 1, seed=4)
    with at_point(fmu, MODEL_EXCHANGE, INITIALIZATION, point) as rov:
        seeds = {known: rng.uniform(-1.0, 1.0) for known in point}
        columns = [[seed * d for d in rov.derivatives(unknowns, known)] for known, seed in seeds.items()]
        result = reals(*[0.0] * len(unknowns))
        rov.expect(
            "fmi2GetDirectionalDerivative",
            references(*(fmu.vr[name] for name in unknowns)),
            len(unknowns),
            references(*(fmu.vr[name] for name in seeds)),
            len(seeds),
            reals(*seeds.values()),
            result,
        )
        for i, column in enumerate(zip(*columns, strict=True)):
            assert result[i] == pytest.approx(sum(column), rel=1e-12, abs=1e-12 * max(map(abs, column)))


# ---- The model structure ----

Jacobian = dict[tuple[str, str], float]


def jacobian(rov: Instance, unknowns: Sequence[str], knowns: Sequence[str]) -> Jacobian:
    columns = {known: rov.derivatives(unknowns, known) for known in knowns}
    return {(name, known): d for known, column in columns.items() for name, d in zip(unknowns, column, strict=True)}


def declared(unknowns: Sequence[Any]) -> dict[tuple[str, str], str]:
    return {
        (unknown.variable.name, known.name): kind
        for unknown in unknowns
        for known, kind in zip(unknown.dependencies, unknown.dependenciesKind, strict=True)
    }


@pytest.mark.parametrize("structure", ["outputs", "derivatives"])
def test_dependencies_are_declared_as_they_are(fmu: Fmu, structure: str) -> None:
    rng = random.Random(5)
    unknowns = [unknown.variable.name for unknown in getattr(fmu.description, structure)]
    knowns = fmu.inputs + fmu.states
    motions = [random_motion(fmu, rng) for _ in range(20)]
    sets = [{}, random_parameters(fmu, rng, "fixed"), random_parameters(fmu, rng, "tunable")]
    samples: list[list[Jacobian]] = []
    for parameters in sets:
        samples.append([])
        for motion in motions:
            with at_point(fmu, CO_SIMULATION, STEP, motion | parameters) as rov:
                samples[-1].append(jacobian(rov, unknowns, knowns))

    def strongest(pair: tuple[str, str]) -> str | None:
        values = [{sample[pair] for sample in of_set} for of_set in samples]
        if set.union(*values) == {0.0}:
            return None
        if any(len(of_set) > 1 for of_set in values):
            return "dependent"
        start, fixed, tunable = values
        return "tunable" if tunable != start else "fixed" if fixed != start else "constant"

    found = {(name, known): strongest((name, known)) for name in unknowns for known in knowns}
    assert {pair: kind for pair, kind in found.items() if kind} == declared(getattr(fmu.description, structure))


def test_initial_dependencies_are_declared_as_they_are(fmu: Fmu) -> None:
    unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
    samples: list[Jacobian] = []
    for point in points(fmu, 30, seed=6):
        with at_point(fmu, CO_SIMULATION, INITIALIZATION, point) as rov:
            samples.append(jacobian(rov, unknowns, list(point)))
    values = {pair: {sample[pair] for sample in samples} for pair in samples[0]}
    found = {pair: "constant" if len(of) == 1 else "dependent" for pair, of in values.items() if of != {0.0}}
    assert found == declared(fmu.description.initialUnknowns)


def test_the_structure_lists_every_output_state_and_calculated_variable(fmu: Fmu) -> None:
    variables = fmu.variables.values()
    assert fmu.outputs == [v.name for v in variables if v.causality == "output"]
    assert fmu.derivatives == [v.name for v in variables if v.derivative is not None]
    initial = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
    assert initial == [v.name for v in variables if v.initial == "calculated"]
    assert fmu.derivatives == [f"der({name})" for name in fmu.states]


# ---- Derivatives by time ----


def output_derivatives(rov: Instance) -> list[float]:
    names = rov.fmu.outputs
    values = reals(*[0.0] * len(names))
    vr = references(*(rov.fmu.vr[name] for name in names))
    rov.expect("fmi2GetRealOutputDerivatives", vr, len(names), integers(*[1] * len(names)), values)
    return list(values)


def test_output_derivatives_are_the_slopes_of_the_outputs_over_small_steps(fmu: Fmu) -> None:
    h = 2e-5
    for point in points(fmu, 12, seed=7):
        with at_point(fmu, CO_SIMULATION, STEP, point) as rov:
            before = rov.get(fmu.outputs)
            assert rov.step(0.0, h) == OK
            slopes = output_derivatives(rov)
            assert rov.step(h, h) == OK
            for name, slope, a, b in zip(fmu.outputs, slopes, before, rov.get(fmu.outputs), strict=True):
                assert slope == pytest.approx((b - a) / (2.0 * h), rel=1e-5, abs=1e-5), (name, point)
            rov.expect("fmi2Terminate")
            assert output_derivatives(rov)[0] == rov.get(["der(u)"])[0]


@pytest.mark.parametrize("mode", MODES[MODEL_EXCHANGE][1:])
def test_the_solver_gets_the_derivatives_and_states_that_the_variables_have(fmu: Fmu, mode: str) -> None:
    n = len(fmu.states)
    for point in points(fmu, 5, seed=8):
        with at_point(fmu, MODEL_EXCHANGE, mode, point) as rov:
            derivatives, states = reals(*[0.0] * n), reals(*[0.0] * n)
            rov.expect("fmi2GetDerivatives", derivatives, n)
            rov.expect("fmi2GetContinuousStates", states, n)
            assert bytes(derivatives) == bytes(reals(*rov.get(fmu.derivatives)))
            assert bytes(states) == bytes(reals(*(point[name] for name in fmu.states)))
            assert len({*derivatives}) > 3
