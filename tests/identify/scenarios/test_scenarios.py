"""Identification in every scenario: what it is held to, and that the scenarios are what they say."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from tests.identify.scenarios.catalogue import COMPLETE, HEADING, INCOMPLETE, OWNERS, SCENARIOS
from tests.identify.scenarios.judge import broken, promises, read_gate
from tests.identify.scenarios.outcome import outcome, read_result
from tests.identify.scenarios.tank import Logs, driven, flights, moved, true_values
from tests.report.results import without_findings
from verification.references import pool
from verification.references.pool import Commands, Conditions

BY_DEFAULT = {"load of 0.1 N in heave": 1}
"""The quick scenarios of the default tests, and the number of their seeds."""
OFTEN = ("clean", "delay and lag", "gaps while turning", "pilot", "tether", "tilt with roll and pitch")
"""The scenarios that the long tests run with 5 seeds. All of them are run with more seeds once a week."""
WEEKLY = {
    **dict.fromkeys(SCENARIOS, 200),
    **dict.fromkeys(OWNERS, 20),
    "heavy": 20,
    "heavy in a current": 20,
    "owner": 40,
}
FAMILY = sum(3 * len(scenario.truths(0)) + 12 for scenario in SCENARIOS.values())
"""At least the number of promises of all scenarios."""


def judged() -> Iterator[object]:
    """Yield each scenario with each number of seeds."""
    for name in SCENARIOS:
        yield pytest.param(name, WEEKLY[name], marks=pytest.mark.weekly, id=f"{name}-{WEEKLY[name]}")
    for name in OFTEN:
        yield pytest.param(name, 5, marks=pytest.mark.long, id=f"{name}-5")
    for name, seeds in BY_DEFAULT.items():
        yield pytest.param(name, seeds, id=f"{name}-{seeds}")


@pytest.mark.parametrize(("name", "seeds"), [*judged()])
def test_a_scenario_is_identified(name: str, seeds: int, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    outcomes = [outcome(scenario, seed, tmp_path / str(seed)) for seed in range(seeds)]
    assert not broken(promises(name, outcomes, scenario.expected, read_gate()), FAMILY)


def test_the_gate_knows_the_scenarios_of_the_vehicles_that_ship() -> None:
    names = {name for name, *_ in read_gate()}
    assert (COMPLETE.keys() | INCOMPLETE.keys()) - names == {"sag", "saturation"}, "whose intervals do not cover"
    assert names <= SCENARIOS.keys()


SWITCHES = np.cumsum([0.0, 2.0, 2.5, 2.5, 3.0, 2.0, 1.5, 4.0])
PULSES = np.array([0.0, 0.55, 0.0, -0.35, 0.45, -0.65, 0.25, 0.0])
"""Commands that no fit has seen, each held for about a time constant."""


@pytest.mark.long
def test_pulses_that_were_not_fitted_are_predicted(tmp_path: Path) -> None:
    """The prediction uses the identified vehicle and dead time; the independent integrator simulates both."""
    scenario, time = COMPLETE["delay and lag"], np.arange(0.0, 22.0, 0.05)
    scenario.write(0, tmp_path)
    result = identify(load_tests(tmp_path))
    delay = sum(effect.value for effect in result.effects if effect.kind == "dead time")
    for axis in scenario.recorded:
        signs = driven(scenario.truth, axis)
        pulses = Commands(SWITCHES, {name: sign * PULSES for name, sign in signs.items()})
        true = pool.motion(scenario.truth, pulses, time, scenario.conditions)[axis.velocity]
        modelled = pool.motion(result.vehicle, pulses, time, Conditions(delay=delay))[axis.velocity]
        error = np.linalg.norm(true - modelled) / np.linalg.norm(true - true.mean())
        assert error < 0.1, axis.name


# ---- What is read from a result --------------------------------------------------------------------------------------


def test_what_is_judged_is_read_from_the_result() -> None:
    """A lag that is told, a load without evidence, a force in heave, and yaw that must not be used."""
    result = without_findings()
    truths = {("surge", "a_d_u"): 8.0, ("heave", "b_d_w"): 2.0, ("", "T_top"): 0.3, ("", "b_t_top"): 0.0}
    truths |= {("surge", "V_ss 30 %"): 0.3, ("surge", "V_ss -70 %"): -0.7}
    one = replace(result.axes[0].predictions[0], measured=np.array([0.0, 1.0, np.nan, 5.0]))
    one = replace(one, predicted=np.zeros(4), deviation=np.ones(4))
    found = read_result(result, truths, [one], 2.0)
    covered = {estimate.quantity: estimate.covered for estimate in found.estimates}
    assert covered == {"a_d_u": False, "b_d_w": True, "T_top": False, "b_t_top": False, "V_ss 30 %": True}
    assert found.effects == (("lag", "top", 0.12), ("current", "log_1.csv", 0.1))
    assert found.false_effects(["lag", "current of heave"]) == ("current of log_1.csv",)
    assert found.disturbances == (("heave", ""),)
    assert (found.alarms, found.unusable) == (("heave", "yaw"), ("yaw",))
    (band,) = found.bands
    assert (band.coverage, band.error, band.claimed) == pytest.approx((2.0 / 3.0, 26.0 / 3.0, 1.0))


# ---- Tank tests and dives --------------------------------------------------------------------------------------------


def test_a_log_has_what_the_vehicle_did(tmp_path: Path) -> None:
    scenario = replace(COMPLETE["pilot"], logs=Logs("pilot", count=1, seconds=20.0, between_rows=True, rate=5.0))
    (flight,) = flights(scenario, np.random.default_rng(0))
    scenario.write(0, tmp_path)
    log = np.genfromtxt(tmp_path / flight.file, delimiter=",", names=True, deletechars="")
    assert log["time_[s]"] == pytest.approx(flight.time)
    assert log["u_l_[%]"] == pytest.approx(100.0 * flight.commands.at(flight.time)["l"], abs=1e-5)
    assert np.any(flight.commands.switches * 5.0 % 1.0 > 0.1)
    motion = moved(scenario.truth, flight.commands, flight.time, flight.conditions)
    columns = ("surge_velocity_[m/s]", "depth_[m]", "heading_[deg]")
    for sensor, column in zip(scenario.sensors, columns, strict=True):
        values = np.radians(log[column]) if sensor is HEADING else log[column]
        errors = values - true_values(sensor, motion)
        assert 0.7 * sensor.noise < np.std(errors) < 1.3 * sensor.noise
