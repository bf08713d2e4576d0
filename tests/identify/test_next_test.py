"""The proposed test: it stays within the limits of the tank, and narrows the interval as it says."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, YAW, Axis
from rov_fmu.identify.beginning import begin
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior
from rov_fmu.identify.likelihood.solve import total_information
from rov_fmu.identify.next_test import next_test
from rov_fmu.identify.result import Answer, NextTest
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import TankLimits
from tests.identify.conftest import SHORT, TRUTH, with_logs
from tests.recordings import run

REST = 4.0
"""The rest between both commands of a proposed test, s."""


def proposed(fit: Fit, axis: Axis = HEAVE, **limits: float) -> NextTest | None:
    return next_test(fit.objective, replace(fit.posterior, z=fit.file.posterior.z), axis, TankLimits(**limits), ())


def plan(test: NextTest) -> tuple[tuple[float, float], ...]:
    """Return the commands and the durations (s) of a test, from its words."""
    form = r"hold (\d+)% of \w+ for (\d+) s, rest, then -(\d+)% for (\d+) s"
    found = re.fullmatch(form, test.words)
    assert found, test.words
    ahead, first, astern, second = map(float, found.groups())
    return ((0.01 * ahead, first), (0.0, REST), (-0.01 * astern, second))


def test_the_vehicle_stays_in_the_tank(fit: Fit) -> None:
    """The integrator of the tests flies the proposed test, and a minute of coasting after it."""
    free, within = proposed(fit), proposed(fit, tank_length=1.0)
    assert free
    assert within
    covered = [float(np.ptp(run(TRUTH, HEAVE, [*plan(t), (0.0, 60.0)], 10.0).position)) for t in (free, within)]
    assert covered[1] <= 1.0 < covered[0]
    brief = proposed(fit, duration=12.0)
    assert brief
    assert [plan(test)[0][1] for test in (free, brief)] == [8.0, 4.0], "a third of the duration, and at most 8 s"
    turn = proposed(fit, YAW, tank_length=0.1)
    assert turn
    assert (turn.axis, turn.then < turn.now) == (YAW, True), "a turn needs no length"


def test_no_command_is_above_the_strongest(fit: Fit) -> None:
    test, best = proposed(fit, command_max=0.25), proposed(fit)
    assert test
    assert best
    assert max(abs(command) for command, _ in plan(test)) <= 0.25
    assert best.then < test.then, "the best one is proposed"
    assert proposed(fit, command_max=0.1) is None


def test_a_command_is_held_for_2_s_or_not_at_all(fit: Fit) -> None:
    test = proposed(fit, duration=6.0)
    assert test
    assert plan(test)[0][1] == 2.0
    assert proposed(fit, duration=5.9) is None


def test_the_interval_after_the_test_is_that_of_data_with_it(fit: Fit, tmp_path: Path) -> None:
    """A log of the proposed test joins the others, and the interval becomes as narrow as was said."""
    test = proposed(fit)
    assert test
    assert test.is_useful
    more = ((0.0, 2.0), *plan(test), (0.0, 2.0))
    known, logs, rows = begin(with_logs(tmp_path, (HEAVE, "a", SHORT), (YAW, "a", SHORT), (HEAVE, "b", more)))
    objective = Objective.of_known(known, logs, rows)
    indices = [fit.posterior.table.index(p.kind, p.of, p.part) for p in objective.table.parameters]
    z = np.array(
        [usual if n is None else fit.file.posterior.z[n] for n, usual in zip(indices, objective.mean, strict=True)]
    )
    _, information = total_information(objective, z, objective.data(z, objective.runs(z)))
    after = Posterior.of(objective.table, z, information)
    command = float(test.target.split()[-1].rstrip("%")) / 100.0

    def logarithm(z: Array) -> Array:
        vehicle, shapes = after.table.model(z)
        return np.log(np.abs(shapes.motions(vehicle, HEAVE, np.array([command])).response()[0]))

    (slope,) = after.slopes(logarithm)
    now = QUANTILE * float(np.sqrt(slope @ after.covariance @ slope))
    assert 0.6 * test.then < now < 1.6 * test.then, "this log has an offset and a window of its own"
    assert now < 0.8 * test.now


def test_what_is_shown_too_wide_for_another_reason_stays_so(fit: Fit) -> None:
    """An interval whose larger half is 30 %, of which the posterior explains less, has a part that no test narrows."""
    test, (low, high) = proposed(fit), (-0.26, -0.15)
    answer = Answer(HEAVE, -0.5, (-0.2, (low, high)), (1.0, (1.0, 1.0)), (1.0, (1.0, 1.0)))
    posterior = replace(fit.posterior, z=fit.file.posterior.z)
    wider = next_test(fit.objective, posterior, HEAVE, TankLimits(), [answer])
    assert test
    assert wider
    assert test.target == wider.target == "the speed at -50%"
    assert wider.now == pytest.approx(0.3)
    assert wider.then == pytest.approx(np.sqrt(test.then**2 + 0.3**2 - test.now**2))


def test_a_stronger_command_removes_what_is_allowed_beyond_the_tests(fit: Fit) -> None:
    """Dives up to 25 % leave the speed at 50 % uncertain by 0.1 ln 2, which a test of 60 % does not."""
    posterior = replace(fit.posterior, z=fit.file.posterior.z)
    test, allowed = proposed(fit), QUANTILE * 0.1 * np.log(2.0)
    assert test
    half = float(np.hypot(test.now, allowed))
    answer = Answer(
        HEAVE, -0.5, (-0.2, (-0.2 * (1.0 + half), -0.2 / (1.0 + half))), (1.0, (1.0, 1.0)), (1.0, (1.0, 1.0))
    )
    wider = next_test(fit.objective, posterior, HEAVE, TankLimits(), [answer], (0.25, 0.25))
    weaker = next_test(fit.objective, posterior, HEAVE, TankLimits(command_max=0.4), [answer], (0.25, 0.25))
    assert wider
    assert weaker
    assert wider.now == pytest.approx(half)
    assert max(abs(command) for command, _ in plan(wider)) >= 0.6
    assert wider.then == pytest.approx(test.then, rel=0.3)
    assert weaker.then > QUANTILE * 0.1 * np.log(0.5 / 0.4)
