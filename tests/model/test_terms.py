"""The generated C (rov_fmu/engine/source.py) agrees with the formulas in Python, and its step with 50 digits."""

import random
from pathlib import Path

import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.model.steps import Motion
from tests.model.test_c_step import case
from verification.references import reference

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=["videoray", "bluerov2", "bluerov2_heavy"])
def motion(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Motion:
    return Motion(load_vehicle(SHIPPED[request.param]).rov, tmp_path_factory.mktemp("terms"))


@pytest.mark.parametrize("reverse", [1.0, 30.0, 1.0 / 30.0])
def test_a_step_is_exact(motion: Motion, reverse: float, tmp_path: Path) -> None:
    """The drag in reverse is 30 times that ahead, the same, or a 30th of it."""
    rov = motion.rov
    if reverse != 1.0:
        drag = {
            f"{key}_{form.axis.velocity}_reverse": reverse * rov[f"{key}_{form.axis.velocity}"]
            for form in rov.layout.axes
            for key in ("a_d", "b_d")
        }
        motion = Motion(rov.extended(drag), tmp_path)
        rov = motion.rov
    rng = random.Random(2)
    for _ in range(10):
        inputs, state, h = case(rov, rng, 1.0)
        found, exact = motion.step(rov, inputs, state, h), reference.step(rov, inputs, state, h)
        for name, value in exact.state.items():
            room = 1e-12 * exact.scale[name] + 2.0**-51 * abs(state[name]) * (name in rov.layout.pose)
            assert abs(found[name] - value) <= room, (name, inputs, state, h, float(found[name] - value))


def test_calculated_variables_agree_with_python(motion: Motion) -> None:
    rng = random.Random(3)
    for _ in range(100):
        inputs, state, _ = case(motion.rov, rng)
        found = motion.calculate({**motion.rov.coefficients, **inputs, **state})
        for name, rate in motion.rov.derivatives(inputs, state).items():
            assert found[f"der({name})"] == pytest.approx(rate, rel=1e-12, abs=1e-13)
        for name, value in motion.rov.thrust(inputs, state).items():
            assert found[name] == pytest.approx(value, rel=1e-13, abs=1e-14)


def test_tangents_are_differences(motion: Motion) -> None:
    """Each known changes by a millionth. The values are away from the kinks of the formulas."""
    rng = random.Random(4)
    rov = motion.rov
    for _ in range(10):
        inputs = {name: rng.uniform(0.2, 0.9) for name in rov.layout.inputs}
        state = {name: rng.uniform(0.2, 0.9) for name in rov.layout.state}
        values = {**rov.coefficients, **inputs, **state}
        for known, value in values.items():
            size = 1e-6 * max(abs(value), 1e-3)
            ahead, back = (motion.calculate({**values, known: value + s * size}) for s in (1.0, -1.0))
            found = motion.tangent(values, {known: 1.0})
            for name in (*(f"der({s})" for s in rov.layout.state), *rov.layout.thrust):
                slope = (ahead[name] - back[name]) / (2.0 * size)
                assert found[name] == pytest.approx(slope, rel=1e-5, abs=1e-6 * (1.0 + abs(ahead[name]))), (name, known)
