"""Identification in every scenario: what it is held to, and that the scenarios are what they say."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, radians
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, Axis
from rov_fmu.identify import beginning
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import (
    Answer,
    AxisResult,
    Coefficient,
    Disturbance,
    Effect,
    Identification,
    Prediction,
    Verdict,
)
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.identify.scenarios import outcome as of_outcome
from tests.identify.scenarios.catalogue import COMPLETE, HEADING, INCOMPLETE, OWNERS, SCENARIOS
from tests.identify.scenarios.judge import broken, promises
from tests.identify.scenarios.outcome import Estimate, outcome, read_gate, read_result, rows
from tests.identify.scenarios.owners import Kind, Owner, Plan, fly
from tests.identify.scenarios.tank import Logs, Tank, flights, moved, true_values
from verification.references import pool
from verification.references.pool import NOTHING, Array, Commands, Conditions, Tilt

BY_DEFAULT = {"load of 0.1 N in heave": 1}
"""The quick scenarios of the default tests, and the number of their seeds."""
OFTEN = ("clean", "delay and lag", "gaps while turning", "pilot", "tether", "tilt with roll and pitch")
"""The scenarios that the long tests run with 10 seeds. All of them are run with more seeds once a week."""
WEEKLY = {
    **dict.fromkeys(SCENARIOS, 200),
    **dict.fromkeys(OWNERS, 20),
    "heavy": 20,
    "heavy in a current": 20,
    "owner": 40,
}
FAMILY = sum(3 * len(scenario.truths(0)) + 12 for scenario in SCENARIOS.values())
"""At least the number of promises of all scenarios."""

assert SCENARIOS.keys() >= {*BY_DEFAULT, *OFTEN}


def judged() -> Iterator[object]:
    """Yield each scenario with each number of seeds."""
    for name in SCENARIOS:
        yield pytest.param(name, WEEKLY[name], marks=pytest.mark.weekly, id=f"{name}-{WEEKLY[name]}")
        if name in OFTEN:
            yield pytest.param(name, 10, marks=pytest.mark.long, id=f"{name}-10")
        if name in BY_DEFAULT:
            yield pytest.param(name, BY_DEFAULT[name], id=f"{name}-{BY_DEFAULT[name]}")


@pytest.mark.parametrize(("name", "seeds"), [*judged()])
def test_a_scenario_is_identified(name: str, seeds: int, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    outcomes = [outcome(scenario, seed, tmp_path / str(seed)) for seed in range(seeds)]
    assert not broken(promises(name, outcomes, scenario.expected, read_gate()), FAMILY)


def test_the_gate_knows_the_scenarios_of_the_vehicles_that_ship() -> None:
    names = {name for name, *_ in read_gate()}
    assert COMPLETE.keys() | INCOMPLETE.keys() <= names <= SCENARIOS.keys()


PULSES = Commands(
    np.cumsum([0.0, 2.0, 2.5, 2.5, 3.0, 2.0, 1.5, 4.0]), {"": np.array([0.0, 0.55, 0.0, -0.35, 0.45, -0.65, 0.25, 0.0])}
)
"""Commands that no fit has seen, each held for about a time constant."""


@pytest.mark.long
def test_pulses_that_were_not_fitted_are_predicted(tmp_path: Path) -> None:
    """The prediction uses the identified vehicle and dead time; the independent integrator simulates both."""
    scenario, time = COMPLETE["delay and lag"], np.arange(0.0, 22.0, 0.05)
    scenario.write(0, tmp_path)
    result = identify(load_tests(tmp_path))
    delay = sum(effect.value for effect in result.effects if effect.kind == "dead time")
    for axis, thrusters in {"surge": {"l": 1.0, "r": 1.0}, "heave": {"t": 1.0}, "yaw": {"l": 1.0, "r": -1.0}}.items():
        pulses = Commands(PULSES.switches, {name: sign * PULSES.thrusters[""] for name, sign in thrusters.items()})
        velocity = {"surge": "u", "heave": "w", "yaw": "r"}[axis]
        true = pool.motion(scenario.truth, pulses, time, scenario.conditions)[velocity]
        modelled = pool.motion(result.vehicle, pulses, time, Conditions(delay=delay))[velocity]
        error = np.linalg.norm(true - modelled) / np.linalg.norm(true - true.mean())
        assert error < 0.1, axis


# ---- What is read from a result --------------------------------------------------------------------------------------


def test_what_is_judged_is_read_from_the_result() -> None:
    time = np.arange(4.0)
    measured = np.array([0.0, 1.0, np.nan, 5.0])
    depth = replace(
        prediction("b.csv", is_position=True, span=10.0),
        measured=measured,
        predicted=0.0 * time,
        deviation=time * 0.0 + 1.0,
    )
    number = 1.0, (0.9, 1.1)
    heave = AxisResult(
        HEAVE,
        Verdict("do not use", ()),
        (Answer(HEAVE, 0.3, (0.2, (0.1, 0.3)), number, number),),
        (Coefficient("a_d_w", 41.0, (40.0, 42.0), "1", "", 0.2), Coefficient("b_d_w", 1.0, None, "1", "", 1.0)),
        (depth,),
        (),
        None,
    )

    def force(axis: Axis | None, cause: str, evidence: float) -> Disturbance:
        return Disturbance("force", axis, "a.csv", 1.0, "N", 0.1, None, evidence, cause)

    def effect(kind: str, of: str, evidence: float) -> Effect:
        return Effect(kind, of, "", 0.1, (0.0, 0.2), "1", evidence)

    nothing = cast("Any", None)  # of the rest nothing is read
    result = Identification(
        nothing, {}, nothing, None, (heave,), {"top": (Coefficient("T_top", 0.1, (0.0, 0.2), "s", "", 0.1),)}, (),
        (effect("lag", "", 9.0), effect("current", "a.csv", 9.0), effect("load", "heave", 3.0)),
        (force(HEAVE, "the voltage", 9.0), force(None, "", 9.0), force(HEAVE, "the time", 3.0)),
        (), (), nothing, 0.0, 0.0,
    )  # fmt: skip
    truths = {("heave", "a_d_w"): 43.0, ("heave", "b_d_w"): 1.0, ("", "T_top"): 0.3}
    truths |= {("heave", "V_ss 30 %"): 0.25, ("heave", "V_ss 50 %"): 0.5, ("heave", "V_ss -30 %"): -0.25}
    found = read_result(result, truths, heave.predictions, 2.0)
    assert found.estimates[0] == Estimate("heave", "a_d_w", 41.0, (40.0, 42.0), 43.0, 0.2)
    covered = {estimate.quantity: estimate.covered for estimate in found.estimates}
    assert covered == {"a_d_w": False, "b_d_w": False, "T_top": False, "V_ss 30 %": True, "V_ss 50 %": False}
    assert found.effects == (("lag", "", 0.1), ("current", "a.csv", 0.1))
    assert found.false_effects(["lag", "current of heave"]) == ("current of a.csv",)
    assert found.disturbances == (("heave", "the voltage"), ("thrust", ""))
    assert found.alarms == ("heave", "thrust")
    assert found.unusable == ("heave",)
    (band,) = found.bands
    assert (band.coverage, band.error, band.claimed) == pytest.approx((2.0 / 3.0, 26.0 / 3.0, 1.0))
    *numbers, whole = rows("a", 7, found, ["lag"])
    assert [row["quantity"] for row in numbers] == [*covered]
    assert numbers[0] == {
        "scenario": "a", "seed": "7", "axis": "heave", "quantity": "a_d_w", "covered": "0", "error": "-0.04651",
        "width": "2",
    }  # fmt: skip
    assert (whole["alarms"], whole["false_effects"], whole["cpu"]) == ("2", "current of a.csv", "2.0")
    assert whole["causes"] == "heave: the voltage; thrust: unknown"


def prediction(file: str, *, is_position: bool, span: float) -> Prediction:
    """Return a prediction whose only error is 2 m, with a band of ± 1.96 m."""
    time = np.zeros(1)
    return Prediction(
        HEAVE, file, "depth", "m", is_position, span, "", time, time + 2.0, time, time + 1.0, 9.0, 0.1, 2.0, 0.0
    )


def test_logs_that_are_held_out_by_hand_are_predicted_and_not_fitted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of them, a velocity is judged over the whole recording, and a position over 10 s."""
    read: list[list[str]] = []
    judged = (
        prediction("dive_3.csv", is_position=True, span=10.0),
        prediction("dive_3.csv", is_position=False, span=inf),
    )
    others = prediction("dive_3.csv", is_position=True, span=inf), prediction("dive_1.csv", is_position=False, span=inf)

    def fake(tests: beginning.Tests) -> Identification:
        read.append([log.file for log in tests.folder.logs])
        axis = AxisResult(HEAVE, Verdict("good", ()), (), (), (*others, *judged), (), None)
        nothing = cast("Any", None)
        return Identification(
            tests.folder, {}, nothing, None, (axis,), {}, (), (), (), (), (), nothing, float(len(read)), 0.0
        )

    monkeypatch.setattr(of_outcome, "identify", fake)
    found = outcome(OWNERS["owner"], 0, tmp_path / "0")
    assert read == [["dive_1.csv", "dive_2.csv"], ["dive_1.csv", "dive_2.csv", "dive_3.csv"]]
    assert [(band.coverage, band.error) for band in found.bands] == [(0.0, 4.0)] * 2
    monkeypatch.setattr(of_outcome, "identify", lambda _: 1 / 0)
    assert outcome(COMPLETE["load of 0.1 N in heave"], 0, tmp_path / "1").error.startswith("ZeroDivisionError")


# ---- Tank tests and dives --------------------------------------------------------------------------------------------


def logged(scenario: Tank, folder: Path) -> dict[str, dict[str, Array]]:
    """Return the columns of the logs of seed 0, by file."""
    scenario.write(0, folder)
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


# ---- Owners' vehicles ------------------------------------------------------------------------------------------------


CONDITIONS = {
    "nothing": NOTHING,
    "saturation": Conditions(saturation=0.2),
    "sag": Conditions(thrust=lambda time: 1.0 - 0.05 * time),
    "tether": Conditions(tether=(3.0, 3.0, 0.0)),
    "tilt": Conditions(tilt=Tilt(radians(20.0))),
}


@pytest.mark.parametrize("conditions", CONDITIONS.values(), ids=CONDITIONS)
def test_an_owners_vehicle_moves_as_in_the_pool(conditions: Conditions, tmp_path: Path) -> None:
    """The other integrator has a curve of straight lines, which agree at the only command."""
    scenario, level = Owner(), 0.3
    scenario.write(0, tmp_path)
    kind = scenario.kind
    plan: Plan = [(2.0, {"surge": level}), (2.0, {"yaw": level}), (2.0, {"sway": -level}), (3.0, {"heave": level})]
    time, commands, states = fly(kind, plan, conditions)
    switches = np.array([0.0, 2.0, 4.0, 6.0])
    thrusters = {str(n): column[np.searchsorted(time, switches + 0.01)] for n, column in enumerate(commands.T, 1)}
    motion = pool.motion(
        in_pool(kind, tmp_path, min(level, conditions.saturation)), Commands(switches, thrusters), time, conditions
    )
    for n, name in enumerate("uvwr"):
        assert states[:, n] == pytest.approx(motion[name], abs=1e-5), name
    assert states[:, 6] == pytest.approx(motion["z"], abs=1e-5)
    assert states[:, 7] - radians(37.0) == pytest.approx(motion["psi"], abs=1e-5)
    assert np.abs(states[:, :4]).max() > 0.3


def in_pool(kind: Kind, folder: Path, command: float) -> Vehicle:
    """Return the vehicle with curves that agree at a command and its opposite."""
    (curve,) = kind.curves.values()
    values = {"a_t_t200": 0.0, "a_t_t200_reverse": 0.0, "c_0_t200": 0.0, "T_t200": curve.lag, "F_0_w": kind.load}
    values |= {"b_t_t200": curve.force(command) / command, "b_t_t200_reverse": curve.force(-command) / -command}
    values |= {"m_rov": kind.mass, "I_r": kind.turning}
    for key, numbers in (("m_a", kind.added), ("a_d", kind.quadratic), ("b_d", kind.linear)):
        values |= {f"{key}_{name}": number for name, number in zip("uvwr", numbers, strict=True)}
    return load_vehicle(folder / "similar.toml").replaced(values)
