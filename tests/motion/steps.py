"""A step of a vehicle in Python and in C, and how far it is from the exact one."""

from collections.abc import Callable, Mapping
from typing import Any

from checks import reference
from rov_fmu.motion.rov import Rov
from tests.fmi import OK
from tests.fmi2 import Fmu
from tests.vehicles import State, Values

Step = Callable[[Rov, Values, Values, float], State]
POSE = ("x", "y", "z", "psi")
ROUNDING = 2.0**-52


def in_python(rov: Rov, inputs: Values, state: Values, h: float, steps: int = 1) -> State:
    """The state after equal steps that last h together."""
    for _ in range(steps):
        state = rov.step(inputs, state, h / steps)
    return dict(state)


def in_fmu(fmu: Fmu, rov: Rov, inputs: Values, state: Values, h: float, steps: int = 1) -> State:
    """The state of a new instance after equal steps that last h together."""
    with fmu.instance() as instance:
        instance.start({**rov.coefficients, **inputs, **state})
        for n in range(steps):
            assert instance.step(n * h / steps, h / steps) == OK, instance.log
        return dict(zip(state, instance.get(list(state)), strict=True))


def errors(found: Values, exact: Mapping[str, Any], scale: Mapping[str, Any], before: Values) -> tuple[float, float]:
    """Largest error of velocities and forces, and of the pose beyond the rounding of a pose that is far from zero."""
    largest = [0.0, 0.0]
    for name, value in found.items():
        error = abs(value - exact[name])
        assert error == error, name  # noqa: PLR0124 (NaN)
        if name in POSE:
            error = max(0.0, error - 2.0 * ROUNDING * abs(before[name]))
        relative = float(error / scale[name]) if scale[name] else float(error)
        largest[name in POSE] = max(largest[name in POSE], relative)
    return largest[0], largest[1]


def worst(step: Step, rov: Rov, inputs: Values, state: Values, h: float) -> tuple[float, float]:
    """Errors of a step against the exact one, by the largest velocity on the way and by the length of the path."""
    exact = reference.step(rov, inputs, state, h)
    return errors(step(rov, inputs, state, h), exact.state, exact.scale, state)
