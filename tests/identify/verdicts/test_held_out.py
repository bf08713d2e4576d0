"""What is held out, by which data, and how uncertain its prediction is."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.held_out import Knowledge, ahead, held_out, predictions, unseen_variance
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import DataPart, Objective
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.search import structure, with_steps, worst
from rov_fmu.identify.likelihood.solve import minimise
from rov_fmu.identify.result import CONSTANTS, score_of
from tests.folders import DOWN, SPEED, folder_of, pulled
from tests.identify.conftest import SHORT, with_logs
from tests.vehicles import VIDEORAY


def test_the_current_of_an_unseen_log_is_about_that_of_the_others() -> None:
    """Its variance is at least that of 2 cm/s. It may exceed that of the prior."""
    currents = tuple(Parameter("current", file, deviation=0.1, log=n) for n, file in enumerate("abc"))
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, currents)
    covariance = np.diag([9.0, 0.01**2, 0.02**2])
    usual = 0.02**2 + (0.03**2 + 0.01**2 + 0.04**2 + 0.02**2) / 2.0
    assert unseen_variance(table, np.array([5.0, 0.03, -0.04]), covariance, currents[0]) == pytest.approx(usual)
    assert unseen_variance(table, np.array([5.0, 0.3, -0.4]), covariance, currents[0]) == pytest.approx(
        0.02**2 + (0.3**2 + 0.01**2 + 0.4**2 + 0.02**2) / 2.0
    )
    alone = replace(table, parameters=currents[:1])
    assert unseen_variance(alone, np.array([5.0]), covariance[:1, :1], currents[0]) == pytest.approx(0.02**2 + 0.1**2)


def test_an_axis_that_one_log_shows_is_predicted_by_halves_of_this_log(fit: Fit) -> None:
    """A log of heave and one of yaw: neither knows anything of the other's axis (e12 and e13 of the experience)."""
    objective, best = fit.objective, fit.best
    known = Knowledge(objective, best)
    for n, (axis, other) in enumerate(((HEAVE, YAW), (YAW, HEAVE))):
        alone = DataPart([n], objective.whole.rows)
        assert known.informs(axis, alone)
        assert not known.informs(other, alone)
    out = held_out(objective, best)
    assert {one.axes for one in out} == {(HEAVE,), (YAW,)}
    assert [(one.log, one.by) for one in out] == [
        (n, f"the {half} half and the other log") for n in (0, 1) for half in ("first", "second")
    ]
    own = [p for p in predictions(objective, best, out) if p.is_judged]
    assert [(p.axis, p.by) for p in own] == [(axis, one.by) for one in out for axis in one.axes]
    assert all(p.coverage > 0.8 for p in own)
    assert score_of(own) > 0.5
    heave, yaw = objective.logs
    still = Objective(objective.table, [replace(heave, driven=()), yaw], objective.rows)
    assert {one.axes for one in held_out(still, best)} == {(YAW,)}  # what a log does not drive judges no model


@pytest.mark.parametrize("count", [2, 99])
def test_predictions_take_shorter_steps_where_the_motion_of_wide_parameters_diverges(fit: Fit, count: int) -> None:
    z, covariance = fit.best.z, np.asarray(np.linalg.inv(0.5 * fit.best.information), float)
    changes = Objective.changes
    errors, deviations = ahead(fit.objective, 0, z, covariance, 5.0, 10.0)
    diverges = iter([True] * count)

    def shorter(*given: Any) -> Any:
        if next(diverges, False):
            raise DivergedError
        return changes(*given)

    with (
        patch.object(Objective, "changes", shorter),
        nullcontext() if count == 2 else pytest.raises(DivergedError),
    ):
        again = ahead(fit.objective, 0, z, covariance, 5.0, 10.0)
        assert again[0] == pytest.approx(errors)
        assert again[1] == pytest.approx(deviations, rel=0.1)


def test_a_fit_to_a_part_is_the_minimum_for_this_part(fit: Fit) -> None:
    """J of the part, with the noise of the fit to all data, cannot be made clearly smaller."""
    objective, best = fit.objective, fit.best
    table = objective.table
    fixed = tuple(
        p if p.of_motion else replace(p, low=z, high=z) for p, z in zip(table.parameters, best.z.tolist(), strict=True)
    )
    still = Objective(replace(table, parameters=fixed), objective.logs, objective.rows)
    for held in held_out(objective, best)[:2]:
        part = still.of(held.part)
        reached = part.value(held.fit.z, part.runs(held.fit.z))
        assert minimise(part, held.fit.z).value == pytest.approx(reached, abs=0.5)


def test_the_structure_is_right_where_the_simulation_has_it(fit: Fit) -> None:
    ratios = structure(fit.objective, fit.best)
    assert {*ratios} == {HEAVE, YAW}
    assert worst(ratios) < 1.3
    for axis, one in with_steps(fit.objective, fit.best, ratios).items():
        assert (one.ratio, one.spread) == (ratios[axis].ratio, 0.0)
        assert 0.85 < one.soon < CONSTANTS["soon"].value
        assert one.widens == (one.ratio, one.ratio)


def test_a_log_in_which_an_axis_hardly_moves_tells_little_of_what_the_structure_lacks(tmp_path: Path) -> None:
    """Both logs have errors of a load that the vehicle lacks; only the first one moves far."""
    weak = tuple((0.4 * command, seconds) for command, seconds in SHORT)
    objective = Objective.of_known(*begin(with_logs(tmp_path, (HEAVE, "a", SHORT), (HEAVE, "b", weak))))
    z = objective.mean.copy()
    index = objective.table.index("load", "heave")
    assert index is not None
    z[index] += 3.0
    lacks = []
    for logs in (objective.logs, objective.logs[:1], objective.logs[1:]):
        own = Objective(objective.table, logs, objective.rows)
        lacks.append(structure(own, minimise(own, z, most=0))[HEAVE].lack)
    both, far, near = lacks
    assert far * 0.999 <= both < 0.5 * near, lacks


@pytest.mark.parametrize(
    ("rows", "finite"),
    [
        ("0.5,0.62\n", 0),
        ("0.5,0.62\n-0.5,-0.60\n", 0),
        ("0.2,0.22\n0.3,0.36\n0.4,0.48\n0.5,0.62\n0.6,0.74\n", 5),
    ],
)
def test_a_row_that_the_others_do_not_determine_is_not_predicted(rows: str, finite: int, tmp_path: Path) -> None:
    """The centre of a prior has seen the row (e9 of the experience)."""
    tables = {"thrust_t200.csv": pulled(40.0, 2.0), "steady_heave.csv": f"{SPEED}\n{rows}"}
    (axis,) = identify(load_tests(folder_of(tmp_path, DOWN, tables))).axes
    assert sum(np.isfinite(p.held_out) for p in axis.points) == finite
    assert ("Nothing of this axis was checked on unseen data." in axis.verdict.reasons) == (finite == 0)
    assert axis.verdict.word != "good"
