"""The costs that decide between explanations of files in different scales, computed by hand."""

from dataclasses import replace
from math import inf, log10, nan, pi

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.slips import search
from rov_fmu.identify.slips.explanation import Evidence, Explanation, Files, contradict, proportions
from rov_fmu.identify.slips.search import _given, _table, _wrong_time_constants, slips, weak_thrust
from rov_fmu.identify.slips.single_recording import Alone, alone
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from tests.recordings import PLANS, clean
from tests.vehicles import HEAVY, VIDEORAY

MASS = VIDEORAY["m_rov"]
SIZE = 0.5 * 1000.0 * (MASS / 1000.0) ** (2.0 / 3.0)
TYPICAL = Alone(False, 2.0 * MASS, 1.5 * SIZE, 0.0, 1.0, (0.0, 0.0), 1.0)
"""A vehicle in heave with the most plausible proportions."""


def files(*evidence: Evidence, given: Alone | None = None) -> Files:
    return Files(HEAVE, VIDEORAY, evidence, given)


def scaled(file: str, factor: float, vehicle: Alone = TYPICAL) -> Evidence:
    """Return the evidence of a file with a multiple of the measured values."""
    return Evidence(file, "depth", vehicle).undone(1.0 / factor)


def test_a_file_in_another_scale_shows_another_vehicle() -> None:
    """With k times the values, the vehicle seems k times as fast, and force is a v² + b v = m dv/dt in either scale."""
    true = Alone(False, 12.0, 30.0, 5.0, 0.6, (0.1, 0.2), 0.9)
    seen = scaled("a.csv", 10.0, true).alone
    assert (seen.inertia, seen.a, seen.b, seen.speed) == pytest.approx((1.2, 0.3, 0.5, 6.0))
    assert seen.drag(6.0) == pytest.approx(true.drag(0.6))
    assert Evidence("a.csv", "depth", seen).undone(10.0).alone.a == pytest.approx(30.0)


def test_usual_proportions_cost_nothing_and_others_by_their_decades() -> None:
    one = files()
    assert one._unlike(TYPICAL) == pytest.approx(0.0)
    assert one._unlike(replace(TYPICAL, inertia=20.0 * MASS)) == pytest.approx((1.0 / 0.3) ** 2)
    assert one._unlike(replace(TYPICAL, a=15.0 * SIZE)) == pytest.approx((1.0 / 0.45) ** 2)
    assert one._unlike(replace(TYPICAL, inertia=2e9 * MASS)) == 25.0
    assert one._unlike(replace(TYPICAL, a=1e9 * SIZE)) == 25.0
    assert one._unlike(replace(TYPICAL, a=0.0)) == 25.0
    assert one._unlike(replace(TYPICAL, inertia=nan)) == pytest.approx(0.0)
    added = Files(HEAVE, HEAVY, [])
    size = 0.5 * 1000.0 * (HEAVY["m_rov"] / 1000.0) ** (2.0 / 3.0)
    whole = HEAVY["m_rov"] + HEAVY["m_a_w"]
    assert added._unlike(replace(TYPICAL, inertia=whole, a=1.5 * size)) == pytest.approx(0.0)
    assert added._unlike(replace(TYPICAL, inertia=10.0 * whole, a=1.5 * size)) == pytest.approx((1.0 / 0.25) ** 2)


def test_the_size_in_yaw_is_that_of_a_box() -> None:
    size = 0.5 * 1000.0 * 6.0 * VIDEORAY["I_r"] / 1000.0
    found = proportions(YAW, VIDEORAY, Alone(False, 0.3, 0.7, 0.2, 2.0, (0.0, 0.0), 1.0))
    assert found == pytest.approx((0.3 / VIDEORAY["I_r"], (0.7 * 4.0 + 0.4) / (size * 4.0)))
    assert Files(YAW, VIDEORAY, [])._unlike(
        Alone(False, 2.0 * VIDEORAY["I_r"], size, 0.0, 1.0, (0.0, 0.0), 1.0)
    ) == pytest.approx(0.0)


def test_files_of_one_vehicle_may_differ_by_loads_and_by_their_errors() -> None:
    one = files()
    assert one._apart(TYPICAL, TYPICAL) == 0.0
    twice = replace(TYPICAL, inertia=2.0 * TYPICAL.inertia)
    assert one._apart(twice, TYPICAL) == pytest.approx((log10(2.0) / 0.15) ** 2)
    unsure = replace(twice, errors=(0.23, 0.0))
    assert one._apart(unsure, TYPICAL) == pytest.approx(log10(2.0) ** 2 / (0.15**2 + 0.1**2))
    assert one._apart(replace(twice, errors=(inf, 0.0)), TYPICAL) == pytest.approx((log10(2.0) / 0.15) ** 2)
    more = replace(TYPICAL, a=2.0 * TYPICAL.a, errors=(0.0, 0.23))
    assert one._apart(more, TYPICAL) == pytest.approx(log10(2.0) ** 2 / (0.15**2 + 0.1**2))
    assert one._apart(replace(TYPICAL, inertia=1e4 * TYPICAL.inertia), TYPICAL) == 25.0
    assert one._apart(replace(TYPICAL, inertia=1e4 * TYPICAL.inertia, a=1e9), TYPICAL) == 50.0
    square, linear = replace(TYPICAL, a=40.0, b=0.0, speed=0.5), replace(TYPICAL, a=0.0, b=20.0, speed=2.0)
    assert one._apart(square, linear) == pytest.approx((log10(2.0) / 0.15) ** 2), "at the geometric mean, 1 m/s"
    assert one._apart(replace(TYPICAL, a=0.0), TYPICAL) == 0.0, "a ratio of nothing to something tells no scale"


@pytest.mark.parametrize(("speed", "cost"), [(3.9, 0.0), (8.0, (log10(2.0) / 0.1) ** 2), (1000.0, 50.0)])
def test_a_speed_that_no_vehicle_reaches_costs(speed: float, cost: float) -> None:
    """The drag is compared at the same speed, so only the speed itself costs."""
    assert files()._apart(replace(TYPICAL, speed=speed), TYPICAL) == pytest.approx(cost)


def test_the_wrong_one_of_three_files_is_found_with_its_scale() -> None:
    best = files(scaled("a.csv", 1.0), scaled("b.csv", 10.0), scaled("c.csv", 1.0)).explanations()[0]
    assert (best.factor, {*best.files}) == (10.0, {"b.csv"})
    assert best.cost == pytest.approx(5.0 + 0.5), "that of one slip in one file"
    assert best.vehicle.a == pytest.approx(TYPICAL.a)
    both = files(scaled("a.csv", 0.01), scaled("b.csv", 0.01)).explanations()[0]
    assert (both.factor, {*both.files}) == (0.01, {"a.csv", "b.csv"})
    assert both.cost == pytest.approx(6.0)


def test_explanations_are_sorted_and_contain_that_without_a_slip() -> None:
    found = files(scaled("a.csv", 1.0), scaled("b.csv", 1.0)).explanations()
    assert (found[0].factor, found[0].files) == (1.0, frozenset())
    assert found[0].cost == pytest.approx(0.0)
    assert [e.cost for e in found] == sorted(e.cost for e in found)
    given = files(scaled("a.csv", 10.0), given=TYPICAL).explanations()
    assert {*given[0].files} == {"a.csv"}
    assert given[0].cost == pytest.approx(5.5)
    (plain,) = (e for e in given if not e.files)
    assert plain.cost == pytest.approx(25.0 + 25.0), "inertia and drag are a decade or two apart"


@pytest.mark.parametrize("factor", [pi / 180.0, 0.1, 10.0, 180.0 / pi, 100.0])
def test_angles_have_scales_of_their_own(factor: float) -> None:
    size = 0.5 * 6.0 * VIDEORAY["I_r"]
    usual = Alone(False, 2.0 * VIDEORAY["I_r"], size, 0.0, 1.0, (0.0, 0.0), 1.0)
    best = Files(YAW, VIDEORAY, [scaled("a.csv", 1.0, usual), scaled("b.csv", factor, usual)]).explanations()[0]
    assert (best.factor, {*best.files}) == (factor, {"b.csv"})


@pytest.mark.parametrize(("cost", "contradicts"), [(13.9, True), (14.0, False)])
def test_another_explanation_contradicts_that_is_about_as_good(cost: float, contradicts: bool) -> None:
    first, same = (Explanation(10.0, frozenset(f), 10.0, TYPICAL) for f in (["a.csv"], ["a.csv", "b.csv"]))
    none = Explanation(1.0, frozenset(), 10.0, TYPICAL)
    other = Explanation(0.1, frozenset(["b.csv"]), cost, TYPICAL)
    assert contradict([first, same, none, other]) == (other if contradicts else None)


# ---- The search ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plain_cost", "share", "told"),
    [(13.9, 0.9, []), (14.0, 0.9, [False]), (24.9, 0.9, [False]), (25.0, 0.9, [True]), (25.0, 0.5, [False])],
)
def test_a_wrong_scale_is_told_or_refused_by_what_it_explains(
    plain_cost: float, share: float, told: list[bool]
) -> None:
    """A cost that is 4 lower is worth a warning; a file that is clear is refused at 15."""
    evidence = [Evidence(f, "depth", replace(TYPICAL, share=share)) for f in ("a.csv", "b.csv")]
    best = Explanation(10.0, frozenset(["a.csv"]), 10.0, TYPICAL)
    found = [*search._wrong_scales(HEAVE, evidence, [best, Explanation(1.0, frozenset(), plain_cost, TYPICAL)])]
    assert [finding.certain for finding in found] == told
    for finding in found:
        assert finding.file == "a.csv"
        assert finding.names == {"quantity": "depth", "unit": "m", "factor": "10.0", "others": ""}


@pytest.mark.parametrize(
    ("ratio", "kind", "certain"),
    [
        (19.9, "", False),
        (20.1, "slow time constants", False),
        (99.0, "slow time constants", False),
        (101.0, "slow time constants", True),
        (1.0 / 19.9, "", False),
        (1.0 / 20.1, "fast time constants", False),
        (1.0 / 99.0, "fast time constants", False),
        (1.0 / 101.0, "fast time constants", True),
    ],
)
@pytest.mark.parametrize("inertia", [MASS, nan])
def test_time_constants_are_compared_with_those_of_the_vehicle(
    ratio: float, kind: str, certain: bool, inertia: float
) -> None:
    """Tau is about V_ss (m/β) / F; an unknown inertia is taken as twice the mass."""
    F = VIDEORAY["alpha_w"] * VIDEORAY.force(HEAVE, 0.5)
    V = (-5.0 + np.sqrt(25.0 + 4.0 * 30.0 * F)) / 60.0
    Tau = V * (MASS if inertia == MASS else 2.0 * MASS) / F
    vehicle = Alone(False, inertia, 30.0, 5.0, 1.0, (0.0, 0.0), 1.0)
    rows = [(0.5, ratio * Tau), (0.0, 1e9)]
    found = [*_wrong_time_constants(HEAVE, VIDEORAY, vehicle, "a.csv", rows)]
    assert [(f.kind, f.certain) for f in found] == ([(kind, certain)] if kind else [])
    assert [f.numbers["ratio"] for f in found] == pytest.approx([ratio] * len(found))
    assert [*_wrong_time_constants(HEAVE, VIDEORAY, vehicle, "a.csv", [(0.0, 1e9)])] == []


def test_a_table_shows_drag_alone() -> None:
    """Force is α times thrust; rows without force or velocity do not count."""
    rows = [(c, V) for c in (0.2, 0.5, -0.8) for V in [VIDEORAY.response(HEAVE, c)[0]]]
    found = _table(HEAVE, VIDEORAY, "a.csv", [*rows, (0.0, 0.1), (0.3, 0.0)])
    assert found
    assert (found.alone.a, found.alone.b) == pytest.approx((VIDEORAY["a_d_w"], VIDEORAY["b_d_w"]))
    assert found.quantity == "velocity"
    assert found.alone.speed == pytest.approx(abs(rows[2][1]))
    assert np.isnan(found.alone.inertia)
    assert found.alone.errors == (inf, 0.1)
    assert found.alone.is_clear
    assert _table(HEAVE, VIDEORAY, "a.csv", [(0.0, 0.1), (0.3, 0.0)]) is None


def test_a_vehicle_is_given_where_all_of_its_drag_and_beta_are() -> None:
    given = _given(HEAVE, VIDEORAY, ["a_d_w", "b_d_w", "beta_w", "m_rov"])
    assert given
    assert (given.inertia, given.a, given.b) == pytest.approx((MASS / VIDEORAY["beta_w"], 18.72, 0.6324))
    assert given.errors == (0.0, 0.0)
    assert _given(HEAVE, VIDEORAY, ["a_d_w", "b_d_w"]) is None


@pytest.mark.parametrize(("strongest", "is_told"), [(0.01, True), (0.0101, False)])
def test_commands_within_one_percent_are_fractions_taken_for_percent(strongest: float, is_told: bool) -> None:
    time = np.arange(0.0, 20.0, 0.1)
    recording = Recording("a.csv", HEAVE, "depth", time, np.where(time > 2.0, strongest, 0.0), 0.1 * time)
    found = [finding for finding in slips({"heave": [recording]}, VIDEORAY) if finding.kind == "fractions as percent"]
    assert [f.numbers["percent"] for f in found] == pytest.approx([1.0] * is_told)
    assert all(f.certain for f in found)


@pytest.mark.parametrize(("speed", "is_told"), [(4.01, True), (3.99, False)])
def test_a_table_faster_than_any_vehicle_is_refused(speed: float, is_told: bool) -> None:
    found = slips({}, VIDEORAY, steady={"surge": {"a.csv": [(0.5, speed)]}})
    assert [finding.certain for finding in found if finding.kind == "too fast"] == [True] * is_told


@pytest.mark.parametrize(("ratio", "is_told"), [(2.49, True), (2.51, False)])
def test_two_betas_are_wrong_by_one_cause_if_they_are_alike(ratio: float, is_told: bool) -> None:
    rov = VIDEORAY.replaced({"beta_u": 1.3, "beta_r": 1.3 * ratio})
    found = weak_thrust(rov, ["rear", "top"], [SURGE, HEAVE, YAW])
    assert [finding.axis for finding in found] == ["surge", "yaw"] * is_told
    for finding in found:
        assert float(finding.names["factor"]) == pytest.approx(1.3 * np.sqrt(ratio))
        assert finding.names["together"] == "2"


# ---- One recording ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("of", [SURGE, HEAVE, YAW], ids=lambda axis: axis.name)
def test_a_recording_by_itself_shows_the_vehicle_roughly(of: Axis) -> None:
    recording = clean(VIDEORAY, of, PLANS[of.name][0], 20.0).noisy(np.random.default_rng(0), noise=1e-4)
    found = alone(prepare(recording, VIDEORAY), VIDEORAY)
    assert found
    assert not found.turned
    form = VIDEORAY.layout.kinds[of.name]
    assert found.inertia == pytest.approx(VIDEORAY.effective_inertia(form), rel=0.3)
    drag = (VIDEORAY[of.coefficient("a_d")] * found.speed + VIDEORAY[of.coefficient("b_d")]) * found.speed
    assert found.drag(found.speed) == pytest.approx(drag, rel=0.3)
    assert found.share > 0.9
    assert max(found.errors) < 0.5
    late = alone(prepare(replace(recording, values=-recording.values), VIDEORAY), VIDEORAY)
    assert late
    assert late.turned
    assert (late.inertia, late.a, late.b) == pytest.approx((found.inertia, found.a, found.b), rel=1e-6)


@pytest.mark.parametrize(("samples", "is_enough"), [(20, True), (19, False)])
def test_twenty_samples_of_a_motion_with_commands_are_needed(samples: int, is_enough: bool) -> None:
    moved = clean(VIDEORAY, HEAVE, ((0.5, 10.0),), 2.0)
    part = slice(samples)
    recording = Recording("a.csv", HEAVE, "depth", moved.time[part], moved.command[part], moved.position[part])
    assert (alone(prepare(recording, VIDEORAY), VIDEORAY) is not None) == is_enough
    for still in (replace(recording, command=np.zeros(samples)), replace(recording, values=np.ones(samples))):
        assert alone(prepare(still, VIDEORAY), VIDEORAY) is None


def test_the_velocity_of_a_force_balances_the_drag() -> None:
    one = Alone(False, 1.0, 30.0, 5.0, 1.0, (0.0, 0.19), 0.51)
    assert one.drag(one.steady(12.0)) == pytest.approx(12.0)
    assert one.is_clear
    assert not replace(one, share=0.5).is_clear
    assert not replace(one, errors=(0.0, 0.2)).is_clear
