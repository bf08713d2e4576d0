"""Whether the model of an axis may be trusted: one table of rules, which the documentation has, too."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, isfinite, nan

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.findings import acting, effect_in_words, tested_in_words, told_apart
from rov_fmu.identify.result import (
    DISAGREEMENT,
    MOST_UNKNOWN,
    WORST_UNKNOWN,
    WRONG,
    Answer,
    AxisResult,
    IdentifiedCoefficient,
    Verdict,
    coverage_of,
    is_extrapolated,
    is_known,
    is_whole,
    relative_error,
    score_of,
)
from rov_fmu.io.messages import MOST, capitalized, first_of, listed
from rov_fmu.io.numbers import percent, significant
from rov_fmu.vehicle.description import Word
from rov_fmu.vehicle.vehicle import Vehicle

MOST_GAIN = 0.3
"""No answers are given where the thrust changes by more than this share: nobody knows for which thrust they are."""
_MOST_ERROR, _MOST_SOON = 1.25, 1.3
"""The largest errors R over 10 s and R₂ over 2 s of a *good* model: 9 of 12 *good* axes with a wrong answer had more,
and none of 45 right ones."""
_FAST = 19.0
"""The rate of a log, 1/s, from which a faster one hardly tells more: 20 Hz, less what clocks differ by."""
WORDS: tuple[Word, ...] = ("good", "usable", "do not use")


@dataclass(frozen=True)
class Rule:
    """What lowers a verdict: a value of the result beyond a limit."""

    of: str
    """What the value is, in words."""
    value: Callable[[AxisResult], float]
    """NaN where nothing can be judged."""
    usable: float | None
    """The limit beyond which a model is at most *usable*."""
    bad: float | None
    """The limit beyond which it is *do not use*."""
    sentence: str
    """The reason, with `size`, the value with two digits, `share`, the value in percent, and what `names` tells."""
    names: Callable[[AxisResult], Mapping[str, str]] = lambda _: {}
    unit: str = "%"
    is_least: bool = False
    """True if a value below the limit is beyond it."""
    is_told: bool = False
    """True if the reason is told even of a good model, as what it rests on."""
    remedy: str | Callable[[AxisResult], str] = ""
    """The one thing to do about it, as a sentence; empty where that was done already."""

    def word(self, value: float) -> Word:
        """Return the best verdict that a value allows."""
        sign = -1.0 if self.is_least else 1.0
        beyond = [limit is not None and sign * value > sign * limit for limit in (self.usable, self.bad)]
        return "do not use" if beyond[1] else "usable" if beyond[0] else "good"

    @property
    def row(self) -> tuple[str, str, str]:
        """Return the row of the documentation: what is judged, and when it is *usable* and *do not use*."""
        side = "below" if self.is_least else "above"
        factor, unit = (100.0, " %") if self.unit == "%" else (1.0, "")
        told = ["" if limit is None else f"{side} {factor * limit:g}{unit}" for limit in (self.usable, self.bad)]
        return self.of, told[0], told[1]


def _largest(e: AxisResult) -> dict[str, str]:
    """Return what the largest unknown disturbance does, and its file."""
    largest = max(e.unknown, key=lambda d: d.share)
    what = acting(largest)
    return {"what": capitalized(what), "file": largest.file}


def _reach(e: AxisResult) -> dict[str, str]:
    """Return how good the predictions are, as the end of a sentence."""
    score = score_of(e.moving)
    if score < 0.0:
        return {"reach": "are worse than no change"}
    return {"reach": f"reach {percent(score)} of the way from no change (0%) to the noise of the sensors (100%)"}


def _error_of_tables(e: AxisResult) -> float:
    """Return the RMS of the relative errors of the steady velocities of tables that are held out; NaN without any."""
    return relative_error(e.points, "held_out", "V_ss")


def _widest(e: AxisResult, *of: str) -> tuple[float, Answer | None]:
    """Return the largest half-width of some answers within the tests, and the answer; NaN without any.

    That of a time is relative to it, and that of a speed or a distance to the largest one of these answers: a few
    millimetres per second of a speed that is next to nothing do not matter.
    """
    within = [a for a in e.answers if not is_extrapolated(a.command, e.tested)] or e.answers
    widths = list[tuple[float, Answer]]()
    for key in of:
        largest = 0.0 if key == "rise" else max((abs(getattr(a, key)[0]) for a in within), default=nan)
        for a in within:
            value, ends = getattr(a, key)
            widths.append((max(abs(end - value) for end in ends) / max(largest, abs(value)), a))
    return max(widths, key=lambda pair: pair[0], default=(nan, None))


def _half_width(e: AxisResult, *of: str) -> float:
    return _widest(e, *of)[0]


def _known(e: AxisResult, *of: str) -> dict[str, str]:
    """Return at which command the least certain answer is, and how well it is known, as the end of a sentence."""
    width, answer = _widest(e, *of)
    if answer is None:
        return {}
    known = f"known to no better than {percent(width)} of the largest tested one" if is_known(width) else "not known"
    return {"command": f"{answer.command:.0%}", "known": known}


_ALONE = "Log this axis alone, both ways, each command for 8 s. If it is known there, the other axes disturb it here."


def _apart(e: AxisResult) -> str:
    """Return how to tell an axis from what drives the vehicle at the same time."""
    if not e.alone:
        return _ALONE if e.mixed else ""
    return f"{capitalized(told_apart('it', first_of(e.mixed, MOST), e.alone, ''))}." if e.mixed else ""


def _unless_alone(words: str) -> Callable[[AxisResult], str]:
    """Return what to do where the axis has no log of its own; where it has one, that alone should count."""
    return lambda e: _apart(e) if e.alone else words


def _again(e: AxisResult) -> str:
    """Return how to see whether the largest unknown disturbance belongs to its log alone."""
    is_gain = max(e.unknown, key=lambda d: d.share).changes_thrust
    voltage = ", with the voltage" if is_gain and not e.has_voltage else ""
    return f"Log it again{voltage}. If that log is good, leave the axis out of this one by [leave_out] in rov.toml."


def _faster(e: AxisResult) -> str:
    """Return how to see what is fast."""
    rate = max((p.rate for p in e.predictions), default=0.0)
    return "" if rate >= _FAST else "Log at 20 Hz or more, with steps of the command from rest."


RULES = (
    Rule(
        "logs with other motors",
        lambda e: len(e.misfits),
        None,
        0.0,
        "The motors of {file} are not the thrusters of the vehicle.",
        lambda e: {"file": listed(e.misfits)},
        "1",
        remedy="Take a base with the motors that the warning names.",
    ),
    Rule(
        "unseen samples in the 95 % bands",
        lambda e: coverage_of(e.predictions),
        0.8,
        0.6,
        "The 95% bands contain {share} of the unseen samples.",
        is_least=True,
        is_told=True,
        remedy="See in the report which log is predicted badly, and leave the axis out of it by [leave_out].",
    ),
    Rule(
        "score G",
        lambda e: score_of(e.moving),
        0.5,
        0.25,
        "The predictions {reach}.",
        _reach,
        is_least=True,
        remedy=_unless_alone(_ALONE),
    ),
    Rule(
        "moving quantities for which no change is a better prediction",
        lambda e: len(e.worse) / len(e.moving) if e.moving else nan,
        0.0,
        0.5,
        "A prediction of no change is better for the {quantity} in {file}.",
        lambda e: {"quantity": e.worse[0].quantity, "file": e.worse[0].file},
        remedy=_unless_alone(
            "Check signs and units with `rov-fmu inspect`; if they are right, log this axis alone, both ways."
        ),
    ),
    Rule(
        "nothing predicted that moves",
        lambda e: not e.moving and not isfinite(_error_of_tables(e)),
        0.0,
        None,
        "Nothing of this axis was checked on unseen data.",
        unit="1",
        remedy="Record another log that drives this axis.",
    ),
    Rule(
        "errors R of the fit to all data",
        lambda e: e.structure,
        _MOST_ERROR,
        WRONG,
        "The model's errors are {size} times what noise explains, so it lacks something.",
        unit="1",
        remedy=_apart,
    ),
    Rule(
        "errors R₂ of the fit over 2 s",
        lambda e: e.soon,
        _MOST_SOON,
        None,
        "Over 2 s, the model's errors are {size} times the noise, so it lacks something fast.",
        unit="1",
        remedy=_faster,
    ),
    Rule(
        "unknown disturbances, relative to thrust or velocity",
        lambda e: sum(d.share for d in e.unknown),
        MOST_UNKNOWN,
        WORST_UNKNOWN,
        "{what} in {file}.",
        _largest,
        remedy=_again,
    ),
    Rule(
        "no answers",
        lambda e: not e.answers,
        None,
        0.0,
        "No steady velocity is determined.",
        unit="1",
        remedy="Hold commands along this axis, both ways, for 8 s each.",
    ),
    Rule(
        "half-width of the widest V_ss, relative to the largest one",
        lambda e: _half_width(e, "steady"),
        0.15,
        0.3,
        "The steady velocity at {command} is {known}.",
        lambda e: _known(e, "steady"),
        remedy="Hold this command and the opposite one until the speed is steady.",
    ),
    Rule(
        "the same of times and stopping distances",
        lambda e: _half_width(e, "rise", "stop"),
        0.3,
        None,
        "A time or a stopping distance at {command} is {known}.",
        lambda e: _known(e, "rise", "stop"),
        remedy="Log how the vehicle speeds up from rest, and how it slows down without thrust.",
    ),
    Rule(
        "held-out V_ss of tables, error (RMS)",
        _error_of_tables,
        0.2,
        0.4,
        "The other commands predict a V_ss of the tables with an error of {share} (RMS).",
        is_told=True,
        remedy="Measure the table again, both ways.",
    ),
    Rule(
        "upper end of the effective inertia, relative to that in air",
        lambda e: e.inertia,
        None,
        1.0,
        "The inertia is at most {share} of that of the vehicle in air, which cannot be: check the unit of velocity, "
        "the mass, and a thrust that is assumed.",
        is_least=True,
        remedy="Check the unit of the velocity, then the mass, then the thrust.",
    ),
    Rule(
        "effects of unusual size",
        lambda e: len(e.unusual),
        0.0,
        None,
        "The {name} is unusual.",
        lambda e: {"name": listed([f"{one.name} ({effect_in_words(one)})" for one in e.unusual])},
        "1",
        remedy="If it is right, say so in [priors] of rov.toml.",
    ),
    Rule(
        "slips",
        lambda e: len(e.slips),
        None,
        0.0,
        "The {quantity} in {file} seems to have another unit or sign.",
        lambda e: {"quantity": e.slips[0].quantity, "file": e.slips[0].file},
        "1",
        remedy="Check the file; [columns] of rov.toml changes a unit or a sign.",
    ),
    Rule(
        "an assumed vehicle",
        lambda e: float(e.is_assumed),
        0.0,
        None,
        "The mass and the thrusters are assumed.",
        unit="1",
        remedy="Write what you know into rov.toml: `rov-fmu inspect --draft` drafts it.",
    ),
    Rule(
        "difference of J to another vehicle of a second start",
        lambda e: e.difference,
        None,
        DISAGREEMENT,
        "Two starts of the fit led to different vehicles.",
        unit="1",
        remedy="Record a longer log of this axis.",
    ),
)
"""All rules, in the order in which their reasons are told."""


def verdict(e: AxisResult) -> Verdict:
    """Return the worst word of all rules, with a reason for each doubt, the worst first, and the tested commands.

    What to do is the first remedy that was not followed already. A *usable* model may have none left, because its
    intervals allow for the doubts.
    """
    values = sorted(((rule, rule.value(e)) for rule in RULES), key=lambda pair: -WORDS.index(pair[0].word(pair[1])))
    word = values[0][0].word(values[0][1])
    reasons = [
        rule.sentence.format(size=significant(value, 2), share=percent(value), **rule.names(e))
        for rule, value in values
        if rule.word(value) != "good" or (rule.is_told and isfinite(value))
    ]
    if word != WORDS[-1] and not is_whole(e.tested):
        reasons.append(f"It holds for commands {tested_in_words(e.tested)}.")
    remedies = [rule.remedy for rule, value in values if rule.word(value) != "good"]
    told = (one if isinstance(one, str) else one(e) for one in remedies)
    return Verdict(word, tuple(reasons), next(filter(None, told), ""))


def most_inertia(vehicle: Vehicle, axis: Axis, beta: IdentifiedCoefficient | None) -> float:
    """Return the largest effective inertia by the interval of β, relative to the inertia in air; inf if unknown."""
    if beta is None or beta.interval is None:
        return inf
    effective = vehicle.effective_inertia(axis)
    return effective * beta.value / beta.interval[0] / vehicle[axis.inertia]
