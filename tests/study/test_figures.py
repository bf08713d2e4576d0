"""Figures of responses for which they are known in closed form, and the reasons for missing ones."""

from math import exp, log, pi, sqrt

import numpy as np
import pytest

from rov_fmu.study.figures import Figures, unusable

T = np.linspace(0.0, 40.0, 4001)
FIRST = np.where(T > 2.0, 3.0 * (1.0 - np.exp(-np.maximum(T - 2.0, 0.0) / 1.5)), 0.0)
"""A response from 0 to 3 that begins at 2 s, with a time constant of 1.5 s."""
ZETA, OMEGA = 0.4, 2.0
_D = OMEGA * sqrt(1.0 - ZETA**2)
SECOND = 1.0 - np.exp(-ZETA * OMEGA * T) * (np.cos(_D * T) + ZETA * OMEGA / _D * np.sin(_D * T))
"""A step response that overshoots."""

KNOWN = {
    "V_ss(y)": 3.0,
    "Tau(y, 2)": 1.5,
    "settling_time(y, 2)": 1.5 * log(20.0),
    "settling_time(y, 2, 40, 0.02)": 1.5 * log(50.0),
    "overshoot(z)": exp(-pi * ZETA / sqrt(1.0 - ZETA**2)),
    "V_ss(-2*y)": -6.0,
    "at(y, 3.5)": 3.0 * (1.0 - exp(-1.0)),
    "out['der(y)'][-1]": 1.0,
    "y[t >= 10][0]": 3.0 * (1.0 - exp(-8.0 / 1.5)),
    "(m < 6.5) + 2 * (m <= 6.5) + 4 * (m > 6.5) + 8 * (m >= 6.5)": 10.0,
    "t[where(y > 3*(1 - e**-1))[0][0]]": 3.5,
    "sum(y[(t > 3.4) & ~(t >= 3.6)]) / len(y[341:360])": 3.0 * (1.0 - exp(-1.0)),
    "mean(t[3 < y * 2 < 4]) > 2 and not m == 6": 1.0,
    "where(m > 6, 4, 5)": 4.0,
    "round(m / 4, 1) + 7 // 2 - 7 % 4": 1.6,
    "2**-1 + (-8)**2": 64.5,
    "sum(diff(t) * (y[1:] + y[:-1]) / 2)": 3.0 * (38.0 - 1.5),
    "gradient(t**2, t)[1000]": 20.0,
    "interp(3.5, t, y)": 3.0 * (1.0 - exp(-1.0)),
    "settling_time(y, start=2, band=0.02)": 1.5 * log(50.0),
    "settling_time(t, band=0.06)": 0.94 * 38.0,
    "V_ss(t)": 38.0,
    "V_ss(t, 10, 20)": 19.5,
    "Tau(t, 10, 20)": 9.5 * (1.0 - exp(-1.0)),
    "overshoot(y)": 0.0,
    "final(y) + len(y)": 4004.0,
    "max(1, 3, 2) + min(5, 4) + max(t)": 47.0,
    "round(149.9, -2) + clip(m, 0, 5)": 105.0,
    "sorted(-t)[0] + t[::2][5] + t[-2:][0]": 0.09,
    "(1 if m > 6 else 2) + (0 < m < 6) + (m > 6 or m / 0) + (not m)": 2.0,
    "((m > 6) ^ (m > 7)) * 1 + (m != 6.5) * 2 + any(t > 3) * 4 + all(t > 0) * 8": 5.0,
    "~(m < 6) + ~(not m) * 2 + ~(m > 6 and m > 7) * 4": 7.0,
    "(m or 0) + (m and 3) * 2": 3.0,
    "median(t) + percentile(t, 25) + searchsorted(t, 0.995) + hypot(3, 4)": 135.0,
}


@pytest.mark.parametrize("expression", KNOWN)
def test_a_figure_is_what_the_response_has_in_closed_form(expression: str) -> None:
    run = {"y": FIRST, "z": SECOND, "m": 6.5, "der(y)": np.ones(len(T))}
    (found,), reason = Figures({"f": expression}, T).of(run)
    assert found == pytest.approx(KNOWN[expression], abs=1.1e-2)  # a step is 0.01 s
    assert reason == ""


def test_what_cannot_be_computed_is_nan_with_its_reason_and_the_others_are_there() -> None:
    odd = {"half": "y[0.5]", "choice": "1 if y else 2", "none": "Tau(0*y)", "never": "Tau(-t, 0, 0)", "end": "log(0)"}
    figures = Figures({"far": "y[9999]", "all": "2*y", "zero": "1/0", "late": "V_ss(y, 50, 60)", **odd, "m": "m"}, T)
    found, reason = figures.of({"y": FIRST, "m": 6.5})
    assert found == pytest.approx([*[None] * 9, 6.5])
    far, others, zero, late, half, choice, *infinite = reason.split("; ")
    assert half == "half: an index must be a whole number"
    assert choice.startswith("choice: The truth value of an array with more than one element is ambiguous.")
    assert infinite == ["none: is NaN", "never: is NaN", "end: is infinite"]
    assert far == "far: index 9999 is out of bounds for axis 0 with size 4001"
    assert others == "all: must be one number, and not an array"
    assert zero == "zero: division by zero"
    assert late == "late: there is no time 50 s in a run from 0 to 40 s"
    found, reason = figures.of({"y": np.full(10_000, 2.0), "m": 1.0})
    assert found[0] == 2.0, "the next run has nothing of this one's errors"


@pytest.mark.parametrize("function", ["V_ss", "Tau", "overshoot", "settling_time"])
def test_a_time_that_no_run_has_is_refused_before_the_first_run_by_one_rule(function: str) -> None:
    reason = "there is no time {} s in a run from 0 to 40 s"
    late = {"(y, 0, 100)": "100", "(y, end=4*10.5)": "42", "(y, -1)": "-1", "(y, m, 41)": "41"}
    for arguments, time in late.items():
        assert unusable(f"1 + {function}{arguments}", ["y"], ["m"], T) == reason.format(time)
    assert unusable(f"{function}(y, 9, 8)", ["y"], ["m"], T) == "there is no communication point from 9 to 8"
    for arguments in ("(y)", "(y, 0, 40)", "(y, m, m + 50)", "(y, end=39.995)"):
        assert unusable(f"{function}{arguments}", ["y"], ["m"], T) == ""
    assert Figures({"f": f"{function}(y, 0, m)"}, T).of({"y": FIRST, "m": 41.0})[1].endswith(reason.format("41"))
    assert unusable("at(y, 50)", ["y"], ["m"], T) == reason.format("50")
    assert unusable("at(y, m + 50)", ["y"], ["m"], T) == ""
