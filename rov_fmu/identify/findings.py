"""What an identification has to tell: findings as functions of the result, their sentences, and their severity.

A finding is never read back: it only becomes a sentence in the terminal, in the report, and in the vehicle file.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import floor, inf, log, log10

import numpy as np

from rov_fmu.equation.catalogue import AXES, COUPLED_AXES, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.units import in_degrees
from rov_fmu.identify.identified_vehicle import tested_ranges
from rov_fmu.identify.likelihood.hypotheses import HYPOTHESES
from rov_fmu.identify.likelihood.kinds import KINDS, PRIORS
from rov_fmu.identify.result import (
    ALARM,
    DISAGREEMENT,
    LEAST_TESTED,
    MOST_UNKNOWN,
    USUAL,
    Answer,
    AxisResult,
    Disturbance,
    Estimate,
    Identification,
    IdentifiedCoefficient,
    IdentifiedEffect,
    Interval,
    Logging,
    Prediction,
    SensorNoise,
    Structure,
    Tested,
    half_width,
    is_extrapolated,
    is_known,
    relative_error,
)
from rov_fmu.identify.tuning import BETA, BETA_WITH_ADDED_MASS
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import capitalized, listed
from rov_fmu.io.numbers import percent, significant, with_interval
from rov_fmu.tank.arrays import rms, usual_range
from rov_fmu.tank.columns import push_along
from rov_fmu.tank.findings import HEADINGS, MISFITS, Finding, Heading, about
from rov_fmu.tank.findings import sentences as sentences_by
from rov_fmu.tank.folder import Folder
from rov_fmu.tank.log import Log
from rov_fmu.vehicle.vehicle import Vehicle

_CONTRADICTION = 0.15
"""Tables that differ by more than this from the model contradict it: batteries and scales explain less."""
_BEYOND = 1.05
"""A wrench is beyond the thrusters if it is so many times what they give."""
_FULL = 0.98
_SATURATED = 0.2
"""Logs are doubted in which thrusters have at least the command _FULL for this share of the time."""
_NEGLIGIBLE = 0.01
"""A disturbance below this share of the thrust is not told."""
_MOST_OUTLIERS = 0.005
"""Outliers are told if more of a sensor's samples are."""
SHARES = (0.3, 0.5, 1.0)
"""The commands of the answers that are told first: weak, half and full."""
STOPPING = (
    "The time is that from rest to 63% of the steady speed, without the lag of the thrusters. The "
    "stopping distance is that without thrust and constant load, from the steady speed to a tenth of it."
)
_ASIDE = 0.1
"""A command of an axis also drives another one if it pushes it with more than this share of the full thrust along it,
which gives it almost a third of its full speed. A symmetric pair leaves less, if its thrust astern is above 80 %."""
_UNLIKE = PRIORS["thrust"].deviation
"""Two thrusters of one type that differ by more than this are not both whole."""
_LEAST_WANDER = 0.005
"""A wander of an estimator's velocity below this one is not told, m/s."""
_ODD = 3.0
"""A log disagrees with the others if its unknown force, or the error of a prediction, is so many times the largest one
of the others."""
_COUPLE = "Write coupling = true into [body] of rov.toml, and log the velocity. Or "
"""What to do about a motion that turns the vehicle where the model leaves its moment out."""
_SURE, _NARROW = 0.99, 0.05
"""A probability above the first number is told as such; a speed known to the second one needs no other test."""
# ---- Kinds and sentences ---------------------------------------------------------------------------------------------

_OWN: Mapping[Heading, Mapping[str, str]] = {
    "Warnings": {
        "worse than no change": (
            "{axes}: the prediction of the {quantity} in {files} is off by {error} (RMS), and a prediction of no "
            "change by {unchanged}"
        ),
        "slip": "{files}: check the {quantity}: {words}? The logs would agree much better",
        "second start": (
            "{axes}: two fits from different starts ended with different answers, so the data do not decide between "
            "them. More or longer logs would"
        ),
        "implausible inertia": (
            "{axes}: the vehicle moves as if its inertia were {factor} times {inertia}. Check {mass}, the positions "
            "and directions of the thrusters, and the units of force{forces} and motion"
        ),
        "thrust tables": (
            "{curve} thrust: the forces in {files} are {ratio} times those that fit the logs. Check their unit, how "
            "many thrusters pulled together, and the battery"
        ),
        "unknown force": (
            "{what} in {files}. Nothing in the logs explains it. If it comes again in another log, it belongs "
            "to the vehicle"
        ),
        "beyond thrusters": (
            "{axes}: the logs have {largest} and the thrusters of rov.toml give {most} at full command. Check their "
            "thrust, directions and positions, and the units of the logs"
        ),
        "change of thrust": "{what} in {files}. A log of the voltage, or of each thruster, may tell why",
        "structure": "the model lacks something along {axes}: its errors are {ratio} times what noise explains",
        "search ended": (
            "no cause that was tried explains the errors along any axis, so the search ended before all were tried. "
            "Check units, signs and the order of the columns, and log one axis alone"
        ),
        "unlogged motion": (
            "{axes}: no log shows how the vehicle moves ahead and sideways. Such a motion turns a vehicle (the Munk "
            "moment), and is the likely cause. {coupling}{apart}"
        ),
        "weak thruster": (
            "thruster {of}: it has {share} of the force of thruster {other} ({low} to {high}). Check both for weed and "
            "damage"
        ),
        **{kind: one.sentence for kind, one in HYPOTHESES.items()},
        "velocity over ground": (
            "{what} in {files}. Check for waves, a changing current, and a vehicle that touches something"
        ),
        "coupling left out": (
            "{files}: the vehicle turns while it moves in surge or sway, but the model leaves out the Coriolis and "
            "Munk forces of such a motion: `coupling = true` in [body] of rov.toml adds them"
        ),
        "do not use": "{axes}: the model must not be used, and its verdict tells why",
        "implausible tuned alpha": (
            "{alpha} = {value:.3g} is not within the usual {low:g} ... {high:g}: the {push} would be {value:.3g} times "
            "that of the thrust curves, which tests give to better than a factor of 2. Check the wanted V_ss and its "
            "unit ({unit}), the command, and the thrust curves"
        ),
        "implausible tuned beta": (
            "{beta} = {value:.3g} is not within the usual {low:g} ... {high:g}. The vehicle would move as if "
            "its inertia were {inertia}. No known vehicle does. Check the wanted Tau (s) and {mass}"
        ),
    },
    "Doubts": {
        "nothing predicted": (
            "{axes}: no motion was predicted that the fit had not seen, so the errors of predictions are not known. "
            "Another log would show them"
        ),
        "assumed thrust": (
            "{curve} thrust: no force was measured, so loads, drag, masses and β are in units of the assumed thrust. A "
            "spring balance tells it: pull with full command, and write command and force into thrust_{curve}.csv"
        ),
        "assumed vehicle": (
            "there is no rov.toml, so the vehicle is taken for {base}, because {reason}: its thrusters, their thrust "
            "and its mass of {mass} are assumed. N, kg and β are relative to them; speeds, times and distances hardly "
            "depend on them. `rov-fmu inspect --draft` writes a rov.toml for what you know"
        ),
        "not identified": "{of}: the tests do not determine {coefficients}{instead}",
        "points differ": "{axes}: {quantity} of the tables differs by {error:.0%} (RMS) from the model",
        "saturation": (
            "{files}: the thrusters had full commands for {share:.0%} of the time. If they cannot follow, they push "
            "less than the model says"
        ),
        "outliers": "{axes}: {share:.0%} of the samples of the {quantity} are outliers, which hardly count in the fit",
        "unusual effect": (
            "{of}the {name} of {value} is unusual. Something else may act in its place, such as a filter of a sensor "
            "or a limit of the commands. [priors] in rov.toml says what is usual"
        ),
        "clock": (
            "{files}: the commands act {time} s {beside} their rows, although the rows are {interval} s apart. Is the "
            "clock of the commands another one?"
        ),
        "drift": (
            "{axes}: over all of {files}, the predicted {quantity} drifts away by {error} (RMS), and a prediction of "
            "no change by {unchanged}"
        ),
    },
    "Facts": {
        "effect": "{of}the {name} is {value}{note}",
        "strength": "thruster {of}: it has {share} of the force of thruster {other} ({low} to {high})",
        "idle voltage": (
            "no effect of the logged voltage ({volts} V) on the thrust is seen, so the vehicle does without it"
        ),
        "small disturbance": "{what} in {files}. It is small, and the intervals allow for it",
        "rocking": (
            "{axes}: no log shows roll and pitch. Rocking raises drag by 3 to 7 %, so that no speed and no time is "
            "claimed to better than 3 %, and no stopping distance to better than 6 %"
        ),
        "estimator": (
            "{axes}: the velocity of the estimator wanders by {size} (RMS) beside its position. The fit takes this for "
            "an error of the estimator"
        ),
        "not told apart": (
            "thrusters {of}: the logs do not tell whether one of them has lost force, because their commands are "
            "always about the same. A log in which these differ tells it"
        ),
        "times": (
            "the logs do not tell {first} from {others}, so its interval contains what they share. Logs at 50 Hz with "
            "steps of single thrusters would"
        ),
        "logging": (
            "{files}: the commands act {time} s {beside} their rows. This belongs to the logger, not to the vehicle"
        ),
    },
}
_FIRST = ("worse than no change", "unreadable file", "missing column", "copy", "frozen sensors", "slip", *MISFITS)
"""The warnings that stand first: wrong predictions, and wrong or missing data."""
_FORMS = {heading: {**forms, **HEADINGS[heading]} for heading, forms in _OWN.items()}
SEVERITY: Mapping[str, Heading] = {kind: heading for heading, forms in _FORMS.items() for kind in forms}
"""The heading of each kind."""
SENTENCES = {kind: form for forms in _FORMS.values() for kind, form in forms.items()}
"""The form of the sentence of each kind."""
_ORDER = [*dict.fromkeys((*_FIRST, *SENTENCES))]
"""The kinds in the order in which they are told, the warnings first."""


def result_sentences(some: Iterable[Finding], kind: str = "") -> tuple[str, ...]:
    """Return the sentences of findings, if given only of those of a kind; similar findings share one sentence."""
    return sentences_by((one for one in some if kind in ("", one.kind)), SENTENCES)


def by_heading(findings: Sequence[Finding]) -> dict[Heading, tuple[str, ...]]:
    """Return the sentences of findings of all axes by their headings: the warnings of all axes come first."""
    return {name: result_sentences(one for one in findings if SEVERITY[one.kind] == name) for name in _FORMS}


def told(identification: Identification) -> Identification:
    """Return an identification with its findings; its vehicle has them too, with its verdicts and errors."""
    findings = findings_of(identification)
    # other files beside the tests say nothing about the vehicle
    groups = by_heading([finding for finding in findings if finding.kind != "other files"])
    made = identification.vehicle.provenance
    assert made
    sentences_of = {
        "warnings": (*groups["Warnings"], *groups["Doubts"]),
        "facts": groups["Facts"],
        "verdicts": tuple(verdict.of(axis) for axis, verdict in identification.verdicts.items()),
        "errors": tuple(error_in_words(result.main) for result in identification.axes if result.main),
    }
    made = made.model_copy(update=sentences_of)
    vehicle = identification.vehicle
    layout = replace(vehicle.layout, identified=tuple(tested_ranges(identification)))
    scale = assumed_scale(identification)
    data = vehicle.measured_from + (f" ({scale})" if scale else "")
    vehicle = replace(vehicle, layout=layout, provenance=made, measured_from=data)
    return replace(identification, axes=_with_cure(identification), findings=findings, vehicle=vehicle)


# ---- Findings from the result ----------------------------------------------------------------------------------------


def findings_of(identification: Identification) -> tuple[Finding, ...]:
    """Return all findings of an identification with those about reading, the most important kinds first."""
    return tuple(sorted(_every(identification), key=lambda one: _ORDER.index(one.kind)))


def _every(identification: Identification) -> Iterator[Finding]:
    """Yield all findings, those about reading first."""
    yield from identification.folder.findings
    for result in identification.axes:
        yield from _on_axis(identification, result)
    for curve, known in identification.curves.items():
        yield from _not_identified(known, f"{curve} thrust", curve=curve)
    yield from _on_forces(identification)
    yield from _on_scale(identification)
    yield from _on_vehicle(identification)
    for d in identification.disturbances:
        if d.kept and d.share > _NEGLIGIBLE:
            yield _disturbance(d, identification.vehicle)
    for log_of in identification.folder.logs:
        yield from _on_log(identification, log_of)
    yield from filter(None, map(_logging, identification.logging))
    for sensor in identification.sensors:
        yield from _on_sensor(sensor)
    yield from _on_search(identification)
    for effect in identification.effects:
        if effect.kept:
            yield from _effect(identification, effect)
    for slip in identification.slips:
        yield about(slip.file, "slip", quantity=slip.quantity, words=slip.words)


def prediction_name(p: Prediction) -> str:
    """Return the name of what is predicted: `heave depth, 10 s ahead`."""
    quantity = p.quantity if p.axis.name in p.quantity else f"{p.axis.name} {p.quantity}"
    return f"{quantity}{p.ahead}"


def _errors(p: Prediction) -> tuple[str, str]:
    """Return the error of a prediction, and that of a prediction of no change, in words."""
    return size_in_words(p.error, p.unit), size_in_words(p.unchanged, p.unit)


def error_in_words(p: Prediction) -> str:
    """Return the error of a prediction beside that of a prediction of no change, and the share in the band."""
    error, unchanged = _errors(p)
    return (
        f"{prediction_name(p)}: off by {error} (RMS) in {p.file}, and a prediction of no change by {unchanged}; "
        f"{p.coverage:.0%} of the samples are inside the 95% band"
    )


def next_tests(identification: Identification) -> list[str]:
    """Return what to measure next, in sentences: the useful test of each axis, the widest interval first.

    Logs that need repair come first. How to identify the other axes of the vehicle comes last.
    """
    of_base = identification.axes_of_base
    groups = grouped(((one.reason, how_to_measure(one.axis, "<axis>")), one.axis) for one in of_base)
    others = [
        f"{listed(axis.name for axis in axes)}: {reason}. {LOG_OUTPUTS if reason == UNLOGGED else how_to_record(axes)}."
        for (reason, _), axes in groups.items()
    ]
    return [*_next_tests(identification), *others]


UNLOGGED = "no log has the commands of its thrusters"
"""Why nothing is learnt about an axis whose thrusters have no output in the logs, although its motion may be there."""
LOG_OUTPUTS = "Log the outputs to all thrusters: MAVLink 1 has eight, and a .BIN file has more"


def is_commanded(axis: Axis, layout: Layout, logs: Sequence[Log]) -> bool:
    """Return True if a log has a command of a thruster along an axis."""
    drivers = {thruster.name for thruster in layout.thrusters_along(axis)}
    largest = (pair for log in logs if log.commands for pair in log.commands.largest.items())
    return any(most for name, most in largest if name in drivers)


def is_unlogged(axis: Axis, layout: Layout, logs: Sequence[Log]) -> bool:
    """Return True if no log has commands of any thruster along an axis, and lacks columns or pulses of them."""
    titles = {f"{form}{thruster.name}" for thruster in layout.thrusters_along(axis) for form in ("", "u_")}
    return (
        not any(log.follows_axis for log in logs)
        and not is_commanded(axis, layout, logs)
        and any(
            (f.kind == "thrusters without pulse" and f.axis == axis.name)
            or (f.kind == "missing column" and str(f.words["column"]).partition(" [")[0] in titles)
            for log in logs
            for f in log.findings
        )
    )


def how_to_record(axes: Sequence[Axis]) -> str:
    """Return what an owner can record, so that axes are identified whose motion the same kind of sensor shows."""
    which, name = ("it", axes[0].name) if len(axes) == 1 else ("each", "<axis>")
    return f"Command {which} both ways, and log {how_to_measure(axes[0], name)}"


def how_to_measure(axis: Axis, name: str) -> str:
    """Return what shows the motion along an axis; `name` is that in the name of a file."""
    if axis is HEAVE:
        return "the depth"
    if axis is YAW:
        return "the heading or the turn rate"
    if axis.is_rotation:
        return "its angle and its rate"
    return (
        "its velocity (a DVL). Without one, film the vehicle along a tape on the floor, and write time, command "
        f"and distance into log_{name}_1.csv; a track from a video does, too"
    )


def _next_tests(identification: Identification) -> list[str]:
    if repairs(identification) or any(one.structure > ALARM for one in identification.axes):
        return ["first repair what disagrees, and identify again: these logs cannot tell which test is useful."]
    speeds = ((one.axis.name, a) for one in identification.axes for a in one.answers if abs(a.command) <= 0.5)
    widest = {name: max(own, key=lambda a: half_width(a.steady)) for name, own in grouped(speeds).items()}
    told = sorted(((half_width(a.steady), name, a.command) for name, a in widest.items()), reverse=True)
    return [
        f"{name}: hold {command:.0%} for 8 s, rest, then {-command:.0%} for 8 s. The speed at {command:.0%} is "
        f"{_known_to(width)}."
        for width, name, command in told
        if width > _NARROW
    ]


def _known_to(width: float) -> str:
    """Return how well a number is known by the relative half-width of its interval: `±12%`, or `not known`."""
    return f"±{width:.0%}" if is_known(width) else "not known"


def repairs(identification: Identification) -> list[str]:
    """Return what to do about each log that does not fit the others, in sentences. It comes before any other test."""
    cure = _cure(identification)
    odd = grouped(_disagreements(identification))
    others = len(identification.folder.logs) - len(odd)
    rest = f": it disagrees with the other {f'{others} logs' if others > 1 else 'log'}" if others > 0 else ""
    return [f"{cure} Then identify again."] * bool(cure) + [
        f"Repair {file} or take it out of the folder{rest}. {' '.join(reasons)} Then identify again."
        for file, reasons in odd.items()
    ]


def _cure(identification: Identification) -> str:
    """Return how to tell yaw from a motion that no log shows and that turns the vehicle, as a sentence; empty if there
    is none, or if no axis is spoilt by it."""
    if all(result.verdict.word != "do not use" for result in identification.axes):
        return ""
    return "".join(f"{capitalized(str(one.words['apart']))}." for one in _on_unlogged_motion(identification))


def _with_cure(identification: Identification) -> tuple[AxisResult, ...]:
    """Return the results of the axes, with one thing to do where an unlogged motion turns the vehicle.

    It bends the thrust curves of yaw, and so each axis that shares them. Mistakes in its logs, and an unknown force or
    velocity along it, are other causes.
    """
    if not (cure := _cure(identification)):
        return identification.axes
    layout = identification.vehicle.layout
    bent = {thruster.curve for thruster in layout.thrusters_along(YAW)}

    def is_bent(one: AxisResult) -> bool:
        is_pushed = any(d.share > MOST_UNKNOWN and not d.changes_thrust for d in one.unknown)
        is_other = one.slips or one.misfits or is_pushed
        return one.axis is YAW or not (is_other or bent.isdisjoint(t.curve for t in layout.thrusters_along(one.axis)))

    return tuple(
        replace(one, verdict=replace(one.verdict, remedy=cure)) if one.verdict.word != "good" and is_bent(one) else one
        for one in identification.axes
    )


def _disagreements(identification: Identification) -> Iterator[tuple[str, str]]:
    """Yield each log that does not fit the others, with the reason as a sentence: a probable slip, motion that the
    others predict worse than no change, or a slow force that is much larger than in the others.

    Where half of the logs are predicted worse than no change, the model is wrong, and no log is the odd one. Nor is one
    that is predicted about as badly as others, or that hardly moves, so that no change is easily a better prediction:
    its error has to exceed the motion of the others. Nor one whose unknown torque an unlogged motion explains.
    """
    explained = {YAW} if any(_on_unlogged_motion(identification)) else {*()}
    slipped = {(slip.file, slip.quantity) for slip in identification.slips}
    for slip in identification.slips:
        yield slip.file, f"Check the {slip.quantity}: {slip.words}?"
    for result in identification.axes:
        judged = [p for p in result.predictions if p.is_judged]
        for p in judged:
            own = [other for other in judged if other.quantity == p.quantity]
            beyond = [max(_ODD * other.error, other.unchanged) for other in own if other.file != p.file]
            is_odd = 2 * sum(other.is_worse for other in own) < len(own) and p.error > max(beyond, default=0.0)
            if p.is_worse and is_odd and (p.file, p.quantity) not in slipped:
                error, unchanged = _errors(p)
                yield (
                    p.file,
                    f"The prediction of its {p.quantity} is off by {error}, and one of no change by {unchanged}.",
                )
    pushed = list[tuple[str, str]]()
    for d in identification.disturbances:
        others = (f for f in identification.unknown_forces if f.axis is d.axis and f.file != d.file)
        most = max((rms(f.force) for f in others), default=inf)
        if (
            d.slow.acts_as == "force"
            and d.axis
            and d.axis not in explained
            and d.kept
            and d.share > MOST_UNKNOWN
            and d.value > _ODD * most
        ):
            size, other = size_in_words(d.value, d.unit), size_in_words(most, d.unit)
            pushed.append((d.file, f"{size} in {d.axis.name} (at most {other} in the other logs)"))
    for file, forces_of in grouped(pushed).items():
        acting = f"An unknown slow force acts in this log: {listed(forces_of)}."
        yield file, f"{acting} Check the thrusters and the tether of that dive."


def driven_aside(identification: Identification) -> list[str]:
    """Return a sentence for each axis whose full command drives other axes, too, which the answers leave out.

    Roll and pitch are left out, because the weight rights the vehicle.
    """
    vehicle, lines = identification.vehicle, []
    for axis in (result.axis for result in identification.axes):
        pushes = {
            other: push
            for command in (-1.0, 1.0)
            for other, push in vehicle.side_effects(axis, command)
            if abs(push) > _ASIDE * vehicle.strongest(other) and not {axis, other} & {ROLL, PITCH}
        }
        others = [
            f"{other.positive if push > 0.0 else other.negative} ({other.name})" for other, push in pushes.items()
        ]
        if others:
            lines.append(
                f"{axis.name}: its thrusters also drive the vehicle {listed(others)}. "
                "These numbers hold only if something prevents that."
            )
    return lines


def extrapolated(identification: Identification) -> list[str]:
    """Return sentences about answers to commands that were not tested, and about the voltage of all answers, if the
    thrust depends on it."""
    tested = [
        f"{result.axis.name} {tested_in_words(result.tested)}"
        for result in identification.axes
        if any(is_extrapolated(answer.command, result.tested) for answer in result.answers)
    ]
    untested = [
        f"{direction} ({result.axis.name})"
        for result in identification.axes
        for direction, strongest in zip((result.axis.negative, result.axis.positive), result.tested, strict=True)
        if strongest < LEAST_TESTED
    ]
    lines = (
        [f"The tests had commands of {listed(tested)}. Numbers for stronger ones are extrapolated."] if tested else []
    )
    if (voltage := identification.vehicle.layout.voltage) is not None:
        lines.insert(0, f"The numbers are for a supply of {voltage:g} V.")
    if untested:
        lines.append(f"No test drives the vehicle {listed(untested)}, so the numbers for that are extrapolated.")
    return lines


def with_lag(identification: Identification) -> list[str]:
    """Return a sentence with the times at half command that contain the lag of the thrusters, if there is one."""
    halves = filter(None, (answer_at(one, 0.5) for one in identification.axes))
    told = [f"{with_error(half.lagged, 's')} ({half.axis.name})" for half in halves if half.lagged]
    return [f"With the lag of the thrusters, the time is {listed(told)}."] if told else []


def tested_in_words(tested: Tested) -> str:
    """Return the commands of the tests of an axis: `from -58% to 64%`."""
    return f"from {0.0 - tested[0]:.0%} to {tested[1]:.0%}"


def headline(result: AxisResult) -> str:
    """Return how fast the vehicle is at half command, or at the strongest tested one below it, with the interval:
    `down 0.63 m/s at 50%, 0.57 to 0.68`; empty without answers."""
    tested = [a for a in result.answers if 0.0 < a.command <= 0.5 and not is_extrapolated(a.command, result.tested)]
    told = max(tested, key=lambda a: a.command, default=answer_at(result, 0.5))
    if told is None:
        return ""
    value, _, ends = in_words(*told.steady, result.axis.unit).partition(" (")
    way = result.axis.positive if told.steady[0] > 0.0 else result.axis.negative
    if not is_known(half_width(told.steady)):
        return f"{way} a speed that is not known at {told.command:.0%}"
    return f"{way} {value.removeprefix('-')} at {told.command:.0%}, {ends.removesuffix(')')}"


def with_error(estimate: Estimate, unit: str) -> str:
    """Return a value with half the width of its interval relative to it, such as `0.62 m/s ±2%`; one whose interval is
    wider than the value is not known."""
    value, interval = estimate
    if not 0.0 < abs(value) < inf:
        return "-"
    if not is_known(error := half_width(estimate)):
        return "not known"
    words, _, _ = in_words(value, interval, unit).partition(" (")
    return f"{words} ±{error:.0%}"


def size_in_words(value: float, unit: str) -> str:
    """Return a size with two digits and its unit; angles are in degrees."""
    factor, shown = in_degrees(unit)
    return f"{significant(factor * value, 2)}{unit_after(shown)}"


def effect_in_words(effect: IdentifiedEffect) -> str:
    """Return the size of an effect; a ratio has two digits of how far it is from 1."""
    if not KINDS[effect.kind].is_ratio or effect.value == 1.0:
        return size_in_words(effect.value, effect.unit)
    return f"{effect.value:.{max(1 - floor(log10(abs(effect.value - 1.0))), 1)}f}"


def effect_or_range(effect: IdentifiedEffect) -> str:
    """Return the size of an effect, or that it is not known, with its interval."""
    if not effect.value or is_known(half_width((effect.value, effect.interval))):
        return effect_in_words(effect)
    return f"not known: {in_words(effect.value, effect.interval, effect.unit)}"


def in_words(value: float, interval: Interval, unit: str) -> str:
    """Return a value with its interval and its unit, such as `0.62 m/s (0.60 to 0.64)`; angles are in degrees."""
    factor, shown = in_degrees(unit)
    text, low, high = with_interval(factor * value, (factor * interval[0], factor * interval[1]))
    return f"{text}{unit_after(shown)} ({low} to {high})"


def unit_after(unit: str) -> str:
    """Return a unit as it follows a number: nothing for a ratio."""
    return "" if unit == "1" else f" {unit}"


def answer_at(result: AxisResult, command: float) -> Answer | None:
    """Return the answers for a command, or None."""
    return next((answer for answer in result.answers if abs(answer.command - command) < 1e-6), None)


def _on_axis(identification: Identification, result: AxisResult) -> Iterator[Finding]:
    """Yield the findings about an axis."""
    axis = result.axis.name
    yield from _on_predictions(result)
    yield from _on_coefficients(identification, result)
    yield from _on_points(result)
    if result.verdict.word == "do not use":
        yield Finding("do not use", axis)
    if result.structure > ALARM:
        yield about("", "structure", axis, ratio=significant(result.structure, 2))
    if result.axis is YAW:
        yield from _on_unlogged_motion(identification)
    if may_rock(identification.folder, result.axis):
        yield Finding("rocking", axis)
    if result.difference > DISAGREEMENT:
        yield Finding("second start", axis)


def _on_predictions(result: AxisResult) -> Iterator[Finding]:
    """Yield a finding for each prediction that is worse than one of no change.

    That a position drifts away over a whole log is told only if it is predicted well over a shorter time.
    """
    if not result.predictions:
        yield Finding("nothing predicted", result.axis.name)
    worse = [p for p in result.predictions if p.is_worse]
    warned = {(p.file, p.quantity) for p in worse if p.is_judged}
    for p in worse:
        if p.is_judged or (p.file, p.quantity) not in warned:
            kind = "worse than no change" if p.is_judged else "drift"
            error, unchanged = _errors(p)
            yield about(p.file, kind, result.axis.name, quantity=p.quantity, error=error, unchanged=unchanged)


def _on_coefficients(identification: Identification, result: AxisResult) -> Iterator[Finding]:
    """Yield findings about coefficients without an interval, and about an inertia that no vehicle has."""
    axis, half = result.axis, answer_at(result, 0.5)
    instead = f". V_ss at 50% is {in_words(*half.steady, axis.unit)}" if half else ""
    yield from _not_identified(result.known, axis.name, instead, axis=axis.name)
    beta = next((known for known in result.known if known.name == axis.coefficient("beta")), None)
    if beta and beta.interval:
        has_added = "m_a" in identification.vehicle.layout.by_name[axis.name].keys
        low, high = BETA_WITH_ADDED_MASS if has_added else BETA
        if beta.interval[1] < low or beta.interval[0] > high:
            inertia = f"{axis.inertia} with the added one" if has_added else axis.inertia
            names = {"factor": significant(1.0 / beta.value, 2), "inertia": inertia, "mass": axis.inertia}
            curves = {thruster.curve for thruster in identification.vehicle.layout.thrusters_along(axis)}
            files = [*dict.fromkeys(p.file for p in identification.forces if p.subject in curves)]
            names["forces"] = f" (in {listed(files)})" if files else ""
            yield Finding("implausible inertia", axis.name, words=names)


def _not_identified(
    known: Sequence[IdentifiedCoefficient], of: str, instead: str = "", *, axis: str = "", curve: str = ""
) -> Iterator[Finding]:
    if names := [one.name for one in known if one.interval is None]:
        words = {"of": of, "coefficients": listed(names), "instead": instead}
        yield Finding("not identified", axis, curve, words=words)


def _on_points(result: AxisResult) -> Iterator[Finding]:
    """Yield findings about tables of velocities and time constants that contradict the model."""
    for quantity in ("V_ss", "Tau"):
        error = relative_error(result.points, "model", quantity)
        if error > _CONTRADICTION:
            yield about("", "points differ", result.axis.name, quantity=quantity, error=error)


def _on_forces(identification: Identification) -> Iterator[Finding]:
    """Yield findings about tables of forces whose scale contradicts that of the logs.

    Where the model is wrong along all axes of a curve, its forces make up for what it lacks, and tell no table.
    """
    layout = identification.vehicle.layout
    pairs = ((t.curve, one.structure) for one in identification.axes for t in layout.thrusters_along(one.axis))
    least = {curve: min(errors) for curve, errors in grouped(pairs).items()}
    told = [p for p in identification.forces if p.counts and p.measured * p.model > 0.0]
    for (curve, file), ratios in grouped(((p.subject, p.file), p.measured / p.model) for p in told).items():
        ratio = float(np.median(ratios))
        if least.get(curve, 0.0) <= USUAL and abs(log(ratio)) > log(1.0 + _CONTRADICTION):
            yield Finding("thrust tables", curve=curve, file=file, words={"ratio": significant(ratio, 2)})


def may_rock(folder: Folder, axis: Axis) -> bool:
    """Return True if only dives tell how fast an axis is, and none of them shows roll and pitch."""
    logs = [log for log in folder.logs if log.axis in (None, axis)]
    are_level = (log.axis or log.tilt for log in logs)
    return bool(logs) and ("steady", axis.name) not in folder.rows and not any(are_level)


def _on_unlogged_motion(identification: Identification) -> Iterator[Finding]:
    """Yield a finding if the model does not explain yaw in dives with a push ahead or sideways, and none shows the
    motion there."""
    if not any(result.axis is YAW and result.structure > USUAL for result in identification.axes):
        return
    layout, alone, others = identification.vehicle.layout, set[str](), set[str]()
    for dive in identification.folder.logs:
        shown = {channel.quantity.axis for channel in dive.channels if not channel.unused}
        if dive.axis or not dive.commands or YAW not in shown:
            continue
        if {SURGE, SWAY} & shown:
            return
        commands = dive.commands.in_rows
        ahead = [np.abs(push_along(layout, axis, commands)).max() for axis in (SURGE, SWAY)]
        if max(ahead) > _ASIDE:
            others.add(dive.whole_file)
        elif np.abs(push_along(layout, YAW, commands)).max() > _ASIDE:
            alone.add(dive.whole_file)
    if others:
        yield about(
            "",
            "unlogged motion",
            YAW.name,
            coupling="Log the velocity, or " if layout.coupled else _COUPLE,
            apart=told_apart(YAW.name, sorted(others), sorted(alone), "turn on the spot in a log of its own"),
        )


def told_apart(axis: str, mixed: Sequence[str], alone: Sequence[str], how: str) -> str:
    """Return how to tell an axis from what drives the vehicle at the same time in `mixed` logs, as a sentence without
    its end. `how` is how to log it alone, where no log is `alone`."""
    leave = f"leave {axis} out of {listed(mixed)} by [leave_out] in rov.toml"
    return f"{leave}, because it is alone in {listed(alone)}" if alone else f"{how}, and {leave}"


def assumed_scale(identification: Identification, unit: str = "N") -> str:
    """Return the words that belong beside a number in a unit if its scale is that of an assumed thrust, or an empty
    text. No motion determines the scale of forces and masses."""
    is_scaled = not {"N", "kg"}.isdisjoint(unit.split("."))
    return "in units of the assumed thrust" if is_scaled and any(_on_scale(identification)) else ""


def _on_scale(identification: Identification) -> Iterator[Finding]:
    """Yield a finding for each curve whose thrust is an assumption: neither a test nor rov.toml tells it."""
    layout, description = identification.vehicle.layout, identification.folder.rov_file.description
    told = {p.subject for p in identification.forces} | ({*description.known} if description else set())
    for curve, known in identification.curves.items():
        if description and curve not in description.layout.curves_by_name:
            continue  # one that a thruster has by a hypothesis: it has the thrust of the one that it shared
        a_t = layout.curves_by_name[curve].coefficient("a_t") if curve in layout.curves_by_name else ""
        if a_t in {one.name for one in known} and not {curve, a_t} & told:
            yield Finding("assumed thrust", curve=curve)


def _on_vehicle(identification: Identification) -> Iterator[Finding]:
    """Yield a finding if nobody described the vehicle, and one about a logged voltage that acts on nothing."""
    description, vehicle = identification.folder.rov_file.description, identification.vehicle
    volts = identification.folder.voltages
    if volts and identification.curves and vehicle.layout.voltage is None:
        ends = dict.fromkeys(f"{end:.3g}" for end in usual_range(np.concatenate(volts)))
        yield about("", "idle voltage", volts=" to ".join(ends))
    if description and description.assumed:
        names = {"base": description.base_name, "reason": description.assumed, "mass": f"{vehicle['m_rov']:.3g} kg"}
        yield Finding("assumed vehicle", words=names)


def acting(d: Disturbance) -> str:
    """Return what a disturbance does in its log as a sentence without the file: `an unknown slow force of ... acts`."""
    is_turn = d.axis is not None and d.axis.is_rotation
    return d.slow.sentence.format(
        push="torque" if is_turn else "force",
        thrust="torque" if is_turn else "thrust",
        size=percent(d.value) if d.changes_thrust else size_in_words(d.value, d.unit),
        share=percent(d.share),
    )


def _disturbance(d: Disturbance, vehicle: Vehicle) -> Finding:
    """Return the finding about a disturbance that the evidence shows."""
    kind = d.slow.finding if d.share >= MOST_UNKNOWN else "small disturbance"
    where = d.axis.name if d.axis else listed(one.name for one in (SURGE, SWAY) if vehicle.layout.has(one))
    what = acting(d) if d.changes_thrust else f"{where}: {acting(d)}"
    return about(d.file, kind, d.axis.name if d.axis else "", what=what)


def beyond_thrusters(wrench: Vehicle, own: Vehicle) -> Iterator[Finding]:
    """Yield a finding for each axis along which a wrench, which is a vehicle's thrust, exceeds its own thrusters."""
    for axis in (form.axis for form in own.layout.axes if own.layout.thrusters):
        largest, most = wrench.strongest(axis), own.strongest(axis)
        if largest > _BEYOND * most:
            sizes = {"largest": f"{largest:.3g} {axis.load}", "most": f"{most:.3g} {axis.load}"}
            yield about("", "beyond thrusters", axis.name, **sizes)


def _on_log(identification: Identification, log: Log) -> Iterator[Finding]:
    """Yield findings about full commands, and about turns that the model takes for independent of the other motion."""
    description = identification.folder.rov_file.description
    # The full command of a wrench is its largest force in the logs, so it says nothing about what thrusters can follow.
    if log.commands and not (description and description.layout.has_wrench):
        values = np.abs(log.commands.at(log.commands.rows))
        share = float(np.mean(np.any(values >= _FULL, axis=1)))
        if share > _SATURATED:
            yield about(log.file, "saturation", share=share)
    layout = identification.vehicle.layout
    if all(map(layout.has, COUPLED_AXES)) and not layout.coupled:
        surge, sway, yaw = (any(c.quantity.axis is a and not c.unused for c in log.channels) for a in COUPLED_AXES)
        if yaw and (surge or sway):
            yield Finding("coupling left out", file=log.file)


def _on_sensor(sensor: SensorNoise) -> Iterator[Finding]:
    """Yield findings about many outliers, and about an estimator whose velocity wanders."""
    if sensor.outliers > _MOST_OUTLIERS:
        yield about("", "outliers", sensor.axis.name, quantity=sensor.quantity, share=sensor.outliers)
    if sensor.wander > max(sensor.white, _LEAST_WANDER):
        yield about("", "estimator", sensor.axis.name, size=size_in_words(sensor.wander, sensor.unit))


def _on_search(identification: Identification) -> Iterator[Finding]:
    """Yield the causes that were found, and findings about what the logs do not tell apart."""
    yield from filter(None, map(_structure, identification.structures))
    if identification.has_ended:
        yield Finding("search ended")
    for names in identification.alike:
        yield about("", "not told apart", of=listed(names))
    if len(identification.times) > 1:
        first, *others = (f"the {time}" for time in identification.times)
        yield about("", "times", first=first, others=listed(others))


def _structure(structure: Structure) -> Finding | None:
    """Return the finding about a hypothesis that won; None where only its effect is told."""
    hypothesis, value, unit = HYPOTHESES[structure.kind], structure.value, structure.unit
    kind = KINDS.get(structure.kind)
    if kind and abs(value - (1.0 if kind.is_ratio else kind.null or 0.0)) < hypothesis.least:
        return None
    size = percent(value) if unit == "1" else size_in_words(value, unit)
    words = {"of": structure.of, "value": size, **dict(structure.words)}
    share = percent(structure.probability) if structure.probability < _SURE else "above 99%"
    odds = f" (probability {share} among the known causes)"
    return Finding(structure.kind, words={**words, "odds": odds})


def _logging(logging: Logging) -> Finding | None:
    """Return the finding about a logger's offset, None where it may be 0.

    A row tells a command between one interval before it and the row itself. More than that is another clock.
    """
    low, high = logging.offset_interval
    if low <= 0.0 <= high:
        return None
    is_usual = high >= -1.5 * logging.interval and low <= 0.5 * logging.interval
    kind, beside = "logging" if is_usual else "clock", "before" if logging.offset < 0.0 else "after"
    return about(logging.file, kind, beside=beside, time=_rounded(logging.offset), interval=_rounded(logging.interval))


def _rounded(time: float) -> float:
    """Return the size of a time with two digits."""
    return float(significant(abs(time), 2))


def _effect(identification: Identification, effect: IdentifiedEffect) -> Iterator[Finding]:
    """Yield the fact about an effect that is kept, after the doubt about one of an unusual size."""
    if effect.beside:
        share, low, high = (
            f"{value:.1%}" if value > 0.9 else f"{value:.0%}" for value in (effect.value, *effect.interval)
        )
        kind = "strength" if abs(effect.value - 1.0) < _UNLIKE else "weak thruster"
        yield about("", kind, of=effect.of, other=effect.beside, share=share, low=low, high=high)
        return
    of, is_curve = effect.of, effect.of in identification.vehicle.layout.curves_by_name
    words = {"of": f"{of}{' thrust' if is_curve else ''}: " if of else "", "name": effect.name}
    words["value"] = in_words(effect.value, effect.interval, effect.unit)
    if effect.is_unusual:
        yield Finding("unusual effect", words=words)
    scale = assumed_scale(identification, effect.unit)
    words["note"] = KINDS[effect.kind].why_not + (f", {scale}" if scale else "")
    axis = of if of in AXES else ""
    yield Finding("effect", axis, of if is_curve else "", "" if is_curve or axis else of, words)
