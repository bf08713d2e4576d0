"""How fast, how soon and how far: the uncertainty of the answers."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.identify.assess import answers, answers_of_file, commands_of_answers
from rov_fmu.identify.assess import tested_commands as of_tests
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.result import Tested, half_width
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import REFIT
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


def test_answers_are_as_uncertain_as_the_drag_and_the_vehicle_file() -> None:
    """The file has other curves than the fit, and none is exact."""
    uncertain, file = of_drag(0.04), VIDEORAY.with_(b_d_u=1.1 * VIDEORAY["b_d_u"])
    axis = VIDEORAY.layout.by_name["surge"]

    def numbers(rov: Vehicle, command: float) -> np.ndarray:
        V, Tau = rov.response(SURGE, command)
        return np.array([abs(V), Tau, rov.alone(SURGE, rov.layout.usual_inputs).stopping_distance(abs(V), 0.1)])

    more, less = (VIDEORAY.with_(a_d_u=VIDEORAY["a_d_u"] * np.exp(s)) for s in (0.01, -0.01))
    found = answers([uncertain], SURGE, file, FULL)
    assert axis
    assert [one.command for one in found] == [0.3, -0.3, 0.5, -0.5, 1.0, -1.0]
    for answer in found:
        c = answer.command
        slopes = np.log(numbers(more, c) / numbers(less, c)) / 0.02
        half = t.ppf(0.975, 10) * 0.04 * np.abs(slopes)
        for (value, (low, high)), number, fitted, width in zip(
            (answer.steady, answer.rise, answer.stop), numbers(file, c), numbers(VIDEORAY, c), half, strict=True
        ):
            assert abs(value) == pytest.approx(number)
            assert low < value < high
            ends = np.minimum(fitted * np.exp(-width), number * 0.99), np.maximum(fitted * np.exp(width), number * 1.01)
            assert sorted(map(abs, (low, high))) == pytest.approx(ends, rel=1e-3)
    for answer in answers([of_drag(0.0)], SURGE, VIDEORAY, FULL):
        for value, (low, high) in (answer.steady, answer.rise):
            assert sorted((low / value, high / value)) == pytest.approx([np.exp(-0.01), np.exp(0.01)])


def test_the_time_with_the_lag_is_as_certain_as_the_tests_tell_it_and_not_its_parts() -> None:
    """The tests tell the sum of both times, not how it is shared: a longer lag goes with less inertia."""
    rov = extended(VIDEORAY, T_rear=0.2)
    lag, inertia = Parameter("lag", ""), Parameter("inertia", "surge", is_log=True)
    table = Table(rov.layout, rov.coefficients, {}, (lag, inertia))
    z = np.array([0.2, np.log(rov.effective_inertia(rov.layout.by_name["surge"]))])

    def half(posterior: Posterior) -> float:
        (lagged,) = (one.lagged for one in answers([posterior], SURGE, rov, FULL) if one.command == 0.5)
        assert lagged
        assert lagged[1][0] < lagged[0] < lagged[1][1]
        return half_width(lagged)

    alone, opposed, equal = (
        half(Posterior(table, z, np.array([[0.03**2, r * 0.03 * 0.1], [r * 0.03 * 0.1, 0.1**2]])))
        for r in (0.0, -0.9, 0.9)
    )
    assert opposed < alone < equal
    assert alone**2 == pytest.approx(0.5 * (opposed**2 + equal**2), rel=0.05), "as variances add"
    assert not any(one.lagged for one in answers([of_drag(0.04)], SURGE, VIDEORAY, FULL)), "it has no lag"


def test_the_way_to_stop_is_without_the_loss_of_thrust_and_answers_beyond_the_tests_are_wider() -> None:
    losing, exact = extended(VIDEORAY, d_rear=3.0), of_drag(0.0)
    table = replace(exact.table, layout=losing.layout, base=losing.coefficients)
    half, full = (
        next(a for a in answers([replace(exact, table=table)], SURGE, losing, (0.5, 0.5)) if a.command == command)
        for command in (0.5, 1.0)
    )
    V, _ = losing.response(SURGE, 0.5)
    assert VIDEORAY.response(SURGE, 0.5)[0] > V
    coasting = VIDEORAY.alone(SURGE, VIDEORAY.layout.usual_inputs)
    assert half.stop[0] == pytest.approx(coasting.stopping_distance(V, 0.1))
    assert half.steady[1][1] / half.steady[0] == pytest.approx(np.exp(0.01))
    for value, (_, high) in (full.steady, full.rise, full.stop):
        assert np.log(high / value) == pytest.approx(t.ppf(0.975, 10) * 0.15 * np.log(2.0))
    assert answers_of_file(losing, SURGE)[2].stop[0] == pytest.approx(half.stop[0])


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_intervals_contain_what_a_part_of_the_data_says_where_it_differs_by_more_than_chance(share: float) -> None:
    """The difference of an efficient fit and of one to a part of its data has the difference of their variances."""
    part, difference = of_drag(0.05), share * t.ppf(0.975, 10) * 0.04
    other = replace(part, z=part.z + difference)
    V, Tau = VIDEORAY.with_(a_d_u=VIDEORAY["a_d_u"] * np.exp(difference)).response(SURGE, 0.5)
    alone, both = (answers([of_drag(0.03)], SURGE, VIDEORAY, FULL, fits=fits)[2] for fits in ((), [other]))
    if share < 1.0:
        assert (both.steady, both.rise, both.stop) == (alone.steady, alone.rise, alone.stop)
    else:
        assert (both.steady[1][0], both.rise[1][0]) == pytest.approx((V, Tau))
        assert (V, Tau) < (alone.steady[1][0], alone.rise[1][0])


def test_answers_of_a_file_have_the_intervals_of_its_estimates() -> None:
    """A file without estimates has no intervals: both ends are the value."""
    rov = load_vehicle(REFIT)
    names, rows = rov.uncertainty.names, np.random.default_rng(0).random((1000, len(rov.uncertainty.names)))
    drawn = [rov.with_(**dict(zip(names, row, strict=True))) for row in rov.uncertainty.drawn(rows).tolist()]
    for answer, exact in zip(answers_of_file(rov, HEAVE), answers_of_file(VIDEORAY, HEAVE), strict=True):
        numbers = np.array([k.response(HEAVE, answer.command) for k in drawn])
        for (value, interval), some, own in zip(
            (answer.steady, answer.rise), numbers.T, rov.response(HEAVE, answer.command), strict=True
        ):
            assert value == pytest.approx(own)
            assert interval == pytest.approx(np.quantile(some, (0.025, 0.975)), abs=0.3 * np.std(some))
        assert exact.steady == (exact.steady[0], (exact.steady[0], exact.steady[0]))


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


@pytest.mark.parametrize(
    ("tested", "more"),
    [((0.7, 0.57), [-0.7, 0.57]), ((0.0, 0.5), []), ((0.31, 0.97), []), ((0.04, 0.6), [0.6])],
)
def test_the_strongest_tested_commands_are_answered_unless_they_are_usual(tested: Tested, more: list[float]) -> None:
    assert commands_of_answers(tested) == [0.3, -0.3, 0.5, -0.5, 1.0, -1.0, *more]
