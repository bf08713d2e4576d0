"""Steps one by one, as a simulation that waits for its commands makes them, equal one simulation of the whole time."""

import numpy as np
import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.c.stepper import Stepper
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ROOT

FILES = [SHIPPED["videoray"], SHIPPED["bluerov2_heavy"], ROOT / "tests" / "vehicle" / "thrust_effects.toml"]
H, STEPS = 0.004, 150


def vehicle(n: int) -> Vehicle:
    return load_vehicle(FILES[n])


@pytest.mark.parametrize("n", range(len(FILES)))
def test_steps_equal_one_simulation(n: int) -> None:
    rov = vehicle(n)
    layout = rov.layout
    record = [*layout.state, *layout.angles]
    if layout.lagging and not layout.fins:  # otherwise the accelerations jump with the commands
        record += [f"der({name})" for name in layout.velocities]
    random = np.random.default_rng(n)
    levels = random.uniform(-0.6, 0.6, (len(layout.commands), STEPS // 10)).repeat(10, axis=1)
    commands = np.vectorize(layout.command_of)(levels)
    start = {"V_N": 0.2, "psi_0" if layout.has_attitude else "psi": 3.0}
    stepper = Stepper(rov, start, record)
    times = H * np.arange(STEPS + 1)
    steps = zip(commands.T, np.diff(times).tolist(), strict=True)
    found = np.array([stepper.step([*column], h) for column, h in steps])
    held = {name: np.append(row, row[-1]) for name, row in zip(layout.commands, commands, strict=True)}
    expected = simulate(rov, times, start | held, record).values[:, 0, 1:].T
    assert np.ptp(expected[:, 0]) > 0.01
    states = len(layout.state)
    np.testing.assert_array_equal(found[:, :states], expected[:, :states])
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert stepper.time == pytest.approx(H * STEPS, abs=1e-12)


def test_a_motion_that_cannot_be_computed_is_told() -> None:
    rov = vehicle(0)
    stepper = Stepper(rov, {"u": 1e200}, ["u"])
    with pytest.raises(OverflowError, match="from 0 s on"):
        stepper.step([0.0] * len(rov.layout.commands), 1.0)
