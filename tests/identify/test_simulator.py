"""The simulator of recordings: its derivatives by all parameters, and properties of its output."""

from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.identify.effects.current import Current
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.reverse import ReverseDrag, ReverseThrust
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.pool import run
from tests.vehicles import VIDEORAY

PLAN = ((0.0, 1.0), (0.3, 4.0), (-0.5, 3.0), (0.7, 2.0), (0.0, 2.0), (-0.2, 3.0))


def simulator(rov: Rov, axis: Axis, quantity: str, extras: dict[Effect, float]) -> tuple[Simulator, np.ndarray]:
    """Return a model of two recordings with all parameters, and x near the truth; no sample is at a command change."""
    random = np.random.default_rng(0)
    clean = run(rov, axis, PLAN, 20.0)
    recordings = [clean.recorded(random, quantity, f"log_{n}.csv") for n in range(2)]
    curves = {t.curve for t in rov.layout.drivers(axis)}
    thrust = [name for name in rov.layout.coefficients if name in {f"{k}_{c}" for k in ("a_t", "b_t") for c in curves}]
    names = (*thrust, *map(axis.coefficient, ("a_d", "b_d", "beta")))
    data = tuple(prepare(recording, rov) for recording in recordings)
    model = Simulator(data, rov, names, tuple(extras), np.array([0.5, 2.0]))
    return model, model.start({name: rov[name] for name in names}, extras)


def everything(axis: Axis, curve: str) -> dict[Effect, float]:
    found = {
        Delay(axis.name): 0.123,
        Delay("log_1.csv", axis.name): 0.0211,
        Load(axis.name): 0.013,
        Load("log_1.csv", axis.name): -0.021,
        ReverseThrust(curve): 0.6,
        ReverseDrag(axis.name): 1.3,
    }
    if axis is SURGE:
        found[Current("log_0.csv", axis.name)] = 0.1
    return found


@pytest.mark.parametrize("lag", [0.0, 0.21])
@pytest.mark.parametrize(
    ("axis", "quantity", "curve"),
    [(SURGE, "velocity", "rear"), (SURGE, "distance", "rear"), (HEAVE, "depth", "top"), (YAW, "heading", "rear")],
)
def test_derivatives_are_those_of_differences(axis: Axis, quantity: str, curve: str, lag: float) -> None:
    """The differences by a delay also contain that the simulation begins at another time, like other values there."""
    extras = everything(axis, curve) | ({Lag(curve): lag} if lag else {})
    model, x = simulator(VIDEORAY, axis, quantity, extras)
    J = model.jacobian(x)
    for n in range(len(x)):
        h = 1e-4 * max(abs(x[n]), 0.1)
        up, down = (model.residuals(x + sign * h * (np.arange(len(x)) == n)) for sign in (1.0, -1.0))
        errors = (up - down) / (2.0 * h) - J[:, n]
        if model.shared > n >= len(model.names) and model.extras[n - len(model.names)].is_delay:
            starts = J[:, model.shared :]
            errors -= starts @ np.linalg.lstsq(starts, errors)[0]
        errors = np.abs(errors)
        assert np.quantile(errors, 0.99) < 1e-5 * np.abs(J[:, n]).max()  # at a reversal the drag has a kink


@pytest.mark.parametrize("shift", [0.1, 0.33])
def test_a_delay_is_the_same_as_commands_that_come_later(shift: float) -> None:
    late = Delay("heave")
    model, x = simulator(VIDEORAY, HEAVE, "depth", {late: shift})
    moved = tuple(replace(d, switches=d.switches + shift) for d in model.data)
    other = replace(model, data=moved, extras=())
    assert model.residuals(x) == pytest.approx(other.residuals(np.delete(x, len(model.names))), rel=1e-12)


def test_a_current_carries_distances_along() -> None:
    current = Current("log_0.csv", "surge")
    model, x = simulator(VIDEORAY, SURGE, "distance", {current: 0.2})
    still = x.copy()
    still[len(model.names)] = 0.0
    (with_it, other), (without, same) = model.run(x), model.run(still)
    time = model.data[0].time
    assert with_it.values - without.values == pytest.approx(0.2 * (time - time[0]), abs=1e-12)
    assert other.values == pytest.approx(same.values, abs=1e-12)


def test_what_a_pool_does_is_what_the_simulator_does() -> None:
    clean = run(VIDEORAY, HEAVE, PLAN, 20.0, delay=0.2)
    recording = clean.recorded(np.random.default_rng(0), "depth", noise=0.0)
    model = Simulator((prepare(recording, VIDEORAY),), VIDEORAY, (), (Delay("heave"),), np.ones(1))
    x = np.array([0.2, 0.0, 0.0])
    assert np.abs(model.residuals(x)).max() < 1e-8


def test_an_axis_of_a_vehicle_of_any_form() -> None:
    """The BlueROV2 has vectored thrusters, sway, a reverse curve and a dead band."""
    rov = load_vehicle(SHIPPED["bluerov2"]).rov
    signs = {name.removeprefix("u_"): sign for name, sign in rov.layout.signs(SWAY).items()}
    straight = replace(rov.layout, coupled=False)
    clean = run(Rov(straight, rov.coefficients), SWAY, PLAN, 20.0, pattern=signs)
    recording = clean.recorded(np.random.default_rng(0), "velocity", noise=0.0)
    steady = [replace(curve, keys=tuple(k for k in curve.keys if k != "T")) for curve in rov.layout.curves]
    base = Rov(replace(straight, curves=tuple(steady)), rov.coefficients)
    lags = {c.name: rov[c.coefficient("T")] for c in rov.layout.curves if c.has_lag}
    model = Simulator((prepare(recording, base),), base, (), tuple(Lag(c) for c in lags), np.ones(1))
    assert np.abs(model.residuals(np.array([*lags.values(), 0.0]))).max() < 1e-7
