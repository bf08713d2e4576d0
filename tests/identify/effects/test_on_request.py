"""The effects that [fit] asks for: voltage, attitude and speed of advance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.engine.simulation import simulate
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.tank_tests import load_tank_tests
from rov_fmu.identify.diagnostics import on_voltage
from rov_fmu.identify.effects.advance import Advance
from rov_fmu.identify.effects.attitude import Attitude
from rov_fmu.identify.effects.effect import Setting, with_effects
from rov_fmu.identify.effects.voltage import Voltage, voltage_at
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.identify import identify
from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.model.layout import HEAVE, SURGE
from rov_fmu.tank.description import Requests
from rov_fmu.vehicle.vehicle import VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import vehicle_text
from tests.identify.scenarios.catalogue import SCENARIOS
from tests.identify.scenarios.outcome import write
from tests.vehicles import VIDEORAY

TIME = np.arange(0.0, 60.0, 0.05)
LOSS = 4.0


def advancing(loss: float, seed: int) -> Recording:
    """Return a recording of surge by a vehicle whose thrusters lose thrust at speed."""
    random = np.random.default_rng(seed)
    command = np.repeat([0.0, 0.3, 0.9, -0.5, 0.6, 0.0, -0.8, 0.2, 1.0, 0.0], len(TIME) // 10)
    truth = with_effects(VIDEORAY, {Advance("rear"): loss})
    inputs = dict.fromkeys(("u_l", "u_r"), command[None, :])
    (u,) = simulate(truth, TIME, inputs, ["u"]).values[:, 0]
    return Recording(f"{seed}.csv", SURGE, "velocity", TIME, command, u + 0.005 * random.standard_normal(len(TIME)))


@pytest.mark.parametrize("loss", [pytest.param(0.0, marks=pytest.mark.long), LOSS])
def test_the_loss_by_advance_is_fitted_where_there_is_one(loss: float) -> None:
    (fit,) = fit_recordings([advancing(loss, n) for n in range(2)], VIDEORAY, requests=Requests(advance=("rear",)))
    (found,) = (effect for effect in fit.effects if effect.kind == "advance")
    assert found.kept == (loss > 0.0)
    if loss:
        assert found.interval
        assert found.interval[0] < loss < found.interval[1]
        assert fit.rov["d_rear"] == found.value
    else:
        assert "d_rear" not in fit.rov.coefficients


@pytest.mark.long
def test_a_vehicle_of_logs_with_voltage_has_the_battery_and_the_exponent(tmp_path: Path) -> None:
    scenario = SCENARIOS["sag with voltage"]
    found = identify(load_tank_tests(write(scenario, 0, tmp_path / "tests")))
    vehicle = found.vehicle
    assert not [finding for finding in found.findings if finding.kind == "unknown voltage"], "rov.toml says it"
    path = tmp_path / "rov.toml"
    path.write_text(vehicle_text(vehicle, tmp_path), encoding="utf-8")
    again = load_vehicle(path)
    assert again.layout.voltage == pytest.approx(15.2, abs=0.01)
    assert again.rov["V_0_top"] == 16.0
    low, high = again.intervals["n_V_rear"]
    assert low < 1.5 < high < low + 0.05


def test_thrust_of_an_unknown_voltage_is_told() -> None:
    rov = VIDEORAY.extended({"V_0_rear": 15.2, "n_V_rear": 1.8, "V_0_top": 15.2, "n_V_top": 1.8})
    said = Requests(voltage=True, measured_at={"rear": 16.4})
    (line,) = sentences(on_voltage(rov, said))
    assert line.startswith("top thrust is taken as measured at 15.2 V, the mean voltage of the logs. ")
    assert 'V_0_top = { value = 16.0, unit = "V"' in line
    assert [*on_voltage(rov, replace(said, measured_at={"rear": 16.4, "top": 16.4}))] == []
    assert [*on_voltage(rov, Requests())] == [], "the vehicle file has them"


def test_a_log_without_the_column_is_refused_with_one_line(tmp_path: Path) -> None:
    folder = write(replace(SCENARIOS["sag"], rov_file="[fit]\nvoltage = true\n"), 0, tmp_path)
    with pytest.raises(VehicleFileError) as refused:
        load_tank_tests(folder)
    reason = "every log must have the column voltage [V], but there is none in log_0.csv, log_1.csv"
    assert str(refused.value) == f"{folder / 'rov.toml'}: fit.voltage: {reason}"


def test_the_voltage_is_that_of_the_recordings_unless_it_is_given() -> None:
    log = Recording(
        "a.csv", SURGE, "velocity", TIME, TIME, TIME, context={"voltage": np.linspace(16.0, 14.0, len(TIME))}
    )
    requests = Requests(voltage=True, measured_at={"top": 12.0})
    assert [*Voltage.candidates(Setting([log], VIDEORAY, requests=requests))] == [Voltage("rear", V_0=15.0, usual=15.0)]
    assert not [*Voltage.candidates(Setting([log], VIDEORAY))]
    assert voltage_at(log, np.array([-1.0, 30.0])) == pytest.approx([16.0, 15.0], abs=0.01)
    powered = with_effects(VIDEORAY, {Voltage("rear", V_0=12.0, usual=15.0): 2.0})
    assert powered.force(SURGE, 0.5) == pytest.approx((15.0 / 12.0) ** 2 * VIDEORAY.force(SURGE, 0.5))
    assert powered.force(HEAVE, 0.5) == VIDEORAY.force(HEAVE, 0.5)


def test_depth_and_heading_follow_the_measured_attitude() -> None:
    still, pitched = np.zeros(len(TIME)), np.full(len(TIME), 0.1)
    ahead = {"u": np.full((1, len(TIME)), 0.5), "z": np.full((1, len(TIME)), 2.0), "psi": np.full((1, len(TIME)), 1.0)}
    ahead |= {f"der({name})": np.zeros((1, len(TIME))) for name in ("z", "psi")}
    level = Attitude(TIME, still, still).turned(TIME, ahead, 0.0)
    assert level["z"] == pytest.approx(ahead["z"])
    bow_up = Attitude(TIME, still, pitched).turned(TIME, ahead, 0.0)
    assert bow_up["z"][0] == pytest.approx(2.0 - 0.5 * np.sin(0.1) * TIME)
    assert bow_up["der(z)"] == pytest.approx(-0.5 * np.sin(0.1))
    assert bow_up["psi"] == pytest.approx(ahead["psi"])
    turning = Attitude(TIME, still, pitched).turned(TIME, ahead | {"r": np.full((1, len(TIME)), 0.2)}, 0.0)
    assert turning["psi"][0] - 1.0 == pytest.approx(0.2 * (1.0 / np.cos(0.1) - 1.0) * TIME)


def test_the_net_weight_stays_vertical() -> None:
    down = Attitude(TIME, np.full(len(TIME), 0.2), np.full(len(TIME), -0.1)).weight(TIME[:1])
    force = np.array([down["X_ext"][0], down["Y_ext"][0], 1.0 + down["Z_ext"][0]])
    assert np.linalg.norm(force) == pytest.approx(1.0)
    assert force[0] == pytest.approx(np.sin(0.1))
    assert force[1] == pytest.approx(np.cos(0.1) * np.sin(0.2))
