"""Gains in SI units: calm in all corners, and the same flight in Python, in C, and by the FMU."""

import re
import shutil
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import yaml
from fmpy.validation import validate_fmu
from matplotlib.figure import Figure

import rov_fmu
from rov_fmu.autopilot.figures import first_holds
from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.gains import Autopilot, autopilot_of
from rov_fmu.autopilot.law import AXES, PLACE, RATE, SENSORS, STICK
from rov_fmu.autopilot.pilot import Pilot
from rov_fmu.bridges.autopilot.files import gains_yaml
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.c.compile import PLATFORMS
from rov_fmu.c.simulation import Array
from rov_fmu.c.stepper import Stepper
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, YAW
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.schema import UNDETERMINED, Basis
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import spread
from tests.vehicles import FINNED

VIDEORAY, SIX, HEAVY = (load_vehicle(SHIPPED[name]) for name in ("videoray", "bluerov2", "bluerov2_heavy"))
SHIPPED_WITH_THRUSTERS = ("videoray", "videoray_refit", "bluerov2", "bluerov2_heavy")
_MASSES = [name for name in SIX.coefficients if name in ("m_rov", "I_r") or name.startswith("m_a_")]


def scaled(mass: float, **others: float) -> Vehicle:
    return SIX.with_(**{name: mass * SIX[name] for name in _MASSES}, **others)


OWN = {
    "VideoRay": VIDEORAY,
    "Heavy": HEAVY,
    "4 kg": scaled(4.0 / SIX["m_rov"], T_t200=0.05),
    "25 kg": scaled(25.0 / SIX["m_rov"], T_t200=0.25),
    "drag x 4": SIX.with_(**{name: 4.0 * SIX[name] for name in SIX.coefficients if name[:4] in ("a_d_", "b_d_")}),
    "sinks": SIX.with_(F_0_w=20.0) if "F_0_w" in SIX.coefficients else SIX,
}


@pytest.mark.parametrize("step", [0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("name", spread([*OWN], ["VideoRay", "Heavy", "25 kg"]))
def test_the_gains_are_calm_in_all_corners_when_all_exchange_at_once(name: str, step: float) -> None:
    """With 30 % more and less thrust and inertia, and the commands one step late, as in Jacobi loops, and a load."""
    vehicle = OWN[name]
    made, axes = autopilot_of(vehicle, step), vehicle.layout.bare_axes
    corners = [
        {"z": 10.0, "X_ext": 0.2}
        | ({"Y_ext": 0.1} if "Y_ext" in vehicle.layout.inputs else {})
        | {axis.coefficient("alpha"): thrust * vehicle[axis.coefficient("alpha")] for axis in axes}
        | {axis.coefficient("beta"): vehicle[axis.coefficient("beta")] / inertia for axis in axes}
        for thrust, inertia in ((1.0, 1.0), (1.3, 0.7), (0.7, 1.3), (1.3, 1.3), (0.7, 0.7))
    ]
    flights, steps = Flights(vehicle, made.sharing, corners, [1] * len(corners)), round(12.0 / step)
    held = [axis for axis in made.axes if axis in (HEAVE, ROLL, PITCH, YAW)]
    modes = np.tile([PLACE if axis in held else STICK for axis in AXES], (steps, 1))
    aim = np.zeros(len(AXES))
    for depth, heading in ((10.0, 0.0), (11.0, 0.0), (11.0, 1.5)):
        aim[[2, 5]] = depth, heading
        flight = flights.fly(made.loops, modes, np.tile(aim, (steps, 1)), step)
        changes = np.abs(np.diff(flight.outputs[:, -round(2.0 / step) :], axis=1)).sum(axis=1).max() / 2.0
        assert changes < 1.0, "the full command changes less than once in a second at rest"
        if depth == 10.0:  # the hold begins without thrust, so that a heavy vehicle sinks at first
            continue
        errors = flight.sensors[:, :, [2, 5]] - [depth, heading]
        assert (errors.max(axis=1) < [0.12, 0.12]).all()
        assert (np.abs(errors[:, -1]) < [0.35, 0.4]).all()


@pytest.mark.parametrize("step", [0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("name", [*SHIPPED_WITH_THRUSTERS, "25 kg"])
def test_a_first_hold_is_quick_and_does_not_overshoot(name: str, step: float) -> None:
    """By at most 1.5 cm and 1 degree in still water, in a current and a step late; of corners 6 cm, 3 degrees."""
    vehicle = OWN[name] if name in OWN else load_vehicle(SHIPPED[name])
    made = autopilot_of(vehicle, step)
    for axis, (figures, worst) in first_holds(made).items():
        most, far = (0.015, 0.06) if axis is HEAVE else (radians(1.0), radians(3.0))
        assert figures.overshoot[:3].max() < most
        assert figures.overshoot.max() == worst < far
        assert figures.rise[:3].max() < 1.0 + 3.0 / made.gain(axis, "k_x")
        assert figures.rest[[0, 2]].max() < 0.02


@pytest.mark.parametrize("name", SHIPPED_WITH_THRUSTERS)
def test_hold_and_the_file_of_gains_tell_the_same(name: str) -> None:
    """Whole holds in Python against the flights in C, and against the figures by hand."""
    rov = rov_fmu.load(name)
    run = rov.hold(15.0, start={"z": 10.0}, depth=11.0, heading=np.pi / 2)
    told = yaml.safe_load(gains_yaml(rov)["gains.yaml"])["first_hold"]
    for aim, axis, variable, end in (("depth", "heave", "z", 11.0), ("heading", "yaw", "psi", np.pi / 2)):
        errors, begin, found = run[variable] - end, run[variable][0], run.aims[aim]
        assert (found.variable, found.value) == (variable, end)
        assert found.overshoot == pytest.approx(errors.max(), abs=1e-12)
        assert found.overshoot == pytest.approx(told[axis]["overshoot"], rel=0.01, abs=1e-6)
        before = run.time[errors < 0.1 * (begin - end)]
        assert before[-1] < found.rise <= before[-1] + 0.0201
        assert found.rise == pytest.approx(told[axis]["rise"], abs=0.006)
        assert f"{aim}: aim {end:.4g}" in repr(run)


def test_the_plot_of_a_hold_has_the_aims_with_their_figures() -> None:
    run = rov_fmu.load("bluerov2").hold(4.0, start={"psi": 3.0}, heading=-3.0, surge=0.2, depth=50.0)
    figure = run.plot(["psi", "z", "u"], Figure())
    labels = [text for axes in figure.axes for text in axes.get_legend_handles_labels()[1] if text.startswith("aim")]
    angle, depth, speed = (text.replace("\n", " ").replace(": ", ":\n", 1) for text in labels)
    assert re.fullmatch(r"aim -171.9 deg:\n90 % after \d\.\d+ s, overshoot [\d.e-]+ deg", angle)
    assert re.fullmatch(r"aim 50 m:\nnot reached, overshoot 0 m", depth)
    assert speed.startswith("aim 0.2 m/s")
    assert run.aims["heading"].overshoot < 0.1, "the way is 16 degrees over the end of the circle"


def test_gains_of_the_owner_replace_those_that_are_made() -> None:
    rov = rov_fmu.load("bluerov2")
    runs = [rov.hold(6.0, start={"z": 10.0}, gains=gains, depth=11.0) for gains in ({}, {"k_x_w": 0.3})]
    assert runs[1].aims["depth"].rise > 2.0 * runs[0].aims["depth"].rise
    own, usual = (rov.autopilot(gains=gains).autopilot for gains in ({"bias_w": -3.0, "k_p_r": 2.0}, {}))
    assert (own.gain(HEAVE, "bias"), own.gain(YAW, "k_p")) == (-3.0, 2.0)
    own.loops["bias"][2], own.loops["k_p"][5] = usual.gain(HEAVE, "bias"), usual.gain(YAW, "k_p")
    assert (own.loops == usual.loops).all()
    for gains, reason in (
        ({"k_p_q": 1.0}, r"^gains: there is no k_p_q, only .*did you mean k_p_"),
        ({"f_a_w": 1.0}, r"^gains: there is no f_a_w, only "),
        ({"k_p_w": -1.0}, r"^gains: k_p_w = -1.0: must be a number that is at least 0$"),
        ({"bias_w": np.nan}, r"^gains: bias_w = nan: must be a finite number$"),
    ):
        with pytest.raises(InputError, match=reason):
            rov.autopilot(gains=gains)


def test_only_what_thrusters_push_is_held() -> None:
    assert [axis.name for axis in autopilot_of(VIDEORAY).axes] == ["surge", "heave", "yaw"]
    with pytest.raises(InputError, match="moves thrusters alone, and not the fins"):
        autopilot_of(FINNED)
    with pytest.raises(InputError, match="cannot hold sway, only surge, heave and yaw"):
        Pilot(autopilot_of(VIDEORAY)).hold(sway=0.1)
    with pytest.raises(InputError, match="north and east are held together"):
        rov_fmu.load("bluerov2").hold(1.0, north=1.0)
    with pytest.raises(InputError, match=r"there is no dept.*did you mean depth"):
        rov_fmu.load("bluerov2").autopilot().hold(dept=1.0)
    for arguments, aims, reason in (
        ((5.0,), {"depth": "deep"}, "depth = 'deep': must be a finite number"),
        ((5.0,), {"depth": 2.0, "heave": 0.1}, "depth and heave are aims of one axis, heave"),
        ((-1.0,), {"depth": 2.0}, "seconds = -1.0: must be a time above 0"),
    ):
        with pytest.raises(InputError, match=reason):
            rov_fmu.load("bluerov2").hold(*arguments, **aims)


def test_the_feed_forward_makes_a_speed_follow() -> None:
    """A sine of 0.4 m/s in surge: without feed-forward the error is over ten times as large."""
    made, h = autopilot_of(HEAVY), 0.02
    wanted = 0.4 * np.sin(2.0 * np.pi * np.arange(2000) * h / 8.0)
    aims = np.zeros((2000, len(AXES)))
    aims[:, 0], aims[:, 2] = wanted, 10.0
    modes = np.tile([RATE, STICK, PLACE, PLACE, PLACE, PLACE], (2000, 1))
    sizes = []
    for names in ((), ("d_1", "d_2", "inertia")):
        loops = made.loops.copy()
        for name in names:
            loops[name] = 0.0
        seen = Flights(HEAVY, made.sharing, [{"z": 10.0}]).fly(loops, modes, aims, h).sensors[0, :, 6]
        sizes.append(np.sqrt(np.mean((seen - wanted)[500:] ** 2)))
    assert sizes[0] < 0.02
    assert sizes[1] > 5.0 * sizes[0]


# ---- The same flight everywhere --------------------------------------------------------------------------------------

AIMS: dict[str, Any] = {"depth": 11.0, "heading": 1.0, "surge": 0.3}
STEPS = 400


HOLD = {"mode_w": 2.0, "ref_z": 11.0, "mode_r": 2.0, "ref_psi": 1.0}


def by_flights(made: Autopilot, delay: int = 0, **aims_of: float) -> Array:
    pilot = Pilot(made).hold(**(aims_of or AIMS))
    modes, aims = np.tile(pilot.modes, (STEPS, 1)), np.tile(pilot.aims, (STEPS, 1))
    flight = Flights(made.vehicle, made.sharing, [{"z": 10.0}], [delay]).fly(made.loops, modes, aims, 0.02)
    seen: Array = flight.sensors[0]
    return seen


def begun(path: Path, fmi: int, values: dict[str, float]) -> tuple[Any, dict[str, int]]:
    """Return an instance of FMPy that is initialized with values, and the references of its variables."""
    description = fmpy.read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    folder = fmpy.extract(str(path), unzipdir=str(path.with_suffix("").absolute()))
    fmu = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    if fmi == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    (fmu.setReal if fmi == 2 else fmu.setFloat64)([reference[name] for name in values], [*values.values()])
    fmu.exitInitializationMode()
    return fmu, reference


@pytest.mark.parametrize("name", ["videoray", "bluerov2_heavy"])
def test_python_flies_as_the_flights_in_c_do(name: str) -> None:
    result = rov_fmu.load(name).hold(STEPS * 0.02, {}, start={"z": 10.0}, step=0.02, gains={}, **AIMS)
    seen = by_flights(autopilot_of(load_vehicle(SHIPPED[name])))
    for variable in ("z", "psi", "u"):
        assert result[variable][:STEPS] == pytest.approx(seen[:, SENSORS.index(variable)], abs=1e-9)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("vehicle", [VIDEORAY, HEAVY])
def test_the_fmu_flies_as_flights_in_c_and_restores_its_state(vehicle: Vehicle, fmi: int, tmp_path: Path) -> None:
    made = autopilot_of(vehicle)
    path = tmp_path / "autopilot.fmu"
    path.write_bytes(autopilot_fmu(made, ["host"], fmi))
    assert validate_fmu(str(path)) == []
    pilot, reference = begun(path, fmi, HOLD | {"mode_u": 1.0, "ref_u": 0.3})
    get, put = (pilot.getReal, pilot.setReal) if fmi == 2 else (pilot.getFloat64, pilot.setFloat64)
    layout = vehicle.layout
    sensors = [*layout.pose, *layout.velocities, *layout.over_ground]
    rov = Stepper(vehicle, {"z": 10.0}, [*sensors, *(("phi", "theta", "psi") if layout.has_attitude else ())])
    seen, commands = by_flights(made), [reference[name] for name in layout.commands]
    now = rov.recorded()
    for n in range(STEPS):
        for name in ("z", "psi", "u"):
            at = dict(zip((*sensors, "phi", "theta", "psi"), now, strict=False))[name]
            assert at == pytest.approx(seen[n, SENSORS.index(name)], abs=1e-9)
        put([reference[name] for name in sensors], now[: len(sensors)])
        if n == STEPS // 2:
            saved = pilot.getFMUState() if fmi == 3 else pilot.getFMUstate()
            pilot.doStep(n * 0.02, 0.02)
            first = get(commands)
            (pilot.setFMUState if fmi == 3 else pilot.setFMUstate)(saved)
        pilot.doStep(n * 0.02, 0.02)
        assert n != STEPS // 2 or get(commands) == first
        now = rov.step(get(commands), 0.02)
    pilot.terminate()
    pilot.freeInstance()


PLAN = """
step = 0.02
stop_time = 8.0
connect = [
  ["rov.pose", "autopilot.pose"], ["rov.velocity", "autopilot.velocity"],
  ["rov.body_velocity", "autopilot.body_velocity"], ["autopilot.thrusters", "rov.thrusters"],
]
[component.rov]
vehicle = "bluerov2"
start = { z = 10.0 }
[component.autopilot]
companion = "autopilot"
for = "rov"
start = { mode_w = 2.0, ref_z = 11.0, mode_r = 2.0, ref_psi = 1.0 }
"""


@pytest.mark.long
def test_in_a_system_whose_members_exchange_at_once_commands_arrive_a_step_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plan.toml").write_text(PLAN, encoding="utf-8")
    assert main(["system", "plan.toml", "-o", "my.ssp", "--run"]) == 0
    system = np.genfromtxt("my.csv", delimiter=",", names=True, deletechars="")
    later = by_flights(autopilot_of(SIX), 1, depth=11.0, heading=1.0)
    for variable in ("z", "psi"):
        assert system[f"rov.{variable}"][:STEPS] == pytest.approx(later[:, SENSORS.index(variable)], abs=1e-9)


@pytest.mark.long
def test_the_fmu_has_all_platforms(tmp_path: Path) -> None:
    for fmi in (2, 3):
        path = tmp_path / "a.fmu"
        path.write_bytes(autopilot_fmu(autopilot_of(VIDEORAY), fmi=fmi))
        folder = Path(fmpy.extract(str(path), unzipdir=str(tmp_path / f"fmu{fmi}")))
        found = {one.name for one in (folder / "binaries").iterdir()}
        assert found == {name if fmi == 2 else p.folder for name, p in PLATFORMS.items() if p.by_default}
        shutil.rmtree(folder)


# ---- The files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("basis", "told"),
    [
        (
            Basis("Identified", (0.001, 0.113)),
            ["the lag of t200 thrust is not known (0.001 to 0.11 s), and 0.02 s is assumed"],
        ),
        (Basis(UNDETERMINED), ["the lag of t200 thrust is not known, and 0.02 s is assumed"]),
        (Basis("Identified", (0.015, 0.03)), []),
        (Basis("Wu (2018)"), []),
    ],
)
def test_a_lag_that_is_not_known_is_told(basis: Basis, told: list[str]) -> None:
    coefficients = {**HEAVY.coefficients, "T_t200": 0.02}
    vehicle = replace(HEAVY, coefficients=coefficients, basis={**HEAVY.basis, "T_t200": basis})
    assert vehicle.unknown_lags == told


def test_an_export_takes_coefficients_and_a_dead_time_that_the_file_has_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", "bluerov2", "--to", "gains", "--set", "T_d=0.02", "--set", "T_t200=0.05"]) == 0
    table = yaml.safe_load((tmp_path / "bluerov2_gains" / "gains.yaml").read_text(encoding="utf-8"))
    assert {axis["lag"] for axis in table["axes"].values()} == {0.07}
    capsys.readouterr()
    assert main(["export", "bluerov2", "--to", "gains", "--set", "z=2"]) == 2
    assert capsys.readouterr().err == "rov-fmu: --set z: an export has coefficients alone, such as T_d=0.02\n"


def test_the_gains_are_a_table_for_any_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", "bluerov2_heavy", "--to", "gains"]) == 0
    table = yaml.safe_load((tmp_path / "bluerov2_heavy_gains" / "gains.yaml").read_text(encoding="utf-8"))
    made = autopilot_of(HEAVY)
    assert [*table["axes"]] == [axis.name for axis in made.axes]
    assert table["axes"]["surge"]["k_p"] == pytest.approx(made.gain(SURGE, "k_p"), rel=1e-5)
    down, up = table["forward_starboard_down"], table["forward_port_up"]
    signs = {"surge": 1, "sway": -1, "heave": -1, "roll": 1, "pitch": -1, "yaw": -1}
    for name, row in down["allocation"].items():
        assert up["allocation"][name] == [sign * x for sign, x in zip(signs.values(), row, strict=True)]
    assert up["bias"]["heave"] == -down["bias"]["heave"] > 0.0, "the Heavy floats up"
    forces, commands = np.array(table["force_to_command"]["t200"]).T
    assert (np.diff(forces) > 0.0).all()
    assert (np.diff(commands) > 0.0).all()
