"""Laws that steps of a whole vehicle obey, in Python and in the FMU, tested without a reference."""

import random
from collections.abc import Callable
from dataclasses import replace

from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import Step
from tests.often import often
from tests.vehicles import (
    VIDEORAY,
    Case,
    State,
    Values,
    random_case,
    random_vehicle,
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
