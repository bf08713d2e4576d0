"""How fast, how soon and how far: the uncertainty of the answers."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify.assess import answers, differs
from rov_fmu.identify.assess import tested_commands as of_tests
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.kinds import LAG, LEAST_LAG
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.result import Tested
from rov_fmu.tank.arrays import Array
from tests.folders import HEAD, MASS, TURNS, folder_of, responses
from tests.identify.conftest import FORCES
from tests.vehicles import VIDEORAY, extended

FULL = (1.0, 1.0)
"""Tests of all commands."""


def of_drag(deviation: float) -> Posterior:
    """Return the posterior of the drag in surge."""
    drag = Parameter("quadratic drag", "surge", is_log=True, sets=("a_d_u",))
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, (drag,))
    return Posterior(table, np.log([VIDEORAY["a_d_u"]]), np.array([[deviation**2]]))


def test_the_way_to_stop_is_without_the_loss_of_thrust_and_answers_beyond_the_tests_are_wider() -> None:
    losing, exact = extended(VIDEORAY, d_rear=3.0), of_drag(0.0)
    table = replace(exact.table, layout=losing.layout, base=losing.coefficients)
    half, full = (
        next(a for a in answers([replace(exact, table=table)], SURGE, losing, (0.5, 0.5), least=0.03) if a.command == c)
        for c in (0.5, 1.0)
    )
    V, _ = losing.response(SURGE, 0.5)
    assert VIDEORAY.response(SURGE, 0.5)[0] > V
    coasting = VIDEORAY.alone(SURGE, VIDEORAY.layout.usual_inputs)
    assert half.stop[0] == pytest.approx(coasting.stopping_distance(V, 0.1))
    beyond = t.ppf(0.975, 10) * 0.1 * np.log(2.0)
    for at, own in ((half, 0.0), (full, beyond)):
        for (value, (_, high)), by_drag in zip((at.steady, at.rise, at.stop), (0.03, 0.03, 0.06), strict=True):
            assert np.log(high / value) == pytest.approx(max(own, by_drag)), "it may have rocked unseen"


def test_a_command_is_tested_by_the_motion_along_its_axis_that_it_holds(fit: Fit) -> None:
    """Logs of heave and yaw held 30 % ahead for 8 s and 20 % astern for 6 s; the thrust tables went to 80 %."""
    found, z = of_tests(fit.objective, fit.best.z), fit.best.z
    assert {*found} == {*fit.known.layout.bare_axes}
    for axis in (HEAVE, YAW):
        astern, ahead = found[axis]
        assert 0.12 < astern <= 0.2, "it was still gaining speed"
        assert 0.24 < ahead <= 0.3

    def commanded(change: Callable[[Array], Array]) -> dict[Axis, Tested]:
        fine = [one.refined(0.1) for one in fit.objective.logs]
        logs = [one.with_inputs(change(one.record.inputs.copy())) for one in fine]
        return of_tests(Objective(fit.objective.table, logs, fit.objective.rows), z)

    def with_a_peak(inputs: Array) -> Array:
        inputs[5] = 1.0
        return inputs

    peaked, weaker = commanded(with_a_peak), commanded(lambda inputs: 0.5 * inputs)
    for axis in (HEAVE, YAW):
        assert peaked[axis][1] == pytest.approx(found[axis][1], abs=0.03), "the vehicle hardly moved in 0.1 s"
        assert weaker[axis][0] <= 0.1
        assert weaker[axis][1] == pytest.approx(0.15), "of what moved the vehicle faster, no command tells"


def test_a_steady_table_tests_its_commands_and_thrust_tables_test_none(tmp_path: Path) -> None:
    tables = responses(VIDEORAY, HEAVE)
    tests = load_tests(folder_of(tmp_path, f"{HEAD}[known]\n{MASS}{TURNS}", {**FORCES, **tables}))
    known, logs, rows = begin(tests)
    objective = Objective.of_known(known, logs, rows)
    assert of_tests(objective, objective.mean)[HEAVE] == (0.7, 0.8)


def test_two_vehicles_differ_only_along_the_axes_whose_answers_differ(fit: Fit) -> None:
    table = fit.objective.table
    other = fit.best.z.copy()
    for n, p in enumerate(table.parameters):
        other[n] += p.of == "heave" and p.kind in ("quadratic drag", "linear drag")
    ends = (table, fit.best.z), (table, other)
    assert [differs(ends, axis, (0.5, 0.5)) for axis in (HEAVE, YAW)] == [True, False]
    # The parameters of another fit may be others, in another order.
    turned = replace(table, parameters=table.parameters[::-1])
    assert not any(differs((ends[0], (turned, fit.best.z[::-1])), axis, (0.5, 0.5)) for axis in (HEAVE, YAW))


def test_the_time_with_the_lag_contains_that_with_both_ends_of_the_lag(fit: Fit) -> None:
    """Also where the lag ends at its bound, below which nothing changes, so that no derivative shows it."""
    index = fit.objective.table.index(LAG)
    assert index is not None
    z = fit.best.z.copy()
    z[index] = LEAST_LAG
    lag = np.arange(len(z)) == index
    posterior = Posterior(fit.objective.table, z, np.diag(np.where(lag, 0.05**2, 1e-10)))
    vehicle, _ = fit.objective.table.model(z)
    slower = vehicle.with_(**{c.coefficient("T"): float(posterior.ends(index)[2]) for c in vehicle.layout.curves})
    (answer,) = answers((posterior,), HEAVE, vehicle, (0.5, 0.5), (0.3,))
    (late,) = answers(
        (replace(posterior, z=np.where(lag, posterior.ends(index)[2], z)),), HEAVE, slower, (0.5, 0.5), (0.3,)
    )
    assert answer.lagged
    assert late.lagged
    assert answer.lagged[1][0] <= answer.lagged[0] < late.lagged[0] <= 1.02 * answer.lagged[1][1]
    assert answer.rise[1][1] < 1.01 * answer.rise[0], "the time without the lag is known"
