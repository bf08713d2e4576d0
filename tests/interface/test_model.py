"""The Python interface: what it returns, and one clear line for whatever cannot be."""

import sys
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import rov_fmu
from rov_fmu.build import build_fmu
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES
from rov_fmu.fmu.content import native_content
from rov_fmu.interface.arguments import duration_times
from rov_fmu.interface.model import VehicleModel
from rov_fmu.io.messages import FileError, InputError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import BY_HAND
from tests.vehicles import SIX, THRUST_EFFECTS, a_vehicle, pulsed

TIMES = [0.0, 1.0, 2.0]
AHEAD = {"u_l": 0.3, "u_r": 0.3}


@pytest.fixture(scope="module")
def videoray() -> VehicleModel:
    return rov_fmu.load("videoray")


@pytest.fixture(scope="module")
def six() -> VehicleModel:
    """Return a vehicle with six axes and every effect."""
    return VehicleModel(**vars(a_vehicle(SIX)))


# ---- Load and change -------------------------------------------------------------------------------------------------


def test_a_vehicle_is_loaded_by_its_name_or_path(videoray: VehicleModel) -> None:
    assert rov_fmu.load(str(SHIPPED["videoray"])) == rov_fmu.load(SHIPPED["videoray"]) == videoray
    assert repr(videoray) == "<VehicleModel videoray: VideoRay Pro 4; axes surge, heave, yaw; inputs u_l, u_r, u_t>"


def test_a_coefficient_that_is_set_by_hand_says_so(videoray: VehicleModel) -> None:
    changed = videoray.with_(a_d_u=10, beta_w=np.float64(0.5))
    assert (changed["a_d_u"], changed["beta_w"]) == (10.0, 0.5)
    assert {name for name, source in changed.sources.items() if source == BY_HAND} == {"a_d_u", "beta_w"}
    expected = "set by hand: a_d_u = 10 N.s2/m2, beta_w = 0.5"
    assert repr(changed).endswith(f"; {expected}>")
    described = native_content(changed).files["modelDescription.xml"].decode()
    assert f'description="{videoray.description} ({expected})"' in described
    assert videoray["a_d_u"] != 10.0
    assert "set by hand" not in videoray.summary


# ---- Simulate --------------------------------------------------------------------------------------------------------


def test_a_result_is_a_mapping_of_arrays(videoray: VehicleModel) -> None:
    result = videoray.simulate(TIMES, AHEAD)
    assert result.names == tuple(result) == tuple(result.keys())
    thrust, over_ground = ("F_l", "F_r", "F_t", "tau_rear"), ("vg_N", "vg_E", "vg_D")
    assert result.names == ("u", "w", "r", "x", "y", "z", "psi", *thrust, *over_ground)
    assert result["u"].shape == (3,)
    at_rest, inputs = (dict.fromkeys(names, 0.0) for names in (videoray.layout.state, videoray.layout.inputs))
    assert result["u"][-1] == pytest.approx(videoray.step({**inputs, **AHEAD}, at_rest, 2.0)["u"], rel=1e-12)
    assert result.units["r"] == "rad/s"
    assert repr(result) == f"<Result: 3 times from 0 to 2 s; {', '.join(result.names)}>"
    with pytest.raises(KeyError) as error:
        result["U"]
    assert str(error.value).endswith("; did you mean u?")
    assert result.get("U") is None


def test_a_data_frame_has_a_column_for_each_variable(videoray: VehicleModel, monkeypatch: pytest.MonkeyPatch) -> None:
    many = videoray.simulate_many(TIMES, AHEAD, coefficients={"a_d_u": [8.0, 10.0]})
    frame = many.to_dataframe()
    assert frame.columns.tolist() == list(many.names)
    assert frame["u"].tolist() == many["u"].ravel().tolist()
    assert frame.index[4] == (1, 1.0)
    assert videoray.simulate(TIMES, AHEAD).to_dataframe().index.name == "time"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"^to_dataframe\(\) needs pandas: pip install pandas$"):
        many.to_dataframe()


def test_the_equation_is_not_differentiated_again_for_other_numbers(
    videoray: VehicleModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The units belong to the layout: differentiating took 14 of 15 ms of a simulation of one second."""
    first = videoray.simulate([0.0, 1.0], {"surge": 0.3})
    monkeypatch.setattr("rov_fmu.fmu.variables.dependencies_of", None)
    second = videoray.with_(m_rov=7.0).simulate([0.0, 1.0], {"surge": 0.3})
    assert second.units == first.units
    assert second["u"][-1] != first["u"][-1]


def test_many_vehicles_are_each_like_one(videoray: VehicleModel) -> None:
    commands = np.array([[0.1, 0.5, 0.0], [-0.3, 0.3, 0.0]])
    inputs = {"u_l": commands, "u_r": [0.3, 0.4, 0.0], "u_t": [[0.1], [0.2]]}
    how: dict[str, Any] = {"start": {"u": [0.0, -0.4], "z": 2}, "coefficients": {"a_d_u": [6.0, 10.0]}}
    many = videoray.simulate_many(TIMES, inputs, **how)
    assert many["u"].shape == (2, 3)
    assert repr(many).startswith("<Result: 2 vehicles, 3 times from 0 to 2 s; u, ")
    assert videoray.simulate_many(TIMES, workers=1)["u"].shape == (1, 3)
    failed = videoray.simulate_many(TIMES, start={"u": [0.0, 1e200]})
    assert (failed.failed.tolist(), np.isnan(failed["u"]).tolist()) == ([1], [[False] * 3, [False, True, True]])
    assert repr(failed).startswith("<Result: 2 vehicles, 3 times from 0 to 2 s, 1 failed; u, ")
    lanes = videoray.simulate_many(TIMES, inputs, **how, lanes=True)
    for n, (drag, u) in enumerate(((6.0, 0.0), (10.0, -0.4))):
        own = inputs | {"u_l": commands[n], "u_t": (0.1, 0.2)[n]}
        one = videoray.with_(a_d_u=drag).simulate(TIMES, own, start={"u": u, "z": 2})
        for name, values in one.items():
            assert np.array_equal(values, many[name][n])
            np.testing.assert_allclose(lanes[name][n], values, rtol=1e-12, atol=1e-14)


def test_it_goes_on_with_its_lag_and_with_the_commands_that_act_whatever_was_recorded() -> None:
    late = rov_fmu.load(THRUST_EFFECTS)
    whole = late.simulate([0.0, 1.0, 1.05], {"u_l": [0.5, 0.3, 0.0]}, record="u")
    first = late.simulate([0.0, 1.0], {"u_l": 0.5}, record="u")
    assert first.final.keys() >= {"F_l", "delayed_u_l"}
    then = late.simulate([1.0, 1.05], {"u_l": 0.3}, start=first.final, record="u")
    assert then["u"].tolist() == whole["u"][1:].tolist()


def test_a_loop_of_steps_gives_the_results_of_one_simulation(six: VehicleModel) -> None:
    """The first vehicle turns several times, and the commands of the second one wait."""
    times, values = 0.07 * np.arange(60), 0.6 * np.sin(np.arange(60.0))
    cases: dict[str, tuple[VehicleModel, dict[str, float]]] = {
        "K_ext": (six, {"N_ext": 60.0}),
        "u_l": (rov_fmu.load(THRUST_EFFECTS), {"V_N": 0.1}),
    }
    for name, (vehicle, held) in cases.items():
        run = vehicle.simulate(times, {name: values, **held}, start={"x": 1.0})
        stepper = vehicle.stepper(start={"x": 1.0}, inputs=held)
        assert stepper.now == {name: run[name][0] for name in run.names}
        for n, h in enumerate(np.diff(times).tolist()):
            assert stepper.step({name: values[n], **held}, h) == stepper.now
            for state in (*vehicle.layout.state, *vehicle.layout.continued):
                assert stepper.now[state] == run[state][n + 1], (state, n)
            if n == 30:
                assert deepcopy(stepper).step({}, 1.0) != stepper.now
        assert stepper.time == pytest.approx(times[-1])
        assert vehicle is not six or np.ptp(run["psi"]) > 7.0


def test_a_vehicle_that_rolls_starts_at_its_angles_or_at_its_quaternion(six: VehicleModel) -> None:
    angles = {"phi_0": 0.3, "theta_0": -0.7, "psi_0": 9.0}
    first = six.simulate([0.0, 1.0], {"N_ext": 5.0}, start={**angles, "p": 0.5})
    assert [first[name][0] for name in ("phi", "theta", "psi")] == pytest.approx([0.3, -0.7, 9.0], abs=1e-15)
    for scale, psi in ((1.0, 9.0), (0.5, 6.5)):  # of any length, and in the same turn
        start = {name: scale * first[name][0] for name in QUATERNION} | {"psi_0": psi, "p": 0.5}
        again = six.simulate([0.0, 1.0], {"N_ext": 5.0}, start=start)
        for name in ("p", "phi", "psi", "z"):
            assert again[name] == pytest.approx(first[name], rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("make", [dict, pd.DataFrame])
def test_inputs_have_times_of_their_own(videoray: VehicleModel, make: Callable[[Any], Any]) -> None:
    """They change between the output times, and are 0 before the first of their own; the last of equal times counts."""
    table = make({"time": [0.5, 1.25, 1.25, 9.0], "u_l": [0.3, 7.0, 0.5, 1.0], "u_r": [0.3, 0.3, 0.2, 1.0]})
    table["heave"], table["V_E"] = np.array([0.3, 0.0, -0.4, 0.0]), 0.0
    found = videoray.simulate(TIMES, table, record=["u", "w", "psi", "u_l"])
    held = {"u_l": [0, 0.3, 0.3, 0.5, 0], "u_r": [0, 0.3, 0.3, 0.2, 0], "u_t": [0, 0.3, 0.3, -0.4, 0]}
    every = videoray.simulate([0.0, 0.5, 1.0, 1.25, 2.0], held)
    for name in ("u", "w", "psi"):
        assert found[name].tolist() == every[name][[0, 2, 4]].tolist()
    assert found["u_l"].tolist() == [0.0, 0.3, 0.5]
    assert videoray.simulate(TIMES, {"time": [1.0], "u_l": [0.3]}, record="u_l")["u_l"].tolist() == [0.0, 0.3, 0.3]


def test_a_function_of_time_is_held_at_the_middle_of_each_step(videoray: VehicleModel) -> None:
    found = videoray.simulate(TIMES, {"u_l": lambda t: 0.1 * t, "u_r": 0.3}, record="u")
    expected = videoray.simulate(TIMES, {"u_l": 0.1 * np.array([0.5, 1.5, 2.0]), "u_r": 0.3}, record="u")
    assert found.names == ("u",)
    assert found["u"].tolist() == expected["u"].tolist()


def test_a_command_beyond_full_saturates_with_a_warning(videoray: VehicleModel) -> None:
    with pytest.warns(UserWarning, match=r"^u_l reaches -2, which acts as -1: commands saturate at ±1$") as caught:
        found = videoray.simulate(TIMES, {"u_l": [-2.0, 0.0, 1.2]})
    assert caught[0].filename == __file__
    percent = r"^u_t reaches 2\.5, which acts as 1: commands saturate at ±1 \(30 % is 0\.3\)$"
    with pytest.warns(UserWarning, match=percent):
        videoray.simulate(TIMES, {"heave": 2.5})
    assert found["u"].tolist() == videoray.simulate(TIMES, {"u_l": [-1.0, 0.0, 1.0]})["u"].tolist()


def test_a_stepper_tells_once_that_a_command_saturates(videoray: VehicleModel) -> None:
    stepper = videoray.stepper()
    with pytest.warns(UserWarning, match=r"^u_l reaches -2, which acts as -1: commands saturate at ±1$") as caught:
        speeds = [stepper.step({"u_l": command}, 0.1)["u"] for command in (-2.0, 0.5, -3.0)]
    assert len(caught) == 1
    assert speeds[0] < speeds[1]


def test_a_pulse_of_zero_is_no_signal_and_acts_as_neutral_with_a_warning(videoray: VehicleModel) -> None:
    pulses = pulsed(videoray, (1000.0, 1500.0, 2000.0))
    expected = "^u_l reaches 0: commands are pulse widths, and a pulse of 0 means that there is no signal: it acts as"
    with pytest.warns(UserWarning, match=expected) as caught:
        found = pulses.simulate(TIMES, {"u_l": [1250.0, 0.0, 2000.0]})
    assert len(caught) == 1
    assert found["u"].tolist() == videoray.simulate(TIMES, {"u_l": [-0.5, 0.0, 1.0]})["u"].tolist()
    beyond = r"^u_l reaches 900: commands are pulse widths, and saturate at 1000 and 2000 us$"
    with pytest.warns(UserWarning, match=beyond):
        pulses.simulate(TIMES, {"u_l": [1500.0, 900.0, 2050.0]})


# ---- Mistakes --------------------------------------------------------------------------------------------------------

Call = Callable[[VehicleModel], object]
WRONG: dict[str, tuple[Call, str]] = {
    "no name": (lambda _: rov_fmu.load(5), "vehicle = 5: must be the name of a vehicle"),  # type: ignore[arg-type]
    "no variable for a plot": (lambda v: v.simulate(TIMES).plot([]), "names: must name a variable$"),
    "time stands": (lambda v: v.simulate([0, 1, 1]), r"time\[2\] = 1: must be greater than the time before it, 1"),
    "one time": (lambda v: v.simulate([1]), r"time: must be a sequence of 2 or more times \(s\), .* the shape \(1,\)$"),
    "no names": (
        lambda v: v.simulate(TIMES, 5),  # type: ignore[arg-type]
        "inputs = 5: must be a mapping from names to values, or a data frame$",
    ),
    "too few values": (
        lambda v: v.simulate(TIMES, {"u_l": [0, 1]}),
        r"inputs\['u_l'\]: must be a number, or .* of the shape \(3,\), one value for each time, and has .* \(2,\)$",
    ),
    "two starts of an attitude": (
        lambda _: rov_fmu.load("bluerov2_heavy").simulate(TIMES, start={"eta": 1, "phi_0": 1, "psi_0": 1}),
        r"start\['phi_0'\]: the attitude is also given as a quaternion\. Give only one of the two$",
    ),
    "no attitude": (
        lambda _: rov_fmu.load("bluerov2_heavy").simulate(TIMES, start=dict.fromkeys(QUATERNION, 0)),
        "start: the quaternion eta, epsilon_1, epsilon_2, epsilon_3 is 0 and has no direction$",
    ),
    "one of many out of bounds": (
        lambda v: v.simulate_many(TIMES, coefficients={"a_d_u": [1, -1, 2e6]}),
        r"coefficients\['a_d_u'\] = -1: must be within 0 \.\.\. 1000000 N\.s2/m2$",
    ),
    "no vehicles": (
        lambda v: v.simulate_many(TIMES, coefficients={"a_d_u": []}),
        "a_d_u: has values for 0 vehicles",
    ),
    "a step of no length": (lambda v: v.step({}, {}, 0.0), r"h = 0\.0: must be a time above 0, s$"),
    "a stepper that is too fast": (
        lambda v: v.stepper(start={"u": 1e200}).step({}, 2.0),
        r"the motion cannot be computed from 0 s on: it overflows, .* and needs shorter steps than 2 s$",
    ),
    "times in words": (lambda v: v.simulate(["a"]), r"time = \['a'\]: must be a number, or an array of numbers"),
    "unknown input": (
        lambda v: v.simulate(TIMES, {"ul": 1}),
        r"inputs\['ul'\]: .* no such input, .*; did you mean u_l?",
    ),
    "a value is missing": (
        lambda v: v.simulate(TIMES, {"u_l": [0, None, 1]}),
        r"inputs\['u_l'\]\[1\] = nan: must be a finite",
    ),
    "an axis and its thruster": (
        lambda v: v.simulate(TIMES, {"surge": 0.3, "u_l": 0.1}),
        r"inputs\['u_l'\]: surge drives this input, too$",
    ),
    "own times fall": (
        lambda v: v.simulate(TIMES, {"time": [0, 2, 1], "u_l": [0, 0, 0]}),
        r"inputs\['time'\]\[2\] = 1: must not be less than the time before it, 2",
    ),
    "an input at the start": (
        lambda v: v.simulate(TIMES, start={"u_l": 1}),
        r"start\['u_l'\]: .* no such state, only u, w",
    ),
    "two starts": (lambda v: v.simulate(TIMES, start={"u": [1, 2]}), r"start\['u'\]: must be one number, .* \(2,\)"),
    "unknown record": (
        lambda v: v.simulate(TIMES, record=["U"]),
        "record: the vehicle has no variable 'U', only u_l, u_r, u_t, X_ext, .*, 9 more; did you mean u",
    ),
    "too fast": (
        lambda v: v.simulate([1, 2, 3], start={"u": 1e200}),
        r"the motion cannot be .* to time\[1\] = 2 s: it overflows, .* and needs shorter steps than 1 s$",
    ),
    "unequal numbers": (
        lambda v: v.simulate_many(TIMES, {"u_l": [[1], [0.5]]}, coefficients={"a_d_u": [1, 2, 3]}),
        "a_d_u: has values for 3 vehicles, but u_l has values for 2",
    ),
    "response of an unknown axis": (lambda v: v.response("sway", 0.3), "axis = 'sway': .* only surge, heave, yaw"),
    "no workers": (lambda v: v.simulate_many(TIMES, workers=0), "workers = 0: must be a whole number from 1 to 1024"),
    "per vehicle and not per time": (
        lambda v: v.simulate_many(TIMES, {"u_l": np.full(1000, 0.1)}),
        r"inputs\['u_l'\]: .* or \(vehicles, 1\), or \(vehicles, 3\), and has the shape \(1000,\)",
    ),
    "too large": (
        lambda v: v.simulate_many(np.arange(1e6), coefficients={"a_d_u": np.full(1_000_000, 1.0)}),
        "time, record: the result needs 1.12e.05 GB, which is more than the available memory",
    ),
}


def test_a_vehicle_that_turns_over_brings_a_warning() -> None:
    heavy, ahead = rov_fmu.load("bluerov2_heavy"), {"u_1": -0.3, "u_2": -0.3, "u_3": 0.3, "u_4": 0.3}
    times, deep = np.linspace(0.0, 3.0, 301), {"z": 10.0}
    with pytest.warns(UserWarning, match=r"^BlueROV2 Heavy turns over at 1\.87 s: nothing holds it level") as caught:
        found = heavy.simulate(times, ahead, start=deep, record="u")
    assert (found.names, len(caught), caught[0].filename) == (("u",), 1, __file__)
    many = {name: np.array([[x], [0.0]]) for name, x in ahead.items()}
    with pytest.warns(UserWarning, match="turns over at 1"):
        heavy.simulate_many(times, many, start=deep, record="u")
    heavy.simulate(times, {name: 0.5 * x for name, x in ahead.items()})  # tilts
    heavy.simulate(times, start={"phi_0": 3.0})  # begins on its back


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_one_line(case: str, videoray: VehicleModel) -> None:
    call, expected = WRONG[case]
    with pytest.raises((InputError, FileError), match=f"^{expected}") as error:
        call(videoray)
    assert isinstance(error.value, ValueError)
    assert "\n" not in str(error.value)


def test_a_vehicle_that_cannot_be_is_neither_built_nor_simulated(videoray: VehicleModel, tmp_path: Path) -> None:
    """However it came about."""
    for name, value in (("a_du", 1.0), ("a_d_u", float("nan"))):
        wrong = replace(videoray, coefficients={**videoray.coefficients, name: value})
        for action in (lambda v: build_fmu(v, tmp_path / "x.fmu"), lambda v: v.simulate(TIMES)):
            with pytest.raises(InputError, match=rf"^{name}( = nan)?: "):
                action(wrong)
    with pytest.raises(ValueError, match=r"^there is no backend 'nativ', only native, pythonfmu$"):
        build_fmu(videoray, tmp_path / "x.fmu", backend="nativ")
    assert not list(tmp_path.iterdir())


# ---- Commands along axes, and durations ------------------------------------------------------------------------------


def test_a_command_along_an_axis_is_that_of_its_thrusters(videoray: VehicleModel) -> None:
    times = np.array(TIMES)
    expected = videoray.simulate(times, {"u_l": 0.3 + 0.1, "u_r": 0.3 - 0.1, "u_t": 0.02 * times})
    result = videoray.simulate(times, {"surge": 0.3, "yaw": 0.1, "heave": 0.02 * times})
    assert all(np.array_equal(result[name], expected[name]) for name in result)


def test_a_step_takes_the_inputs_of_a_simulation(videoray: VehicleModel) -> None:
    after = videoray.step({"surge": 0.3}, {"z": 2.0}, 1.0)
    run = videoray.simulate([0.0, 1.0], {"surge": 0.3}, start={"z": 2.0})
    assert after == pytest.approx({name: run[name][-1] for name in after}, rel=1e-12, abs=1e-12)
    assert videoray.derivatives({"surge": 0.3}, {})["u"] == pytest.approx(
        videoray.derivatives(AHEAD, videoray.layout.at_rest)["u"], rel=1e-15
    )
    assert videoray.response("surge", 0.3) == videoray.response(AXES["surge"], 0.3)


def test_a_duration_gives_a_result_every_hundredth_of_a_second(videoray: VehicleModel) -> None:
    result = videoray.simulate(2, {"surge": 0.3})
    assert np.array_equal(result.time, np.round(0.01 * np.arange(201), 12))
    at_once = videoray.simulate([0.0, 2.0], {"surge": 0.3})["u"][-1]
    assert result["u"][-1] == pytest.approx(at_once, rel=1e-14)
    assert videoray.simulate(0.01).time.tolist() == [0.0, 0.01]
    assert videoray.simulate(0.025).time.tolist() == [0.0, 0.01, 0.02, 0.025]
    assert len(duration_times(1e4)) == 1_000_001
    for wrong in (0.0, -1.0, 10000.01):
        with pytest.raises(InputError, match=r"^time = .*: a duration must be within 0\.01 \.\.\. 10000 s"):
            videoray.simulate(wrong)
