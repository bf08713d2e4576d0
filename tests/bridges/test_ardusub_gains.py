"""The gains of ArduSub: the rule by hand, what the real ArduSub showed, and flights by the stand-in over the protocol.

The figures of the real ArduSub are those of flights in ALT_HOLD of its simulator, with steps of depth and heading.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.autopilot.ardusub import FIRMWARE, ROWS, Leg, fly
from rov_fmu.bridges.ardusub.files import flight_table, gains_files
from rov_fmu.bridges.ardusub.gains import LEGS, Tuned, figures, read_gains, tuned
from rov_fmu.c.simulation import Array
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.io.messages import FileError, InputError
from rov_fmu.vehicle.description import Provenance
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.bridges.ardusub import ArduSub
from tests.bridges.test_sitl import served, setup_of
from tests.often import spread
from tests.vehicles import FINNED, with_intervals
from verification.references.autopilot.ardusub import VECTORED, VECTORED_6DOF, Hold

SIX, HEAVY, VIDEORAY = (load_vehicle(SHIPPED[name]) for name in ("bluerov2", "bluerov2_heavy", "videoray"))
UNPLACED = tuple(
    replace(one, name=name, position=None) for one, name in zip(SIX.layout.thrusters, "abcdef", strict=True)
)
"""The thrusters of the BlueROV2 without their places, and without the names of motors."""
STEPS = (Leg(SURGE, 0.0, 0.1), Leg(HEAVE, 0.5, 3.0), Leg(YAW, radians(30.0), 1.5))
AHEAD = (Leg(SURGE, 0.0, 0.1), Leg(YAW, 0.2, 3.5), Leg(SURGE, 0.5, 3.5))
_THRUST = ("a_t_t200", "b_t_t200", "a_t_t200_reverse", "b_t_t200_reverse", "c_0_t200", "T_t200")
GREBE = SIX.with_(
    **dict(zip(_THRUST, (36.0, 17.0, 30.5, 13.0, 0.065, 0.11), strict=True)),
    **{"m_rov": 13.1, "m_a_w": 19.0, "a_d_w": 92.0, "b_d_w": 11.0},
    **{"I_r": 0.23, "m_a_r": 0.12, "a_d_r": 1.15, "b_d_r": 0.22},
)
"""A vehicle like one that the real ArduSub flew, with more lag and a wider dead band than the BlueROV2."""
IDENTIFIED = SIX.with_(
    **dict(zip(_THRUST, (39.64, 16.77, 30.81, 14.43, 0.0649, 0.0824), strict=True)),
    **{"beta_w": 0.776, "a_d_w": 90.0, "b_d_w": 11.0, "beta_r": 0.749, "a_d_r": 1.05, "b_d_r": 0.2},
)
"""What `identify` made of a flight of that vehicle by the real ArduSub, from the numbers of a BlueROV2."""
FLOWN = {
    "bluerov2_heavy": (HEAVY, {"PSC_ACCZ_P": 1.2, "PSC_ACCZ_I": 1.56}),
    "grebe": (GREBE, {"PSC_ACCZ_P": 3.22, "PSC_ACCZ_I": 4.18, "PSC_ACCZ_FF": 0.805}),
    "identified": (IDENTIFIED, {"PSC_ACCZ_P": 3.22, "PSC_ACCZ_FF": 0.805}),
}
"""Vehicles with the gains of depth with which the real ArduSub flew them, or the vehicle that they are like. Its
gains of yaw had no margin for 15 ms."""


@pytest.fixture
def without_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains.fly", lambda *_: iter(()))
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains._DELAYS", ())


@pytest.fixture
def ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains.LEGS", AHEAD)


def values_of(found: Tuned) -> dict[str, float]:
    return {name: value for name, (value, _) in found.gains.items()}


# ---- The rule --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("without_flight")
@pytest.mark.parametrize("name", FLOWN)
def test_the_gains_are_within_30_percent_of_those_that_the_real_ardusub_flew(name: str) -> None:
    vehicle, flown = FLOWN[name]
    found = values_of(tuned(vehicle))
    assert {gain: found[gain] for gain in flown} == pytest.approx(flown, rel=0.3)
    assert (found["PSC_POSZ_P"], found["PSC_VELZ_P"]) == (2.0, 8.0)
    assert {*found} == {gain for gain in FIRMWARE for axis in vehicle.layout.bare_axes if ROWS.get(axis, "-") in gain}


@pytest.mark.usefixtures("without_flight")
def test_the_rule_by_hand() -> None:
    """Four thrusters with an arm of 0.1888 m, two ahead and two astern, make 5.4556 N.m at 30 %; J is 0.28 kg.m2.

    Without flights, the ratio and the integrator of the heading are the first of those to choose from.
    """
    found = values_of(tuned(SIX.with_(T_t200=0.2)))
    p = 9.0 * 0.28 / (5.4556 / 0.3)
    expected = {"ATC_RAT_YAW_P": p, "ATC_RAT_YAW_I": 0.3 * p, "ATC_RAT_YAW_D": 0.1 * p, "ATC_ANG_YAW_P": 6.0}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-4)
    p = 0.8 * 26.07 / (0.2 * 16.0643 / 0.3)
    expected = {"PSC_ACCZ_P": p, "PSC_ACCZ_I": 1.3 * p, "PSC_ACCZ_D": 0.0, "PSC_ACCZ_FF": 0.25 * p}
    expected |= {"PSC_VELZ_P": 4.4, "PSC_POSZ_P": 1.1}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-4)
    late = SIX.with_(replace(SIX.layout, has_dead_time=True)).with_(T_d=0.15, T_t200=0.1)
    found = values_of(tuned(late))
    assert found["PSC_VELZ_P"] == pytest.approx(0.88 / 0.25)
    assert found["ATC_ANG_YAW_P"] == pytest.approx(0.585 / (1.3 / 0.7 * 0.185) / 1.5)
    tilt = values_of(tuned(HEAVY))
    assert tilt["ATC_ANG_RLL_P"] == pytest.approx(9.0 / 2.5)
    assert tilt["ATC_RAT_PIT_I"] == pytest.approx(0.5 * tilt["ATC_RAT_PIT_P"])


def identified(**intervals: tuple[float, float]) -> Vehicle:
    """Return the BlueROV2 as if it had been identified, with good verdicts."""
    return with_intervals(judged("good"), intervals)


@pytest.mark.usefixtures("without_flight")
@pytest.mark.parametrize(
    ("half", "margin"),
    [(0.02, 1.2), (0.25, 1.27), (0.5, 1.66)],
)
def test_the_margin_is_that_of_the_intervals_of_an_identified_vehicle(half: float, margin: float) -> None:
    """The acceleration per command follows beta_r: the end of 97.5 % of its interval, and at least 20 %."""
    beta = SIX["beta_r"]
    rov = identified(beta_r=((1.0 - half) * beta, (1.0 + half) * beta))
    (told,) = re.findall(r"yaw ([\d.]+) times", " ".join(tuned(rov).notes))
    assert float(told) == pytest.approx(margin, abs=0.08)
    by_hand = with_intervals(SIX, {"beta_r": (0.9 * beta, 1.1 * beta)})
    assert "yaw 1.86 times" in " ".join(tuned(by_hand).notes), "one interval tells nothing of the thrust"
    assert values_of(tuned(rov))["ATC_ANG_YAW_P"] == pytest.approx(0.585 / (float(told) * 0.035) / 1.5, rel=0.01)


@pytest.mark.usefixtures("without_flight")
def test_gains_for_a_lag_that_is_not_known_are_for_the_middle_of_its_interval() -> None:
    rov = identified(T_t200=(0.001, 0.113))
    found = tuned(rov)
    assert found.gains["ATC_RAT_YAW_D"][0] == pytest.approx(0.5 * 0.057 * found.gains["ATC_RAT_YAW_P"][0])
    assert any("the lag of t200 thrust is not known (0.001 to 0.11 s)" in note for note in found.notes)
    assert "the gains are for a lag of 0.057 s" in found.notes


@pytest.mark.usefixtures("without_flight")
def test_the_scale_of_an_assumed_thrust_cancels() -> None:
    """A log without a measured force gives thrust, mass and inertia in the same unknown unit."""
    scaled = [*_THRUST[:4], "m_rov", "I_p", "I_q", "I_r", *(f"m_a_{velocity}" for velocity in "uvwpqr")]
    other = HEAVY.with_(**{name: 1.7 * HEAVY[name] for name in scaled})
    assert values_of(tuned(other)) == pytest.approx(values_of(tuned(HEAVY)), rel=1e-12)


def judged(word: str) -> Vehicle:
    """Return the BlueROV2 with a verdict of yaw, and a good one of the other axes."""
    words = dict.fromkeys((axis.name for axis in SIX.layout.bare_axes), "good") | {"yaw": word}
    verdicts = tuple(f"{axis}: {word}." for axis, word in words.items() if word)
    return replace(SIX, provenance=Provenance(tool="T", method="T", inputs={}, verdicts=verdicts))


def without_lag() -> Vehicle:
    return SIX.with_(SIX.layout.with_keys(lambda part, key: key in part.keys and key != "T"))


LEFT_OUT = "left out, so that it keeps its gains: {}"
NO_LAG = "curve {} has no lag T, which limits how fast the loop may be"
VERDICT = LEFT_OUT.format("the verdict is {}")
SENTENCES: dict[str, tuple[Callable[[], Vehicle], dict[str, str]]] = {
    "good": (lambda: judged("usable"), {}),
    "do not use": (lambda: judged("do not use"), {"yaw": VERDICT.format("do not use")}),
    "not identified": (lambda: judged("not identified"), {"yaw": VERDICT.format("not identified")}),
    "without a verdict": (lambda: judged(""), {"yaw": VERDICT.format("not identified")}),
}


@pytest.mark.usefixtures("without_flight")
@pytest.mark.parametrize("name", SENTENCES)
def test_an_axis_without_what_the_rule_needs_is_left_out_with_a_sentence(name: str) -> None:
    """A parameter that is not in the file keeps what its owner has set."""
    vehicle, sentences = SENTENCES[name]
    found = tuned(vehicle())
    assert [note for note in found.notes[:-1] if note != found.vehicle.caution] == [
        f"{axis}: {words}" for axis, words in sentences.items()
    ]
    named = {axis.name for axis, of in ROWS.items() if any(of in name for name in found.gains)}
    assert named == {"heave", "yaw"} - sentences.keys()


@pytest.mark.parametrize(
    ("vehicle", "reasons"),
    [
        (VIDEORAY, {"yaw": NO_LAG.format("rear"), "heave": NO_LAG.format("top")}),
        (without_lag(), dict.fromkeys(("yaw", "heave"), NO_LAG.format("t200"))),
        (SIX.with_(c_0_t200=0.4), dict.fromkeys(("yaw", "heave"), "a demand of 30 % gives no thrust")),
    ],
)
def test_without_any_gains_there_is_nothing_to_load(vehicle: Vehicle, reasons: dict[str, str]) -> None:
    words = " and ".join(f"{axis}: {reason}" for axis, reason in reasons.items())
    with pytest.raises(InputError, match=f"^{vehicle.identifier}: there are no gains to load: {re.escape(words)}$"):
        tuned(vehicle)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"fins": FINNED.layout.fins}, "no frame of ArduSub has a motor for each of u_1, u_2, .*u_plane, and no other"),
        (
            {"thrusters": SIX.layout.thrusters[:5]},
            "no frame of ArduSub has a motor for each of u_1, .* and u_5, and no",
        ),
        ({"thrusters": UNPLACED}, "which motors of vectored drive which thrusters is open: write the positions"),
    ],
)
def test_a_vehicle_that_no_frame_of_ardusub_drives_is_one_line(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"^bluerov2: {message}[^\n]*$"):
        tuned(replace(SIX, layout=replace(SIX.layout, **changed)))


@pytest.mark.parametrize("axes", spread([(HEAVE,), (YAW,), (SURGE, HEAVE)], [(SURGE, HEAVE)]))
def test_a_vehicle_has_the_gains_and_the_legs_of_its_axes(
    axes: tuple[Axis, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other gains are those of the whole vehicle: the rule takes each axis for itself."""
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains._flaws", lambda *_: {})
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains._compared", lambda *_: {})
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains.LEGS", tuple(replace(leg, seconds=0.05) for leg in STEPS))
    forms = tuple(form for form in SIX.layout.axes if form.axis in axes)
    few = SIX.with_(replace(SIX.layout, axes=forms, surface=False))
    found, whole = tuned(few), values_of(tuned(SIX))
    assert values_of(found) == {n: x for n, x in whole.items() if any(ROWS.get(axis, "-") in n for axis in axes)}
    assert [leg.leg.axis for leg in found.legs] == [SURGE, *(leg.axis for leg in STEPS[1:] if leg.axis in axes)]
    assert str(gains_files(found)["steps.csv"]).count("\n") == len(found.legs)


# ---- The check -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def six() -> Tuned:
    return tuned(SIX)


def test_gains_of_an_axis_that_do_not_win_are_left_out_and_the_table_says_by_what(six: Tuned) -> None:
    """The real ArduSub, too, overshot more with a heading of such gains of a BlueROV2, and less in depth."""
    assert {name.partition("_")[0] for name in six.gains} == {"PSC"}
    over, settled, rest = six.compared[YAW]
    assert over > 1.1
    assert 1.0 > settled > rest
    assert six.compared[HEAVE].max() < 0.5
    (note,) = [note for note in six.notes if note.startswith("yaw: ")]
    words = f"{over:.0%} of the overshoot, {settled:.0%} of the settling time and {rest:.0%} of the error at rest"
    assert (
        note
        == f"yaw: {LEFT_OUT.format(f'with them it would have {words} that it has with the firmware{chr(39)}s gains')}"
    )
    shown = flight_table(six)
    rows = [*zip(*(column.cells for column in shown.columns), strict=True)]
    assert rows[-1] == (
        "yaw, also 20 ms later: of the firmware's",
        *(f"{x:.0%}" for x in six.compared[YAW]),
        "left out",
    )
    assert rows[-2][-1] == "written"
    headings = [row for row in rows if str(row[0]).startswith("heading")]
    assert all(before == after for row in headings for before, after in [str(row[2]).split(" → ")])


def test_the_gains_that_the_owner_has_are_what_is_to_be_beaten(six: Tuned, tmp_path: Path) -> None:
    """Against themselves, gains win nothing."""
    path = tmp_path / "own.param"
    path.write_text("".join(f"{name} {value}\n" for name, value in values_of(six).items()), "utf-8")
    words = "heave: with them it would have 100% of the overshoot, 100% of the settling time and 100% of the error at"
    with pytest.raises(
        InputError, match=f"there are no gains to load: yaw: .* your gains and {words} rest .* your gains$"
    ):
        tuned(SIX, path)
    path.write_text("PSC_ACCZ_P 0.5\n", "utf-8")
    found = tuned(SIX, path)
    assert {name: found.compared[HEAVE][n] for n, name in enumerate("osr")} == pytest.approx(
        {name: six.compared[HEAVE][n] for n, name in enumerate("osr")}
    )
    assert str(gains_files(found)["steps.csv"]).startswith("leg,unit,overshoot (your),overshoot (these)")


REAL = {
    "bluerov2": (SIX, {(10.5, 1.5): (10.5, 5.3), (14.0, 2.0): (6.9, 4.2)}, 0.0),
    "bluerov2, 20 ms": (SIX, {(12.0, 1.5): (8.6, 4.5), (9.0, 1.5): (13.1, 6.7), (11.0, 2.0): (10.6, 5.8)}, 0.02),
    "bluerov2_heavy": (HEAVY, {(12.0, 1.5): (2.9, 1.7), (7.2, 1.2): (6.7, 6.1)}, 0.0),
    "bluerov2_heavy, 20 ms": (HEAVY, {(9.0, 1.5): (5.6, 6.4), (11.0, 2.0): (3.6, 4.8)}, 0.02),
}
"""Of flights of the real ArduSub: by k_v (1/s) and ratio, with 0.3/s of P as the integrator, the overshoot of a heading
(deg), and when it was settled (s) in turns by -30, 90 and -90 degrees; the dead time of the vehicle."""


@pytest.mark.parametrize("name", spread(REAL, ["bluerov2", "bluerov2_heavy"], [*REAL]))
def test_the_check_flight_predicts_the_real_ardusub(name: str) -> None:
    """Within 1 degree and 1.2 s. It flew with little more than the dead time."""
    vehicle, flights, dead = REAL[name]
    whole = values_of(tuned_without_flight(vehicle))
    p = [k_v * whole["ATC_RAT_YAW_P"] / (1.5 * whole["ATC_ANG_YAW_P"]) for k_v, _ in flights]
    gains: dict[str, Any] = {name: np.full(len(p), value) for name, value in whole.items()}
    gains |= {f"ATC_RAT_YAW_{key}": np.array(p) * part for key, part in (("P", 1.0), ("I", 0.3))}
    gains["ATC_RAT_YAW_D"] *= np.array(p) / whole["ATC_RAT_YAW_P"]
    gains["ATC_ANG_YAW_P"] = np.array([k_v / ratio for k_v, ratio in flights])
    legs = [leg for leg in LEGS[:-1] if leg.axis in (SURGE, HEAVE, YAW)]
    flown = [*fly(vehicle, gains, legs, [{}] * len(p), 0.0, [0.005 + dead] * len(p))]
    turns = [cells for axis, _, _, cells in figures(vehicle, flown) if axis is YAW][1:]
    over = np.max([cells[0] for cells in turns], axis=0)
    settled = np.mean([np.minimum(cells[1], 8.0) for cells in turns], axis=0)
    expected = np.array([*flights.values()])
    assert over == pytest.approx(expected[:, 0], abs=1.0)
    assert settled == pytest.approx(expected[:, 1], abs=1.2)


def tuned_without_flight(vehicle: Vehicle) -> Tuned:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rov_fmu.bridges.ardusub.gains.fly", lambda *_: iter(()))
        patch.setattr("rov_fmu.bridges.ardusub.gains._DELAYS", ())
        return tuned(vehicle)


def chatter(vehicle: Vehicle, gains: Mapping[str, float]) -> Array:
    """Return the changes of the demands of ArduSub in the last second: of a turn, and ahead."""
    legs = [*fly(vehicle, gains, AHEAD)][1:]
    return np.array([np.abs(np.diff(leg.demands[-400:, 2, 0])).sum() for leg in legs])


@pytest.mark.usefixtures("without_flight")
def test_gains_that_are_too_high_chatter_ahead_and_hardly_in_a_turn_as_with_the_real_ardusub() -> None:
    """It flew a vehicle with a lag of 0.11 s with gains for k_v = 25/s, and with about twice as much:
    6 changes of the command a second ahead, and 0.7 in steps."""
    p = 25.0 / 9.0 * values_of(tuned(GREBE))["ATC_RAT_YAW_P"]
    ratios = {"P": 1.0, "I": 0.15, "D": 0.15 * 0.11}
    gains, others = (
        {"ATC_ANG_YAW_P": 5.0, **{f"ATC_RAT_YAW_{key}": ratio * factor * p for key, ratio in ratios.items()}}
        for factor in (1.0, 1.8)
    )
    assert (chatter(GREBE, gains) < [1.5, 0.2]).all()
    turn, straight = chatter(GREBE, others)
    assert straight > 0.5 > 10.0 * turn


@pytest.mark.usefixtures("ahead")
@pytest.mark.long
def test_gains_are_lowered_until_nothing_chatters_for_all_that_the_estimates_allow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The thrust of depth chatters in the fastest corner. A lag of 0.05 s may be one of 0.4 s by its interval."""
    monkeypatch.setattr("rov_fmu.bridges.ardusub.gains._DRAWS", 1)
    sure = with_intervals(GREBE.with_(T_t200=0.05), {"m_rov": (13.0, 13.2)})
    certain, doubtful = tuned(sure), tuned(with_intervals(sure, {"T_t200": (0.001, 0.4)}))
    start = "heave: the gains are "
    (note,) = [note for note in certain.notes if note.startswith(start)]
    share = float(note.removeprefix(start).partition("%")[0]) / 100.0
    assert 0.25 < share < 1.0
    whole, lowered = values_of(tuned_without_flight(sure)), values_of(certain)
    ratios = {n: x / whole[n] for n, x in lowered.items() if x and "ACCZ" in n}
    assert ratios == pytest.approx(dict.fromkeys(ratios, share), abs=0.005)
    (cost,) = [note for note in doubtful.notes if note.startswith("overshoot with the longest lag")]
    (longest, own), *_ = re.findall(r"50% ahead: depth ([\d.]+) cm \(([\d.]+)\)", cost)
    assert float(longest) > 2.0 * float(own)
    assert not [note for note in certain.notes if "longest lag" in note]


@pytest.mark.usefixtures("ahead")
def test_the_gains_of_another_vehicle_and_those_that_chatter_are_told(tmp_path: Path) -> None:
    path = tmp_path / "own.param"
    lines = [
        "# The gains of ArduSub for grebe8, frame vectored",
        "ATC_RAT_YAW_P 2.2",
        "RC1_MIN,1100",
        "ATC_ANG_YAW_P 5",
    ]
    path.write_text("\n".join(lines), "utf-8")
    found = tuned(GREBE, path)
    assert found.notes[0] == f"{path}: has the gains of grebe8; the vehicle is bluerov2"
    assert found.usual["ATC_RAT_YAW_P"] == 2.2
    (note,) = [note for note in found.notes if note.startswith("your gains")]
    assert note.startswith("your gains are not recommended: yaw chatters (its demand changes by ")


# ---- The stand-in ----------------------------------------------------------------------------------------------------


def by_the_stand_in(vehicle: Vehicle, gains: Mapping[str, float], legs: tuple[Leg, ...]) -> list[Array]:
    """Fly steps with the stand-in, through the protocol of `sitl`. Return depths and headings less their targets."""
    frame, errors = VECTORED_6DOF if len(vehicle.layout.thrusters) == len(VECTORED_6DOF) else VECTORED, []
    with served(setup_of(vehicle, z=10.0)) as (_, port):
        autopilot = ArduSub(port, depth=10.0, start=0.0, hold=Hold.by(gains, frame=frame))
        autopilot.hold.rise.most = 500.0  # the hover throttle, which is above the default
        for leg in legs:
            autopilot.hold.depth += leg.size * (leg.axis is HEAVE)
            autopilot.hold.heading += leg.size * (leg.axis is YAW)
            begin = len(autopilot.history)
            autopilot.fly(leg.seconds)
            at = [[one["position"][2], one["attitude"][2]] for one in autopilot.history[begin:]]
            errors.append(np.array(at) - [autopilot.hold.depth, autopilot.hold.heading])
        autopilot.close()
    return errors


@pytest.mark.parametrize("name", spread(["bluerov2_heavy", "identified"], ["identified"], ["bluerov2_heavy"]))
def test_the_stand_in_flies_the_gains_as_the_loop_does_and_depth_better_than_the_firmwares(
    name: str,
) -> None:
    """Both are written of their own: they agree within 1 cm and 1 degree. Those of an identified vehicle fly the true
    one."""
    gains, vehicle = values_of(tuned_without_flight(FLOWN[name][0])), GREBE if name == "identified" else FLOWN[name][0]
    own = by_the_stand_in(vehicle, gains, STEPS)
    for leg, errors in zip(fly(vehicle, gains, STEPS), own, strict=True):
        assert leg.errors[:, 3, 0] == pytest.approx(errors[:, 0], abs=0.01)
        assert leg.errors[:, 2, 0] == pytest.approx(errors[:, 1], abs=radians(1.0))
    usual, depths = [leg.errors[:, 3, 0] for leg in fly(vehicle, {}, STEPS)][1], own[1][:, 0]
    assert depths.max() < min(0.05, 0.6 * usual.max())
    assert np.abs(depths[-100:]).max() < 0.05 < np.abs(usual[-100:]).max()


# ---- The files -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def flown() -> Tuned:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "rov_fmu.bridges.ardusub.gains.LEGS", (Leg(SURGE, 0.0, 0.1), Leg(YAW, 0.5, 0.5), Leg(SURGE, 0.5, 0.5))
        )
        return tuned(replace(HEAVY, name="A\nB # C"))


def test_the_parameters_have_the_form_and_the_names_that_ground_stations_read(flown: Tuned, tmp_path: Path) -> None:
    """MAVProxy skips lines that begin with # and reads two words of others; QGroundControl reads the five columns of
    system, component, name, value and type, 9 for a float."""
    files = gains_files(flown)
    for version, suffix in product(("before-4.7", "from-4.7"), ("param", "params")):
        name, columns = f"gains-{version}.{suffix}", 2 if suffix == "param" else 5
        text = files[name]
        assert isinstance(text, str)
        rows = [re.split(r"\t" if columns == 5 else " ", line) for line in text.splitlines() if line and line[0] != "#"]
        assert {len(row) for row in rows} == {columns}
        assert columns == 2 or {(row[0], row[1], row[4]) for row in rows} == {("1", "1", "9")}
        written = {row[2] if columns == 5 else row[0]: float(row[3] if columns == 5 else row[1]) for row in rows}
        expected = values_of(flown)
        if version == "from-4.7":
            for begin, new, factor in (("ACCZ", "D_ACC", 0.1), ("POSZ", "D_POS", 1.0), ("VELZ", "D_VEL", 1.0)):
                expected |= {n.replace(begin, new): factor * expected.pop(n) for n in [*expected] if begin in n}
            assert "conversion to 4.7 leaves it as it was" in text
        assert written == pytest.approx(expected, rel=1e-3)
        reasons = {line.partition(":")[0] for line in text.splitlines() if "documented are" in line}
        assert {f"# {parameter}" for parameter in written} == reasons
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        gains, owner = read_gains(path)
        assert gains == pytest.approx(values_of(flown), rel=1e-3)
        assert owner == "bluerov2_heavy"


def test_the_table_and_the_picture_show_the_same_legs(flown: Tuned) -> None:
    files = gains_files(flown)
    legs = ["heading +29 deg", *(f"50% ahead: {words}" for words in ("depth", "roll", "pitch", "heading"))]
    lines = str(files["steps.csv"]).splitlines()
    assert [line.split(",")[0] for line in lines] == ["leg", *legs]
    assert {line.count(",") for line in lines} == {9}
    shown = [*flight_table(flown).columns[0].cells]
    assert [*shown[: len(legs)], len(shown)] == [*legs, len(legs) + len(flown.compared)]
    picture = files["steps.png"]
    assert isinstance(picture, bytes)
    assert picture[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("RC1_MIN 1100\n", "has none of the gains, such as ATC_RAT_YAW_P"),
        ("\n# x\nATC_RAT_YAW_P 1 2\n", "line 3: must be a parameter and its value, and is 'ATC_RAT_YAW_P 1 2'"),
        ("ATC_RAT_YAW_P x", "line 1: ATC_RAT_YAW_P = 'x': must be a number from 0 to 1e+06"),
        ("ATC_RAT_YAW_P -1", "line 1: ATC_RAT_YAW_P = '-1': must be a number from 0 to 1e+06"),
        ("PSC_D_ACC_P,nan", "line 1: PSC_ACCZ_P = 'nan': must be a number from 0 to 1e+06"),
        ("x" * 1_000_001, "has 1,000,001 bytes; at most 1,000,000 are read"),
    ],
)
def test_a_mistake_in_given_gains_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "own.param"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=f"^{re.escape(f'{path}: {message}')}$"):
        tuned(SIX, path)


@pytest.mark.usefixtures("ahead")
def test_the_command_writes_a_folder_and_tells_the_next_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", "videoray", "--to", "ardusub-gains"]) == 2
    assert "videoray: there are no gains to load: yaw: curve rear has no lag T" in capsys.readouterr().err
    assert main(["export", "bluerov2", "--to", "ardusub-gains"]) == 0
    out = capsys.readouterr().out
    assert "times); 15 ms are assumed" in " ".join(out.split())
    assert "A flight with the firmware's gains" in out
    assert "Next: fly bluerov2_ardusub_gains/gains-from-4.7.param" in out
    written = {path.name for path in (tmp_path / "bluerov2_ardusub_gains").iterdir()}
    names = {f"gains-{version}.{suffix}" for version in ("before-4.7", "from-4.7") for suffix in ("param", "params")}
    assert written == {*names, "steps.csv", "steps.png"}
