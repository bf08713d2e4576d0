"""Laws that steps of a whole vehicle obey, in Python and in the FMU, tested without a reference."""

import random
from collections.abc import Callable
from dataclasses import replace
from math import hypot

import pytest

from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import Step
from tests.often import often
from tests.vehicles import (
    HEAVY,
    VEHICLES,
    VIDEORAY,
    Case,
    State,
    Values,
    frictionless,
    random_case,
    random_vehicle,
    still,
)


def negated(values: Values, *names: str) -> State:
    return {name: -value if name in names else value for name, value in values.items()}


def mirrored(rov: Vehicle) -> Vehicle:
    """Return the vehicle whose rear thrusters have the health of each other."""
    swapped = {"health_l": rov["health_r"], "health_r": rov["health_l"]}
    return replace(rov, coefficients={**rov.coefficients, **swapped})


def for_every(law: Callable[[Step, Case], None]) -> Callable[[list[Step], int], None]:
    """Make a test of a law for random vehicles like the VideoRay, many more of them in the long and weekly tests."""

    @often("cases", 15, 100, 1000)
    def test(steps: list[Step], cases: int) -> None:
        rng = random.Random(law.__name__)
        for _ in range(cases):
            case = random_case(rng, random_vehicle(rng, VIDEORAY.layout), longest=1.0)
            for step in steps:
                law(step, case)

    test.__doc__ = law.__doc__
    return test


# ---- Mirror images, to the last bit ----


@for_every
def test_port_and_starboard_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    k, i, s, h = case
    inputs = negated({**i, "u_l": i["u_r"], "u_r": i["u_l"]}, "N_ext", "V_E")
    assert step(mirrored(k), inputs, negated(s, "r", "y", "psi"), h) == negated(step(*case), "r", "y", "psi")


@for_every
def test_ahead_and_astern_are_mirror_images_to_the_last_bit(step: Step, case: Case) -> None:
    """In the mirror image, each rear thruster does the opposite of the other one, so their torque is the same."""
    k, i, s, h = case
    inputs = negated({**i, "u_l": -i["u_r"], "u_r": -i["u_l"]}, "X_ext", "V_N", "V_E")
    assert step(mirrored(k), inputs, negated(s, "u", "x", "y"), h) == negated(step(*case), "u", "x", "y")


# ---- Without force ----


def energy(rov: Vehicle, state: Values) -> float:
    """Return the kinetic energy with the effective inertias."""
    return 0.5 * sum(rov.effective_inertia(form) * state[form.axis.velocity] ** 2 for form in rov.layout.axes)


@pytest.mark.parametrize("vehicle", [name for name, rov in VEHICLES.items() if rov.layout.coupled])
def test_without_thrust_and_load_energy_only_falls(vehicle: str) -> None:
    rov = VEHICLES[vehicle].with_(**{n: 0.0 for n in VEHICLES[vehicle].coefficients if n.startswith("F_0")})
    rng = random.Random(vehicle)
    for _ in range(10):
        _, _, state, h = random_case(rng, rov, -2.0, 0.0)
        state |= dict.fromkeys(rov.layout.lagging, 0.0)
        after = rov.step(still(rov), state, h)
        assert energy(rov, after) <= energy(rov, state) * (1.0 + 1e-15)
        assert energy(rov, rov.step(still(rov), after, h)) <= energy(rov, after) * (1.0 + 1e-15)


def test_coupling_does_no_work() -> None:
    """Without drag, the energy is constant, and (M_u u)^2 + (M_v v)^2 is an invariant of Kirchhoff's equations."""
    rov = frictionless(HEAVY)
    M_u, M_v = (rov.effective_inertia(rov.layout.by_name[name]) for name in ("surge", "sway"))
    rng = random.Random(12)
    for _ in range(10):
        _, _, state, h = random_case(rng, rov, -2.0, 0.5)
        state |= dict.fromkeys(rov.layout.lagging, 0.0)
        after = rov.step(still(rov), state, h)
        assert energy(rov, after) == pytest.approx(energy(rov, state), rel=1e-14)
        momenta = [hypot(M_u * s["u"], M_v * s["v"]) for s in (state, after)]
        assert momenta[1] == pytest.approx(momenta[0], rel=1e-14)
