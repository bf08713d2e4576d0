"""Derivatives are the slopes of the values. Their dependencies are tested in tests/fmu/test_dependencies.py."""

import random
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import pytest
from mpmath import mp

from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests import fmi3
from tests.fmi import (
    CO_SIMULATION,
    INITIALIZATION,
    INSTANTIATED,
    MODEL_EXCHANGE,
    MODES,
    STEP,
    AnyInstance,
    Fmu,
    reals,
    room,
)
from tests.fmu.calls.conftest import WRAPPERS, modes_of
from tests.fmu.results.test_outside import TILTED, excess
from tests.often import often, spread
from tests.vehicles import (
    EVERYTHING,
    HEAVY,
    OUTSIDE,
    SIX,
    VIDEORAY,
    State,
    Values,
    at_rest,
    in_waves,
    surfaced,
    with_rotors,
)
from verification.references import rigid_vehicle

ROVS = {
    "videoray_dir": VIDEORAY,
    "videoray3_dir": VIDEORAY,
    "heavy_dir": HEAVY,
    "heavy3_dir": HEAVY,
    "everything3_dir": load_vehicle(EVERYTHING),
    "six_dir": SIX,
    "outside3_dir": OUTSIDE,
    "rotors_dir": with_rotors(SIX),
    "rotors3_dir": with_rotors(SIX),
    "wavy3_dir": in_waves(surfaced(SIX)),
}


_SOME = ("videoray_dir", "everything3_dir")
"""The FMUs of the default tests: each vehicle once, and both versions of FMI."""


@pytest.fixture(scope="module", params=spread(ROVS, _SOME, ["rotors_dir"]))
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """Return the FMU of the VideoRay, or of a vehicle with lag and coupling, with all effects, or with six axes.

    The rotors of the last one lag in speed.
    """
    return WRAPPERS[3 if "3" in request.param else 2](request.getfixturevalue(request.param))


@pytest.fixture
def rov(fmu: Fmu) -> Vehicle:
    """Return the vehicle of the FMU."""
    outputs = {name for name in fmu.outputs if not name.startswith("der(")}
    return next(rov for rov in ROVS.values() if {*rov.layout.state, *rov.layout.calculated} == outputs)


def given(fmu: Fmu) -> list[str]:
    """Return the states that have a start value. A quaternion follows from the angles, which are parameters."""
    return [name for name in fmu.states if fmu.variables[name].initial == "exact"]


def random_motion(fmu: Fmu, rng: random.Random) -> dict[str, float]:
    """Return random inputs and states: both signs, zeros, saturated commands, but no command near its limit."""
    values = {name: rng.uniform(-3.0, 3.0) for name in fmu.inputs + given(fmu)}
    for name in fmu.commands:
        values[name] = rng.choice([rng.uniform(-0.99, 0.99), rng.choice([-1, 1]) * rng.uniform(1.01, 2.0)])
    for name in (*fmu.commands, *(velocity for velocity in "uvwpqr" if velocity in values)):
        values[name] = rng.choice([values[name], values[name], 0.0])
    return values


def random_parameters(fmu: Fmu, rng: random.Random) -> dict[str, float]:
    return {name: (float(fmu.variables[name].start) or 1.0) * rng.uniform(0.7, 1.3) for name in fmu.parameters}


def points(fmu: Fmu, n: int, seed: int) -> list[dict[str, float]]:
    rng = random.Random(seed)  # no zeros, as with a saturated command they put the mix at its limit
    motions = ({name: x or rng.uniform(-0.9, 0.9) for name, x in random_motion(fmu, rng).items()} for _ in range(n))
    return [motion | random_parameters(fmu, rng) for motion in motions]


def at_point(fmu: Fmu, kind: int, mode: str, point: dict[str, float]) -> AnyInstance:
    rov = fmu.instance(kind)
    rov.set(point)
    rov.reach(mode)
    return rov


# ---- Directional derivatives ----


def calculated(rov: Vehicle, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return every output and every derivative of a vehicle, with how far it is outside of its identified ranges."""
    found = rigid_vehicle.calculated(rov, values)
    return found | ({"outside": excess({**values, **found}, TILTED)} if rov.layout.outside else {})


_SLOPES: dict[tuple[Any, ...], dict[str, float]] = {}
"""Slopes by vehicle, point, known and side. All versions and interfaces are compared with the same slopes."""


def slopes(rov: Vehicle, point: Values, known: str, side: int = 1) -> dict[str, float]:
    """Return the one-sided slope of every output and derivative by one known, computed in 50 digits."""
    key = (id(rov), *point.items(), known, side)
    if key not in _SLOPES:
        with mp.workdps(50):
            h = side * mp.mpf(10) ** -18
            here, near, far = (calculated(rov, {**point, known: mp.mpf(point[known]) + n * h}) for n in range(3))
            _SLOPES[key] = {name: float((4 * near[name] - far[name] - 3 * here[name]) / (2 * h)) for name in here}
    return _SLOPES[key]


def check_slopes(rov: Vehicle, instance: AnyInstance, point: Values, known: str, side: int = 1) -> None:
    unknowns = instance.fmu.unknowns
    found, expected = instance.derivatives(unknowns, known), slopes(rov, point, known, side)
    size = max(1.0, *map(abs, expected.values()))  # for rounding in a sum of large terms
    error = 1e-11 if rov.layout.has_attitude else 1e-12
    for name, d in zip(unknowns, found, strict=True):
        assert d == pytest.approx(expected[name], rel=error, abs=0.01 * error * size), (name, known, side, point)


@often("number", 1, 2, 60)
def test_directional_derivatives_are_the_slopes_of_the_equations(fmu: Fmu, rov: Vehicle, number: int) -> None:
    """The knowns are all inputs, states and coefficients; the unknowns are all calculated variables.

    A command beyond its range is held at the end of the range, where its slope is that from within.
    """
    for point, kind in product(points(fmu, number, seed=1), MODES):
        held = {name: max(-1.0, min(1.0, x)) if name in fmu.commands else x for name, x in point.items()}
        with at_point(fmu, kind, INITIALIZATION, point) as instance:
            for known, x in held.items():
                check_slopes(rov, instance, held, known, -1 if known in fmu.commands and x == 1.0 else 1)


def kinks(rov: Vehicle, point: Values) -> Iterator[tuple[State, str, int]]:
    """Yield points at the limit of saturation or a dead band, or at rest, each with a known to vary and the side."""
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
    for name, low, high in layout.identified:
        if name in layout.velocities:
            calm = {**still, **dict.fromkeys((*layout.velocities, *layout.initial), 0.0)}
            yield {**calm, name: low}, name, 1
            yield {**calm, name: high}, name, -1


def test_at_a_kink_the_derivative_is_one_sided(fmu: Fmu, rov: Vehicle) -> None:
    """The side is a command within ±1, a wider dead band, a positive velocity, or within an identified range."""
    for kink, known, inside in kinks(rov, *points(fmu, 1, seed=9)):
        with at_point(fmu, CO_SIMULATION, INITIALIZATION, kink) as instance:
            check_slopes(rov, instance, kink, known, inside)


def test_derivatives_are_the_same_in_every_mode_and_the_adjoint_ones_agree_with_them(fmu: Fmu) -> None:
    """(v J) u = v (J u) for random u and v. In Initialization Mode the coefficients are knowns, too."""
    rng, unknowns = random.Random(4), fmu.unknowns
    for point, (kind, mode) in product(points(fmu, 2, seed=2), modes_of(fmu.VERSION)):
        if mode == INSTANTIATED:
            continue
        with at_point(fmu, kind, INITIALIZATION, point) as first, at_point(fmu, kind, mode, point) as rov:
            for name in fmu.inputs + given(fmu):
                assert rov.derivatives(unknowns, name) == first.derivatives(unknowns, name)
            if isinstance(rov, fmi3.Instance):
                known = list(point) if mode == INITIALIZATION else fmu.inputs + fmu.states
                u, v = ({name: rng.uniform(-1.0, 1.0) for name in names} for names in (known, unknowns))
                row = rov.adjoint(unknowns, known, list(v.values()))
                terms = [a * b for a, b in zip(v.values(), rov.derivatives(unknowns, u), strict=True)]
                combined = sum(a * b for a, b in zip(row, u.values(), strict=True))
                assert combined == pytest.approx(sum(terms), rel=1e-11, abs=1e-13 * sum(map(abs, terms)))


# ---- Derivatives by time ----


@often("number", 2, 4, 300)
def test_output_derivatives_are_those_of_the_equations(fmu: Fmu, rov: Vehicle, number: int) -> None:
    """By the chain rule, with the inputs held. Every fourth point is at rest."""
    for n, point in enumerate(points(fmu, number, seed=7)):
        motion = point | ({name: at_rest(rov)[name] for name in given(fmu)} if n % 4 == 0 else {})
        with at_point(fmu, CO_SIMULATION, STEP, motion) as instance:
            motion |= dict(zip(fmu.states, instance.get(fmu.states), strict=True))
            with mp.workdps(50):
                rates = calculated(rov, motion)
            expected = dict.fromkeys(fmu.outputs, 0.0)
            for state in fmu.states:
                rate = float(rates[f"der({state})"])
                slope = slopes(rov, motion, state, -1 if rate < 0.0 else 1)  # a rotor at rest turns to one side
                expected = {name: value + slope[name] * rate for name, value in expected.items()}
            size = max(map(abs, expected.values()))
            found = dict(zip(fmu.outputs, instance.rates(fmu.outputs), strict=True))
            assert found == pytest.approx(expected, rel=1e-11, abs=1e-13 * size), motion
            instance.expect("Terminate")
            assert instance.rates(["u"]) == pytest.approx(instance.get(["der(u)"]), rel=1e-13)


def test_the_solver_gets_the_derivatives_and_states_that_the_variables_have(fmu: Fmu, rov: Vehicle) -> None:
    n = len(fmu.states)
    for point, mode in product(points(fmu, 3, seed=8), MODES[MODEL_EXCHANGE][1:]):
        with at_point(fmu, MODEL_EXCHANGE, mode, point) as instance:
            derivatives, states, nominals = room(n), room(n), room(n)
            instance.expect("GetContinuousStateDerivatives", derivatives, n)
            instance.expect("GetContinuousStates", states, n)
            instance.expect("GetNominalsOfContinuousStates", nominals, n)
            assert list(nominals) == [rov.layout.state[name].nominal for name in fmu.states]
            assert bytes(derivatives) == bytes(reals(*instance.get(fmu.derivatives)))
            assert bytes(states) == bytes(reals(*instance.get(fmu.states)))
            assert all(point[name] == state for name, state in zip(fmu.states, states, strict=True) if name in point)
            assert len({*derivatives}) > 3
