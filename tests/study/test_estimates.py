"""The estimates of a vehicle file vary together in a study, and its page shows them with their Sobol indices."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu import Results
from rov_fmu.cli import main
from rov_fmu.fmus.variable import Variable
from rov_fmu.io.messages import FileError
from rov_fmu.study.plan.plan import Plan
from rov_fmu.study.plan.sampling import Design
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
    return Design(plan, has or _has(vehicle), vehicle)


# ---- Drawn -----------------------------------------------------------------------------------------------------------


def test_random_runs_are_the_draws_of_the_vehicle_with_the_same_seed() -> None:
    found = _design(REFITTED, sampler="random", runs=5, seed=1)
    drawn = REFITTED.draws(5, np.random.default_rng(1), forced=True)
    assert tuple(drawn) == found.names
    assert np.array_equal(found.rows(0, 5), np.column_stack([*drawn.values()]))


@pytest.mark.parametrize(
    ("verdicts", "axes"),
    [((), ""), (("surge: good. As it is.", "yaw: do not use. No."), "heave: not identified, yaw: do not use")],
)
def test_a_study_warns_of_axes_that_are_not_fit_for_use(verdicts: tuple[str, ...], axes: str) -> None:
    assert REFITTED.provenance
    vehicle = replace(REFITTED, provenance=REFITTED.provenance.model_copy(update={"verdicts": verdicts}))
    warnings = [warning for warning in _design(vehicle).warnings() if "may be off" in warning]
    assert warnings == (
        [f"the estimates of its.toml do not show how far these axes may be off: {axes}"] if axes else []
    )


def test_what_is_drawn_has_the_errors_and_correlations_of_the_file() -> None:
    found = _design(MADE, sampler="random", runs=6000)
    drawn = found.rows(0, 6000)
    assert found.names == (*ROWS,)
    assert drawn.mean(axis=0) == pytest.approx([9.0, 5.0, 18.0], abs=0.04)
    assert drawn.std(axis=0) == pytest.approx([0.5, 0.3, 0.6], rel=0.03)
    expected = np.eye(3)
    expected[0, 1] = expected[1, 0] = -0.8
    assert np.corrcoef(drawn.T) == pytest.approx(expected, abs=0.04)


# ---- Messages --------------------------------------------------------------------------------------------------------


def test_a_reader_is_warned_of_what_he_may_not_expect() -> None:
    for words, design in {
        "no row in [estimates] of its.toml: a_d_u, b_d_u and a_d_w vary as if correlated with nothing": _design(
            with_intervals(MADE, MADE.intervals)
        ),
        "the plan gives a_d_u: its correlation with b_d_u in its.toml is left out": _design(MADE, set={"a_d_u": 9.0}),
        "the FMU has other values than its.toml of beta_w (0.5, not 0.620654): the estimates were found": _design(
            MADE, _has(MADE, beta_w=0.5, a_d_u=7.0)
        ),
        "what is correlated has one Sobol index together: a_d_u and b_d_u": _design(MADE, sampler="saltelli", runs=8),
    }.items():
        (warning,) = design.warnings()
        assert warning.startswith(words)
    assert not [*_design(REFITTED).warnings()]


def test_an_estimate_that_does_not_fit_the_plan_or_the_fmu_is_a_line() -> None:
    made = with_intervals(MADE, {name: MADE.intervals[name] for name in ("a_d_u", "b_d_u")}, MADE.estimates)
    has = _has(MADE)
    without = {name: variable for name, variable in has.items() if name != "a_d_u"}
    narrow = has | {"b_d_u": replace(has["b_d_u"], minimum=6.0, maximum=7.0)}
    all_set = {"a_d_u": 9.0, "b_d_u": 5.0}
    for words, design in (
        ("the FMU has no variable 'a_d_u' that is a number", _design(made, without)),
        ("b_d_u of this vehicle does not fit the FMU: it must be within 6 ... 7 N.s/m", _design(made, narrow)),
        ("nothing varies, because [set] gives every coefficient that has an interval", _design(made, set=all_set)),
        ("a grid needs values or a range, but estimated", _design(made, sampler="grid")),
    ):
        (line,) = design.check({})
        assert line.startswith(f"vary_from = 'its.toml': {words}")
    (line,) = _design(made, sampler="saltelli").check({})
    assert (
        line
        == "sampler = 'saltelli': Sobol indices need independent variables, but all varied variables are correlated"
    )
    assert not [*_design(MADE, sampler="saltelli").check({})]


# ---- Done ------------------------------------------------------------------------------------------------------------


def planned(folder: Path, fmu: Path, runs: int) -> Path:
    """Write the plan of a study beside the vehicle file from which it varies."""
    write_vehicle(MADE, folder / "made.toml")
    (folder / "plan.toml").write_text(f"""fmu = "{beside(fmu, folder)}"
vary_from = "made.toml"
stop_time = 0.1
step = 0.1
runs = {runs}
sampler = "saltelli"
[vary]
m_rov.normal = {{ mean = 6.572, sd = 0.05 }}
[figures]
mixed = "a_d_u + 2*b_d_u + a_d_w + 4*m_rov"
same = "0*a_d_u"
""")
    return folder / "plan.toml"


@pytest.mark.long
def test_sobol_indices_are_those_of_groups_in_closed_form_and_warnings_are_told(
    videoray_fmu: Path,
    tmp_path: Path,
    scheduler: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The variance of a sum of normal numbers is the sum of the variances of its independent groups.

    If a_d_u and b_d_u were independent, they would have 0.60 of it.
    """
    monkeypatch.setattr("rov_fmu.study.results.plots.inline_svg", lambda *_, **__: "")
    plan = str(planned(tmp_path, videoray_fmu, 2560))
    assert main(["study", plan, "-o", str(tmp_path / "results"), "--scheduler", scheduler]) == 0
    results = Results(tmp_path / "results")
    assert results.warnings
    lines = without_progress(capsys.readouterr().err).splitlines()
    assert lines == [f"rov-fmu: warning: {warning}" for warning in results.warnings]
    assert results.plan["vary_from"]["estimates"] == {
        name: {"value": value, "error": error} for name, (value, error, _) in ROWS.items()
    }
    assert results.groups == (("a_d_u", "b_d_u"), ("a_d_w",), ("m_rov",))
    both = 0.5**2 + (2.0 * 0.3) ** 2 - 2.0 * 0.8 * 0.5 * (2.0 * 0.3)
    shares = np.array([both, 0.6**2, (4.0 * 0.05) ** 2])
    shares /= shares.sum()
    found = results.sensitivity("mixed")
    assert found.index.tolist() == ["a_d_u, b_d_u", "a_d_w", "m_rov"]
    for index in ("S1", "ST"):
        assert found[index].to_numpy() == pytest.approx(shares, abs=0.02)
    assert (abs(found.S1 - shares) <= found.S1_95).all()
    assert (found.S1_95 < 0.2).all()
    with pytest.raises(FileError, match="same is the same in all runs"):
        results.sensitivity("same")
