"""The tuning guide: α and β in closed form or fitted to many points, for different vehicles and directions."""

import re
from math import e, inf, nan
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import t

from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, VehicleAxis
from rov_fmu.fmu.card import card
from rov_fmu.identify.tuning import Target, Tuning, TuningError, implausible, tune
from rov_fmu.io.output import sealed, without_seal
from rov_fmu.report.console_results import print_tuning
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import TUNED, Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_tuned
from tests.commands import Capsys
from tests.vehicles import extended, pulsed, thruster

k = load_vehicle(VIDEORAY)
"""The vehicle of the paper."""
HEAVE_AT_30 = ["--axis", "heave", "--command", "0.3", "--v-ss", "0.175", "--tau", "2.209"]


def tuned_to(k: Vehicle, axis: Axis, command: float, V_ss: float, Tau: float | None = None) -> Vehicle:
    """Tune to one command."""
    points = [Target("V_ss", command, V_ss)] + ([] if Tau is None else [Target("Tau", command, Tau)])
    return tune(k, axis, points).vehicle


def test_the_printout_names_the_inputs_that_are_held(capsys: Capsys) -> None:
    """For a turn to starboard, the left thruster pushes ahead and the right one astern, by the paper's (4)."""
    points = [Target("V_ss", command, sign * 0.5) for command, sign in ((0.3, 1), (-0.4, -1))]
    print_tuning(tune(k, YAW, points))
    said = capsys.readouterr().out
    assert "A command of 30% of yaw: u_l = 0.3, u_r = -0.3\n" in said
    assert "A command of -40% of yaw: u_l = -0.4, u_r = 0.4\n" in said
    print_tuning(tune(pulsed(k, (1100.0, 1500.0, 1900.0)), YAW, points))
    assert "A command of 30% of yaw: u_l = 1620, u_r = 1380\n" in capsys.readouterr().out


def test_steady_velocities_alone_leave_beta() -> None:
    tuning = tune(k, SURGE, [Target("V_ss", c, V) for c, V in ((0.2, 0.31), (0.5, 0.86), (0.7, 1.47))])
    assert tuning.vehicle["beta_u"] == k["beta_u"]
    assert [*tuning.intervals] == ["alpha_u"]


def test_intervals_are_those_of_linear_regression() -> None:
    """With linear drag, V_ss is proportional to α, so that its relative errors are linear in α."""
    plain = k.with_(alpha_u=1.0, a_d_u=0.0)
    wanted = [Target("V_ss", c, V) for c, V in ((0.2, 0.31), (0.5, 1.06), (0.7, 1.47), (-0.4, -0.6))]
    ratios = np.array([p.by(plain, SURGE) / p.value for p in wanted])
    alpha = ratios.sum() / (ratios @ ratios)
    errors = alpha * ratios - 1.0
    relative = np.sqrt(errors @ errors / 3.0 / (ratios @ ratios)) / alpha
    factor = np.exp(t.ppf(0.975, 3) * relative)
    tuning = tune(plain, SURGE, wanted)
    assert tuning.vehicle["alpha_u"] == pytest.approx(alpha, rel=1e-9)
    assert tuning.intervals["alpha_u"] == pytest.approx((alpha / factor, alpha * factor), rel=1e-6)


@pytest.mark.parametrize(
    ("command", "V_ss", "Tau", "named"),
    [
        (0.3, -0.2, 2.0, "V_ss = -0.2 m/s must be positive"),
        (0.3, 0.0, 2.0, "size of at least 1e-09"),
        (-0.3, 0.2, 2.0, "must be negative, for a command of -0.3 gives a thrust of -0.59985 N"),
        (0.0, 0.2, 2.0, "not 0"),
        (30, 0.2, 2.0, "of 30 must"),
        (0.3, 0.2, 0.0, "at least 1e-09 s"),
        (0.3, inf, 2.0, "V_ss"),
        (nan, 0.2, 2.0, "command"),
        (0.3, 0.2, nan, "Tau"),
        (0.3, 1e5, 2.0, "alpha_w"),
        (0.3, 0.2, 1e-9, "beta_w"),
    ],
)
def test_what_no_tuning_gives(command: float, V_ss: float, Tau: float, named: str, capsys: Capsys) -> None:
    check_refused([f"--command={command}", f"--v-ss={V_ss}", f"--tau={Tau}"], named, capsys)


@pytest.mark.parametrize(
    ("alpha", "beta", "told"),
    [
        (0.5, 1.2, {}),
        (0.49, 0.6, {"alpha": {"value": 0.49, "low": 0.5, "high": 2.0}}),
        (1.0, 1.21, {"beta": {"value": 1.21, "low": 0.05, "high": 1.2}}),
    ],
)
def test_an_implausible_alpha_or_beta_is_told(alpha: float, beta: float, told: dict[str, dict[str, float]]) -> None:
    points = (Target("V_ss", 0.3, 0.2), Target("Tau", 0.3, 2.0))
    rov = k.with_(alpha_w=alpha, beta_w=beta)
    found = [*implausible(Tuning(HEAVE, rov, points, {"alpha_w": None, "beta_w": None}))]
    numbers = [{name: word for name, word in finding.words.items() if not isinstance(word, str)} for finding in found]
    assert numbers == [*told.values()]
    assert [finding.kind for finding in found] == [f"implausible tuned {kind}" for kind in told]
    of_alpha_alone = [*implausible(Tuning(HEAVE, rov, points[:1], {"alpha_w": None}))]
    assert len(of_alpha_alone) == ("alpha" in told), "beta was not tuned"


# ---- Of another vehicle, by direction --------------------------------------------------------------------------------

BUOYANT = Vehicle(
    Layout(
        (VehicleAxis(SWAY), VehicleAxis(HEAVE, ("m_a", "a_d", "b_d", "a_d_reverse", "b_d_reverse", "F_0"))),
        (Curve("prop", ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "c_0_reverse")),),
        (
            thruster("port", "prop", (0.0, 0.0, 1.0), (0.0, -0.2, 0.0)),
            thruster("starboard", "prop", (0.0, 0.0, 1.0), (0.0, 0.2, 0.0)),
            thruster("aside", "prop", (0.0, -1.0, 0.0), (0.0, 0.0, 0.0)),
        ),
    ),
    {"m_rov": 11.0, "m_a_w": 14.0, "a_d_v": 60.0, "b_d_v": 2.0, "alpha_v": 0.9, "beta_v": 0.8}
    | {"a_d_w": 40.0, "b_d_w": 5.0, "a_d_w_reverse": 70.0, "b_d_w_reverse": 3.0, "F_0_w": -3.0}
    | {"alpha_w": 1.1, "beta_w": 0.7, "a_t_prop": 30.0, "b_t_prop": 31.0, "c_0_prop": 0.08}
    | {"a_t_prop_reverse": 22.0, "b_t_prop_reverse": 25.0, "c_0_prop_reverse": 0.1}
    | {"health_port": 1.0, "health_starboard": 1.0, "health_aside": 1.0},
)


def heave_after(t: float, command: float, alpha: float, beta: float, d: float) -> float:
    """Return the velocity of BUOYANT in heave after some seconds from rest, by integration of its equation.

    Each of the two thrusters loses d |c| v.
    """
    c = abs(command)
    thrust = 2.0 * (30.0 * (c - 0.08) ** 2 + 31.0 * (c - 0.08))
    if command < 0.0:
        thrust = -2.0 * (22.0 * (c - 0.1) ** 2 + 25.0 * (c - 0.1))

    def rate(_: float, state: list[float]) -> list[float]:
        (v,) = state
        drag = 40.0 * v * v + 5.0 * v if v > 0.0 else -70.0 * v * v + 3.0 * v
        return [beta * (alpha * (thrust - 2.0 * d * c * v) - 3.0 - drag) / 25.0]

    return float(solve_ivp(rate, (0.0, t), [0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[0, -1])


@pytest.mark.parametrize(
    ("command", "V_ss", "Tau"), [(0.5, 0.6, 0.9), (-0.5, -0.5, 0.9), (0.12, -0.15, 2.0), (1.0, 0.01, 0.5)]
)
@pytest.mark.parametrize("d", [0.0, 9.0])
def test_each_direction_has_its_thrust_drag_and_load(command: float, V_ss: float, Tau: float, d: float) -> None:
    tuned = tuned_to(extended(BUOYANT, d_prop=d) if d else BUOYANT, HEAVE, command, V_ss, Tau)
    alpha, beta = tuned["alpha_w"], tuned["beta_w"]
    assert heave_after(100.0 * Tau, command, alpha, beta, d) == pytest.approx(V_ss, rel=1e-9)
    risen = (1.0 - 1.0 / e) * V_ss
    assert heave_after(Tau, command, alpha, beta, d) == pytest.approx(risen, rel=1e-9)


@pytest.mark.parametrize(
    ("axis", "command", "V_ss", "reason"),
    [
        (HEAVE, 0.08, 0.1, "heave: a command of 0.08 gives no thrust, it is within the dead band"),
        (
            HEAVE,
            -0.5,
            -0.1,
            "heave: V_ss = -0.1 m/s must be below the -0.186697 m/s that F_0 alone gives, "
            "for a command of -0.5 gives a thrust of -27.04 N",
        ),
        (SWAY, 0.5, -0.1, "sway: V_ss = -0.1 m/s must be positive, for a command of 0.5 gives a thrust of 13.52 N"),
    ],
)
def test_what_no_tuning_of_a_direction_gives(axis: Axis, command: float, V_ss: float, reason: str) -> None:
    with pytest.raises(TuningError, match=f"^{re.escape(reason)}$"):
        tuned_to(BUOYANT, axis, command, V_ss)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_speed_at_which_the_thrust_is_lost_is_refused(sign: float) -> None:
    """The two thrusters of heave lose 2 d |c| v of their thrust, 2 (30 (c - 0.08)^2 + 31 (c - 0.08)) ahead."""
    slips = extended(BUOYANT, d_prop=9.0)
    excess = 0.42 if sign > 0.0 else 0.4
    thrust = 30.0 * excess**2 + 31.0 * excess if sign > 0.0 else 22.0 * excess**2 + 25.0 * excess
    end = sign * thrust / (9.0 * 0.5)
    assert tuned_to(slips, HEAVE, sign * 0.5, 0.9 * end)["alpha_w"] > 50.0
    with pytest.raises(
        TuningError, match=f"must be slower than {end:g} m/s, for a .* has lost its thrust there by the sp"
    ):
        tuned_to(slips, HEAVE, sign * 0.5, 1.001 * end)


# ---- rov-fmu tune ----------------------------------------------------------------------------------------------------


def check_refused(options: list[str], named: str, capsys: Capsys) -> None:
    assert main(["tune", str(VIDEORAY), "--axis", "heave", *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert named in err


def test_tuned_vehicle_file_changes_nothing_else(tmp_path: Path, capsys: Capsys) -> None:
    assert main(["tune", str(VIDEORAY), *HEAVE_AT_30]) == 0
    assert re.search(r"^alpha_w = 1\.140(.|\n)*^beta_w = 0\.58998", capsys.readouterr().out, re.M)
    output = tmp_path / "tuned.toml"
    assert main(["tune", str(VIDEORAY), *HEAVE_AT_30[:4], "--v-ss", "0.2", "--tau", "3", "-o", str(output)]) == 0
    tuned, vehicle = load_vehicle(output), load_vehicle(VIDEORAY)
    assert tuned.response(HEAVE, 0.3) == pytest.approx((0.2, 3.0), rel=1e-5)
    assert tuned.sources["alpha_w"] == "Tuned to V_ss = 0.2 at 30%, Tau = 3 at 30%"
    assert tuned.data
    assert vehicle.data
    assert tuned.data.resolve() == vehicle.data
    before, after = (without_seal(path.read_text(encoding="utf-8")).splitlines() for path in (VIDEORAY, output))
    changed = {a.split(" ")[0] for a, b in zip(before, after, strict=True) if a != b}
    assert changed == {"name", "identifier", "data", "pictures", "alpha", "beta"}
    assert (
        tuned["alpha_w"] == tune(vehicle, HEAVE, [Target("V_ss", 0.3, 0.2), Target("Tau", 0.3, 3.0)]).vehicle["alpha_w"]
    )


@pytest.mark.parametrize(
    ("file", "identifier", "name"),
    [
        ("mine.toml", "mine", "VideoRay Pro 4, tuned: mine"),
        ("VideoRay.toml", "VideoRay_tuned", "VideoRay Pro 4, tuned: VideoRay"),
        ("bluerov2.toml", "bluerov2_tuned", "VideoRay Pro 4, tuned: bluerov2"),
        ("2 är-b.toml", "_2__r_b", "VideoRay Pro 4, tuned: 2 är-b"),
    ],
)
def test_a_tuned_vehicle_is_one_of_its_own(file: str, identifier: str, name: str, tmp_path: Path) -> None:
    """Its FMU does not replace that of the vehicle that ships, and the card says that it is tuned."""
    output = tmp_path / file
    assert main(["tune", str(VIDEORAY), *HEAVE_AT_30[:4], "--v-ss", "0.2", "-o", str(output)]) == 0
    tuned = load_vehicle(output)
    assert (tuned.identifier, tuned.name) == (identifier, name)
    assert "alpha_w: tuned to V_ss = 0.2 at 30%." in card(tuned)["From which data"]
    assert main(["tune", str(output), *HEAVE_AT_30[:4], "--v-ss", "0.21", "-o", str(output)]) == 0
    assert (load_vehicle(output).identifier, load_vehicle(output).name) == (identifier, name)
    assert main(["tune", str(output), *HEAVE_AT_30[:4], "--v-ss", "0.2", "-o", str(tmp_path / "next.toml")]) == 0
    assert load_vehicle(tmp_path / "next.toml").name == "VideoRay Pro 4, tuned: next"


def test_a_tuned_copy_of_an_identified_vehicle_says_so(tmp_path: Path) -> None:
    """Its verdicts are of another vehicle, and its first line has its own digest."""
    write_tuned(SHIPPED["videoray_refit"], path := tmp_path / "mine.toml", {"alpha_u": 1.1}, f"{TUNED} V_ss")
    text = path.read_text(encoding="utf-8")
    assert text == sealed(without_seal(text))
    trust = "The predictions are those of the vehicle before it was tuned."
    assert trust in card(load_vehicle(path))["How far to trust it"]
    assert trust not in card(load_vehicle(SHIPPED["videoray_refit"]))["How far to trust it"]


def test_points_of_a_file(tmp_path: Path, capsys: Capsys) -> None:
    points = tmp_path / "points.csv"
    points.write_text(
        "command [%],velocity [cm/s],time constant [s]\n20,11.24490,3.210526\n30,17.49804,\n70,,0.980904\n",
        encoding="utf-8",
    )
    output = tmp_path / "tuned.toml"
    assert main(["tune", str(VIDEORAY), "--axis", "heave", "--points", str(points), "-o", str(output)]) == 0
    found = load_vehicle(output)
    assert [found[name] for name in ("alpha_w", "beta_w")] == pytest.approx([k["alpha_w"], k["beta_w"]], rel=1e-6), (
        "Table 9 is what the points were made with"
    )
    assert "95 %" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "content", "named"),
    [
        ([], "", "--points"),
        (["--points", "POINTS", "--tau", "3"], "", "use either --points, or"),
        (["--axis", "sway", *HEAVE_AT_30[2:]], "", "sway: the vehicle has only surge, heave, yaw"),
        (["--points", "nowhere.csv"], "", "nowhere.csv: there is no such file"),
        ([*HEAVE_AT_30[2:], "-o", "nowhere/tuned.toml"], "", "no folder"),
        (["--points", "POINTS"], "velocity [m/s]\n20,-0.1\n", "line 2, column 'velocity [m/s]' = -0.1"),
        (["--points", "POINTS"], "velocity [m/s]\n0,0.1\n", "line 2"),
        (["--points", "POINTS"], "velocity [m/s],time constant [s]\n20,,\n", "no row has a velocity"),
    ],
)
def test_wrong_options_and_points_are_one_line(
    options: list[str], content: str, named: str, tmp_path: Path, capsys: Capsys
) -> None:
    points = tmp_path / "points.csv"
    points.write_text(f"command [%],{content}", encoding="utf-8")
    check_refused([str(points) if option == "POINTS" else option for option in options], named, capsys)
