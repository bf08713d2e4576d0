"""What is known before a fit: the centre of the priors by the tests, and the rows of tables."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.fit import Fit
from tests.folders import DOWN, FORCE, HEAD, SPEED, folder_of, read
from tests.identify.conftest import add_voltage
from tests.recordings import run, write_log
from tests.vehicles import VIDEORAY

FORCES, SPEEDS = (0.2, 0.5, 0.9, -0.4), {0.3: 0.2, 0.5: 0.4, -0.8: -0.8}
"""The commands of the forces, and V_ss by command."""
STEADY = "\n".join([SPEED, *(f"{c},{V}" for c, V in SPEEDS.items()), ""])


def thrust(command: float) -> float:
    return (32.0 * abs(command) + 10.0) * command


def test_the_drag_of_the_priors_balances_the_thrust_at_the_largest_velocity(tmp_path: Path) -> None:
    """70 % of it grows with the square of the velocity, and the added mass is half the mass."""
    forces = "\n".join([FORCE, *(f"{c},{thrust(c)}" for c in FORCES), ""])
    windows = "[windows]\nheave = [-0.8, 0.4]\n"
    known, _, rows = begin(read(tmp_path, DOWN + windows, {"thrust_t200.csv": forces, "steady_heave.csv": STEADY}))
    coefficients, F, V = known.coefficients, np.quantile([abs(thrust(c)) for c in SPEEDS], 0.9), 0.8
    expected = {"a_t_t200": 32.0, "b_t_t200": 10.0, "a_d_w": 0.7 * F / V**2, "b_d_w": 0.3 * F / V}
    for name, value in expected.items():
        pair = [coefficients[f"{name}{end}"] for end in ("", "_reverse")]
        assert pair == pytest.approx([value, value], rel=0.02), name
    assert coefficients["beta_w"] == pytest.approx(1.0 / 1.5)
    assert [(row.noise, row.quantity, row.command, row.measured, row.scale) for row in rows] == [
        *(("forces of t200", "force", c, pytest.approx(thrust(c)), pytest.approx(thrust(0.9))) for c in FORCES),
        *(("tables of heave", "V_ss", c, SPEEDS[c], abs(SPEEDS[c])) for c in (0.3, -0.8)),
    ]


def test_a_log_tells_the_drag_of_the_priors_by_its_usual_motion(fit: Fit) -> None:
    """The log of heave has commands of 30 % and 20 %, and about the V_ss of the first."""
    known, (heave, *_) = fit.known.coefficients, fit.objective.logs
    a, b = known["a_d_w"], known["b_d_w"]
    V = 7.0 * b / (3.0 * a)
    depth = heave.measured[0].channel
    assert pytest.approx(np.quantile(np.abs(np.diff(depth.values[::10])), 0.9), rel=0.1) == V
    forces = [(6.494 * c + 0.0513) * c for c in (0.3, 0.2)]
    assert a * V**2 + b * V == pytest.approx(np.quantile(forces, 0.9), rel=0.02)


@pytest.mark.parametrize(("fall", "depends"), [(0.029, False), (0.031, True)])
def test_thrust_depends_on_a_voltage_that_changes_by_3_percent(fall: float, depends: bool, tmp_path: Path) -> None:
    path = folder_of(tmp_path, f'base = "videoray"\n{HEAD}', {})
    recording = run(VIDEORAY, HEAVE, ((0.0, 2.0), (0.3, 6.0)), 10.0)
    add_voltage(write_log(path, "0", recording.noisy(np.random.default_rng(0))), 16.0 * fall / len(recording.time))
    known, _, _ = begin(load_tests(path))
    mean = pytest.approx(16.0 * (1.0 - 0.5 * fall), abs=0.01)
    assert known.layout.voltage == (mean if depends else None)
    assert {name: x for name, x in known.coefficients.items() if name.startswith(("V_0", "n_V"))} == (
        {"V_0_rear": mean, "V_0_top": mean, "n_V_rear": 0.0, "n_V_top": 0.0} if depends else {}
    )


def test_an_interval_of_given_thrust_is_its_prior_and_a_number_without_is_exact(tmp_path: Path) -> None:
    given = 'a_t_t200 = { value = 40.0, unit = "N", source = "s", interval = [36.0, 42.0] }\n'
    given += 'b_t_t200 = { value = 8.0, unit = "N", source = "s" }\n'
    rov = DOWN.replace("[known]\n", f"[known]\n{given}")
    known, _, _ = begin(read(tmp_path, rov, {"steady_heave.csv": STEADY}))
    assert known.thrust_errors == pytest.approx({"t200": 3.0 / 40.0 / t.ppf(0.975, 10)})
    assert known.exact == {"m_rov", "b_t_t200"}
    assert [curve.name for curve in known.curves] == ["t200"]
