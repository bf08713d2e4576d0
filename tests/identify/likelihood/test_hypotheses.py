"""Hypotheses about the structure: what each changes, where the alarm tries them, and which one wins.

The logs are simulated by the vehicle of the FMU, whose thrusters are ill, or whose commands are changed on their way
from the log to the thrusters. So what is named is what was done.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from math import hypot
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import rov_fmu
from rov_fmu.equation.catalogue import CURVE, HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.parts import SourcedVector, Thruster
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.effects import optional_effects
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.fit import Fit, _searched_for_structure
from rov_fmu.identify.likelihood.hypotheses import (
    CONTRAST,
    HYPOTHESES,
    Start,
    Starts,
    Suspect,
    applied,
    contrasts,
    in_order,
)
from rov_fmu.identify.likelihood.kinds import (
    DIRECTION,
    KINDS,
    NEUTRAL,
    OWN_CURVE,
    POWER,
    POWER_ASTERN,
    SHIFT,
    STRENGTH,
    TURN,
)
from rov_fmu.identify.likelihood.objective import Data, DataPart, Objective
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior
from rov_fmu.identify.likelihood.records import SampledLog, beside_lines, lost_between_rows
from rov_fmu.identify.likelihood.search import (
    Misfit,
    StructureFit,
    StructureSearch,
    _after_steps,
    _spread,
    comparison,
    fitted,
    rough,
    structure,
    times_of,
    unseen_errors,
    windows,
    with_shared,
    with_steps,
    worst,
)
from rov_fmu.identify.likelihood.solve import Minimum, evidence, minimise, start_of
from rov_fmu.identify.progress import ProgressReport
from rov_fmu.identify.result import ALARM, USUAL
from rov_fmu.interface.model import VehicleModel
from rov_fmu.tank import log as tank_log
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface
from tests.folders import HEAD, folder_of
from tests.often import spread
from tests.vehicles import VIDEORAY
from verification.references.autopilot.flights import flown

SECONDS, INTERVAL = 45.0, 0.1
NOISE = {"surge velocity [m/s]": 0.005, "sway velocity [m/s]": 0.005, "heading [deg]": 0.3, "depth [m]": 0.01}
OUTPUTS = {"surge velocity [m/s]": "u", "sway velocity [m/s]": "v", "heading [deg]": "psi", "depth [m]": "z"}
TURNS = (-170.0, -90.0, -30.0, 15.0, 60.0, 135.0)
"""Angles of a velocity sensor, degrees."""
Commands = dict[str, Array]


def slewed(u: Array, rate: float) -> Array:
    """A command that follows another one at a rate, in 1/s; both are held for INTERVAL."""
    found = [u[0]]
    for value in u[1:]:
        found.append(found[-1] + np.clip(value - found[-1], -rate * INTERVAL, rate * INTERVAL))
    return np.array(found)


@dataclass(frozen=True)
class Fault:
    """What is wrong with a vehicle or its log."""

    kind: str
    """The hypothesis that must win; empty for none, as for a thruster that has lost force."""
    of: str = ""
    health: float = 1.0
    acting: Callable[[Commands], Commands] = dict
    """From the commands of the log to those that act."""
    value: float | None = None
    rotor_lag: float = 0.0
    """The time constant of the rotors' speeds, s."""
    inertia: float = 1.0
    """The factor of the inertia."""
    turned: float = 0.0
    """How far the velocity sensor is turned to starboard, rad."""
    angle: float = 0.0
    """Vectored thrusters push at this angle from ahead, rad, and all are 5 mm ahead of their places; 0: as given."""


def faults(names: list[str]) -> dict[str, Fault]:
    """One fault of each kind, of the first thrusters of a vehicle."""
    first, second = names[:2]
    return {
        "healthy": Fault(""),
        "dead": Fault("", first, 0.0),
        "half": Fault("", second, 0.5),
        "three quarters": Fault("", second, 0.75),
        "astern": Fault(
            OWN_CURVE, second, 0.9, acting=lambda u: {**u, second: np.where(u[second] < 0.0, 0.8, 1.0) * u[second]}
        ),
        "off": Fault(NEUTRAL, second, acting=lambda u: {**u, second: u[second] + 0.04}, value=0.04),
        "limited": Fault("command limit", acting=lambda u: {n: np.clip(c, -0.4, 0.4) for n, c in u.items()}, value=0.4),
        "rotors": Fault("rotor lag", rotor_lag=0.15),
        "drooping": Fault("voltage drop", acting=lambda u: drooping(u, 0.3), value=0.3),
        "slewed": Fault("slew limit", acting=lambda u: {n: slewed(c, 0.8) for n, c in u.items()}, value=1.25),
    }


def drooping(u: Commands, share: float) -> Commands:
    """The commands whose thrust is that of some commands at a voltage that falls with the load."""
    left = np.sqrt(1.0 - share * np.mean(np.square([*u.values()]), axis=0))
    return {name: c * left for name, c in u.items()}


def with_rotors(vehicle: Vehicle, T: float) -> VehicleModel:
    """The vehicle with rotors whose speed lags by T, s."""
    curves = tuple(
        replace(curve, lag="speed", keys=tuple(key for key in CURVE if key in {*curve.keys, "T"}))
        for curve in vehicle.layout.curves
    )
    lags = {one.coefficient("T"): T for one in curves}
    layout = replace(vehicle.layout, curves=curves)
    return rov_fmu.load(
        replace(
            Vehicle(vehicle.layout, vehicle.coefficients), layout=layout, coefficients={**vehicle.coefficients, **lags}
        )
    )


def dive(vehicle: str | Vehicle, fault: Fault, rng: np.random.Generator) -> str:
    """A log of steps of all thrusters, each at its own levels, with the noise of sensors."""
    whole = without_surface(rov_fmu.load(vehicle))
    names = [t.name for t in whole.layout.thrusters]
    n = round(SECONDS / INTERVAL) + 1
    time = INTERVAL * np.arange(n)
    parts = (time // 3.0).astype(int)
    logged = {name: rng.choice([-0.8, -0.5, -0.3, 0.0, 0.0, 0.3, 0.5, 0.8], parts[-1] + 1)[parts] for name in names}
    if fault.health != 1.0:
        whole = whole.with_(**{f"health_{fault.of}": fault.health})
    if fault.inertia != 1.0:
        names_of = [axis.coefficient("beta") for axis in whole.layout.bare_axes]
        whole = whole.with_(**{name: whole[name] / fault.inertia for name in names_of})
    if fault.angle:
        g_u, g_v = np.array([np.cos(fault.angle), np.sin(fault.angle)]) / np.sqrt(0.5)

        def moved(t: Thruster) -> Thruster:
            (X, Y, Z), (x, y, z) = t.direction.value, t.place
            along = SourcedVector((g_u * X, g_v * Y, Z), "")
            return replace(t, direction=along, position=SourcedVector((x + 0.005, y, z), ""))

        layout = replace(whole.layout, thrusters=tuple(map(moved, whole.layout.thrusters)))
        whole = rov_fmu.load(replace(Vehicle(whole.layout, whole.coefficients), layout=layout))
    if fault.rotor_lag:
        whole = with_rotors(whole, fault.rotor_lag)
    acting = fault.acting(logged)
    motion = dict(whole.simulate(time, {f"u_{name}": acting[name] for name in names}))
    columns = {f"{name} [1]": logged[name] for name in names}
    if fault.turned:
        c, s = np.cos(fault.turned), np.sin(fault.turned)
        ahead, starboard = motion["u"], motion["v"]
        motion |= {"u": c * ahead + s * starboard, "v": c * starboard - s * ahead}
    for title, variable in OUTPUTS.items():
        if variable in motion:
            values = np.degrees(motion[variable]) if "deg" in title else motion[variable]
            columns[title] = values + NOISE[title] * rng.standard_normal(n)
    rows = np.column_stack([time, *columns.values()]).tolist()
    lines = [",".join(f"{value:.5g}" for value in row) for row in rows]
    return "\n".join([",".join(["time [s]", *columns]), *lines]) + "\n"


def folder(path: Path, vehicle: str, fault: Fault, seed: int = 0, dives: int = 1) -> Path:
    rng = np.random.default_rng(seed)
    without = "[body]\ncoupling = false\n" if fault.kind == "coupling" else ""
    dives_of = {f"dive_{n}.csv": dive(vehicle, fault, rng) for n in range(dives)}
    return folder_of(path, f'base = "{vehicle}"\n{HEAD}{without}', dives_of)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Objective:
    """A dive of the VideoRay."""
    tests = load_tests(folder(tmp_path_factory.mktemp("model"), "videoray", Fault("")))
    return Objective.of_known(*begin(tests))


@pytest.fixture(scope="module")
def four_axes(tmp_path_factory: pytest.TempPathFactory) -> Objective:
    """A dive of the BlueROV2, whose sway is measured, too."""
    return Objective.of_known(*begin(load_tests(folder(tmp_path_factory.mktemp("four_axes"), "bluerov2", Fault("")))))


# ---- What each changes -----------------------------------------------------------------------------------------------


def test_each_hypothesis_changes_what_acts(four_axes: Objective) -> None:
    """It changes the commands that the filter reads, or frees its row, and nothing else. All models have all rows."""
    (sampled,), plain = four_axes.logs, four_axes.table.parameters
    for kind, hypothesis in HYPOTHESES.items():
        for of in hypothesis.suspects(four_axes.table.known, four_axes.logs):
            acting = ((sampled.record.told[-1], np.inf),) * len(of) if kind == "idle commands" else None
            changed = applied(four_axes, {(kind, of): acting})
            pairs = [*zip(changed.table.parameters, plain, strict=True)]
            assert all(one.key == other.key for one, other in pairs)
            freed = {one.key for one, other in pairs if one.is_fixed < other.is_fixed}
            if kind == "rotor lag":
                assert all(one.has_rotors for one in changed.logs[0].layout.curves)
                assert not freed
                continue
            is_other = not np.array_equal(changed.logs[0].record.inputs, sampled.record.inputs)
            if kind == "momentary commands":
                assert {key[0] for key in freed} == {"short force"}
                continue
            assert freed == ({(kind, of[0] if of else "", "")} if hypothesis.starts else set())
            assert freed or is_other
    assert sum(one.probability for one in HYPOTHESES.values()) < 0.65


def test_a_thruster_with_a_curve_of_its_own_differs_astern_and_in_its_neutral(model: Objective) -> None:
    """All else is that of the other one: the numbers of both curves are written out here."""
    changed = applied(model, {(OWN_CURVE, ("r",)): 0.0})
    table, shared = changed.table, changed.table.layout.curve_of["l"].name
    z = table.each("mean")
    for kind, of, value in (
        ("reverse thrust", shared, 0.1),
        ("dead band", shared, 0.03),
        ("thrust scale", shared, 0.2),
        ("advance", shared, 0.05),
        (OWN_CURVE, "r", np.log(0.6)),
        (NEUTRAL, "r", 0.005),
    ):
        index = table.index(kind, of)
        assert index is not None
        z[index] = value
    for some in (z, np.array([z, z]).T):
        c = table.coefficients(some)
        left, right = (table.layout.curve_of[name] for name in ("l", "r"))
        for key, factor, more in (
            *((key, 1.0, 0.0) for key in ("a_t", "b_t", "d", "T")),
            *((key, 0.6, 0.0) for key in ("a_t_reverse", "b_t_reverse")),
            ("c_0", 1.0, -0.005),
            ("c_0_reverse", 1.0, 0.005),
        ):
            expected = factor * np.asarray(c[left.coefficient(key)]) + more
            assert np.asarray(c[right.coefficient(key)]) == pytest.approx(expected, rel=1e-12)
    assert c[left.coefficient("c_0")] == pytest.approx(0.03)


def uncoupled(objective: Objective) -> Objective:
    """J of the vehicle without coupling."""
    known = objective.table.known
    logs = [replace(one, layout=replace(one.layout, coupled=False)) for one in objective.logs]
    return Objective.of_known(replace(known, layout=replace(known.layout, coupled=False)), logs, objective.rows)


def test_coupling_as_a_hypothesis_is_the_coupling_of_the_file(four_axes: Objective) -> None:
    """A dive without the velocity to starboard does not tell it."""
    (sampled,), known = four_axes.logs, four_axes.table.known
    assert not [*HYPOTHESES["coupling"].suspects(known, [sampled])]
    plain = uncoupled(four_axes)
    assert [*HYPOTHESES["coupling"].suspects(plain.table.known, plain.logs)] == [()]
    others = tuple(one for one in sampled.record.sensors if one.axis is not SWAY)
    ahead = replace(sampled, record=replace(sampled.record, sensors=others))
    assert not [*HYPOTHESES["coupling"].suspects(plain.table.known, [ahead])]
    coupled = applied(plain, {("coupling", ()): None})
    values = [one.value(one.mean, one.runs(one.mean)) for one in (four_axes, coupled, plain)]
    assert values[0] == values[1] != values[2]


def with_logs(objective: Objective, logs: Sequence[SampledLog]) -> Objective:
    """J with other logs."""
    return Objective.of_known(objective.table.known, logs, objective.rows)


def test_idle_commands_of_one_file_leave_another_alone(model: Objective) -> None:
    (sampled,) = model.logs
    other, told = replace(sampled, log=replace(sampled.log, file="other.csv")), sampled.record.told
    idle: Suspect = "idle commands", (sampled.log.file,)
    first, second = applied(with_logs(model, [sampled, other]), {idle: ((told[5], np.inf),)}).logs
    assert not first.record.inputs[:5].any()
    assert np.array_equal(second.record.inputs, other.record.inputs)


def one_of_each(model: Objective) -> Starts:
    """One hypothesis of each kind about a model whose log has momentary commands in far rows."""
    told, found = model.logs[0].record.told, dict[Suspect, Start]()
    for kind, hypothesis in HYPOTHESES.items():
        of = next(hypothesis.suspects(model.table.known, model.logs))
        found[kind, of] = ((told[5], np.inf),) * len(of) if hypothesis.has_times else None
    return found


def test_a_set_of_hypotheses_changes_a_model_whatever_their_order(four_axes: Objective) -> None:
    """Lines between momentary commands are those of the commands that act, and a slew limit repeats none of them."""
    plain = uncoupled(four_axes)
    plain = Objective.of_known(replace(plain.table.known, turned=(("5", "6"),)), plain.logs, plain.rows)
    lossy = with_logs(plain, [replace(one, lost={"yaw": 0.1}, interval=0.5) for one in plain.logs])
    starts = one_of_each(lossy)
    every = [*starts]
    for pair in combinations(every, 2):
        one, two = (applied(lossy, {name: starts[name] for name in names}) for names in (pair, pair[::-1]))
        (sampled,), (other,) = one.logs, two.logs
        assert (sampled.is_momentary, sampled.layout) == (other.is_momentary, other.layout)
        for key in ("told", "since", "inputs", "beside"):
            assert np.array_equal(getattr(sampled.record, key), getattr(other.record, key)), (pair, key)
        assert one.table.parameters == two.table.parameters
    assert in_order(reversed(every)) == every
    (momentary,) = (one for one in every if one[0] == "momentary commands")
    for name in every[: every.index(momentary)]:
        acting = applied(lossy, {name: starts[name]})
        (lines,) = applied(lossy, {momentary: None, name: starts[name]}).logs
        known = acting.table.known
        (expected,) = (log.with_lines(known.coefficients, known.full) for log in acting.logs)
        assert lines.record.beside is not None
        assert expected.record.beside is not None
        assert np.array_equal(lines.record.beside, expected.record.beside)
    with pytest.raises(AssertionError):  # the lines would be those of other commands
        lines.with_inputs(lines.record.inputs)


def test_only_a_rows_own_limits_change_its_commands(model: Objective) -> None:
    """The commands that act are those of a loop written out separately."""
    (sampled,) = model.logs
    names = [name for name in sampled.layout.inputs if name in sampled.layout.commands]
    u = sampled.record.inputs[:, [[*sampled.layout.inputs].index(name) for name in names]]
    limited = applied(model, {("command limit", ()): None})
    z = np.array([p.mean for p in limited.table.parameters])
    index = limited.table.index("command limit")
    assert index is not None
    sets = np.repeat(z[:, None], 2, axis=1)
    sets[index] = 0.55, 1.0
    found = limited.table.followed(sets, limited.logs[0])
    assert np.array_equal(found[0][:, : len(names)], np.clip(u, -0.55, 0.55))
    assert np.array_equal(found[1], sampled.record.inputs)
    slow = applied(model, {("slew limit", ()): None})
    (fine,), z = slow.logs, np.array([p.mean for p in slow.table.parameters])
    index = slow.table.index("slew limit")
    assert index is not None
    told = fine.record.told
    for rise in (1.25, 0.04, 0.0):  # the second ramp ends within its row
        z[index] = rise
        acting = slow.table.followed(z, fine)[:, 0]
        now = fine.record.inputs[0, 0]
        for wanted, mean in zip(fine.record.inputs[:200, 0].tolist(), acting, strict=False):
            h, within = 0.05 / 100, [now]
            for _ in range(100):
                now = wanted if abs(wanted - now) * rise <= h else now + np.copysign(h / rise, wanted - now)
                within.append(now)
            assert mean == pytest.approx(np.mean(within), abs=0.01)
    assert fine.spans[:-1] == pytest.approx(0.05)
    assert told[-1] + fine.spans[-1] >= sampled.record.time[-1]
    assert {*sampled.record.told} <= {*told}


def seldom(sampled: SampledLog, number: int) -> SampledLog:
    """The log of a logger that writes only some of its rows."""
    told, inputs = sampled.record.told[::number], sampled.record.inputs[::number]
    since = np.append(told[0], told[:-1])
    record, thinned = (replace(own, told=told, since=since, inputs=inputs) for own in (sampled.record, sampled.thinned))
    return replace(sampled, interval=number * sampled.interval, record=record, thinned=thinned)


WITHOUT_NULL = (
    "coupling",
    "turned round",
    "rotor lag",
    "momentary commands",
)
"""The hypotheses that nothing within their bounds makes absent, for the reasons beside them in the table."""


@pytest.mark.parametrize("number", [1, 4])
@pytest.mark.parametrize("kind", [kind for kind in HYPOTHESES if kind not in WITHOUT_NULL])
def test_a_hypothesis_that_is_absent_is_the_model_without_it(
    kind: str, number: int, model: Objective, four_axes: Objective
) -> None:
    """J of the data is the same, and close to where the hypothesis is absent, it is almost the same."""
    hypothesis = HYPOTHESES[kind]
    of_kind = four_axes if kind == TURN else model
    plain = with_logs(of_kind, [seldom(one, number) for one in of_kind.logs])
    of = next(hypothesis.suspects(plain.table.known, plain.logs))
    absent = applied(plain, {(kind, of): ((-np.inf, np.inf),) * len(of) if hypothesis.has_times else None})
    values = []
    for some in (plain, absent):
        objective = applied(some, {}, thinned=True)
        indices = [n for n, p in enumerate(objective.table.parameters) if p.kind == kind]
        sets = np.repeat(np.array([p.mean for p in objective.table.parameters])[:, None], 2, axis=1)
        sets[indices] = np.reshape([objective.table.parameters[n].null for n in indices], (-1, 1))
        runs = objective.runs(sets[:, 0])
        values.append(objective.value(sets[:, 0], runs) - objective.prior(sets[:, 0]))
        sets[indices, 1] += objective.free[indices] * np.where(
            objective.high[indices] > sets[indices, 1], 1e-11, -1e-11
        )
        near = objective.trials(sets, [objective.whole] * 2, runs)
        values += [value - objective.prior(z) for (value, _), z in zip(near, sets.T, strict=True)]
    assert values == pytest.approx([values[0]] * len(values), abs=1e-6, rel=0.0)


def test_of_thrusters_that_no_log_tells_apart_one_is_tried(model: Objective) -> None:
    known, (sampled,) = model.table.known, model.logs
    assert [*HYPOTHESES[NEUTRAL].suspects(known, model.logs)] == [("l",), ("r",)]
    inputs = sampled.record.inputs.copy()
    inputs[:, 1] = inputs[:, 0]
    alike = [sampled.with_inputs(inputs)]
    assert [*HYPOTHESES[NEUTRAL].suspects(known, alike)] == [("l",), ("r",)]  # the pair turns to opposite sides
    straight = replace(
        known, layout=replace(known.layout, axes=tuple(f for f in known.layout.axes if f.axis.name == "surge"))
    )
    assert [*HYPOTHESES[NEUTRAL].suspects(straight, alike)] == [("l",)]


def test_only_ratios_within_thrusters_that_push_along_the_same_axes_are_told(four_axes: Objective) -> None:
    """How strong all are that push ahead and sideways, which is uncertain here, is told of none of them."""
    table = four_axes.table
    level = {"1": 0.8 * 0.87, **dict.fromkeys("234", 0.87), "5": 1.1, "6": 1.1}
    rows = {name: n for name in level if (n := table.index(STRENGTH, name)) is not None}
    assert len(rows) == 6
    z, C = table.each("mean"), np.diag(np.full(len(table.parameters), 1e-4))
    for name, n in rows.items():
        z[n] = level[name]
        alike = [m for other, m in rows.items() if (other in "56") == (name in "56")]
        C[n] = 0.0
        C[n, alike] = 0.05**2
        C[n, n] += 0.004**2
    posterior = Posterior(table, z, C)
    fit = SimpleNamespace(
        posterior=posterior,
        posteriors=(posterior, posterior),
        file=SimpleNamespace(posterior=posterior),
        known=table.known,
        odds={},
        objective=four_axes,
        structure={},
    )
    found = [one for one in optional_effects(cast("Fit", fit)) if one.kind == STRENGTH]
    assert {frozenset((one.of, one.beside)) & {*"56"} for one in found} == {frozenset(), frozenset("56")}
    assert len(found) == 4
    (ill,) = (one for one in found if one.kept)
    assert ill.of == "1"
    assert ill.value == pytest.approx(0.8)
    low, high = ill.interval
    own = hypot(0.004, 0.8 * 0.004, 0.2 * 0.05) / 0.87  # that of the ratio of two numbers
    assert (low, high) == pytest.approx((0.8 - QUANTILE * own, 0.8 + QUANTILE * own))


def test_momentary_commands_lose_what_changes_between_rows() -> None:
    """White commands lose half of their variance, and held ones that change seldom nearly nothing."""
    rng = np.random.default_rng(0)
    assert beside_lines(rng.standard_normal(20000)) == pytest.approx(0.5, abs=0.02)
    assert beside_lines(np.repeat(rng.standard_normal(400), 50)) < 0.03
    assert beside_lines(np.zeros(10)) == 0.0


def off_beside(start: float, end: float) -> Callable[[Commands], Commands]:
    """Thrusters that are on between two times, s."""

    def acting(u: Commands) -> Commands:
        time = INTERVAL * np.arange(len(next(iter(u.values()))))
        return {n: np.where((time >= start) & (time < end), c, 0.0) for n, c in u.items()}

    return acting


@pytest.mark.parametrize(
    ("start", "end", "drag"), [(0.0, SECONDS, 2.0), (2.5, SECONDS, 1.0), (0.0, 40.0, 2.0), (4.0, 41.5, 1.0)]
)
def test_commands_are_idle_until_the_thrusters_are_on(start: float, end: float, drag: float, tmp_path: Path) -> None:
    """Also a vehicle with the wrong drag tells it, and none whose commands are reversed for the whole log."""
    logs = {"dive.csv": dive("videoray", Fault("", acting=off_beside(start, end)), np.random.default_rng(3))}
    tests = load_tests(folder_of(tmp_path, f'base = "videoray"\n{HEAD}', logs))
    model = Objective.of_known(*begin(tests))
    (of,) = HYPOTHESES["idle commands"].suspects(model.table.known, model.logs)
    z = np.array([p.mean + np.log(drag) * (p.kind == "quadratic drag") for p in model.table.parameters])
    found = times_of(model, z, of)
    assert tuple(found) == (of if start > 0.0 or end < SECONDS else ())
    for begins, ends in found.values():
        assert max(begins, 0.0) == pytest.approx(start, abs=0.35)
        assert min(ends, SECONDS) == pytest.approx(end, abs=0.35)
        changed = applied(model, {("idle commands", of): ((begins, ends),)}).logs[0].record
        whole = model.logs[0].record
        acts = (whole.told >= begins) & (whole.told < ends)
        assert not changed.inputs[~acts].any()
        assert np.array_equal(changed.inputs[acts], whole.inputs[acts])
    (sampled,) = model.logs
    assert not times_of(with_logs(model, [sampled.with_inputs(-sampled.record.inputs)]), z, of)


@pytest.mark.parametrize(
    ("values", "interval", "share"),
    [
        (np.tile([0.3, -0.2], 200), 0.1, 1.0),
        (np.tile([0.3, -0.2], 200), 0.02, 0.0),
        (np.tile([0.01, -0.01], 200), 0.1, 0.0),
        (np.sin(0.05 * np.arange(400)), 0.1, 0.0),
        (np.repeat([0.3, -0.3] * 40, 5), 0.1, 0.0),
    ],
    ids=["from row to row", "close rows", "small changes", "a pilot's stick", "steps that hold"],
)
def test_only_what_lines_between_far_rows_lack_is_lost(
    values: Array, interval: float, share: float, model: Objective
) -> None:
    """The same function decides in the hypotheses and in what `inspect` tells."""
    layout = model.table.known.layout
    thrusters = [t.name for t in layout.thrusters]
    rows = np.array([interval * n for n in range(len(values))])
    commands = tank_log.Commands.of_rows(thrusters, rows, np.array([values] * len(thrusters)).T, tank_log.Source(""))
    lost = lost_between_rows(replace(model.logs[0].log, commands=commands), layout)
    assert max(lost.values(), default=0.0) == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize("vehicle", spread(["bluerov2", "bluerov2_heavy"], ["bluerov2"]))
def test_a_flight_of_the_autopilot_has_momentary_commands(vehicle: str, tmp_path: Path) -> None:
    """The law changes them 400 times a second, so that the log has the noise of the estimates. Its rows stay apart."""
    logs = {"flight.csv": flown(rov_fmu.load(vehicle), 12.0, 1)}
    known, recorded, rows = begin(load_tests(folder_of(tmp_path, f'base = "{vehicle}"\n{HEAD}', logs)))
    assert list(HYPOTHESES["momentary commands"].suspects(known, recorded)) == [("flight.csv",)]
    plain = Objective.of_known(known, recorded, rows)
    (sampled,) = applied(plain, {("momentary commands", ("flight.csv",)): None}).logs
    assert sampled.is_momentary
    assert not list(HYPOTHESES["momentary commands"].suspects(known, [sampled]))
    least = 1e-3  # of full thrust
    assert sampled.record.beside is not None
    assert sampled.record.beside.shape == (len(sampled.record.told), len(sampled.layout.axes))
    assert np.all(sampled.record.beside >= least)
    assert np.any(sampled.record.beside > 5.0 * least)


def test_lines_between_momentary_commands_are_wrong_where_their_second_differences_are_large(model: Objective) -> None:
    """Commands that jump at any time and then settle, known 100 times per row, give the true mean of each row."""
    rng, rows, fine = np.random.default_rng(0), 400, 100
    target = np.repeat(rng.uniform(-0.5, 0.5, 40), rows * fine // 40)
    command, now = np.zeros(rows * fine), 0.0
    for n, wanted in enumerate(np.roll(target, 37)):
        now += (wanted - now) / fine  # a stick that moves within a row
        command[n] = now
    known, log = model.table.known, model.logs[0]
    layout, names = log.layout, [*log.layout.inputs]
    thrusters = [names.index(f"u_{t.name}") for t in layout.thrusters_along(SURGE)]
    axis = [form.axis for form in layout.axes].index(SURGE)

    def thrust(commands: Array) -> Array:
        inputs = np.zeros((len(commands), len(names)))
        inputs[:, thrusters] = commands[:, None]
        lines = log.with_inputs(inputs)
        return lines.thrust(known.coefficients, lines.record.inputs)[:, axis] / known.full["surge"]

    sampled = np.zeros((rows, len(names)))
    sampled[:, thrusters] = command[::fine, None]
    beside = log.with_inputs(sampled).with_lines(known.coefficients, known.full).record.beside
    assert beside is not None
    at_rows, between = thrust(command[::fine]), thrust(command[:: fine // 5]).reshape(rows, 5).mean(axis=1)
    lacking = np.abs(between[:-1] - 0.5 * (at_rows[1:] + at_rows[:-1]))
    size = beside[:-1, axis]
    calm, busy = size < np.quantile(size, 0.5), size > np.quantile(size, 0.95)
    assert np.sqrt(np.mean(lacking[busy] ** 2)) > 10.0 * np.sqrt(np.mean(lacking[calm] ** 2))
    assert 0.05 < np.sqrt(np.mean((lacking / size)[busy] ** 2)) < 0.6  # the prior: 0.25, within a factor of e


@pytest.mark.parametrize(("lack", "error"), [(0.0, 0.01), (0.04, np.hypot(0.01, 0.06)), (1e9, np.hypot(0.01, 1.0))])
def test_what_the_structure_lacks_changes_speeds_and_times_by_its_size(
    lack: float, error: float, model: Objective
) -> None:
    objective = model
    axes = [form.axis for form in model.table.known.layout.axes]
    z = np.array([p.mean for p in objective.table.parameters])
    found = unseen_errors(objective, z, {}, dict.fromkeys(axes, Misfit(1.0, lack)))
    exact = Posterior(objective.table, z, np.diag(np.full(len(z), 1e-8)))
    for axis in axes:
        if not model.table.known.coefficients[axis.coefficient("F_0")]:  # a load is no part of the thrust

            def logarithms(z: Array, axis: Axis = axis) -> Array:
                vehicle, shapes = objective.table.model(z)
                return np.log([part[0] for part in shapes.motions(vehicle, axis, np.array([0.5])).response()])

            _, covariance, _ = replace(exact, covariance=found).numbers(logarithms)
            assert np.sqrt(np.diag(covariance)) == pytest.approx([error, error], rel=0.01)


def at_truth(folder: Path) -> tuple[Objective, Minimum]:
    """Return J of dives of a vehicle that ships, and its numbers as a minimum."""
    objective = Objective.of_known(*begin(load_tests(folder)))
    z = objective.mean.copy()
    kinds = np.array([p.kind for p in objective.table.parameters])
    z[kinds == "lag"] = KINDS["lag"].low
    z[kinds == "logging offset"] = -KINDS["lag"].low  # without a lag, each row is at the time of its command
    runs = objective.runs(z)
    return objective, Minimum(z, 0.0, runs, [Data.of(run, [], len(z)) for run in runs], np.eye(len(z)))


def test_a_log_that_begins_in_motion_is_predicted_as_well_as_the_whole_one(tmp_path: Path) -> None:
    """Its predictions start 5 s after any first sample, and the time of none is rounded to before that."""
    title, *rows = dive("videoray", Fault(""), np.random.default_rng(3)).splitlines()
    some = {f"{n:02}.csv": "\n".join([title, *rows[n:]]) + "\n" for n in (0, *range(45, 60))}
    objective, best = at_truth(folder_of(tmp_path, f'base = "videoray"\n{HEAD}', some))
    for n, runs in enumerate(best.runs):
        ratios = structure(objective.of(DataPart([n], [])), replace(best, runs=[runs], data=[best.data[n]]))
        assert worst(ratios) < 1.2, n


@pytest.mark.parametrize("factor", [1.0, 1.15])
def test_the_spread_of_the_inertia_from_step_to_step_is_seen(factor: float, tmp_path: Path) -> None:
    """A dive with a larger and one with a smaller inertia, by a vehicle between both. Noise alone has next to none."""
    random = np.random.default_rng(4)
    some = {f"{n}.csv": dive("videoray", Fault("", inertia=factor**power), random) for n, power in enumerate((1, -1))}
    objective, best = at_truth(folder_of(tmp_path, f'base = "videoray"\n{HEAD}', some))
    before = structure(objective, best)
    after = with_steps(objective, best, before)
    for axis in (SURGE, YAW):
        assert after[axis].ratio == before[axis].ratio
        assert after[axis].spread == pytest.approx(np.log(factor), rel=0.2, abs=0.02)
    error = np.diag(unseen_errors(objective, best.z, {}, {YAW: Misfit(spread=0.2)}))
    own = [p.of == "yaw" and p.kind == "inertia" for p in objective.table.parameters]
    assert error[own] == pytest.approx(2.0 * 0.01**2 + 0.2**2)


def test_a_step_has_the_samples_of_2_s_and_before_the_next_one() -> None:
    """A stick that moves slowly has none, and one that moves on within 0.6 s has one."""
    told = np.arange(0.0, 10.0, 0.1)
    push = np.where(told < 3.0, 0.0, np.where(told < 3.45, 0.2, np.where(told < 4.0, 0.5, 0.1)))
    spans = [told[at] for at in _after_steps(push, told, told)]
    assert [(at[0], at[-1]) for at in spans] == [pytest.approx((3.0, 3.9)), pytest.approx((4.0, 5.9))]
    assert not [*_after_steps(0.05 * told, told, told)]


def test_a_spread_is_what_exceeds_the_errors() -> None:
    """For equal errors, it is the sample variance minus theirs."""
    values, error = np.array([0.3, -0.2, 0.1, 0.5, -0.4]), 0.1
    weights = np.full(5, error**-2)
    assert _spread(values, weights) == pytest.approx(np.sqrt(np.var(values, ddof=1) - error**2))
    assert _spread(values, weights / 20.0) == 0.0
    assert _spread(values[:3], weights[:3]) == 0.0


@pytest.mark.parametrize("shared", [0.0, 0.06])
def test_a_lag_is_as_uncertain_as_what_commands_do_between_rows(shared: float, model: Objective) -> None:
    """Its interval contains what all sensors share. A log without such commands tells it."""
    nothing, (log,) = dict.fromkeys((form.axis for form in model.table.known.layout.axes), Misfit()), model.logs
    lost, other = replace(log, lost={"yaw": 0.1}), replace(log, log=replace(log.log, file="other.csv"))
    error = np.hypot(log.interval / (2.0 * np.pi), shared / QUANTILE)
    for logs, expected in (([lost], error), ([lost, other], 0.0)):
        objective = with_logs(model, logs)
        parameters = objective.table.parameters
        sensors = [n for n, p in enumerate(parameters) if p.kind == "sensor lag"]
        (lag,) = (n for n, p in enumerate(parameters) if p.kind == "lag")
        z = np.array([p.mean for p in parameters])
        z[sensors] = shared + 0.1 * np.arange(len(sensors))
        found = unseen_errors(objective, z, {}, nothing)
        for n in sensors:
            both = found[np.ix_([lag, n], [lag, n])]
            assert np.diag(both) ** 0.5 == pytest.approx([expected, expected])
            assert both.sum() == pytest.approx(0.0, abs=1e-12), "the sum is told"


def test_errors_that_no_log_shows_are_those_of_the_time_of_commands_and_of_the_scale_of_sensors(
    model: Objective,
) -> None:
    """Of a vehicle whose velocities are all 1 % larger, and whose time constants are longer by a shift of commands."""
    nothing = dict.fromkeys((form.axis for form in model.table.known.layout.axes), Misfit())
    objective = with_logs(model, [replace(one, lost={"yaw": 0.1}) for one in model.logs])
    table, (sampled,) = objective.table, objective.logs
    index, file = table.index("logging width", sampled.log.file), sampled.log.file
    assert index is not None
    z = np.array([p.mean for p in table.parameters])
    vehicle, shapes = table.model(z)
    for width, window in ((0.05, 0.2), (0.4, 0.4), (0.6, 1.0)):  # beyond a half, commands change at any time
        z[index] = width
        assert windows(objective, z) == {file: pytest.approx(window)}
        found = unseen_errors(objective, z, {}, nothing)
        assert np.array_equal(found, found.T)
        for axis in vehicle.layout.bare_axes:
            own = {p.kind: n for n, p in enumerate(table.parameters) if p.of == axis.name}
            _, time = shapes.motions(vehicle, axis, np.array([0.5])).response()
            late = 0.05 * window * sampled.interval / time[0]
            assert found[own["inertia"], own["inertia"]] == pytest.approx(2.0 * 0.01**2 + late**2)
            larger = z.copy()  # by a standard error of the scale
            for kind in ("quadratic drag", "linear drag", "inertia"):
                larger[own[kind]] -= found[own[kind], own["linear drag"]] / 0.01
            before, after = (
                np.array([part[0] for part in sh.motions(v, axis, np.array([0.5])).response()])
                for v, sh in (table.model(z), table.model(larger))
            )
            if not vehicle[axis.coefficient("F_0")]:  # a load is no part of the thrust
                assert after / before == pytest.approx([1.01, 1.0], abs=2e-4)
    narrow = Posterior(table, z, np.diag(np.full(len(z), 1e-4)))
    assert np.allclose(narrow.widened({}, found).covariance, narrow.covariance + found)
    assert narrow.widened({}, np.zeros_like(found)) is narrow


@pytest.mark.parametrize("kind", [POWER, POWER_ASTERN])
@pytest.mark.parametrize("power", [-0.5, 0.5])
def test_an_unusual_form_of_drag_is_a_lack_of_its_axis_alone(kind: str, power: float, model: Objective) -> None:
    table, z = model.table, model.mean.copy()
    n = table.index(kind, "surge")
    assert n is not None
    z[n] = power
    found = np.diag(unseen_errors(model, z, {}, {axis: Misfit() for axis in table.layout.bare_axes}))
    for m, p in enumerate(table.parameters):
        if p.kind == "linear drag":  # b/s, of a scale s of speeds
            lack = np.hypot(0.01, 0.05) if p.of == "surge" else 0.01
            assert np.sqrt(found[m]) == pytest.approx(lack)


@pytest.mark.parametrize("health", spread([1.0, 0.5], [0.5], [1.0]))
def test_only_what_is_named_silences_the_alarm(health: float, tmp_path: Path) -> None:
    """The heading of the vehicle is unstable, and its controller acts between the rows of the log.

    So the vehicle that flew cannot be predicted over 10 s, and is right all the same. The model that lacks an ill
    thruster is wrong, although large slow and short forces explain each next sample.
    """
    logs = {"flight.csv": flown(rov_fmu.load("bluerov2").with_(health_3=health), 25.0, 1)}
    held = Objective.of_known(*begin(load_tests(folder_of(tmp_path, f'base = "bluerov2"\n{HEAD}', logs))))
    loud = {"slow force", "short force", "slow gain", "coloured noise"} if health < 1.0 else set[str]()
    for objective in (held, applied(held, {("momentary commands", ("flight.csv",)): None})):
        z = np.array(
            [p.mean + 2.0 * p.deviation * (p.kind in loud and not p.is_fixed) for p in objective.table.parameters]
        )
        runs = objective.runs(z)
        data = [Data.of(run, [], len(z)) for run in runs]
        best = Minimum(z, objective.value(z, runs), runs, data, np.eye(len(z)))
        assert np.sqrt(np.mean(data[0].normalised ** 2)) < 1.5
        errors = {axis.name: one.ratio for axis, one in structure(objective, best).items()}
        if health < 1.0:
            assert errors["yaw"] > ALARM
        else:
            assert max(errors.values()) < USUAL
        if objective is held:
            ahead = {axis.name: one.ratio for axis, one in structure(objective, best, ahead=True).items()}
            assert ahead["yaw"] > ALARM


def test_a_wrong_structure_widens_what_it_concerns_and_never_beyond_the_prior(model: Objective) -> None:
    table = model.table
    deviation = np.array([p.deviation for p in table.parameters])
    narrow = Posterior.of(table, model.mean, np.diag(2.0 / (0.01 * deviation) ** 2))
    axes = [form.axis for form in model.table.known.layout.axes]
    nothing = np.zeros((len(deviation), len(deviation)))
    assert narrow.widened(dict.fromkeys(axes, (1.0, 1.0)), nothing) is narrow
    errors = narrow.widened(dict.fromkeys(axes, (1.01, 1.01)), nothing).errors
    slightly = errors[model.free] / narrow.errors[model.free]
    assert 1.0 - 1e-12 <= slightly.min() <= slightly.max() < 1.03, "there is no cliff"
    for of_all, factor in ((5.0, np.sqrt(1.0 + 2.0 * 24.0)), (1.0, 1.0)):
        wide = narrow.widened({axis: (of_all, 5.0) if axis.name == "heave" else (1.0, 1.0) for axis in axes}, nothing)
        for p, before, after, prior in zip(table.parameters, narrow.errors, wide.errors, deviation, strict=True):
            if p.kind in ("inertia", "quadratic drag"):
                own = np.sqrt(1.0 + 2.0 * 24.0) if p.kind == "inertia" else factor
                assert after == pytest.approx((own if p.of == "heave" else 1.0) * before, rel=0.02)
            assert after <= prior * (1.0 + 1e-6)
    assert np.all(narrow.widened(dict.fromkeys(axes, (np.inf, np.inf)), nothing).errors <= deviation * (1.0 + 1e-6))


# ---- The search ------------------------------------------------------------------------------------------------------


OFF: Suspect = NEUTRAL, ("r",)
OWN: Suspect = OWN_CURVE, ("r",)
DROP: Suspect = "voltage drop", ()
SLEW: Suspect = "slew limit", ()
ROTORS: Suspect = "rotor lag", ()


@pytest.fixture(scope="module")
def ill_model(tmp_path_factory: pytest.TempPathFactory) -> Objective:
    """A dive with a thruster that pushes less astern."""
    fault = faults(["l", "r"])["astern"]
    return Objective.of_known(*begin(load_tests(folder(tmp_path_factory.mktemp("ill"), "videoray", fault, 2))))


def test_before_any_fit_j_shows_which_thruster_is_ill(ill_model: Objective) -> None:
    J = comparison(ill_model, {}, rough(ill_model.table))
    values = {
        (kind, of): min(J({(kind, of): start}) for start in hypothesis.starts or (None,))
        for kind, hypothesis in HYPOTHESES.items()
        if hypothesis.changes_thrust and not hypothesis.has_times
        for of in hypothesis.suspects(ill_model.table.known, ill_model.logs)
    }
    assert min(values, key=lambda key: values[key]) == OWN


def test_the_data_tell_the_health_of_a_thruster_that_turns_the_vehicle_and_not_of_one_that_is_alone(
    model: Objective,
) -> None:
    """Of the vertical one, less drag, inertia and load explain the motion as well."""
    told = contrasts(model, model.mean)
    assert max(told["l"], told["r"]) < 0.1 * CONTRAST
    assert told["t"] > 2.0 * CONTRAST


@pytest.mark.parametrize(
    ("before", "after", "names"),
    [
        ({SURGE: 9.0, YAW: 9.0, HEAVE: 1.0}, {SURGE: 1.2, YAW: 1.5, HEAVE: 1.0}, [OWN]),
        ({SURGE: 9.0, YAW: 9.0, HEAVE: 1.0}, {SURGE: 1.2, YAW: 1.5, HEAVE: 4.0}, []),
        ({SURGE: 9.0, YAW: 9.0, HEAVE: 1.0}, {SURGE: 1.2, YAW: 6.0, HEAVE: 1.0}, []),
        ({SURGE: 3.2, YAW: 1.0, HEAVE: 1.0}, {SURGE: 2.4, YAW: 1.0, HEAVE: 1.0}, []),
        ({SURGE: 2.0, YAW: 1.0, HEAVE: 1.0}, {SURGE: 1.4, YAW: 1.0, HEAVE: 1.0}, [OWN]),
        ({SURGE: 2.0, YAW: 1.0, HEAVE: 1.0}, {SURGE: 1.45, YAW: 1.0, HEAVE: 1.0}, []),
        ({SURGE: 1.0, YAW: 1.0, HEAVE: 6.0}, {SURGE: 1.0, YAW: 1.0, HEAVE: 6.0}, []),
    ],
)
def test_a_cause_is_named_if_it_explains_the_errors_along_its_axes_and_makes_no_others(
    before: dict[Axis, float],
    after: dict[Axis, float],
    names: list[Suspect],
    ill_model: Objective,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The other one comes nearest, and the model that is told is without it."""
    errors = {"plain": before, "dead": after}
    monkeypatch.setattr(
        "rov_fmu.identify.likelihood.search.structure",
        lambda _, of: {axis: Misfit(error) for axis, error in errors[of].items()},
    )
    plain, dead = (
        StructureFit(starts, ill_model, cast("Minimum", of), score, score)
        for starts, of, score in (({}, "plain", 0.0), ({OWN: 0.0}, "dead", 100.0))
    )
    search = searching(plain, dead, monkeypatch)
    search.run()
    assert [*search.odds] == names
    assert search.refuted == ({} if names else {OWN: 0.0})
    assert search.now is (dead if names else plain)


@pytest.mark.parametrize(
    ("suspect", "end", "after", "is_named"),
    [
        (DROP, 0.4, {SURGE: 1.2, YAW: 1.2}, True),
        (DROP, 0.5, {SURGE: 1.2, YAW: 1.2}, False),
        ((TURN, ()), np.pi, {SURGE: 1.2, YAW: 1.2}, True),
        (ROTORS, None, {SURGE: 9.0, YAW: 2.9}, True),
        (ROTORS, None, {SURGE: 9.0, YAW: 3.1}, False),
    ],
)
def test_no_cause_is_named_at_a_bound_of_the_search_nor_a_lag_where_no_axis_is_right(
    suspect: Suspect,
    end: float | None,
    after: dict[Axis, float],
    is_named: bool,
    four_axes: Objective,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A sensor that is turned about is at a bound beyond which nothing lies."""
    errors = {"plain": {SURGE: 9.0, YAW: 9.0}, "with": after}
    monkeypatch.setattr(
        "rov_fmu.identify.likelihood.search.structure",
        lambda _, of: {axis: Misfit(error) for axis, error in errors[of].items()},
    )
    plain = StructureFit({}, four_axes, cast("Minimum", "plain"), 0.0, 0.0)
    changed = applied(four_axes, {suspect: end})
    search = searching(plain, StructureFit({suspect: end}, changed, cast("Minimum", "with"), 100.0, 100.0), monkeypatch)
    search.run()
    assert [*search.odds] == [suspect] * is_named
    assert [*search.refuted] == [suspect] * (not is_named)


def searching(plain: StructureFit, now: StructureFit, monkeypatch: pytest.MonkeyPatch) -> StructureSearch:
    """A search that holds a fit, and in which nothing asks for another one."""
    search = StructureSearch(plain)
    search.suspects, search.apart, search.now = {OFF: (None,), OWN: (0.5,)}, {}, now
    search.tried[frozenset(now.starts)] = now
    monkeypatch.setattr(search, "_round", list)
    return search


def test_a_hypothesis_begins_as_in_a_first_fit_where_the_end_of_another_diverges(
    ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With more noise than at that end, it would stay far from its minimum, and no lag of rotors would be found."""
    starts = list[Array]()

    def diverging(_: Objective, z: Array, *__: object, **___: object) -> Minimum:
        starts.append(z)
        raise DivergedError

    monkeypatch.setattr("rov_fmu.identify.likelihood.solve._minimised", diverging)
    z = ill_model.mean + 0.01
    near = StructureFit({}, ill_model, Minimum(z, 0.0, [], [], np.eye(len(z))), 0.0, 0.0)
    assert fitted(near, ill_model, {ROTORS: None}, 0.0) is None
    thinned = applied(ill_model, {ROTORS: None}, thinned=True)
    assert np.array_equal(starts[1], np.clip(start_of(thinned), thinned.low, thinned.high))
    assert not np.array_equal(starts[0], starts[1])


def one_more(search: StructureSearch) -> list[Starts]:
    """The sets with one hypothesis more, none of which was tried or refuted."""
    others = (
        {**search.now.starts, one: start} for one, (start,) in search.suspects.items() if one not in search.refuted
    )
    return [some for some in others if frozenset(some) not in search.tried]


@pytest.mark.parametrize("surge", [1.4, 9.0])
def test_what_explains_nothing_keeps_no_other_hypothesis_from_being_named(
    surge: float, ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slew limit wins by far, and the errors stay. Without it, a lag of the rotors explains an axis, or both."""
    scores = {frozenset[Suspect](): 0.0, frozenset({SLEW}): 50.0, frozenset({ROTORS}): 30.0}
    scores[frozenset({SLEW, ROTORS})] = 52.0
    errors = {one: {SURGE: surge, YAW: 1.4} if ROTORS in one else {SURGE: 9.0, YAW: 9.0} for one in scores}

    def fit(_: object, __: object, starts: Starts, *___: object) -> StructureFit:
        key = frozenset(starts)
        return StructureFit(starts, ill_model, cast("Minimum", key), scores[key], scores[key])

    monkeypatch.setattr("rov_fmu.identify.likelihood.search.fitted", fit)
    monkeypatch.setattr(
        "rov_fmu.identify.likelihood.search.structure",
        lambda _, of, **__: {axis: Misfit(error) for axis, error in errors[of].items()},
    )
    monkeypatch.setattr(StructureFit, "needed", property(lambda self: self.starts))
    search = StructureSearch(fit(None, None, {}))
    search.suspects, search.apart = {SLEW: (1.0,), ROTORS: (None,)}, {}
    monkeypatch.setattr(search, "_promising", partial(one_more, search))
    search.run()
    assert search.odds == {ROTORS: 30.0}
    assert [*search.refuted] == [SLEW]


@pytest.mark.parametrize(("yaw", "is_late", "has_ended"), [(9.0, True, True), (9.0, False, False), (4.0, True, False)])
def test_a_search_ends_when_it_is_late_and_the_model_is_wrong_along_all_axes(
    yaw: float, is_late: bool, has_ended: bool, ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is tried in the first round may explain the errors. Beyond it, a fit adds nothing that anybody could use."""
    fits = list[frozenset[Suspect]]()

    def fit(_: object, __: object, starts: Starts, *___: object) -> StructureFit:
        fits.append(frozenset(starts))
        return StructureFit(starts, ill_model, cast("Minimum", None), 20.0 * len(starts), 0.0)

    monkeypatch.setattr("rov_fmu.identify.likelihood.search.fitted", fit)
    monkeypatch.setattr(
        "rov_fmu.identify.likelihood.search.structure", lambda *_, **__: {SURGE: Misfit(9.0), YAW: Misfit(yaw)}
    )
    monkeypatch.setattr(StructureFit, "needed", property(lambda self: self.starts))
    search = StructureSearch(fit(None, None, {}), most=1 if is_late else 9)
    search.suspects, search.apart = {SLEW: (1.0,), ROTORS: (None,)}, {}
    monkeypatch.setattr(search, "_promising", partial(one_more, search))
    search.run()
    assert fits[:3] == [frozenset[Suspect](), frozenset({SLEW}), frozenset({ROTORS})]
    assert (len(fits) == 3, search.has_ended, search.now.starts) == (has_ended, has_ended, {})


def test_a_fit_that_will_not_be_good_enough_is_given_up(ill_model: Objective, monkeypatch: pytest.MonkeyPatch) -> None:
    quick, steps, derivatives = applied(ill_model, {}, thinned=True), list[Array](), Objective.data

    def counted(self: Objective, z: Array, *some: Any, **how: Any) -> list[Data]:
        steps.append(z)
        return derivatives(self, z, *some, **how)

    monkeypatch.setattr(Objective, "data", counted)
    near = StructureFit({}, quick, minimise(quick, start_of(quick), most=1, last=False), 0.0, 0.0)
    counts = list[int]()
    for enough in (1e6, 0.0):
        steps.clear()
        found = fitted(near, ill_model, {ROTORS: None}, 0.0, enough)
        counts.append(len(steps))
        assert (found is None) == (enough > 0.0)
    assert 2 * counts[0] < counts[1]


@pytest.mark.parametrize(("ratio", "searches"), [(99.0, True), (101.0, False)])
def test_no_cause_is_tried_where_the_errors_are_far_beyond_any(
    ratio: float, searches: bool, ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Along all axes. The search has ended then, which is told, and nothing is refined."""
    misfits = {SURGE: Misfit(ratio), YAW: Misfit(300.0)}
    monkeypatch.setattr(StructureFit, "misfits", property(lambda _: misfits))
    begun = list[StructureSearch]()

    def run(self: StructureSearch) -> None:
        begun.append(self)

    monkeypatch.setattr(StructureSearch, "run", run)
    quick = applied(ill_model, {}, thinned=True)
    end = minimise(quick, start_of(quick), most=1)
    start = StructureFit({}, quick, end, 0.0, 0.0)
    search, _ = _searched_for_structure(start, ill_model, ProgressReport(), is_mistake=False)
    assert bool(begun) == searches
    assert search.has_ended == (not searches)


@pytest.mark.parametrize(("alone", "names"), [(28.0, [OFF]), (15.0, [OFF, OWN])])
def test_a_hypothesis_leaves_if_a_later_one_explains_as_much_without_it(
    alone: float, names: list[Suspect], ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No alarm asks for it: the fit with both is as good as that with the right one."""
    scores = {frozenset[Suspect](): 0.0, frozenset({OWN, OFF}): 30.0}
    scores |= {frozenset({OFF}): alone, frozenset({OWN}): 12.0}

    def fit(_: object, __: object, starts: Starts, *___: object) -> StructureFit:
        score = scores[frozenset(starts)]
        return StructureFit(starts, ill_model, cast("Minimum", None), score, score)

    monkeypatch.setattr("rov_fmu.identify.likelihood.search.structure", lambda *_, **__: {})
    monkeypatch.setattr("rov_fmu.identify.likelihood.search.fitted", fit)
    monkeypatch.setattr(StructureFit, "needed", property(lambda self: self.starts))
    search = StructureSearch(fit(None, None, {}))
    search.suspects, search.apart = {OFF: (None,), OWN: (0.5,)}, {}
    search.now = fit(None, None, {OWN: 0.5, OFF: None})
    search.tried[frozenset(search.now.starts)] = search.now
    search.run()
    assert {*search.odds} == {*names}
    best = scores[frozenset(names)]
    assert search.odds == {name: best - max(scores[some] for some in scores if name not in some) for name in names}


@pytest.mark.parametrize(("again", "names"), [(38.0, {OFF}), (20.0, {OFF, OWN})])
def test_another_minimum_is_no_evidence_for_a_hypothesis(
    again: float, names: set[Suspect], ill_model: Objective, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit is much better with a thruster that ends whole. So it is without that hypothesis, if begun from there."""

    def fit(starts: Starts, score: float) -> StructureFit:
        return StructureFit(starts, ill_model, cast("Minimum", None), score, 0.0)

    monkeypatch.setattr("rov_fmu.identify.likelihood.search.fitted", lambda _, __, starts, *___: fit(starts, again))
    monkeypatch.setattr("rov_fmu.identify.likelihood.search.structure", lambda *_, **__: {})
    monkeypatch.setattr(
        StructureFit, "needed", property(lambda self: {k: z for k, z in self.starts.items() if k != OWN})
    )
    search = searching(fit({}, 0.0), fit({OFF: None}, 10.0), monkeypatch)
    both = search.tried[frozenset({OFF, OWN})] = fit({OFF: None, OWN: 1.0}, 40.0)
    rounds = iter([[both]])
    monkeypatch.setattr(search, "_round", lambda: next(rounds, []))
    search.run()
    assert {*search.now.starts} == names


@pytest.mark.weekly
def test_a_wrong_hypothesis_is_taken_back(ill_model: Objective, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the voltage is taken to fall, because nothing else was thought of, the alarm stays.

    The right hypothesis is found from either fit, although the noise of both explains what it would.
    """
    monkeypatch.setattr(
        "rov_fmu.identify.likelihood.search.applied", lambda plain, starts, **_: applied(plain, starts, thinned=True)
    )
    quick = applied(ill_model, {}, thinned=True)
    quick.is_thinned = False  # it stands for all samples
    near = minimise(quick, start_of(quick), enough=8.0, last=False)
    start = evidence(quick, near)
    search = StructureSearch(StructureFit({}, quick, near, start, start))
    other, right = (fitted(search.now, ill_model, {one: z}, 0.0) for one, z in ((DROP, 0.1), (OWN, 0.0)))
    assert other
    assert right
    assert right.score > other.score > search.now.score
    search.tried[frozenset({DROP})] = search.now = other
    search.run()
    assert [*search.odds] == [OWN]
    assert worst(structure(search.now.objective, search.now.minimum)) < ALARM


# ---- What wins -------------------------------------------------------------------------------------------------------


def check(path: Path, vehicle: str, fault: Fault, seed: int, dives: int) -> None:
    tests = load_tests(folder(path, vehicle, fault, seed, dives))
    found = identify(tests)
    assert [(one.kind, one.of) for one in found.structures] == [(fault.kind, fault.of)] * bool(fault.kind)
    assert not found.slips
    for told in found.structures:
        assert told.probability > 0.95
        if fault.value is not None:
            ((low, high),) = (one.interval for one in found.effects if one.kind == told.kind and one.of == told.of)
            assert low - 0.03 <= fault.value <= high + 0.03
    assert found.vehicle.layout.coupled == (vehicle == "bluerov2")
    if not fault.kind and fault.of:
        ill = {one.of: one for one in found.effects if one.kind == STRENGTH and one.kept}
        (low, high), other = ill[fault.of].interval, ill[fault.of].beside
        assert low - 0.005 <= fault.health <= high + 0.005
        assert found.vehicle[f"health_{fault.of}"] < (fault.health + 0.05) * found.vehicle[f"health_{other}"]


@pytest.mark.parametrize("health", spread([0.0, 0.94], (), [0.0]))
def test_a_thruster_that_is_dead_or_a_little_weaker_is_told(health: float, tmp_path: Path) -> None:
    check(tmp_path, "videoray", Fault("", "l", health), 1, 1)


@pytest.mark.weekly
def test_the_angle_and_the_places_of_thrusters_are_told_and_written(tmp_path: Path) -> None:
    found = identify(load_tests(folder(tmp_path, "bluerov2", Fault("", angle=np.radians(41.0)), 1, 2)))
    assert {axis.verdict.word for axis in found.axes} == {"good"}
    told = {one.kind: one for one in found.effects if one.kept and one.kind in (DIRECTION, SHIFT)}
    for kind, truth in ((DIRECTION, np.radians(41.0)), (SHIFT, 0.005)):
        low, high = told[kind].interval
        assert low <= truth <= high
    for before, now in zip(
        load_vehicle(SHIPPED["bluerov2"]).layout.thrusters, found.vehicle.layout.thrusters, strict=True
    ):
        X, Y, Z = now.direction.value
        assert abs(Z) == 1.0 or np.degrees(np.arctan2(abs(Y), abs(X))) == pytest.approx(41.0, abs=0.5)
        assert now.place[0] - before.place[0] == pytest.approx(0.005, abs=0.0015)


@pytest.mark.weekly
def test_a_thruster_with_a_curve_of_its_own_is_named(tmp_path: Path) -> None:
    """Commands astern act at 0.8 of what they are."""
    check(tmp_path, "videoray", faults(["l", "r"])["astern"], 1, 1)


@pytest.mark.weekly
def test_a_coupled_vehicle_is_named_and_written(tmp_path: Path) -> None:
    check(tmp_path, "bluerov2", Fault("coupling"), 1, 1)


@pytest.mark.weekly
def test_rotors_whose_speed_lags_are_told_from_a_lag_of_the_force(tmp_path: Path) -> None:
    check(tmp_path, "videoray", faults(["l", "r"])["rotors"], 1, 1)


@pytest.mark.weekly
@pytest.mark.parametrize("turned", TURNS)
def test_a_turned_velocity_sensor_is_named_and_turned_back(turned: float, tmp_path: Path) -> None:
    angle = np.radians(turned)
    check(tmp_path, "bluerov2", Fault(TURN, turned=angle, value=angle), 1, 1)


@pytest.mark.weekly
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", [*faults(["l", "r"])])
@pytest.mark.parametrize(("vehicle", "names"), [("videoray", ["l", "r"]), ("bluerov2", ["1", "2"])])
def test_faults_are_named(vehicle: str, names: list[str], name: str, seed: int, tmp_path: Path) -> None:
    assert vehicle in SHIPPED
    check(tmp_path, vehicle, faults(names)[name], seed, 2)


def test_what_shows_along_one_axis_alone_is_no_fault_of_its_thrusters() -> None:
    """Nothing measures heave here, and no other axis of the VideoRay has its thruster."""
    large, small, none = Misfit(7.0, 0.1), Misfit(0.2, 0.02), Misfit()
    measured = {SURGE: large, YAW: small}
    assert with_shared(VIDEORAY.layout, measured) == {**measured, HEAVE: none}
    assert with_shared(VIDEORAY.layout, {SURGE: large}) == {SURGE: large, YAW: large, HEAVE: none}
