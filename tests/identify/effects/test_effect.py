"""What every effect declares."""

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.effects.advance import Advance
from rov_fmu.identify.effects.attitude import Attitude
from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.effects.current import Current, CurrentEast, CurrentNorth
from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.effects.delay import Delay
from rov_fmu.identify.effects.effect import Effect, Setting, axis_of, delay_of, with_effects
from rov_fmu.identify.effects.lag import Lag
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.effects.reverse import ReverseDrag, ReverseThrust
from rov_fmu.identify.effects.voltage import Voltage, voltage_at
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, Axis
from rov_fmu.report.findings import acting, verdict
from rov_fmu.tank.description import Requests
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle

ROV = load_vehicle(SHIPPED["videoray"]).rov
TIME = np.linspace(0.0, 10.0, 100)


def recording(file: str, axis: Axis, **more: object) -> Recording:
    return Recording(file, axis, "velocity", TIME, np.ones(100), np.zeros(100), **more)  # type: ignore[arg-type]


SETTING = Setting(
    [recording("a.csv", SURGE), recording("b.csv", SURGE), recording("a.csv", HEAVE, beside={"psi": TIME})],
    ROV,
    known=["F_0_u"],
    requests=Requests(lag=("top",)),
)


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_effect_has_words_limits_and_a_start_within_them(kind: str) -> None:
    assert acting(FittedEffect(kind, "a.csv", "m/s", 0.1, None, kept=True))
    assert verdict(FittedEffect(kind, "a.csv", "1", 0.1, None, kept=False)) == f"left at {EFFECTS[kind].neutral:g}"
    for effect in EFFECTS[kind].candidates(SETTING):
        low, high = effect.bounds(SETTING)
        assert low <= effect.begin <= high
        assert effect.prior(SETTING) > 0.0


def test_candidates_are_those_that_are_neither_known_nor_in_the_vehicle() -> None:
    found = [effect for kind in EFFECTS.values() for effect in kind.candidates(SETTING)]
    assert Lag("top") in found
    assert Lag("rear") not in found
    assert {Load("heave"), Delay("surge"), Delay("b.csv", "surge"), DeadBand("rear")} <= {*found}
    assert not any(isinstance(effect, Load) and "surge" in (effect.of, effect.axis) for effect in found), "it is known"


def test_effects_of_different_kinds_differ() -> None:
    effects: list[Effect] = [Load("heave"), Load("heave"), Delay("heave")]
    assert len({*effects}) == 2


@pytest.mark.parametrize(
    ("effect", "value", "expected"),
    [
        (Load("heave"), 0.5, {"F_0_w": 0.5}),
        (Load("b.csv", "surge"), 0.5, {}),
        (Lag("rear"), 0.3, {"T_rear": 0.3}),
        (DeadBand("top"), 0.04, {"c_0_top": 0.04}),
        (ReverseThrust("top"), 0.5, {"a_t_top_reverse": 0.5 * ROV["a_t_top"], "b_t_top_reverse": 0.5 * ROV["b_t_top"]}),
    ],
)
def test_an_effect_of_the_vehicle_sets_its_coefficients(
    effect: Effect, value: float, expected: dict[str, float]
) -> None:
    added = with_effects(ROV, {effect: value}).coefficients
    assert {name: added[name] for name in added.keys() - ROV.coefficients.keys()} == expected


HEAVE_PUSH, PULL = ROV["alpha_w"] * (6.494 + 0.0513), 6.494 + 0.0513
SURGE_PUSH = ROV["alpha_u"] * (42.9 + 2.711)


@pytest.mark.parametrize(
    ("effect", "bound", "prior"),
    [
        (Load("heave"), 1.5 * HEAVE_PUSH, 0.2 * PULL),
        (Load("a.csv", "heave"), 1.5 * HEAVE_PUSH, 0.04 * PULL),
        (Load("surge"), 1.5 * SURGE_PUSH, 0.2 * (42.9 + 2.711)),
    ],
)
def test_a_load_is_at_most_one_and_a_half_times_the_strongest_thrust(
    effect: Effect, bound: float, prior: float
) -> None:
    assert effect.bounds(SETTING) == pytest.approx((-bound, bound))
    assert effect.prior(SETTING) == pytest.approx(prior)


def test_a_vehicle_without_thrust_may_have_any_load() -> None:
    still = Setting(SETTING.recordings, ROV.replaced({"a_t_top": 0.0, "b_t_top": 0.0}))
    assert Load("heave").bounds(still) == (-1.5e6, 1.5e6)


def test_the_usual_loss_by_advance_takes_all_thrust_at_two_metres_per_second() -> None:
    """The rear curve has two thrusters together; the loss is that of both."""
    assert Advance("rear").prior(SETTING) == pytest.approx(0.5 * (42.9 + 2.711))
    assert Advance("rear").bounds(SETTING) == pytest.approx((0.0, 5.0 * (42.9 + 2.711)))
    still = Setting(SETTING.recordings, ROV.replaced({"a_t_top": 0.0, "b_t_top": 0.0}))
    assert Advance("top").prior(still) == 0.5e-3


@pytest.mark.parametrize(
    ("effect", "value", "is_none"),
    [
        (Advance("rear"), 0.0, True),
        (Advance("rear"), 0.01, False),
        (DeadBand("rear"), 0.0, True),
        (DeadBand("rear"), 0.01, False),
        (Voltage("rear"), 1.0, True),
        (Voltage("rear"), 1.01, False),
        (Load("heave"), 0.0, False),
    ],
)
def test_values_that_stand_for_no_effect(effect: Effect, value: float, is_none: bool) -> None:
    assert effect.is_none(value) == is_none


def test_effects_of_single_files_and_less_likely_ones_are_dropped_first() -> None:
    ranks: dict[int, list[Effect]] = {
        0: [Load("a.csv", "heave"), Delay("a.csv", "surge")],
        1: [ReverseDrag("heave")],
        2: [Load("surge"), Load("sway")],
        3: [ReverseThrust("top")],
        4: [Current("a.csv", "surge"), CurrentNorth("a.csv"), CurrentEast("a.csv")],
        5: [DeadBand("top"), Advance("top")],
        6: [Load("heave"), Load("yaw")],
        7: [Lag("top")],
        8: [Delay("heave")],
        9: [Voltage("top")],
    }
    assert {rank: {effect.rank for effect in effects} for rank, effects in ranks.items()} == {n: {n} for n in ranks}


def test_many_effects_need_more_evidence() -> None:
    many = (Load("a.csv", "heave"), ReverseDrag("heave"), ReverseThrust("top"), DeadBand("top"), Advance("top"))
    few = (Load("heave"), Delay("heave"), Lag("top"), Voltage("top"), Current("a.csv", "surge"), CurrentNorth("a.csv"))
    assert all(effect.is_one_of_many for effect in many)
    assert not any(effect.is_one_of_many for effect in few)


def test_effects_concern_the_recordings_of_their_axis_or_file() -> None:
    a_surge, b_surge, a_heave = SETTING.recordings
    assert [Load("surge").concerns(r) for r in SETTING.recordings] == [True, True, False]
    assert [Load("a.csv", "surge").concerns(r) for r in SETTING.recordings] == [True, False, False]
    assert [CurrentNorth("a.csv").concerns(r) for r in SETTING.recordings] == [True, False, False], "not in heave"
    assert axis_of(Delay("heave"), SETTING.recordings) is HEAVE
    assert axis_of(Lag("top"), [a_heave, b_surge]) is HEAVE
    delays = {Delay("surge"): 0.3, Delay("b.csv", "surge"): 0.1, Load("surge"): 5.0}
    assert [delay_of(delays, r) for r in (a_surge, b_surge, a_heave)] == pytest.approx([0.3, 0.4, 0.0])


def test_the_delay_of_a_single_file_is_a_fifth_as_likely() -> None:
    assert Delay("heave").prior(SETTING) == 0.5
    assert Delay("a.csv", "heave").prior(SETTING) == pytest.approx(0.1)


def test_currents_are_north_and_east_where_a_heading_is_logged() -> None:
    psi = {"psi": TIME}
    recordings = [
        recording("a.csv", SURGE),
        recording("b.csv", SURGE, beside=psi),
        recording("b.csv", SWAY, beside=psi),
    ]
    setting = Setting([*recordings, recording("a.csv", HEAVE)], ROV)
    assert [*Current.candidates(setting)] == [Current("a.csv", "surge")]
    assert [*CurrentNorth.candidates(setting)] == [CurrentNorth("b.csv")]
    inputs = [e.input for e in (Current("a", "surge"), Current("a", "sway"), CurrentNorth("b"), CurrentEast("b"))]
    assert inputs == ["V_N", "V_E", "V_N", "V_E"]
    assert (Load("heave").input, Load("a.csv", "heave").input, Load("a.csv", "yaw").input) == ("", "Z_ext", "N_ext")


def test_a_voltage_is_the_given_one_or_the_mean_of_the_logs() -> None:
    values = [np.full(100, 15.0), np.where(TIME < 5.0, np.nan, 16.0003)]
    logs = [recording(f, SURGE, context={"voltage": v}) for f, v in zip(("a", "b"), values, strict=True)]
    mean = round((100 * 15.0 + 50 * 16.0003) / 150, 3)
    for given, V_0 in (({}, mean), ({"rear": 14.8}, 14.8)):
        setting = Setting(logs, ROV, requests=Requests(voltage=True, measured_at=given))
        assert [*Voltage.candidates(setting)] == [Voltage("rear", V_0=V_0, usual=mean)]
    assert [*Voltage.candidates(Setting(logs, ROV))] == []
    powered = Voltage("rear", V_0=14.8, usual=mean).added(ROV, 1.3)
    assert (powered.layout.voltage, powered["V_0_rear"], powered["n_V_rear"]) == (mean, 14.8, 1.3)
    assert voltage_at(logs[1], np.array([0.0, 7.5])) == pytest.approx([16.0003, 16.0003])


def test_the_weight_of_a_tilted_vehicle_acts_along_its_axes() -> None:
    """At a roll of 30° and a pitch of 20°, 1 N down is (-sin 20°, cos 20° sin 30°, cos 20° cos 30°) N of the body."""
    tilted = {"roll": np.full(100, np.radians(30.0)), "pitch": np.full(100, np.radians(20.0))}
    tilted["roll"][3] = tilted["pitch"][70] = np.nan
    attitude = Attitude.of(recording("a.csv", SURGE, context=tilted))
    assert len(attitude.time) == 98
    weight = attitude.weight(np.array([5.0]))
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    assert weight["X_ext"] == pytest.approx(-s)
    assert weight["Y_ext"] == pytest.approx(c * 0.5)
    assert weight["Z_ext"] == pytest.approx(c * np.sqrt(0.75) - 1.0)
    motion = {
        "u": np.full((1, 3), 1.0),
        "w": np.full((1, 3), 0.2),
        "z": np.zeros((1, 3)),
        "der(z)": np.full((1, 3), 0.2),
    }
    turned = attitude.turned(np.array([1.0, 2.0, 3.0]), motion, 0.1)
    rate = c * np.sqrt(0.75) * 0.2 - s
    assert turned["der(z)"] == pytest.approx(np.full((1, 3), rate))
    assert turned["z"] == pytest.approx((rate - 0.2) * np.array([[0.0, 1.0, 2.0]]))
    assert turned["der(theta)"] == pytest.approx(np.zeros((1, 3)), abs=1e-12)
    assert "psi" not in turned
    of_two = {name: np.repeat(values, 2, axis=0) for name, values in motion.items()}
    assert {
        name: v.shape for name, v in attitude.turned(np.array([1.0, 2.0, 3.0]), of_two, 0.1).items()
    } == dict.fromkeys(("phi", "theta", "der(phi)", "der(theta)", "z", "der(z)"), (2, 3))
