"""The dependencies in modelDescription.xml of vehicles of every kind, against slopes of the reference's equations."""

import random
from collections.abc import Sequence

import pytest

from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.fmu.test_versions import described, structure
from tests.vehicles import EVERYTHING, SIX, VEHICLES, numbered, with_axes
from verification.references.rigid_vehicle import QUATERNION, calculated

Point = dict[str, float]
Slopes = dict[tuple[str, str], float]


def slopes(rov: Vehicle, point: Point, knowns: Sequence[str]) -> Slopes:
    """Return central differences at a point of inputs, states and coefficients."""
    found = {}
    for known in knowns:
        step = 1e-6 * max(1.0, abs(point[known]))
        ends = []
        for x in (point[known] + step, point[known] - step):
            ends.append({name: float(y) for name, y in calculated(rov, point | {known: x}, float).items()})
        for name, above in ends[0].items():
            slope = (above - ends[1][name]) / (2.0 * step)
            found[name, known] = 0.0 if abs(slope) < 1e-7 else slope
    return found


def motions(names: Sequence[str], rng: random.Random, pairs: int) -> list[Point]:
    """Return pairs of random motions, the second of which has the opposite signs."""
    found = []
    for _ in range(pairs):
        point = {name: rng.uniform(-0.9, 0.9) for name in names}
        found += [point, {name: -x for name, x in point.items()}]
    return found


def parameters(rov: Vehicle, rng: random.Random, tunable: Sequence[bool]) -> Point:
    of = rov.layout.coefficients
    return {n: x * (rng.uniform(0.6, 1.4) if of[n].tunable in tunable else 1.0) for n, x in rov.coefficients.items()}


def vary(values: Sequence[float]) -> bool:
    return max(values) - min(values) > 1e-4 * max(map(abs, values))


def declared(rov: Vehicle, of: str) -> dict[tuple[str, str], str]:
    """Return a list of <ModelStructure>: each unknown and known with the kind of their dependency."""
    return {
        (unknown, known): kind
        for unknown, knowns, kinds in structure(described(rov, 2), 2)[of]
        for known, kind in zip(knowns, kinds.split(), strict=True)
    }


_ROVS = {"everything": load_vehicle(EVERYTHING), "six axes": SIX} | VEHICLES
_ROVS |= {f"{axes} alone": with_axes(axes) for axes in ("q", "wp", "upr")}
# The default tests have the vehicle with most effects.
_SOME = ("everything",)
_KINDS = [pytest.param(kind, marks=() if kind in _SOME else pytest.mark.long) for kind in _ROVS]


@pytest.mark.parametrize("kind", _KINDS)
def test_declared_dependencies_are_those_of_the_equations(kind: str) -> None:
    rov, rng = numbered(_ROVS[kind].layout), random.Random(1)
    knowns = [*rov.layout.inputs, *rov.layout.state]
    moving = motions(knowns, rng, 2 if rov.layout.has_attitude else 4)
    sets = [parameters(rov, rng, tunable) for tunable in ([], [False], [True])]
    samples = [[slopes(rov, m | k, knowns) for m in moving] for k in sets]

    def strongest(pair: tuple[str, str]) -> str | None:
        values = [[sample[pair] for sample in of_set] for of_set in samples]
        if not any(map(any, values)):
            return None
        if any(map(vary, values)):
            return "dependent"
        start, fixed, tunable = (of_set[0] for of_set in values)
        return "tunable" if vary([start, tunable]) else "fixed" if vary([start, fixed]) else "constant"

    found = {pair: strength for pair in samples[0][0] if (strength := strongest(pair))}
    outputs = {v.name for v in variables(rov) if v.causality == "output"}
    assert {pair: s for pair, s in found.items() if pair[0] in outputs} == declared(rov, "Outputs")
    assert {pair: s for pair, s in found.items() if pair[0].startswith("der(")} == declared(rov, "Derivatives")


_BEYOND_THEIR_RANGES = [(angle, f"{angle}_0") for angle in ("phi", "theta", "psi")]
_BEYOND_THEIR_RANGES += [("phi", "theta_0"), ("psi", "theta_0")]


@pytest.mark.parametrize("kind", _KINDS)
def test_declared_initial_dependencies_are_those_of_the_equations(kind: str) -> None:
    """The knowns are inputs, states and parameters; the only kinds are constant and dependent (2.2.8).

    A quaternion is not known. It follows from the Euler angles at the start, which differ from the later ones where
    they are beyond their ranges.
    """
    rov, rng = numbered(_ROVS[kind].layout), random.Random(2)
    known = {*rov.layout.inputs, *rov.layout.state, *rov.layout.initial} - {*QUATERNION}
    points = [
        m | parameters(rov, rng, [False, True])
        for m in motions(sorted(known), rng, 2 if rov.layout.has_attitude else 4)
    ]
    samples = [slopes(rov, point, list(point)) for point in points]
    values = {pair: [sample[pair] for sample in samples] for pair in samples[0] if pair[0] not in known}
    found = {pair: "dependent" if vary(of) else "constant" for pair, of in values.items() if any(of)}
    found |= dict.fromkeys(_BEYOND_THEIR_RANGES if rov.layout.has_attitude else (), "dependent")
    assert found == declared(rov, "InitialUnknowns")
