"""The findings of an identification: one sentence for each kind, its severity, and when there is none."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.identify.findings import (
    SENTENCES,
    SEVERITY,
    by_heading,
    extrapolated,
    findings_of,
    headline,
    prediction_name,
    repairs,
    result_sentences,
    told,
    with_error,
)
from rov_fmu.identify.result import (
    Answer,
    AxisResult,
    Identification,
    IdentifiedCoefficient,
    IdentifiedEffect,
    Logging,
    MeasuredPoint,
    Slip,
    Structure,
    UnknownForce,
    Verdict,
    coverage_of,
)
from rov_fmu.tank import findings as reading
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.description import Draft, read_rov_file
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.log import Channel, Commands, Source
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.folders import BLUEROV2
from tests.report import results
from tests.report.results import FILES, TIME, example, log, prediction, without_findings

BLUEROV = load_vehicle(SHIPPED["bluerov2"])


def quiet(**changes: Any) -> Identification:
    """A result with one good axis and nothing to tell but its coverage, with some changes."""
    result = without_findings()
    none: dict[str, Any] = {"curves": {}, "forces": (), "effects": (), "disturbances": (), "logging": ()}
    folder = replace(result.folder, findings=[])
    return replace(result, **{"axes": result.axes[:1], "folder": folder, **none, **changes})


def surge(**changes: Any) -> Identification:
    """The quiet result with changes of its axis."""
    result = quiet()
    return replace(result, axes=(replace(result.axes[0], **changes),))


def said(result: Identification, kind: str) -> list[str]:
    """The sentences of a kind."""
    return [*result_sentences(f for f in findings_of(result) if f.kind == kind)]


def disturbance(kind: str = "slow force", **changes: Any) -> Identification:
    axis = None if kind == "slow gain" else SURGE
    size, unit = {"slow force": (2.1, "N"), "slow gain": (0.12, "1"), "slow velocity": (0.11, "m/s")}[kind]
    found = results.disturbance(kind, axis, "log_3.csv", size, unit, 0.16, 20.0)
    return quiet(disturbances=(replace(found, **changes),))


def with_channels(*names: str) -> Identification:
    channels = tuple(Channel(QUANTITIES[name], Source(name), TIME, TIME) for name in names)
    made = quiet().vehicle.provenance
    vehicle = replace(BLUEROV, layout=replace(BLUEROV.layout, coupled=False), provenance=made)
    dive = replace(log("dive.csv"), channels=channels)
    return quiet(folder=replace(quiet().folder, logs=[dive]), vehicle=vehicle)


def with_description(reason: str) -> Identification:
    """A result of a drafted rov.toml; without a reason, a user has named the base."""
    described = read_rov_file(Path("rov.toml"), draft=Draft(BLUEROV2, reason))
    return quiet(folder=replace(quiet().folder, rov_file=described))


def with_full(share: float) -> Identification:
    return quiet(folder=replace(quiet().folder, logs=[log("a.csv", full=share)]))


def with_outliers(share: float) -> Identification:
    return quiet(sensors=(replace(example().sensors[0], outliers=share),))


def unidentified(*names: str) -> tuple[IdentifiedCoefficient, ...]:
    return tuple(IdentifiedCoefficient(name, 1.0, None, "1", "1 within a factor of 3", 1.0) for name in names)


def forces(*ratios: float) -> tuple[MeasuredPoint, ...]:
    return tuple(
        MeasuredPoint("top", "force", "N", "thrust_top.csv", 0.1 * n, 10.0 * n * ratio, 10.0 * n, 10.0 * n, counts=True)
        for n, ratio in enumerate(ratios, 1)
    )


def turning(*names: str, along: Axis = SURGE) -> Identification:
    """A dive with some channels and a push along an axis, whose yaw the model does not explain."""
    result = with_channels(*names)
    pushes = BLUEROV.layout.commands_along(along, 0.5)
    values = np.tile([*pushes.values()], (len(TIME), 1))
    commands = Commands.of_rows([name.removeprefix("u_") for name in pushes], TIME, values, Source("u"))
    (dive,) = result.folder.logs
    folder = replace(result.folder, logs=[replace(dive, commands=commands)])
    return replace(result, folder=folder, axes=(replace(result.axes[0], axis=YAW, structure=2.0),))


def test_a_turn_on_the_spot_that_is_logged_is_not_asked_for_again() -> None:
    moving, turning_alone = turning("heading"), turning("heading", along=YAW)
    (asked,) = said(moving, "unlogged motion")
    assert not repairs(moving)
    few = replace(BLUEROV.layout, axes=tuple(form for form in BLUEROV.layout.axes if form.axis in (HEAVE, YAW)))
    assert said(replace(moving, vehicle=replace(moving.vehicle, layout=few)), "unlogged motion")
    bad = replace(moving.axes[0], verdict=Verdict("do not use", ()))
    again = Verdict("usable", ("The thrust changes slowly.",), "Log it again.")
    heave, ahead, sway = (replace(bad, axis=axis, verdict=again) for axis in (HEAVE, SURGE, SWAY))
    pulled = disturbance("slow force").disturbances
    sway, heave = replace(sway, slips=SLIPS[:1]), replace(heave, disturbances=pulled)
    all_axes = replace(moving, axes=(bad, ahead, sway, heave))
    (first, *_) = repairs(all_axes)
    cure = "Turn on the spot in a log of its own, and leave yaw out of dive.csv by [leave_out] in rov.toml."
    assert first == f"{cure} Then identify again."
    remedies = [one.verdict.remedy for one in told(all_axes).axes]
    assert remedies == [cure, cure, "Log it again.", "Log it again."]  # a slip, and an unknown force, are other causes
    assert "turn on the spot in a log of its own, and leave yaw out of dive.csv" in asked
    assert said(turning_alone, "unlogged motion") == []
    spot = replace(turning_alone.folder.logs[0], file="spot.csv (from 41 s)")
    dives = [replace(one, file="heave.csv") for one in turning("heading", along=HEAVE).folder.logs]  # has no turn
    both = replace(moving, folder=replace(moving.folder, logs=[*moving.folder.logs, spot, *dives]))
    (others,) = said(both, "unlogged motion")
    assert others.endswith("Or leave yaw out of dive.csv by [leave_out] in rov.toml, because it is alone in spot.csv")


BETA = IdentifiedCoefficient("beta_u", 1.5, (1.3, 1.7), "1", "0.65 within a factor of 1.5", 0.2)
SCALE = IdentifiedCoefficient("a_t_top", 6.5, (6.0, 7.0), "N", "6.5 ± 0.6 N", 0.9)
DISTANCE = prediction(SURGE, "distance", error=0.9, span=10.0, coverage=0.7)
DRIFTING = prediction(YAW, "heading", error=0.9)
OF_FILE = IdentifiedEffect("current", "log_1.csv", "current to the north", -0.1, (-0.11, -0.09), "m/s", 12.0)
SLOW = IdentifiedEffect("lag", "", "time constant of the thrusters", 0.6, (0.5, 0.7), "s", 12.0, 2.6)
LATE = Logging("log_1.csv", 0.1, -0.08, (-0.09, -0.07), 0.1)

STRENGTH = IdentifiedEffect("health", "stbd", "", 0.8, (0.79, 0.81), "1", 40.0, beside="port")
CAUSE = Structure("curve of its own", "l", 0.999, 0.5)
LOST = Structure("momentary commands", "a.csv", 1.0, words=(("share", "30%"), ("axis", "yaw"), ("rate", "10")))


def structured(structure: Structure, **changes: Any) -> Identification:
    return quiet(structures=(replace(structure, **changes),))


CASES: Sequence[tuple[str, Identification, str, Identification | None]] = [
    (
        "structure",
        surge(structure=5.0),
        "lacks something along surge: its errors are 5.0 times what noise explains",
        quiet(),
    ),
    (
        "estimator",
        quiet(sensors=(replace(example().sensors[0], unit="m/s", wander=0.03),)),
        "the velocity of the estimator wanders by 0.030 m/s (RMS) beside its position",
        quiet(sensors=(replace(example().sensors[0], unit="m/s", wander=0.001),)),
    ),
    ("search ended", quiet(has_ended=True), "so the search ended before all were tried", quiet()),
    (
        "not told apart",
        quiet(alike=(("5", "6"),)),
        "thrusters 5 and 6: the logs do not tell whether one of them has lost force",
        quiet(),
    ),
    (
        "times",
        quiet(times=("lag of the thrusters", "dead time of the commands", "lag of the sensors")),
        "the logs do not tell the lag of the thrusters from the dead time of the commands and the lag of the sensors, ",
        quiet(times=("lag of the thrusters",)),
    ),
    (
        "unlogged motion",
        turning("heading"),
        "yaw: no log shows how the vehicle moves ahead and sideways",
        turning("heading", "surge velocity"),
    ),
    (
        "weak thruster",
        quiet(effects=(STRENGTH,)),
        "thruster stbd: it has 80% of the force of thruster port (79% to 81%). Check both for weed and damage",
        quiet(effects=(replace(STRENGTH, value=0.91),)),
    ),
    (
        "strength",
        quiet(effects=(replace(STRENGTH, value=0.971, interval=(0.968, 0.974)),)),
        "thruster stbd: it has 97.1% of the force of thruster port (96.8% to 97.4%)",
        quiet(effects=(replace(STRENGTH, value=0.971, evidence=5.0),)),
    ),
    ("coupling", structured(Structure("coupling", "", 0.999, 1.0)), "a motion along one turns or moves", quiet()),
    ("curve of its own", structured(Structure("curve of its own", "l", 0.97, 0.7)), "thruster l: it has a", quiet()),
    ("neutral", structured(Structure("neutral", "l", 0.97, 0.04)), "its neutral is off by 4% of full", quiet()),
    (
        "momentary commands",
        structured(LOST),
        "If they change between the rows (10 per second), about 30% of the yaw command is lost",
        quiet(),
    ),
    (
        "turned round",
        quiet(structures=(Structure("turned round", "5 and 6", 0.97),)),
        "thrusters 5 and 6: they work astern where rov.toml says ahead",
        quiet(),
    ),
    (
        "idle commands",
        quiet(structures=(Structure("idle commands", "a.csv (6.0 to 80.0 s)", 1.0),)),
        "a.csv (6.0 to 80.0 s): the commands do not act before and after, as if the thrusters were off",
        quiet(),
    ),
    (
        "rotor lag",
        quiet(structures=(Structure("rotor lag", "", 0.98),)),
        "the speed of the rotors lags behind",
        quiet(),
    ),
    ("coupling", quiet(structures=(Structure("coupling", "", 0.999),)), "by the Coriolis and Munk forces", quiet()),
    (
        "curve of its own",
        structured(CAUSE, kind="curve of its own"),
        "with 50% of the thrust astern, rel",
        structured(CAUSE, kind="curve of its own", value=1.0002),
    ),
    ("command limit", structured(CAUSE, kind="command limit"), "beyond a command of 50%, they push no more", quiet()),
    ("voltage drop", structured(CAUSE, kind="voltage drop"), "they lose 50% of their thrust while all have", quiet()),
    (
        "slew limit",
        structured(CAUSE, kind="slew limit", value=1.25, unit="s"),
        "as ramps, which take 1.2 s from rest to full command",
        structured(CAUSE, kind="slew limit", value=0.19, unit="s"),
    ),
    (
        "turned velocity sensor",
        structured(CAUSE, kind="turned velocity sensor", value=-1.5708, unit="rad"),
        "the velocity sensor is turned by -90 deg about the vertical axis",
        structured(CAUSE, kind="turned velocity sensor", value=0.04, unit="rad"),
    ),
    ("worse than no change", surge(predictions=(DISTANCE,)), "off by 0.90 m (RMS), and a prediction of", quiet()),
    ("slip", quiet(slips=(Slip("log_1.csv", "depth", "is it in mm", 9.0),)), "check the depth: is it in mm?", quiet()),
    ("second start", surge(difference=41.0), "surge: two fits from different starts ended", surge(difference=39.0)),
    (
        "do not use",
        surge(verdict=Verdict("do not use", ("It is not right.",))),
        "surge: the model must not be used, and its verdict tells why",
        surge(verdict=Verdict("usable", ("It is not quite right.",))),
    ),
    (
        "implausible inertia",
        surge(known=(BETA,)),
        "surge: the vehicle moves as if its inertia were 0.67 times m_rov.",
        surge(known=(replace(BETA, value=1.2, interval=(1.0, 1.4)),)),
    ),
    (
        "implausible inertia",
        replace(surge(known=(replace(BETA, value=0.2, interval=(0.1, 0.29)),)), vehicle=BLUEROV),
        "inertia were 5.0 times m_rov with the added one.",
        replace(surge(known=(replace(BETA, value=0.2, interval=(0.1, 0.31)),)), vehicle=BLUEROV),
    ),
    (
        "thrust tables",
        quiet(forces=forces(2.0, 2.1, 2.2)),
        "the forces in thrust_top.csv are 2.1 times those that fit the logs. Check their unit",
        quiet(forces=forces(1.1, 1.1, 0.9)),
    ),
    (
        "thrust tables",
        replace(quiet(forces=forces(2.0, 2.1, 2.2)), axes=(replace(quiet().axes[0], axis=HEAVE, structure=1.4),)),
        "the forces in thrust_top.csv are 2.1 times those that fit the logs. Check their unit",
        replace(quiet(forces=forces(2.0, 2.1, 2.2)), axes=(replace(quiet().axes[0], axis=HEAVE, structure=3.0),)),
    ),
    (
        "unknown force",
        disturbance(axis=YAW, value=0.21, unit="N.m"),
        "yaw: an unknown slow torque of 0.21 N.m (RMS), 16% of the torque, acts in log_3.csv. Nothing",
        disturbance(evidence=5.0),
    ),
    (
        "unusual effect",
        quiet(effects=(SLOW,)),
        "the time constant of the thrusters of 0.60 s (0.50 to 0.70) is unusual. Something else may act in its place",
        quiet(effects=(replace(SLOW, beyond=0.96),)),
    ),
    (
        "change of thrust",
        disturbance("slow gain"),
        "the thrust changes slowly by 12% (RMS) in log_3",
        quiet(),
    ),
    (
        "velocity over ground",
        disturbance("slow velocity", axis=None),
        "surge: an unknown slow velocity over ground of 0.11 m/s (RMS) acts in log_3.csv. Check for waves",
        None,
    ),
    (
        "coupling left out",
        with_channels("heading", "surge velocity"),
        "dive.csv: the vehicle turns while it moves in surge or sway, but the model leaves out the Coriolis and Munk",
        with_channels("heading", "depth"),
    ),
    ("outliers", with_outliers(0.05), "heave: 5% of the samples of the depth are outliers", with_outliers(0.001)),
    ("nothing predicted", surge(predictions=()), "surge: no motion was predicted that the fit had not", quiet()),
    (
        "assumed thrust",
        quiet(curves={"top": (SCALE,)}, forces=()),
        "top thrust: no force was measured, so loads, drag, masses and β are in units of the assumed thrust. A spring",
        quiet(curves={"top": (SCALE,)}, forces=forces(1.0)),
    ),
    (
        "assumed vehicle",
        with_description("it is the first that ships with 6 thrusters"),
        "the vehicle is taken for bluerov2, because it is the first that ships with 6 thrusters: its thrusters, their ",
        with_description(""),
    ),
    (
        "not identified",
        surge(known=unidentified("a_d_u", "b_d_u")),
        "surge: the tests do not determine a_d_u and b_d_u. V_ss at 50% is 0.500 m/s (0.490 to 0.510)",
        quiet(),
    ),
    (
        "points differ",
        surge(points=(MeasuredPoint("surge", "V_ss", "m/s", "steady.csv", 0.3, 0.2, 0.25, 0.25, counts=True),)),
        "surge: V_ss of the tables differs by 25% (RMS) from the model",
        quiet(),
    ),
    ("saturation", with_full(0.5), "a.csv: the thrusters had full commands for 50% of the time.", with_full(0.1)),
    (
        "clock",
        quiet(logging=(replace(LATE, offset=0.6, offset_interval=(0.5, 0.7)),)),
        "log_1.csv: the commands act 0.6 s after their rows, although the rows are 0.1 s apart.",
        quiet(logging=(LATE,)),
    ),
    (
        "drift",
        surge(predictions=(DRIFTING,)),
        "surge: over all of log_2.csv, the predicted heading drifts away by 52 deg (RMS), and a prediction of no",
        surge(predictions=(replace(DRIFTING, span=10.0), DRIFTING)),
    ),
    (
        "effect",
        quiet(effects=(OF_FILE,)),
        "log_1.csv: the current to the north is -0.100 m/s (-0.110 to -0.090). It belongs to the water, so the",
        quiet(effects=(replace(OF_FILE, evidence=5.0),)),
    ),
    (
        "small disturbance",
        disturbance(share=0.03),
        "It is small, and the intervals allow for it",
        disturbance(share=0.009),
    ),
    (
        "rocking",
        quiet(folder=replace(quiet().folder, rows={})),
        "surge: no log shows roll and pitch. Rocking raises drag by 3 to 7 %, so that no speed and",
        quiet(),
    ),
    (
        "idle voltage",
        replace(with_channels("voltage"), curves={"t200": ()}),
        f"no effect of the logged voltage ({' to '.join(f'{TIME[-1] * part:.3g}' for part in (0.05, 0.95))} V) on the",
        with_channels("depth"),
    ),
    (
        "logging",
        quiet(logging=(LATE,)),
        "log_1.csv: the commands act 0.08 s before their rows. This belongs to the logger, not to the vehicle",
        quiet(logging=(replace(LATE, offset_interval=(-0.1, 0.01)),)),
    ),
]
"""Each kind, a result that tells it, words of its sentence, and a result beside it that does not."""


@pytest.mark.parametrize(("kind", "result", "words", "beside"), CASES, ids=[kind for kind, *_ in CASES])
def test_each_kind_is_told_for_its_reason_alone(
    kind: str, result: Identification, words: str, beside: Identification | None
) -> None:
    (sentence,) = said(result, kind)
    assert words in sentence
    assert sentence in by_heading(findings_of(result))[SEVERITY[kind]]
    assert beside is None or not said(beside, kind)


def test_every_own_kind_has_a_sentence_here() -> None:
    own = {*SENTENCES} - {*reading.SENTENCES}
    of_tuning = {kind for kind in own if kind.startswith("implausible tuned")}
    of_wrenches = {"beyond thrusters"}  # in test_wrench.py
    assert {kind for kind, *_ in CASES} == own - of_tuning - of_wrenches
    assert {*SEVERITY} == {*SENTENCES}


def test_a_quiet_result_tells_nothing_but_its_verdict_and_its_errors() -> None:
    result = told(quiet())
    made = result.vehicle.provenance
    assert made
    assert not [*result.findings, *made.warnings, *made.facts]
    assert made.verdicts == ("surge: good. The bands contain 95 % of the unseen data.",)
    (error,) = made.errors
    assert error == (
        "surge distance, 10 s ahead: off by 0.050 m (RMS) in log_2.csv, and a prediction of no change by 0.70 m; 95% "
        "of the samples are inside the 95% band"
    )


@pytest.mark.parametrize(("span", "words"), [(0.999999, ", 1 s ahead"), (0.25, ", 0.25 s ahead"), (np.inf, "")])
def test_the_span_of_a_prediction_is_told_in_three_digits(span: float, words: str) -> None:
    assert prediction_name(replace(DISTANCE, span=span)) == f"surge distance{words}"


def test_the_main_prediction_is_that_of_a_position_over_10_s_with_the_largest_error_beside_its_noise() -> None:
    distance = prediction(SURGE, "distance", span=10.0, error=0.05)
    noisy, whole = replace(distance, error=0.08, noise=0.02), prediction(SURGE, "distance", error=2.0)
    velocity = prediction(SURGE, "surge velocity", error=0.9)
    (axis,) = surge(predictions=(velocity, replace(distance, error=0.04), whole, distance, noisy)).axes
    assert axis.main is distance
    short = replace(distance, time=TIME[:60], coverage=0.5)
    (axis,) = surge(predictions=(whole, short, distance)).axes
    assert coverage_of(axis.predictions) == pytest.approx((0.5 * 60 + 0.95 * 600) / 660)
    assert quiet().seconds == pytest.approx(2 * 60.0, rel=0.01)


def test_the_vehicle_has_the_ranges_of_its_tests() -> None:
    """They are those of commands, of the measured V_ss and of the depths, of which 0.5 % at each end do not count."""
    values = np.where(TIME > 59.8, 99.0, np.where(TIME < 0.1, 0.0, 1.0 + TIME / 6.0))
    depth, heading = (Channel(QUANTITIES[name], Source(name), TIME, values) for name in ("depth", "heading"))
    dive = replace(log("dive.csv"), channels=(depth, heading))
    vehicle = replace(quiet().vehicle, command_range=(0.2, 0.6))
    found = told(quiet(folder=replace(quiet().folder, logs=[dive]), vehicle=vehicle)).vehicle.layout.identified
    assert found == (("command", 0.0, 0.6), ("u", 0.29, 0.51), ("z", 1.05, 10.9))


def three(**changes: Any) -> Identification:
    """The quiet result of three logs, whose surge velocity is predicted with an error of 0.1 m/s in each."""
    files = (*FILES, "log_3.csv")
    (axis,) = surge(predictions=tuple(prediction(SURGE, "surge velocity", file) for file in files)).axes
    folder = replace(quiet().folder, logs=[*map(log, files)])
    return quiet(**{"axes": (axis,), "folder": folder, **changes})


def two() -> Identification:
    """The same of the first two logs."""
    (axis,) = three().axes
    return three(axes=(replace(axis, predictions=axis.predictions[:2]),))


def worse(result: Identification, *files: str, error: float = 0.9, unchanged: float = 0.7) -> Identification:
    """The result with a prediction that is off by some m/s in these logs, and one of no change by others."""
    (axis,) = result.axes
    own = tuple(replace(p, error=error, unchanged=unchanged) if p.file in files else p for p in axis.predictions)
    return replace(result, axes=(replace(axis, predictions=own),))


def slow_forces(*sizes: float) -> dict[str, Any]:
    """An unknown force in surge with these sizes in the logs, in N. The largest one counts."""
    files = (*FILES, "log_3.csv")
    largest = files[sizes.index(max(sizes))]
    return {
        "disturbances": (results.disturbance("slow force", SURGE, largest, max(sizes), "N", 0.2, 30.0),),
        "unknown_forces": tuple(
            UnknownForce(SURGE, file, TIME, np.full(len(TIME), size), np.ones(len(TIME)))
            for file, size in zip(files, sizes, strict=True)
        ),
    }


ODD = "Repair log_3.csv or take it out of the folder: it disagrees with the other 2 logs. "
SLIPS = [Slip(file, "surge velocity", "is it in cm", 20.0) for file in (*FILES, "log_3.csv")]


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (
            worse(three(), "log_3.csv"),
            [f"{ODD}The prediction of its surge velocity is off by 0.90 m/s, and one of no change by 0.70 m/s."],
        ),
        (worse(three(), "log_2.csv", "log_3.csv"), []),
        (worse(three(), "log_3.csv", error=0.2, unchanged=0.05), []),
        (
            worse(three(slips=(SLIPS[2],)), "log_3.csv"),
            [f"{ODD}Check the surge velocity: is it in cm?"],
        ),
        (
            three(slips=tuple(SLIPS[:2])),
            [
                f"Repair {file} or take it out of the folder: it disagrees with the other log. "
                "Check the surge velocity: is it in cm?"
                for file in FILES
            ],
        ),
        (
            three(slips=tuple(SLIPS)),
            [
                f"Repair {slip.file} or take it out of the folder. Check the surge velocity: is it in cm?"
                for slip in SLIPS
            ],
        ),
        (worse(two(), "log_2.csv"), []),
        (
            three(**slow_forces(0.5, 0.4, 1.6)),
            [
                f"{ODD}An unknown slow force acts in this log: 1.6 N in surge (at most 0.50 N in the other logs). "
                "Check the thrusters and the tether of that dive."
            ],
        ),
        (three(**slow_forces(0.5, 0.6, 1.6)), []),
    ],
)
def test_a_log_that_disagrees_with_the_others_is_repaired_before_anything_is_measured(
    result: Identification, words: list[str]
) -> None:
    """Not the log is wrong where half of the logs are predicted badly, where the error or the unknown force is about as
    large in another one, or where it hardly moves."""
    assert repairs(result) == [f"{sentence} Then identify again." for sentence in words]


def test_warnings_of_all_axes_come_first_and_the_gravest_of_them() -> None:
    kinds = [finding.kind for finding in example().findings]
    headings = [SEVERITY[finding.kind] for finding in example().findings]
    assert kinds[:2] == ["worse than no change", "unknown force"]
    assert headings == sorted(headings, key=["Warnings", "Doubts", "Facts"].index)
    lost = Finding("missing column", file=FILES[0], words={"column": "t"})
    result = without_findings()
    late = told(replace(result, folder=replace(result.folder, findings=[lost])))
    assert [finding.kind for finding in late.findings].index("missing column") == 1


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "words"),
    [
        (0.62, 0.5, 0.64, "m/s", "0.62 m/s ±19%"),
        (0.5, 0.001, 0.7, "rad/s", "29 deg/s ±100%"),
        (0.5, -0.1, 0.7, "rad", "not known"),
        (-0.5, -0.6, -0.4, "1", "-0.50 ±20%"),
        (0.0, 0.0, 0.0, "m", "-"),
        (np.inf, 0.0, np.inf, "m", "-"),
    ],
)
def test_an_error_is_the_larger_half_of_the_interval(
    value: float, low: float, high: float, unit: str, words: str
) -> None:
    assert with_error((value, (low, high)), unit) == words


@pytest.mark.parametrize(
    ("tested", "words"),
    [
        ((0.5, 0.7), []),
        ((0.02, 0.7), ["No test drives the vehicle astern (surge), so the numbers for that are extrapolated."]),
        ((0.7, 0.0), ["No test drives the vehicle forward (surge), so the numbers for that are extrapolated."]),
    ],
)
def test_a_direction_without_a_test_is_extrapolated(tested: tuple[float, float], words: list[str]) -> None:
    assert extrapolated(surge(tested=tested))[1:] == words


def test_a_speed_that_is_not_known_has_no_interval() -> None:
    estimates = (0.6, (0.57, 0.68)), (0.6, (0.00046, 1.5))
    known, unknown = (
        headline(AxisResult(HEAVE, answers=(Answer(HEAVE, 0.5, steady, (1.0, (0.9, 1.1)), (1.0, (0.9, 1.1))),)))
        for steady in estimates
    )
    assert known == "down 0.60 m/s at 50%, 0.57 to 0.68"
    assert unknown == "down a speed that is not known at 50%"
