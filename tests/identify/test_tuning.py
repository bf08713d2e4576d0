"""The tuning guide: α and β in closed form, or over many points."""

import re
from dataclasses import replace
from math import inf, nan
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.identify.response_fit import Point
from rov_fmu.identify.tuning import TuningError, tune, tune_over
from rov_fmu.motion.rov import AXES, HEAVE, SURGE, YAW, Axis, Coefficients
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

HEAVE_AT_30 = ["--axis", "heave", "--command", "0.3", "--v-ss", "0.175", "--tau", "2.209"]


@pytest.fixture
def k(vehicle: Vehicle) -> Coefficients:
    return vehicle.coefficients


def test_heave_at_30_percent_gives_table_9_again(k: Coefficients) -> None:
    tuning = tune(k, HEAVE, 0.3, 0.175, 2.209)
    assert f"{tuning.alpha:.2f}" == "1.14"
    assert f"{tuning.beta:.2f}" == "0.59"


@pytest.mark.parametrize("axis", AXES.values(), ids=lambda m: m.name)
@pytest.mark.parametrize("command", [0.2, 0.7, -0.4])
@pytest.mark.parametrize(("V_ss", "Tau"), [(0.1, 0.2), (0.5, 3.0), (2.0, 20.0)])
def test_tuned_model_has_the_wanted_response(
    axis: Axis, command: float, V_ss: float, Tau: float, k: Coefficients
) -> None:
    V_ss = V_ss if command > 0.0 else -V_ss
    tuned = tune(k, axis, command, V_ss, Tau).coefficients
    assert axis.response(tuned, command) == pytest.approx((V_ss, Tau), rel=1e-12)


def test_without_time_constant_beta_stays(k: Coefficients) -> None:
    assert tune(k, YAW, 0.3, 1.5).beta == k.beta_r


def test_many_points_of_a_tuned_model_give_its_tuning(k: Coefficients) -> None:
    wanted = [Point(q, c, YAW.response(k, c)[q == "Tau"], 1.0, "") for q in ("V_ss", "Tau") for c in (0.2, 0.4, -0.7)]
    tuning = tune_over(k, YAW, wanted)
    assert [tuning.alpha, tuning.beta] == pytest.approx([1.2, 0.12], rel=1e-6)
    assert tuning.estimate
    assert tuning.estimate.degrees_of_freedom == 4.0


def test_scattered_points_have_intervals_and_the_least_error(k: Coefficients) -> None:
    measured = {"V_ss": {0.2: 1.34, 0.3: 1.51, 0.5: 2.61, 0.7: 4.06}, "Tau": {0.2: 3.05, 0.3: 1.95, 0.5: 1.41}}
    points = [Point(q, c, value, 1.0, "") for q, values in measured.items() for c, value in values.items()]
    tuning = tune_over(k, YAW, points)
    low, high = tuning.estimate.intervals["alpha_r"] if tuning.estimate else (nan, nan)
    assert 0.8 < low < tuning.alpha < high < 1.6

    def error(alpha: float, beta: float) -> float:
        tuned = replace(k, alpha_r=alpha, beta_r=beta)
        return sum((YAW.response(tuned, p.command)[p.quantity == "Tau"] / p.value - 1.0) ** 2 for p in points)

    least = error(tuning.alpha, tuning.beta)
    assert least < error(1.2, 0.12)
    for a, b in ((1.01, 1.0), (0.99, 1.0), (1.0, 1.01), (1.0, 0.99)):
        assert least < error(a * tuning.alpha, b * tuning.beta)


def test_steady_velocities_alone_leave_beta(k: Coefficients) -> None:
    tuning = tune_over(k, SURGE, [Point("V_ss", c, V, 1.0, "") for c, V in ((0.2, 0.31), (0.5, 0.86), (0.7, 1.47))])
    assert tuning.beta == k.beta_u
    assert tuning.estimate
    assert tuning.estimate.names == ("alpha_u",)


@pytest.mark.parametrize(
    ("command", "V_ss", "Tau", "named"),
    [
        (0.3, -0.2, 2.0, "sign of the command"), (0.3, 0.0, 2.0, "sign"), (0.0, 0.2, 2.0, "not 0"),
        (30, 0.2, 2.0, "of 30 must"),
        (0.3, 0.2, 0.0, "above 0"), (0.3, 0.2, -1.0, "above 0"), (0.3, nan, 2.0, "V_ss"), (0.3, inf, 2.0, "V_ss"),
        (nan, 0.2, 2.0, "command"), (0.3, 0.2, nan, "Tau"), (0.3, 1e5, 2.0, "alpha_w"), (0.3, 0.2, 1e-9, "beta_w"),
    ],
)  # fmt: skip
def test_what_no_tuning_gives(
    command: float, V_ss: float, Tau: float, named: str, k: Coefficients, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(TuningError, match=re.escape(named)):
        tune(k, HEAVE, command, V_ss, Tau)
    options = [f"--command={command}", f"--v-ss={V_ss}", f"--tau={Tau}"]
    check_refused(["tune", str(VIDEORAY), "--axis", "heave", *options], named, capsys)


# ---- rov-fmu tune ----------------------------------------------------------------------------------------------------


def check_refused(arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert named in err


def test_command_prints_alpha_and_beta(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tune", str(VIDEORAY), *HEAVE_AT_30]) == 0
    out, _ = capsys.readouterr()
    assert re.search(r"^alpha_w = 1\.140", out, re.M)
    assert re.search(r"^beta_w = 0\.58998", out, re.M)


def test_tuned_vehicle_file_changes_nothing_else(tmp_path: Path) -> None:
    output = tmp_path / "tuned.toml"
    assert main(["tune", str(VIDEORAY), *HEAVE_AT_30[:4], "--v-ss", "0.2", "--tau", "3", "-o", str(output)]) == 0
    tuned, vehicle = load_vehicle(output), load_vehicle(VIDEORAY)
    assert HEAVE.response(tuned.coefficients, 0.3) == pytest.approx((0.2, 3.0), rel=1e-5)
    assert tuned.sources["alpha_w"] == "Tuned to V_ss = 0.2 at 30%, Tau = 3 at 30%"
    assert tuned.data
    assert vehicle.data
    assert tuned.data.resolve() == vehicle.data
    before, after = VIDEORAY.read_text(encoding="utf-8").splitlines(), output.read_text(encoding="utf-8").splitlines()
    changed = {a.split(" ")[0] for a, b in zip(before, after, strict=True) if a != b}
    assert changed == {"data", "pictures", "alpha_w", "beta_w"}


def test_points_of_a_file(tmp_path: Path, k: Coefficients, capsys: pytest.CaptureFixture[str]) -> None:
    points = tmp_path / "points.csv"
    points.write_text(
        "command [%],velocity [cm/s],time constant [s]\n20,11.24490,3.210526\n30,17.49804,\n70,,0.980904\n",
        encoding="utf-8",
    )
    output = tmp_path / "tuned.toml"
    assert main(["tune", str(VIDEORAY), "--axis", "heave", "--points", str(points), "-o", str(output)]) == 0
    assert load_vehicle(output).coefficients == k, "Table 9 is what the points were made with"
    assert "95 %" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("command [%],velocity [m/s]\n20,-0.1\n", "line 2, column 'velocity [m/s]' = -0.1"),
        ("command [%],time constant [s]\n20,0\n", "line 2, column 'time constant [s]' = 0"),
        ("command [%],time constant [s]\n20,3\n", "no V_ss"),
        ("command [%],velocity [m/s]\n0,0.1\n", "line 2"),
        ("command [%],velocity [m/s],time constant [s]\n20,,\n", "no V_ss"),
    ],
)
def test_bad_points(content: str, named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = tmp_path / "points.csv"
    points.write_text(content, encoding="utf-8")
    check_refused(["tune", str(VIDEORAY), "--axis", "heave", "--points", str(points)], named, capsys)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ([], "--points"), (["--command", "0.3"], "--v-ss"), (["--points", "a.csv", "--tau", "3"], "instead"),
        (["--points", "nowhere.csv"], "nowhere.csv: cannot be read: No such file"),
        ([*HEAVE_AT_30[2:], "-o", "nowhere/tuned.toml"], "no folder"),
    ],
)  # fmt: skip
def test_bad_options(options: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    check_refused(["tune", str(VIDEORAY), "--axis", "heave", *options], named, capsys)
