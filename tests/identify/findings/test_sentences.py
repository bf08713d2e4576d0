"""The sentences of findings: the causes that they name, and their numbers."""

import re
from math import pi

import pytest

from rov_fmu.identify.findings import sentences
from rov_fmu.identify.slips.explanation import _ANGLES, _LENGTHS
from rov_fmu.tank.findings import Finding


def sentence(*findings: Finding) -> str:
    (found,) = sentences(findings)
    return found


def wrong_scale(factor: float, unit: str, others: str = "") -> str:
    names = {"quantity": "depth", "unit": unit, "factor": repr(factor), "others": others}
    return sentence(Finding("wrong scale", "heave", file="log.csv", names=names))


@pytest.mark.parametrize(
    ("factor", "unit", "cause"),
    [
        (1000.0, "m", "1000 times what the thrust, the size and the other files predict: is it in mm?"),
        (100.0, "m/s", "is it in cm?"),
        (10.0, "m", "is it in dm, or is the scale of the sensor wrong?"),
        (0.1, "m", "0.1 times what the thrust, the size and the other files predict: is the unit or the scale of the"),
        (0.01, "m", "are metres labelled as cm?"),
        (0.001, "m", "are metres labelled as mm?"),
        (pi / 180.0, "rad", "is about 0.01745 times"),
        (pi / 180.0, "rad", "are radians labelled as degrees?"),
        (180.0 / pi, "rad/s", "are degrees labelled as radians?"),
        (10.0, "rad", "is it in tenths of a degree, or is the scale of the sensor wrong?"),
        (100.0, "rad", "is it in hundredths of a degree?"),
        (0.1, "rad", "is the unit or the scale of the sensor wrong?"),
    ],
)
def test_a_wrong_scale_has_a_likely_cause(factor: float, unit: str, cause: str) -> None:
    said = wrong_scale(factor, unit)
    assert cause in said
    assert ("positions and directions of the thrusters" in said) == unit.startswith("rad")


@pytest.mark.parametrize(
    ("unit", "factor"), [*(("m", factor) for factor in _LENGTHS), *(("rad", factor) for factor in _ANGLES)]
)
def test_every_scale_that_is_tried_has_a_cause(unit: str, factor: float) -> None:
    assert re.search(r": (is|are) [^:]+\?", wrong_scale(factor, unit))


def test_other_files_that_may_have_the_wrong_scale_are_named() -> None:
    assert wrong_scale(10.0, "m", "a.csv, b.csv").endswith("? If not, check a.csv, b.csv.")
    assert wrong_scale(10.0, "m").endswith("wrong?")


@pytest.mark.parametrize(
    ("factor", "together", "cause"),
    [
        (1.9, "2", "1.9 times as strong: are they of one thruster, and not of all 2 together?"),
        (2.0, "2", "are they in lbf?"),
        (1.9, "1", "are they in lbf?"),
        (4.2, "1", "are they in lbf?"),
        (4.4, "1", "are they in kgf?"),
    ],
)
def test_a_weak_thrust_has_the_cause_that_leads_to_a_usual_beta(factor: float, together: str, cause: str) -> None:
    """β is usually 0.65, so a factor of 0.65 sqrt(4.448 9.807) = 4.29 is between the causes lbf and kgf."""
    names = {"factor": repr(factor), "together": together}
    assert sentence(Finding("weak thrust", "surge", "rear", names=names)).endswith(cause)


def test_drag_that_is_not_separable_has_a_reason_for_each_coefficient() -> None:
    numbers = {"a_d low": 1.0, "a_d high": 20.0, "correlation": -0.987}
    both = Finding("inseparable drag", "heave", names={"a_d": "a_d_w", "b_d": "b_d_w"}, numbers=numbers)
    said = "a_d_w may lie anywhere from 1.0 to 20, b_d_w is not identifiable at all (correlation -0.99)."
    assert said in sentence(both)
    one = Finding("inseparable drag", "heave", names={"b_d": "b_d_w"})
    assert "linear drag: b_d_w is not identifiable at all. Only their sum" in sentence(one)


def test_drag_at_its_bound_names_the_fit_without_bounds_where_it_is_known() -> None:
    names = {"coefficient": "b_d_w"}
    known, unknown = (
        sentence(Finding("drag at zero", "heave", names=names, numbers=n)) for n in ({"unbounded": -0.9}, {})
    )
    assert "be negative (by (11)-(13) alone -0.9), which is impossible" in known
    assert "be negative, which is impossible" in unknown


@pytest.mark.parametrize(
    ("curve", "numbers", "said"),
    [
        (
            "",
            {},
            "heave: at 40%, V_ss in reverse differs by +6% from that ahead. The model has no such difference. To leave "
            "out one direction, set heave in",
        ),
        (
            "top",
            {"modelled": -0.02},
            "top thrust: at 40%, V_ss in reverse differs by +6% from that ahead. In the model it differs by -2%",
        ),
    ],
)
def test_an_asymmetry_is_that_of_a_curve_or_an_axis(curve: str, numbers: dict[str, float], said: str) -> None:
    names, numbers = {"quantity": "V_ss", "window": "heave"}, {"command": 0.4, "measured": 0.06, **numbers}
    assert sentence(Finding("asymmetry", "heave", curve, names=names, numbers=numbers)).startswith(said)


@pytest.mark.parametrize(("high", "factors"), [(5.0, "3.2 to 5 times"), (3.21, "made 3.2 times")])
def test_a_disagreement_has_one_factor_or_a_range(high: float, factors: str) -> None:
    numbers = {"low": 3.2, "high": high}
    assert factors in sentence(Finding("disagreement", "heave", names={"coefficients": "a_d_w"}, numbers=numbers))


@pytest.mark.parametrize(("start", "when"), [(0.4, "log.csv from the start:"), (12.4, "log.csv after the first 12 s:")])
def test_what_is_unexplained_begins_at_a_time(start: float, when: str) -> None:
    names, numbers = {"cause": "drift"}, {"start": start}
    assert when in sentence(Finding("unexplained", "heave", file="log.csv", names=names, numbers=numbers))


def load(value: float, file: str = "", **more: float) -> Finding:
    names = {"unit": "N"} if file else {"unit": "N", "of": "heave"}
    return Finding("load", "heave", file=file, names=names, numbers={"value": value, **more})


def test_an_effect_has_its_interval_and_that_of_a_file_its_own_words() -> None:
    assert "a constant load of 1.235 N acts in heave (net weight" in sentence(load(1.23456))
    assert "a constant load of 1.23 N (1.10 to 1.40) acts in heave" in sentence(load(1.234, low=1.1, high=1.4))
    apart = sentence(load(1.234, "a.csv", low=1.1, high=1.4), load(2.5, "b.csv", low=2.1, high=2.9))
    assert "in a.csv and b.csv, the constant load differs by 1.2 ... 2.5 N (1.1 to 2.9) from" in apart
    current = Finding("current", "surge", file="a.csv", names={"unit": "m/s"}, numbers={"value": 0.1})
    assert "in a.csv, the water moved at 0.1 m/s" in sentence(current), "it has no other words for a file"
