"""A figure has the unit that its expression gives it, and grows with what it is made of as this unit says."""

from typing import Any

import numpy as np
import pytest

from rov_fmu.study.plan.figures import Figures, read_expression

UNITS = {"x": "m", "y": "m", "u": "m/s", "psi": "rad", "c": "1", "der(u)": "m/s2", "rov.z": "m", "m": "kg"}
TIMES = np.linspace(0.0, 10.0, 101)
VALUES: dict[str, Any] = {
    "x": 3.0 + np.sin(TIMES),
    "y": 5.0 - 0.2 * TIMES,
    "u": 0.5 * (1.0 - np.exp(-TIMES)),
    "psi": 0.3 * TIMES,
    "c": 0.1 * TIMES,
    "der(u)": 0.5 * np.exp(-TIMES),
    "m": 6.0,
    "rov.z": 2.0 + TIMES,
}
OF = {
    "m": [
        "x[-1] - at(x, 2)",
        "max(abs(x))",
        "hypot(x[3], y[3])",
        "where(c > 0.5, x, y)[9]",
        "-2 * mean(x)",
        "ptp(x[t >= 5])",
        "final(rov.z) + out['rov.z'][0]",
    ],
    "m/s": [
        "V_ss(u)",
        "max(u, 0.1 * u)[0] if any(u > 9) else final(u)",
        "percentile(u, 95) / c[50]",
        "interp(3, t, u)",
    ],
    "s": ["Tau(u)", "settling_time(u)", "t[where(u > 0.4)[0][0]]", "t[argmax(x)]"],
    "rad": ["unwrap(psi)[-1]", "arctan2(y, x)[4]"],
    "deg": ["degrees(psi[-1])"],
    "m/s2": ['max(out["der(u)"])'],
    "kg": ["m + 0.5 * m"],
    "1": ["final(x) / y[0]", "sin(psi[3])", "len(x)", "u[-1] > 0.4", "overshoot(x)"],
    "": ["x[0] * y[0]", "u[-1] ** 2", "x[0] + u[0]", "log(u[-1])", "1 + 2", "x[0] / t[9]"],
}
CASES = [(unit, text) for unit, texts in OF.items() for text in texts]


@pytest.mark.parametrize(("unit", "text"), CASES, ids=[text for _, text in CASES])
def test_a_figure_has_the_unit_of_what_it_is_made_of(unit: str, text: str) -> None:
    assert read_expression(text, UNITS).unit == unit


@pytest.mark.parametrize("unit", ["m", "m/s", "kg", "m/s2"])
def test_a_figure_scales_with_the_variables_of_its_unit_alone(unit: str) -> None:
    figures = Figures({f"f{n}": text for n, text in enumerate(OF[unit])}, TIMES)
    before, _ = figures.of(VALUES)
    for other in {*UNITS.values()} - {"1", "rad"}:
        scaled = {name: (1.5 if UNITS[name] == other else 1.0) * value for name, value in VALUES.items()}
        after, _ = figures.of(scaled)
        assert after == pytest.approx((1.5 if other == unit else 1.0) * np.array(before, float))
