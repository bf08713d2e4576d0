"""Slow forces, changes of thrust and velocities over ground: their size, their evidence, and what they follow."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.filter import FilterRun
from rov_fmu.identify.likelihood.fit import fit_all
from rov_fmu.identify.likelihood.kinds import SLOW
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import table_of
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.solve import Minimum, best_explanations, total_information
from rov_fmu.identify.result import KEPT
from rov_fmu.identify.unexplained.disturbances import disturbances, followed
from rov_fmu.tank.arrays import Array
from tests.folders import HEAD, folder_of
from tests.identify.conftest import FORCES, KNOWN, TRUTH
from tests.recordings import PLANS, run, write_log
from tests.vehicles import VIDEORAY

TIME: Array = np.arange(0.0, 100.0, 0.25)
COMMAND = np.where(TIME % 10.0 < 5.0, 0.5, -0.3)
VOLTAGE, DEPTH, ROLL = 16.0 - 0.003 * TIME - 0.1 * (TIME > 40.0), 3.0 + np.sin(0.2 * TIME), 0.2 * np.sin(0.33 * TIME)
NORTH, EAST, HEADING = 5.0 * np.sin(0.05 * TIME), 4.0 * np.cos(0.09 * TIME), 0.4 * np.sin(0.13 * TIME)


@pytest.fixture(scope="module")
def objective(tmp_path_factory: pytest.TempPathFactory) -> Objective:
    """Return J for a dive in which nothing but the channels matters."""
    columns = {
        **dict.fromkeys(("u_l [1]", "u_r [1]"), COMMAND),
        **{"u_t [1]": 0.3 * COMMAND, "voltage [V]": VOLTAGE, "depth [m]": DEPTH, "roll [rad]": ROLL},
        **{"surge velocity [m/s]": 0.5 * np.gradient(NORTH), "heading [rad]": HEADING},
    }
    path = folder_of(tmp_path_factory.mktemp("tests"), f'base = "videoray"\n{HEAD}', {})
    table, header = np.column_stack([TIME, *columns.values()]), ",".join(["time [s]", *columns])
    np.savetxt(path / "dive.csv", table, "%.9g", ",", header=header, comments="")
    known, logs, rows = begin(load_tests(path))
    return Objective(table_of(known, logs, []), logs, rows)


def run_with(objective: Objective, values: Mapping[int, Array], deviation: float = 0.5) -> FilterRun:
    """Return a run through the dive whose states are next to nothing, but for some."""
    time = objective.records[0].time
    states = np.full((len(time), objective.filters[0].states), 1e-9)
    for index, some in values.items():
        states[:, index] = np.interp(time, TIME, some)
    return replace(objective.runs(objective.mean)[0], states=states, deviations=np.full_like(states, deviation))


def centred(values: Array) -> Array:
    return np.asarray((values - values.mean()) / values.std())


CAUSES = {
    "the voltage": COMMAND * (VOLTAGE - VOLTAGE.mean()),
    "the depth": DEPTH,
    "the distance": NORTH * np.cos(HEADING) + (EAST - EAST[0]) * np.sin(HEADING),
    "the command": COMMAND,
    "the time": TIME,
    "the roll": ROLL,
}
OTHER = 0.03 * np.random.default_rng(0).standard_normal(len(TIME))
"""What nothing explains."""


@pytest.mark.parametrize(
    ("evidence", "names"),
    [
        ({"a": 5.9}, ""),
        ({"a": 6.1}, "a"),
        ({"a": 6.1, "b": -3.0}, ""),
        ({"a": 9.0, "b": 2.9}, "a"),
        ({"a": 20.0, "b": 25.0, "c": 5.0}, "ba"),
        ({"a": 12.0, "b": 2.0, "c": 5.0}, "a"),
    ],
)
def test_an_explanation_is_much_better_than_none_and_others_are_nearly_as_good(
    evidence: Mapping[str, float], names: str
) -> None:
    """Something else is as probable before as all that is on the list, however long the list is."""
    assert "".join(best_explanations(evidence)) == names


def test_every_slow_process_has_states_of_its_own(objective: Objective) -> None:
    """The dive has three axes; a process along another one has no state, and does not get those of a neighbour."""
    own, slow = objective.filters[0], [p for p in objective.table.parameters if p.of_kind.slow]
    indices = [index for p in slow for index in own.indices_of(SLOW[p.kind].acts_as, p.of)]
    assert {p.kind for p in slow} == {*SLOW}
    assert len({*indices}) == len(indices) == 3 + 1 + 3
    assert not own.indices_of("force", "sway")


@pytest.mark.weekly
def test_a_disturbance_has_its_size_and_its_evidence(objective: Objective, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has them relative to the thrust along its axis, or to the speed; sizes are twice their deviations or more.

    Two steps show that the other parameters are fitted again.
    """
    monkeypatch.setattr("rov_fmu.identify.unexplained.disturbances._STEPS", 2)
    z, filter_of = objective.mean, objective.filters[0]
    since: Array = np.where(TIME >= 30.0, 1.0, 0.0)
    slow = {
        filter_of.force: 2.0 * since,
        filter_of.gain: 1.1 * since,
        filter_of.drift: 0.7 + 0.0 * TIME,
    }
    speeds = {0: 0.8 + 0.0 * TIME, 1: 0.3 + 0.0 * TIME, 2: 2.0 + 0.0 * TIME}  # of surge, heave and yaw
    moving = {filter_of.drift + 1: 1.2 * since, **speeds}
    run, runs = run_with(objective, {**slow, **moving}), objective.runs(z)
    data = objective.data(z, runs, exact=False)
    best = Minimum(z, objective.value(z, runs), runs, data, total_information(objective, z, data)[1])
    posterior = Posterior.of(objective.table, z, best.information)
    found = {
        (str(one.kind), one.axis): one
        for one in disturbances(objective, best, posterior, [run], VIDEORAY.layout.bare_axes)
    }
    thrust = np.array([VIDEORAY.force(SURGE, c) for c in COMMAND])
    share = np.mean(since)
    sizes = {
        ("slow force", SURGE): (2.0 * share**0.5, np.sqrt(np.mean(thrust**2)), "N"),
        ("slow gain", None): (np.expm1(1.1) * share**0.5, 1.0, "1"),
        ("slow velocity", None): ((0.49 + 1.44 * share) ** 0.5, 0.8, "m/s"),
        ("slow velocity", HEAVE): (0.0, 0.05, "m/s"),
        ("slow force", YAW): (0.0, 0.05 * VIDEORAY.force(YAW, 1.0), "N.m"),
    }
    fell = dict[tuple[str, Axis | None], float]()
    for key, (size, usual, unit) in sizes.items():
        process = found[key]
        assert (process.value, process.share) == pytest.approx((size, size / usual), rel=0.02, abs=1e-6), key
        assert process.unit == unit
        index = objective.table.index(process.kind, process.of)
        assert index is not None
        gone = np.where(np.arange(len(z)) == index, objective.low, z)
        explained = [
            objective.value(other, objective.runs(other, runs)) - objective.prior(other) for other in (gone, z)
        ]
        before = explained[0] - explained[1] + 2.0 * np.log(posterior.errors[index] / objective.deviation[index])
        assert process.evidence <= before + 1e-8 * abs(before), (
            "the fit chooses steps of its own, which round otherwise"
        )
        fell[key] = before - process.evidence
        if before <= KEPT:
            assert process.evidence == pytest.approx(before), key
    assert fell["slow gain", None] > 1.0, "the other parameters are fitted again"


@pytest.mark.weekly
def test_a_slow_force_that_the_other_parameters_explain_as_well_is_none(tmp_path: Path) -> None:
    """Of a depth that drifts. Without a slow force, J rises by 68, but by 16 if the others are fitted again."""
    path = folder_of(tmp_path, KNOWN, FORCES)
    recording = run(TRUTH, HEAVE, PLANS["heave"][0][:4], 10.0).noisy(np.random.default_rng(0), noise=0.01)
    drift = 0.1 * np.sin(2.0 * np.pi * recording.time / 60.0)
    write_log(path, "a", replace(recording, values=recording.values + drift))
    fit = fit_all(*begin(load_tests(path)))
    runs = followed(fit.objective, fit.best.z)
    found = disturbances(fit.objective, fit.best, fit.posterior, runs, [HEAVE])
    assert not [one for one in found if one.kept]
