"""Identification in every scenario: what it is held to, and that the scenarios are what they say."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.recordings import output_error
from rov_fmu.identify.recordings.recordings_fit import estimate_of
from rov_fmu.model.layout import HEAVE, YAW
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.identify.scenarios.catalogue import COMPLETE, DEPTH, HEADING, INCOMPLETE, SCENARIOS, Logs, Scenario, Sensor
from tests.identify.scenarios.judge import FAMILY, problems
from tests.identify.scenarios.outcome import flights, moved, outcome, true_values, write
from verification.references import pool
from verification.references.pool import Array, Commands, Conditions

BY_DEFAULT = ("load of 0.1 N in heave",)
"""The quick scenario of the default tests."""
OFTEN = (
    "clean",
    "delay and lag",
    "gaps while turning",
    "pilot",
    "switches between rows at 5 Hz",
    "tether",
    "tilt with roll and pitch",
    "load, delay, reverse, correlated noise",
)
"""The scenarios that the long tests run with 20 seeds. All of them are run with 200 seeds once a week."""
FEW = 10
"""The number of seeds of the Heavy once a week, because one of them takes minutes."""

assert SCENARIOS.keys() >= {*BY_DEFAULT, *OFTEN}


def judged() -> Iterator[object]:
    """Yield each scenario with each number of seeds."""
    for name in SCENARIOS:
        seeds = FEW if SCENARIOS[name].vehicle == "bluerov2_heavy" else 200
        yield pytest.param(name, seeds, marks=pytest.mark.weekly, id=f"{name}-{seeds}")
        if name in OFTEN:
            yield pytest.param(name, 20, marks=pytest.mark.long, id=f"{name}-20")
        if name in BY_DEFAULT:
            yield pytest.param(name, 2, id=f"{name}-2")


@pytest.mark.parametrize(("name", "seeds"), [*judged()])
def test_a_scenario_is_identified(name: str, seeds: int, tmp_path: Path) -> None:
    """Intervals cover, β is unbiased, and alarms are raised where they should be, and only there."""
    scenario = SCENARIOS[name]
    outcomes = [outcome(scenario, seed, tmp_path / str(seed)) for seed in range(seeds)]
    assert not problems(outcomes, scenario, FAMILY)


# ---- What is found, and what follows from it -------------------------------------------------------------------------

PULSES = Commands(
    np.cumsum([0.0, 2.0, 2.5, 2.5, 3.0, 2.0, 1.5, 4.0]), {"": np.array([0.0, 0.55, 0.0, -0.35, 0.45, -0.65, 0.25, 0.0])}
)
"""Commands that no fit has seen, each held for about a time constant."""


@pytest.mark.long
def test_pulses_that_were_not_fitted_are_predicted(tmp_path: Path) -> None:
    """The prediction uses the identified vehicle and the delay of its findings; the integrator simulates both."""
    scenario, time = COMPLETE["delay and lag"], np.arange(0.0, 22.0, 0.05)
    found = outcome(scenario, 0, tmp_path)
    assert found.rov
    delays = {f.axis: f.numbers["value"] for f in found.findings if f.kind == "delay"}
    for axis, thrusters in {"surge": {"l": 1.0, "r": 1.0}, "heave": {"t": 1.0}, "yaw": {"l": 1.0, "r": -1.0}}.items():
        pulses = Commands(PULSES.switches, {name: sign * PULSES.thrusters[""] for name, sign in thrusters.items()})
        velocity = {"surge": "u", "heave": "w", "yaw": "r"}[axis]
        true = pool.motion(scenario.truth, pulses, time, scenario.conditions)[velocity]
        modelled = pool.motion(found.rov, pulses, time, Conditions(delay=delays[axis]))[velocity]
        error = np.linalg.norm(true - modelled) / np.linalg.norm(true - true.mean())
        assert error < 0.1, axis


@pytest.mark.long
def test_the_current_of_each_recording_is_found(tmp_path: Path) -> None:
    scenario = COMPLETE["another current each time"]
    found = outcome(scenario, 0, tmp_path)
    currents = {f.file: f.numbers["value"] for f in found.findings if f.kind == "current"}
    expected = {f"log_surge_{n}.csv": north for n, (north, _) in enumerate(scenario.currents)}
    assert currents == pytest.approx(expected, abs=0.002)


@pytest.mark.long
@pytest.mark.parametrize(("name", "rate", "most"), [("pilot", 20.0, 10.0), ("clean", 100.0, 30.0)])
def test_identification_is_quick(name: str, rate: float, most: float, tmp_path: Path) -> None:
    """Three recordings of all axes at 20 Hz, and nine of one axis at 100 Hz, each of 60 s; in seconds of one core."""
    scenario = SCENARIOS[name]
    found = outcome(replace(scenario, logs=replace(scenario.logs, rate=rate)), 0, tmp_path)
    assert found.rov
    assert found.seconds < most


# ---- The scenarios ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INCOMPLETE)
def test_what_the_model_lacks_is_large(name: str) -> None:
    """It moves a sensor of an unexplained axis by at least three times its noise (RMS)."""
    scenario = INCOMPLETE[name]
    (flight,) = flights(replace(scenario, logs=replace(scenario.logs, count=1)), np.random.default_rng(0))
    real = moved(scenario.truth, flight.commands, flight.time, flight.conditions)
    modelled = moved(scenario.truth, flight.commands, flight.time, Conditions())
    changes = [
        float(np.sqrt(np.mean((s.scale * true_values(s, real) - true_values(s, modelled)) ** 2))) / s.noise
        for s in scenario.sensors
        if s.axis.name in scenario.unexplained
    ]
    assert max(changes) >= 3.0


def logged(scenario: Scenario, folder: Path) -> dict[str, dict[str, Array]]:
    """Return the columns of the logs of seed 0, by file."""
    write(scenario, 0, folder)
    tables = {
        path.name: np.genfromtxt(path, delimiter=",", names=True, deletechars="") for path in folder.glob("*.csv")
    }
    return {
        file: {name.partition("_[")[0]: t[name] for name in t.dtype.names or ()} for file, t in sorted(tables.items())
    }


def test_a_log_has_what_the_vehicle_did(tmp_path: Path) -> None:
    scenario = replace(COMPLETE["pilot"], logs=Logs("pilot", count=1, seconds=20.0, between_rows=True, rate=5.0))
    (flight,) = flights(scenario, np.random.default_rng(0))
    (log,) = logged(scenario, tmp_path).values()
    assert log["time"] == pytest.approx(flight.time)
    assert log["u_l"] == pytest.approx(100.0 * flight.commands.at(flight.time)["l"], abs=1e-5)
    assert np.any(flight.commands.switches * 5.0 % 1.0 > 0.1)
    motion = moved(scenario.truth, flight.commands, flight.time, flight.conditions)
    for sensor, column in zip(scenario.sensors, ("surge_velocity", "depth", "heading"), strict=True):
        values = np.radians(log[column]) if sensor is HEADING else log[column]
        errors = values - true_values(sensor, motion)
        assert 0.7 * sensor.noise < np.std(errors) < 1.3 * sensor.noise


def test_rows_are_where_a_scenario_puts_them(tmp_path: Path) -> None:
    one = Logs("pilot", count=1)

    def time(folder: str, logs: Logs) -> Array:
        (log,) = logged(replace(COMPLETE["pilot"], logs=logs), tmp_path / folder).values()
        return log["time"]

    assert np.diff(time("even", one)) == pytest.approx(0.05)
    assert np.ptp(np.diff(time("scattered", replace(one, scatter=0.8)))) > 0.05
    gaps = np.diff(time("gaps", replace(one, plan="steps", gaps=2, axes=(YAW,))))
    assert np.sort(gaps)[-3:] == pytest.approx([0.05, 4.05, 4.05], abs=0.051)


def test_values_are_as_a_scenario_measures_them(tmp_path: Path) -> None:
    def first(folder: str, sensor: Sensor, logs: Logs) -> Array:
        scenario = replace(COMPLETE["clean"], logs=logs, sensors=(sensor,))
        return next(iter(logged(scenario, tmp_path / folder).values()))[sensor.quantity]

    depth = first("depth", replace(DEPTH, resolution=0.01), Logs(axes=(HEAVE,), count=1))
    assert 100.0 * depth == pytest.approx(np.round(100.0 * depth), abs=1e-6)
    turning = Logs(axes=(YAW,), count=1)
    heading = first("heading", replace(HEADING, noise=0.0), turning)
    wrapped = first("wrapped", replace(HEADING, noise=0.0, wraps=True), turning)
    late = first("late", replace(HEADING, noise=0.0, late=0.5, every=2), turning)
    assert np.abs(wrapped).max() <= 180.0
    assert np.ptp(heading) > 720.0
    assert (heading - wrapped) / 360.0 == pytest.approx(np.round((heading - wrapped) / 360.0), abs=1e-6)
    assert np.isnan(late[1::2]).all()
    assert late[10::2] == pytest.approx(heading[:-10:2], abs=1e-4)


@pytest.mark.long
def test_a_curve_that_recordings_change_does_not_keep_the_interval_of_its_forces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The interval belongs to another value, so without one of the fit to everything there is none."""
    monkeypatch.setattr(
        output_error, "estimate_of", lambda analysis: replace(estimate_of(analysis), degrees_of_freedom=0.0)
    )
    write(SCENARIOS["load of 0.1 N in heave"], 0, tmp_path)
    rov_file = tmp_path / "rov.toml"
    lines = rov_file.read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if not line.startswith(("a_t_top", "b_t_top")))
    rov_file.write_text(text, encoding="utf-8")
    rov = load_vehicle(SHIPPED["videoray"]).rov
    forces = "".join(f"{c},{rov.force(HEAVE, 0.01 * c) + 0.02 * (c % 3)}\n" for c in range(20, 101, 10))
    (tmp_path / "thrust_top.csv").write_text(f"command [%],force [N]\n{forces}", encoding="utf-8")
    found = identify(load_tank_tests(tmp_path))
    assert found.thrust["top"].estimate.intervals.keys() >= {"a_t_top", "b_t_top"}
    assert not {"a_t_top", "b_t_top", "a_d_w"} & {*found.vehicle.intervals}
