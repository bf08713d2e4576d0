"""Steps of a vehicle in Python and in C, and their errors."""

from collections.abc import Callable, Mapping
from typing import Any

from rov_fmu.c.simulation import simulate
from rov_fmu.vehicle.vehicle import Vehicle
from tests.fmi import OK
from tests.fmi2 import Fmu
from tests.vehicles import State, Values

Step = Callable[[Vehicle, Values, Values, float], State]
POSE = ("x", "y", "z", "psi")
ROUNDING = 2.0**-52


def in_python(rov: Vehicle, inputs: Values, state: Values, h: float, steps: int = 1) -> State:
    """Return the states after h seconds in equal steps."""
    for _ in range(steps):
        state = rov.step(inputs, state, h / steps)
    return dict(state)


def in_engine(rov: Vehicle, inputs: Values, state: Values, h: float) -> State:
    """Return the states after h seconds by the C of the FMU, which the engine runs for any vehicle."""
    found = simulate(rov, [0.0, h], {**inputs, **state}, workers=1).values[:, 0, 1]
    return dict(zip(rov.layout.state, found.tolist(), strict=True))


def in_fmu(fmu: Fmu, rov: Vehicle, inputs: Values, state: Values, h: float, steps: int = 1) -> State:
    """Return the states of a new instance of an FMU after h seconds in equal steps."""
    with fmu.instance() as instance:
        instance.start({**rov.coefficients, **inputs, **state})
        for n in range(steps):
            assert instance.step(n * h / steps, h / steps) == OK, instance.log
        return dict(zip(state, instance.get(list(state)), strict=True))


def errors(found: Values, exact: Mapping[str, Any], scale: Mapping[str, Any], before: Values) -> tuple[float, float]:
    """Return the largest relative errors of velocities and forces, and of the pose.

    The rounding error of a pose that is far from zero does not count.
    """
    largest = [0.0, 0.0]
    for name, value in found.items():
        error = abs(value - exact[name])
        assert error == error, name  # noqa: PLR0124 (NaN)
        if name in POSE:
            error = max(0.0, error - 2.0 * ROUNDING * abs(before[name]))
        relative = float(error / scale[name]) if scale[name] else float(error)
        largest[name in POSE] = max(largest[name in POSE], relative)
    return largest[0], largest[1]


def worst(rov: Vehicle, inputs: Values, state: Values, h: float) -> float:
    """Return the largest error of a step in Python and in C, relative to the largest velocity or the path's length."""
    from verification.references import reference

    exact = reference.step(rov, inputs, state, h)
    found = (step(rov, inputs, state, h) for step in (in_python, in_engine))
    return max(max(errors(one, exact.state, exact.scale, state)) for one in found)
