"""What the structure of the model may lack: one table of hypotheses, and J where some of them are true.

A hypothesis frees rows of the table of parameters, which otherwise stay where they change nothing, or it changes what
the filter reads of the logs: which commands act, and what lies between them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf, pi, radians

import numpy as np
from scipy.special import expit

from rov_fmu.equation.catalogue import COUPLED_AXES, CURVE, REVERSE, SURGE, SWAY, YAW
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.kinds import KINDS, LAG, NEUTRAL, OWN_CURVE, OWN_KEYS, PRIORS, TURN
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import LEAST_COMMAND, SampledLog
from rov_fmu.identify.result import ALARM, CONSTANTS
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import listed
from rov_fmu.io.numbers import percent, significant
from rov_fmu.tank.arrays import Array

_FINEST = 0.05
"""The time between two rows within which a slew limit moves a command, s."""
_WEAK, _WIDER = 0.7, 10.0
"""The health of thrusters at which the data are asked about it, and how many times as wide the priors are then."""
CONTRAST = CONSTANTS["contrast"].value
"""A hypothesis about single thrusters is tried if the data alone tell the health of each to this standard error."""
_ROUNDING = 1e-13
"""What is smaller relative to the largest eigenvalue of the scaled information is rounding."""

Logs = Sequence[SampledLog]
Of = tuple[str, ...]
"""The names of the thrusters or files that a hypothesis is about; empty if it is about all of them."""
Suspect = tuple[str, Of]
"""A key of HYPOTHESES, which is also the kind of its row, and what may have it."""
Acting = tuple[tuple[float, float], ...]
"""When the commands of each of some files begin to act, and when they end, s."""
Start = float | Acting | None
"""The coordinate from which the row of a hypothesis begins, or the times between which it holds; None without both."""
Starts = Mapping[Suspect, Start]
"""Hypotheses that hold together, and where each begins or ends."""
Change = Callable[[Prior, Logs, Of, Start], tuple[Prior, Logs]]
Suspects = Callable[[Prior, Logs], Iterator[Of]]
InWords = Callable[[Prior, Logs, Of, Start], dict[str, str]]


@dataclass(frozen=True)
class Hypothesis:
    """How the model may be wrong, and what changes it."""

    probability: float
    """The prior probability that it is true of any thrusters or files: how many folders have it."""
    suspects: Suspects
    """What may have it: thrusters, or files."""
    change: Change = lambda known, logs, _of, _start: (known, logs)
    """The model with it, beside its row."""
    starts: tuple[float, ...] = ()
    """The coordinates from which its row begins; empty if it has none."""
    sentence: str = ""
    """What is told, with `in_words`, `value`, the number of the row, and `odds`."""
    in_words: InWords = lambda _known, _logs, of, _start: {"of": listed(of)}
    """What may have it, as `of`, and what else the sentence says about it."""
    least: float = 0.0
    """If the number of its row is nearer than this to where it is absent, it is told as an effect alone."""
    ends: tuple[float, ...] = ()
    """The bounds of its row at which its number may be, because nothing lies beyond."""
    alarm: float = ALARM
    """The error over 10 s, relative to the noise, above which it is tried."""
    changes_thrust: bool = True
    """True if it changes the steady forces, so that J shows how likely it is before any fit."""
    has_times: bool = False
    """True if it holds at the beginning and the end of logs, and the unknown force tells until and from when."""
    is_contrast: bool = False
    """True if it is about single thrusters. It is tried only where the data tell these apart from the others."""


# ---- The changes of what the filter reads ----------------------------------------------------------------------------


def _in_logs(changed: Callable[[Prior, SampledLog], SampledLog]) -> Change:
    """Return the change of each log of some files, or of all logs if it is about none."""

    def change(known: Prior, logs: Logs, of: Of, _: Start) -> tuple[Prior, Logs]:
        return known, [one if of and one.file not in of else changed(known, one) for one in logs]

    return change


def _without_idle(known: Prior, logs: Logs, of: Of, start: Start) -> tuple[Prior, Logs]:
    """Return the logs without the commands that do not act."""
    assert isinstance(start, tuple)
    times, found = dict(zip(of, start, strict=True)), []
    for one in logs:
        begin, end = times.get(one.file, (-inf, inf))
        acts = (one.record.told >= begin) & (one.record.told < end)
        found.append(one.with_inputs(np.where(acts[:, None], one.record.inputs, 0.0)))
    return known, found


def _of_layout(changed: Callable[[Layout, Of], Layout]) -> Change:
    """Return the change of the structure of the vehicle, in all logs."""

    def change(known: Prior, logs: Logs, of: Of, _: Start) -> tuple[Prior, Logs]:
        layout = changed(known.layout, of)
        curves = [layout.curves_by_name[curve.name] for curve in known.curves]
        changed_logs = [replace(one, layout=changed(one.layout, of)) for one in logs]
        return replace(known, layout=layout, curves=curves), changed_logs

    return change


def _turned_round(known: Prior, logs: Logs, of: Of, start: Start) -> tuple[Prior, Logs]:
    """Return the model in which some thrusters work astern where they worked ahead, and push to the same side."""

    def opposite(layout: Layout, of: Of) -> Layout:
        return replace(layout, thrusters=tuple(t.opposite if t.name in of else t for t in layout.thrusters))

    signs = ([-1.0 if name in {f"u_{one}" for one in of} else 1.0 for name in log.layout.inputs] for log in logs)
    changed = [log.with_inputs(log.record.inputs * own) for log, own in zip(logs, signs, strict=True)]
    return _of_layout(opposite)(known, changed, of, start)


def _with_rotors(layout: Layout, _: Of) -> Layout:
    return replace(layout, curves=tuple(replace(curve, lag="speed") for curve in layout.curves))


def _coupled(layout: Layout, _: Of) -> Layout:
    return replace(layout, coupled=all(map(layout.has, COUPLED_AXES)))


def _name_of_own(layout: Layout, thruster: str) -> str:
    return f"{layout.curve_of[thruster].name}_{thruster}"


def _with_own_curve(layout: Layout, of: Of) -> Layout:
    """Return the layout in which one thruster has a curve of its own, with a thrust and a dead band astern."""
    (name,) = of
    if name not in layout.curve_of:
        return layout
    shared, own = layout.curve_of[name], _name_of_own(layout, name)
    wanted = {*shared.keys, *(f"{key}{end}" for key in OWN_KEYS for end in ("", REVERSE))}
    current = shared.electric_current and replace(shared.electric_current, name=own)
    keys = tuple(key for key in CURVE if key in wanted)
    curve = replace(shared, name=own, keys=keys, electric_current=current)
    thrusters = (replace(one, curve=own) if one.name == name else one for one in layout.thrusters)
    return replace(layout, curves=(*layout.curves, curve), thrusters=tuple(thrusters))


def _differing(known: Prior, logs: Logs, of: Of, start: Start) -> tuple[Prior, Logs]:
    """Give one thruster a curve of its own, with the numbers of the one that it shared. Those astern may differ."""
    (name,), shared = of, known.layout.curve_of[of[0]]
    own = _name_of_own(known.layout, name)
    known, logs = _of_layout(_with_own_curve)(known, logs, of, start)
    curve = known.layout.curves_by_name[own]
    values = {curve.name_of(key): known.coefficients.get(shared.coefficient(key), 0.0) for key in curve.keys}
    kept = {*shared.keys}.difference((f"a_t{REVERSE}", f"b_t{REVERSE}", "c_0"))
    return replace(
        known,
        coefficients={**known.coefficients, **values},
        curves=[*known.curves, curve],
        exact=known.exact.union(curve.name_of(key) for key in kept if shared.coefficient(key) in known.exact),
        own_curves={**known.own_curves, own: (shared.name, name)},
    ), logs


# ---- What may have them ----------------------------------------------------------------------------------------------


def dive_commands(sampled: SampledLog) -> dict[str, Array]:
    """Return the commands of a dive's thrusters, by their names, in each row.

    It is empty for a log of one axis, whose thrusters all follow one command: no contrast tells them apart.
    """
    if sampled.log.follows_axis:
        return {}
    names = [*sampled.layout.inputs]
    return {t.name: sampled.record.inputs[:, names.index(f"u_{t.name}")] for t in sampled.layout.thrusters}


def _files(may_have: Callable[[SampledLog], bool]) -> Suspects:
    """Return the function that yields one suspect, about all logs that may have something, if there are any."""

    def suspects(_: Prior, logs: Logs) -> Iterator[Of]:
        if files := tuple(one.file for one in logs if may_have(one)):
            yield files

    return suspects


def _has_commands_at_ends(sampled: SampledLog) -> bool:
    """Return True if the first or the last row has a command."""
    return bool(np.abs(sampled.record.inputs[[0, -1]]).max() > LEAST_COMMAND)


def _with_both_velocities(_: Prior, logs: Logs) -> Iterator[Of]:
    """Yield one suspect, about all logs, if one has the velocity over ground both ahead and to starboard."""
    if any({SURGE, SWAY} <= {s.axis for s in one.record.sensors if s.is_horizontal_velocity} for one in logs):
        yield ()


def lost_in_words(lost: Mapping[str, float], interval: float) -> dict[str, str]:
    """Return how much of the command along which axis is lost between rows that are so far apart, s."""
    axis = max(lost, key=lambda one: lost[one])
    return {"share": percent(lost[axis]), "axis": axis, "rate": significant(1.0 / interval, 2)}


def _of_lost(_: Prior, logs: Logs, of: Of, _start: Start) -> dict[str, str]:
    """Return the files, and along which axis most of the command is lost between their rows."""
    most = max((one for one in logs if one.file in of), key=lambda one: max(one.lost.values()))
    return {"of": listed(of), **lost_in_words(most.lost, most.interval)}


def _of_acting(_: Prior, logs: Logs, of: Of, start: Start) -> dict[str, str]:
    """Return each file whose commands do not always act, with the times since its start between which they do."""
    assert isinstance(start, tuple)
    some, words = {one.file: one for one in logs}, []
    for file, (begin, end) in zip(of, start, strict=True):
        ends = np.clip((begin, end), *some[file].record.told[[0, -1]]) - some[file].log.begin
        first, last = (f"{float(at):.1f}" for at in ends)
        words.append(f"{file} ({first} to {last} s)")
    return {"of": listed(words)}


def _thrusters(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield each thruster that the logs command, one of those that no log tells apart."""
    for group in thrusters_alike(known.layout, [*map(dive_commands, logs)]):
        yield group[:1]


def _ill(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield each thruster that may have lost force. A commanded force along an axis of the body is not one of them."""
    if not known.layout.has_wrench:
        yield from _thrusters(known, logs)


def _turned(known: Prior, _: Logs) -> Iterator[Of]:
    """Yield the thrusters that rov.toml says to be reversed, and those mounted the other way."""
    free = {thruster.name for thruster in known.layout.thrusters if not (thruster.arm or known.layout.has_wrench)}
    yield from (of for of in known.turned if of and free.issuperset(of))


def _sharing(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield each thruster that shares a curve with another one."""
    curve_of, names = known.layout.curve_of, known.layout.curves_by_name
    for (name,) in _ill(known, logs):
        is_shared = sum(curve is curve_of[name] for curve in curve_of.values()) > 1
        if is_shared and not curve_of[name].tables and _name_of_own(known.layout, name) not in names:
            yield (name,)


def thrusters_alike(layout: Layout, commands: Sequence[Mapping[str, Array]]) -> list[Of]:
    """Return the thrusters that logs command, in groups that none of these logs tells apart.

    The effects of those of a group along the axes, times their commands in each row, are the same. `commands` has the
    commands of each log by the names of the thrusters.
    """
    shown = list[tuple[bytes, str]]()
    for thruster in layout.thrusters:
        effects = [thruster.effect(axis) for axis in layout.bare_axes]
        values = np.concatenate([np.zeros(0), *(own[thruster.name] for own in commands if thruster.name in own)])
        if any(effects) and values.size and np.ptp(values) >= LEAST_COMMAND:
            sign = 1.0 if next(filter(None, effects)) > 0.0 else -1.0
            signature = np.outer(np.round(np.multiply(effects, sign), 9), sign * values) + 0.0  # no -0
            shown.append((signature.tobytes(), thruster.name))
    return [tuple(names) for names in grouped(shown).values()]


def _commanded(known: Prior, logs: Logs) -> Iterator[Of]:
    if [*_thrusters(known, logs)]:
        yield ()


def _without_voltage(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield one suspect, about all thrusters, if no log has the voltage of the battery."""
    if known.layout.voltage is None and not known.layout.has_wrench:
        yield from _commanded(known, logs)


def _lagging(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield one suspect, about all thrusters, if all forces may lag, and no curve is a table or a wrench's force."""
    curves = known.layout.curves
    if (
        logs
        and curves
        and not known.layout.has_wrench
        and all(c.has_lag and not (c.has_rotors or c.tables) for c in curves)
    ):
        yield ()


def _uncoupled(known: Prior, logs: Logs) -> Iterator[Of]:
    """Yield one suspect, about the vehicle, if a dive has the velocities ahead, to starboard and about the vertical."""
    shown = ({s.axis for s in one.record.sensors if s.is_velocity or s.axis is YAW} for one in logs)
    if not known.layout.coupled and any({*COUPLED_AXES} <= axes for axes in shown):
        yield ()


HYPOTHESES = {
    "idle commands": Hypothesis(
        0.05,
        _files(_has_commands_at_ends),
        _without_idle,
        sentence=(
            "{of}: the commands do not act before and after, as if the thrusters were off{odds}. They count as 0 "
            "there. Record while the thrusters are on"
        ),
        in_words=_of_acting,
        has_times=True,
    ),
    TURN: Hypothesis(
        0.02,
        _with_both_velocities,
        starts=tuple(sign * radians(angle) for angle in (6.0, 15.0, 45.0, 90.0, 135.0, 175.0) for sign in (1.0, -1.0)),
        sentence=(
            "the velocity sensor is turned by {value} about the vertical axis, positive to starboard{odds}. The fit "
            "turns its values back. Correct the angle of mounting where the log is made"
        ),
        least=0.05,  # sensors are mounted to about three degrees
        ends=(-pi, pi),  # the same direction
    ),
    "coupling": Hypothesis(
        0.005,
        _uncoupled,
        _of_layout(_coupled),
        sentence=(
            "surge, sway and yaw: a motion along one turns or moves the vehicle along the others, by the Coriolis and "
            "Munk forces{odds}. The vehicle file says so by coupling = true"
        ),
        # no null: these forces follow from the mass and the inertia, and nothing makes them smaller
    ),
    "turned round": Hypothesis(
        0.05,
        _turned,
        _turned_round,
        sentence=(
            "thrusters {of}: they work astern where rov.toml says ahead{odds}. In [logs], name them under mounted in "
            "place of reversed, or under reversed in place of mounted"
        ),
        # no null: a propeller works ahead or astern, and nothing lies between
    ),
    "rotor lag": Hypothesis(
        0.07,
        _lagging,
        _of_layout(_with_rotors),
        sentence=(
            "all thrusters: the speed of the rotors lags behind the command, and not the force{odds}. The vehicle file "
            'says so by lag = "speed"'
        ),
        alarm=1.0,
        changes_thrust=False,
        # no null: a lag of the speed and one of the force are the same only where both are 0, below their bounds
    ),
    "momentary commands": Hypothesis(
        0.15,
        _files(lambda one: bool(one.lost) and not one.is_momentary),
        _in_logs(lambda known, one: one.with_lines(known.coefficients, known.full)),
        sentence=(
            "{of}: nearly each row has other commands. If they change between the rows ({rate} per second), about "
            "{share} of the {axis} command is lost: log at 50 Hz, or fly without an autopilot (MANUAL). If they hold "
            "until the next row, something else moves the vehicle, such as waves"
        ),
        in_words=_of_lost,
        changes_thrust=False,
        # no null: a straight line between two rows is not a command that holds, however small the short force is
    ),
    OWN_CURVE: Hypothesis(
        0.002,
        _sharing,
        _differing,
        (-0.4,),
        "thruster {of}: it has a curve of its own, with {value} of the thrust astern, relative to ahead, that others "
        "have{odds}. Check its propeller, its speed controller and the neutral of this",
        least=0.05,  # a propeller that has lost nothing astern
        is_contrast=True,
    ),
    NEUTRAL: Hypothesis(
        0.002,
        _sharing,
        _differing,
        (0.04, -0.04),
        "thruster {of}: its neutral is off by {value} of full command{odds}. Set the neutral of its speed controller",
        is_contrast=True,
    ),
    "command limit": Hypothesis(
        0.03,
        _commanded,
        starts=(0.4, 0.6, 0.8),
        sentence="all thrusters: beyond a command of {value}, they push no more{odds}. Check the limits of the speed "
        "controllers, and use only commands below",
    ),
    "voltage drop": Hypothesis(
        0.05,
        _without_voltage,
        starts=(0.1, 0.3),
        sentence=(
            "all thrusters: they lose {value} of their thrust while all have full command, as if the voltage fell "
            "with the load{odds}. Log the voltage of the battery"
        ),
        alarm=1.0,
    ),
    "slew limit": Hypothesis(
        0.03,
        _commanded,
        _in_logs(lambda _, one: one if one.log.follows_axis else one.refined(_FINEST)),
        (3.0, 1.0, 0.3),
        "all thrusters: commands act as ramps, which take {value} from rest to full command{odds}. Check the ramp of "
        "the speed controllers, or a limit in the autopilot",
        least=KINDS[LAG].mean + PRIORS[LAG].deviation,  # a shorter ramp is rather a usual lag
    ),
}
"""All hypotheses about the structure, by the kind of their parameter, in the order in which they change a model: first
which commands act, and then what lies between them. Each is tried after the alarm."""


def in_order(some: Iterable[Suspect]) -> list[Suspect]:
    """Return some hypotheses in the order in which they change a model."""
    kinds = [*HYPOTHESES]
    return sorted(some, key=lambda one: (kinds.index(one[0]), one[1]))


def applied(plain: Objective, starts: Starts, *, thinned: bool = False) -> Objective:
    """Return J if all these hypotheses are true, whose order does not matter. Raises BuildError.

    They change it in the order of HYPOTHESES: lines between momentary commands follow from those that act.
    """
    known, logs = plain.table.known, plain.logs
    for kind, of in in_order(starts):
        known, logs = HYPOTHESES[kind].change(known, logs, of, starts[kind, of])
    freed = ((kind, of[0] if of else "") for kind, of in starts if HYPOTHESES[kind].starts)
    return Objective.of_known(replace(known, freed=known.freed.union(freed)), logs, plain.rows, thinned=thinned)


def row_of(objective: Objective, suspect: Suspect) -> int | None:
    """Return the index of the row that a hypothesis frees, None if it frees none."""
    kind, of = suspect
    return objective.table.index(kind, of[0] if of else "") if HYPOTHESES[kind].starts else None


def contrasts(plain: Objective, z: Array) -> dict[str, float]:
    """Return the standard error of the health of each thruster by the data alone.

    Noise and slow processes have their usual sizes, because a fit that lacks a fault explains it by noise. The priors
    of the motion are so wide that they tell nothing. `z` is a point near the fit. A thruster that no log commands, and
    a commanded force along an axis of the body, are not among the result. Raises DivergedError.
    """
    ill = [("health", name) for (name,) in _ill(plain.table.known, plain.logs)]
    if not ill:
        return {}
    known = replace(plain.table.known, freed=plain.table.known.freed.union(ill))
    objective = Objective.of_known(known, plain.logs, plain.rows, thinned=True)
    of = {name: n for kind, name in ill if (n := objective.table.index(kind, name)) is not None}
    z = np.where(objective.table.each("of_motion"), z, objective.mean)
    z[[*of.values()]] = _WEAK
    z = np.clip(z, objective.low, objective.high)
    tells = np.diag(1.0 / (_WIDER * objective.deviation) ** 2)
    for data in objective.data(z, objective.runs(z), exact=False):
        A = data.slopes / np.sqrt(data.variances)[:, None]
        tells[np.ix_(data.indices, data.indices)] += A.T @ A
    moves = [n for n, p in enumerate(objective.table.parameters) if p.of_motion and not p.is_fixed]
    found = {}
    for name, index in of.items():
        some = [*(n for n in moves if n not in of.values()), index]
        scale = np.sqrt(np.diag(tells)[some])
        inverse = np.linalg.pinv(tells[np.ix_(some, some)] / np.outer(scale, scale), rcond=_ROUNDING, hermitian=True)
        found[name] = float(np.sqrt(inverse[-1, -1]) / scale[-1])
    return found


def apart(plain: Objective, z: Array) -> dict[str, bool]:
    """Return whether the data tell each thruster from all others, by its name; nothing if a motion diverges."""
    with suppress(DivergedError):
        return {name: error < CONTRAST for name, error in contrasts(plain, z).items()}
    return {}


def probability(odds: float) -> float:
    """Return the probability for 2 ln of the odds."""
    return float(expit(0.5 * odds))
