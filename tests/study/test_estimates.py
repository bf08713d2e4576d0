"""The estimates of a vehicle file vary together in a study, and a reader is warned of what he may not expect."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.cli import main
from rov_fmu.fmus.variable import Variable
from rov_fmu.io.messages import FileError
from rov_fmu.study.plan import Plan
from rov_fmu.study.results import Results
from rov_fmu.study.run import prepared
from rov_fmu.study.sampling import Design
from rov_fmu.vehicle.schema import Estimated
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import FROZEN_REFIT, without_progress
from tests.folders import beside
from tests.vehicles import with_intervals

REFITTED = load_vehicle(FROZEN_REFIT)
ROWS = {"a_d_u": (9.0, 0.5, {}), "b_d_u": (5.0, 0.3, {"a_d_u": -0.8}), "a_d_w": (18.0, 0.6, {})}
MADE = with_intervals(
    replace(REFITTED, coefficients={**REFITTED.coefficients, **{name: value for name, (value, _, _) in ROWS.items()}}),
    {name: (value - 1.96 * error, value + 1.96 * error) for name, (value, error, _) in ROWS.items()},
    {name: Estimated(error=error, correlation=others) for name, (_, error, others) in ROWS.items()},
)
"""A vehicle whose coefficients are far from their bounds, so that all distributions are normal."""


def _has(vehicle: Vehicle, **other: float) -> dict[str, Variable]:
    """The coefficients of an FMU that is built from a vehicle."""
    return {
        name: Variable(
            name, n, "Real", "parameter", True, True, declaration.minimum, declaration.maximum, declaration.unit, value
        )
        for n, (name, declaration) in enumerate(vehicle.layout.coefficients.items())
        for value in [other.get(name, vehicle[name])]
    }


def _design(vehicle: Vehicle, has: Mapping[str, Variable] | None = None, **keys: Any) -> Design:
    plan = Plan.model_validate(
        {"fmu": "its.fmu", "stop_time": 1.0, "step": 1.0, "runs": 9, "vary_from": "its.toml", **keys}
    )
    return Design(plan, Path("plan.toml"), has or _has(vehicle), vehicle)


def test_random_runs_are_the_draws_of_the_vehicle_with_the_same_seed() -> None:
    found = _design(REFITTED, sampler="random", runs=5, seed=1)
    drawn = REFITTED.draws(5, np.random.default_rng(1), forced=True)
    assert [*drawn] == found.names
    assert np.array_equal(found.rows(), np.column_stack([*drawn.values()]))


def test_what_is_drawn_has_the_errors_and_correlations_of_the_file() -> None:
    found = _design(MADE, sampler="random", runs=6000)
    drawn = found.rows()
    assert found.names == [*ROWS]
    assert drawn.mean(axis=0) == pytest.approx([9.0, 5.0, 18.0], abs=0.04)
    assert drawn.std(axis=0) == pytest.approx([0.5, 0.3, 0.6], rel=0.03)
    expected = np.eye(3)
    expected[0, 1] = expected[1, 0] = -0.8
    assert np.corrcoef(drawn.T) == pytest.approx(expected, abs=0.04)


def test_what_is_drawn_stays_within_the_bounds_of_the_fmu_and_in_plans_own_order() -> None:
    has = _has(MADE)
    narrow = has | {"a_d_w": replace(has["a_d_w"], minimum=17.9, maximum=18.1)}
    found = _design(MADE, narrow, runs=512, vary={"m_rov": {"uniform": (6.0, 7.0)}, "a_d_u": {"values": (8.0,)}})
    b_d_u, a_d_w, m_rov, a_d_u = found.rows().T
    assert found.names == ["b_d_u", "a_d_w", "m_rov", "a_d_u"]
    assert (a_d_w.min(), a_d_w.max()) == pytest.approx((17.9, 18.1), abs=0.05)
    assert ((a_d_w >= 17.9) & (a_d_w <= 18.1)).all()
    assert (m_rov.min(), m_rov.max()) == pytest.approx((6.0, 7.0), abs=0.1)
    assert ((m_rov >= 6.0) & (m_rov <= 7.0)).all()
    assert {*a_d_u} == {8.0}
    assert b_d_u.mean() == pytest.approx(5.0, abs=0.02)


@pytest.mark.parametrize(
    ("verdicts", "axes"),
    [((), ""), (("surge: good. As it is.", "yaw: do not use. No."), "heave: not identified and yaw: do not use")],
)
def test_a_study_warns_of_axes_that_are_not_fit_for_use(verdicts: tuple[str, ...], axes: str) -> None:
    assert REFITTED.provenance
    vehicle = replace(REFITTED, provenance=REFITTED.provenance.model_copy(update={"verdicts": verdicts}))
    warnings = [warning for warning in _design(vehicle).warnings() if "may be off" in warning]
    assert warnings == (
        [f"the estimates of its.toml do not show how far these axes may be off: {axes}"] if axes else []
    )


def test_a_reader_is_warned_of_correlations_that_are_missing_and_of_another_fmu() -> None:
    named = {name: round(value + 1.0, 3) for name, value in [*MADE.coefficients.items()][:7]}
    for words, design in {
        "no row in [estimates] of its.toml: a_d_u, b_d_u and a_d_w vary as if correlated with nothing": _design(
            with_intervals(MADE, MADE.intervals)
        ),
        "the plan gives a_d_u: its correlation with b_d_u in its.toml is left out": _design(MADE, set={"a_d_u": 9.0}),
        "the FMU has other values than its.toml of beta_w (0.5, not 0.620654): the estimates were found beside those": (
            _design(MADE, _has(MADE, beta_w=0.5, a_d_u=7.0))
        ),
        f"the FMU has other values than its.toml of {next(iter(named))} (": _design(MADE, _has(MADE, **named)),
    }.items():
        (warning,) = design.warnings()
        assert warning.startswith(words)
    assert " and 2 more: the estimates" in warning, "at most five are named"
    assert not [*_design(REFITTED).warnings()]
    assert not [*_design(MADE, _has(MADE, beta_w=0.5), set={"beta_w": 0.62}).warnings()], "the plan gives it"


def test_an_estimate_that_does_not_fit_the_plan_or_the_fmu_is_a_line() -> None:
    made = with_intervals(MADE, {name: MADE.intervals[name] for name in ("a_d_u", "b_d_u")}, MADE.estimates)
    has = _has(MADE)
    without = {name: variable for name, variable in has.items() if name != "a_d_u"}
    narrow = has | {"b_d_u": replace(has["b_d_u"], minimum=6.0, maximum=7.0)}
    none_left = "vary_from = 'its.toml': no coefficient of this vehicle that [vary] and [set] leave has an interval"
    both: dict[str, Any] = {"set": {"a_d_u": 9.0}, "vary": {"b_d_u": {"uniform": (4.0, 5.0)}}}
    for words, design in (
        ("vary_from: a_d_u: the FMU has no variable 'a_d_u' that is a number", _design(made, without)),
        ("vary_from: b_d_u = 5.0: must be within 6 ... 7 N.s/m", _design(made, narrow)),
        (none_left, _design(made, **both)),
        ("vary_from = 'its.toml': a grid needs values or a range, but estimates", _design(made, sampler="grid")),
    ):
        (line,) = design.wrong({})
        assert line.startswith(words)
    (line,) = (one for one in _design(made).wrong({"a_d_u": 0.0}))
    assert line == "vary_from: a_d_u: is given in [set] or [inputs] too"


def test_warnings_are_printed_and_kept_with_the_results(
    videoray_fmu: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_vehicle(MADE, tmp_path / "made.toml")
    plan = tmp_path / "plan.toml"
    plan.write_text(
        f'fmu = "{beside(videoray_fmu, tmp_path)}"\nvary_from = "made.toml"\nstop_time = 0.1\nstep = 0.1\nruns = 2\n'
        'inputs = { u_l = 0.1 }\n[figures]\nmixed = "a_d_u + b_d_u"\n'
    )
    assert main(["study", str(plan), "-o", str(tmp_path / "results"), "--workers", "1"]) == 0
    told = Results(tmp_path / "results").warnings
    assert [warning.partition(" of ")[0] for warning in told] == ["the FMU has other values than made.toml"]
    lines = without_progress(capsys.readouterr().err).splitlines()
    assert lines == [f"rov-fmu: warning: {warning}" for warning in told]
    runs = Results(tmp_path / "results").runs
    assert runs.mixed.tolist() == (runs.a_d_u + runs.b_d_u).tolist()
    plan.write_text(plan.read_text().replace("inputs = { u_l = 0.1 }\n", ""))
    assert prepared(plan).warnings[-1].startswith("the plan gives no input of the FMU (u_l, u_r, ")
    plan.write_text(plan.read_text().replace("made.toml", "other.toml"))
    with pytest.raises(FileError, match=r"vary_from = 'other.toml': there is no such file beside the plan"):
        prepared(plan)
