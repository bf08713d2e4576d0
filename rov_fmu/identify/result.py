"""What an identification found: one object, of which the terminal, the report and the vehicle file are views.

Nothing here is computed: `identify` puts the result together, and the findings (findings.py) are functions of it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, log, nan, sqrt
from typing import Literal

from rov_fmu.equation.catalogue import SURGE, SWAY, Axis
from rov_fmu.identify.likelihood.kinds import KINDS, SENSOR_SCALE, SLOW, Process
from rov_fmu.io.messages import listed
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.folder import Folder
from rov_fmu.tank.quality import rate
from rov_fmu.vehicle.description import Word
from rov_fmu.vehicle.vehicle import Vehicle

Interval = tuple[float, float]
Estimate = tuple[float, Interval]
"""A number with its 95 % interval."""
Tested = tuple[float, float]
"""The strongest command along an axis, astern and ahead, that the tests show for long enough; 0 without one."""


@dataclass(frozen=True)
class Constant:
    """A number of the method that was chosen after results were seen, which stand beside it."""

    value: float
    words: str
    """What it is."""
    seen: str
    """What was seen."""


_FLIGHTS = "ArduSub's simulator"
CONSTANTS = {
    "alike": Constant(
        2.0,
        "samples in turn in which a wrong structure lacks the same",
        "96 % of the intervals of 50 drawn axes with a wrong structure contain the truth; with 6, as many, 1.7 times "
        "as wide; with 1, 93.5 %",
    ),
    "lack": Constant(
        1.5,
        "errors over 10 s beyond the noise, as a standard error of ln of an answer",
        "without it, 14 of 19 *good* axes of vehicles that break the equation had an answer outside its interval",
    ),
    "form": Constant(
        0.1,
        "standard error of ln of an answer, relative to the excess of the power of drag over 2",
        "25 of 36 answers of *usable* axes inside where drag falls at a speed; with it 33, and right ones are wider by "
        "5 to 12 %",
    ),
    "soon": Constant(
        1.15,
        "R₂ from which intervals are wider",
        "0.85 to 1.16 along 45 right axes, and up to 2.98",
    ),
    "least soon": Constant(
        0.002,
        "least noise of a sensor over 2 s, relative to its motion within them",
        _FLIGHTS,
    ),
    "steps": Constant(
        0.01,
        "chance that steps differ so much by noise, below which the inertia has a spread",
        "it widens 1 of 77 axes that the law fits, and 15 of 21 others",
    ),
    "contrast": Constant(
        0.2,
        "standard error of the strength of a thruster by the data alone, up to which a hypothesis is about it",
        "0.003 to 0.12 where logs tell thrusters apart, and 0.45 to 4 where their commands are alike",
    ),
    "shared": Constant(
        0.1,
        "share of a lag's variance from which another time is named",
        "0.28 and 0.58 for lags of sensors, at most 0.02 for others",
    ),
    "far": Constant(
        100.0,
        "gain of evidence that few samples ask for, where the model is wrong along all axes",
        "590 and 690 for swapped and reversed thrusters",
    ),
    "rocking": Constant(
        0.03, "least half-width of V_ss without logged roll and pitch", "drag that waves raise by 3 to 7 %"
    ),
    "late": Constant(0.05, "how much earlier or later commands act along an axis, relative to their window", _FLIGHTS),
    "narrowest": Constant(0.2, "the narrowest such window, relative to the time between two rows", _FLIGHTS),
    "most of row": Constant(0.5, "the window from which commands are told as momentary", _FLIGHTS),
    "finest": Constant(
        KINDS[SENSOR_SCALE].finest,
        "least scale (ln) and offset (m/s) of a velocity sensor that are told",
        "a position with a lag of 0.5 s gave 0.010 and 3 mm/s",
    ),
    "least noise": Constant(0.01, "least noise of a sensor, relative to its motion", _FLIGHTS),
}
"""Chosen after results were seen. [priors] and the rules of the verdict have their own tables, with their reasons."""

POSITIVE, KEPT = 2.0, 6.0
"""The evidence, 2 ln of the Bayes factor or of the posterior odds, that is positive and strong (Kass and Raftery
1995). What is strong is told: an effect, a slow process, a cause, a slip, or a hypothesis about the structure."""
_NOTHING = 0.001
"""The share of the thrust or of the velocity below which a slow process without strong evidence is none."""

_MOVING = 3.0
"""A quantity moves if its change is larger than so many standard deviations of its sensor's noise."""

MOST_UNKNOWN, WORST_UNKNOWN = 0.05, 0.15
"""A model is at most *usable*, and must not be used, if unknown slow forces, changes of the thrust and velocities over
ground together exceed these shares of the thrust and of the velocity: what is unknown acts differently elsewhere."""
LEAST_TESTED = 0.05
"""A direction of an axis is tested by commands from this one."""
_ABOUT = 1.05
"""Commands that differ by less than this factor are not told apart."""
USUAL, ALARM, WRONG = 1.5, 3.0, 5.0
"""The largest error of predictions over 10 s that a right structure usually has, relative to the noise, that from which
the structure is clearly wrong, and that from which no answer is worth much."""
DISAGREEMENT = 40.0
"""The difference of J between two starts from which they led to different vehicles; J is twice a log likelihood."""


@dataclass(frozen=True)
class IdentifiedCoefficient:
    """An identified number with its 95 % interval."""

    name: str
    """The name of the coefficient in the FMU."""
    value: float
    interval: Interval | None
    """None where the data do not identify it, so that it is assumed."""
    unit: str
    began: str
    """The prior in words, such as `18.18 within a factor of 2.7, from the base`."""
    narrowed: float
    """The standard error relative to that of the prior: 1 where the data told nothing."""


@dataclass(frozen=True)
class Answer:
    """What an owner asks about one command of an axis. Each number has its 95 % interval."""

    axis: Axis
    command: float
    """A fraction of full command, with its sign."""
    steady: Estimate
    """The steady velocity V_ss, m/s or rad/s."""
    rise: Estimate
    """The time Tau from rest to 63 % of it, with the lag of the thrusters left out, s."""
    stop: Estimate
    """The stopping distance: from it to a tenth of it without thrust, m or rad."""
    lagged: Estimate | None = None
    """The time with the lag of the thrusters, s; None without a lag."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """The prediction of one measured quantity of a log by a fit without this log. SI units; n samples."""

    axis: Axis
    file: str
    quantity: str
    """Such as `heading` or `surge velocity`."""
    unit: str
    is_position: bool
    span: float
    """How far ahead is predicted, s: inf for a whole log; otherwise the prediction starts anew after this time."""
    by: str
    """The data of the fit in words, such as `the other 2 logs` or `the first half`."""
    time: Array
    measured: Array
    predicted: Array
    deviation: Array
    """The standard deviation of measured minus predicted that the model claims, with the noise of the sensor."""
    unchanged: float
    """The RMS error of a prediction of no change."""
    noise: float
    """The standard deviation of the noise of the sensor."""
    error: float
    """The RMS error."""
    coverage: float
    """The share of the samples inside the 95 % band."""
    loss: float
    """The mean of ln S + rho(e² / S), as in J, with the error e and the square S of the deviation."""

    @property
    def ahead(self) -> str:
        """The span in words, `, 10 s ahead`; empty for a whole log. Rows 0.0999999 s apart make no other one."""
        return f", {self.span:.3g} s ahead" if isfinite(self.span) else ""

    @property
    def is_judged(self) -> bool:
        """True where the band says something: not of a position over a recording, whose errors add up."""
        return not self.is_position or self.span < inf

    @property
    def rate(self) -> float:
        """The usual number of its samples in a second, 1/s."""
        return rate(self.time)

    @property
    def least(self) -> float:
        """The least error that counts."""
        return least_error(self.noise, self.unchanged)

    @property
    def is_worse(self) -> bool:
        """True if no change is a better prediction."""
        return self.error > self.unchanged

    @property
    def moves(self) -> bool:
        """True if the quantity changes by clearly more than the noise of its sensor."""
        return moves(self.noise, self.unchanged)


def moves(noise: float, unchanged: float) -> bool:
    """Return False if the RMS error of a prediction of no change is hardly larger than the noise."""
    return unchanged > _MOVING * noise


def least_error(noise: float, unchanged: float) -> float:
    """Return the least error of predictions that counts: the noise, but at least a small share of the motion.

    `unchanged` is the RMS error of a prediction of no change.
    """
    return max(noise, CONSTANTS["least noise"].value * unchanged)


def coverage_of(predictions: Iterable[Prediction]) -> float:
    """Return the share of samples inside their 95 % bands, over the predictions that are judged; NaN without any."""
    judged = [p for p in predictions if p.is_judged]
    return sum(p.coverage * len(p.time) for p in judged) / sum(len(p.time) for p in judged) if judged else nan


def score_of(predictions: Sequence[Prediction]) -> float:
    """Return the score G of predictions of what moves: 0 for one of no change, 1 for errors as small as the noise.

    G = (L0 - L) / (L0 - Ln), where L is the loss of a prediction, L0 that of no change, whose band is as wide as its
    errors are, and Ln that of a prediction with the errors and the band of the sensor's noise. NaN without predictions.
    """
    gains = [(len(p.time), 1.0 + 2.0 * log(p.unchanged), 2.0 * log(p.unchanged / p.least), p.loss) for p in predictions]
    return sum(n * (L0 - L) for n, L0, _, L in gains) / sum(n * all_ for n, _, all_, _ in gains) if gains else nan


@dataclass(frozen=True)
class IdentifiedEffect:
    """An optional part of the model: what it is, of what, its size, and the evidence for it."""

    kind: str
    """The kind of its parameter (likelihood/parameters.py), such as `current`."""
    of: str
    """The axis, the curve or the file that has it; empty for the vehicle."""
    name: str
    """The parameter in words, such as `current to the north`."""
    value: float
    interval: Interval
    unit: str
    evidence: float
    """2 ln of the Bayes factor of the model with it against the model without it."""
    beyond: float = 0.0
    """How far it is from the usual size, relative to where it is unusual; 0 for what a single log has."""
    least: float = -inf
    """The smallest value that the sampling shows."""
    beside: str = ""
    """The thruster to whose force that of this one is relative."""
    axes: frozenset[str] = frozenset()
    """The names of the axes whose sensors have it; empty if it is none of a sensor."""

    @property
    def rounded_evidence(self) -> float:
        """The evidence to a tenth. A fit repeats no more of it, and what is 0 in theory is 0."""
        return round(self.evidence, 1) + 0.0  # makes 0 of -0

    @property
    def is_unusual(self) -> bool:
        """True if it is so large that something else may act in its place."""
        return self.kept and self.beyond > 1.0

    @property
    def kept(self) -> bool:
        """True if it is reported. The vehicle file has those of the vehicle, but not those of water or sensors."""
        return self.evidence > KEPT and self.value > self.least


@dataclass(frozen=True)
class Structure:
    """A hypothesis about the structure that is more probable than the others, and usually part of the model."""

    kind: str
    """Its key in HYPOTHESES (likelihood/hypotheses.py)."""
    of: str
    """The thrusters or files in words; empty where it is about all of them."""
    probability: float
    """Against the model without it."""
    value: float = nan
    """The number of its parameter; NaN if it has none."""
    unit: str = "1"
    words: tuple[tuple[str, str], ...] = ()
    """What else its sentence needs."""


@dataclass(frozen=True, kw_only=True)
class Disturbance(IdentifiedEffect):
    """An effect that is slow: a force, a change of all thrust, or a velocity over ground.

    Its value is its RMS in the log where it is largest.
    """

    axis: Axis | None = None
    """None for a change of all thrust, and for a horizontal velocity."""
    file: str
    """The log in which it is largest."""
    share: float
    """The value relative to the RMS of the thrust, or of the velocity, in that log."""

    @property
    def slow(self) -> Process:
        """The slow process that it is."""
        return SLOW[self.kind]

    @property
    def size(self) -> float:
        """Its value, or 0 where the data show nothing: the value is then a rest that the fit happens to end with."""
        return self.value if self.kept or self.share >= _NOTHING else 0.0

    @property
    def changes_thrust(self) -> bool:
        """True for a change of all thrust."""
        return self.slow.acts_as == "gain"

    def concerns(self, axis: Axis) -> bool:
        """Return True if it acts along an axis. Without an axis, it acts along all, or on the horizontal velocity."""
        return self.axis is axis or (self.axis is None and (self.changes_thrust or axis in (SURGE, SWAY)))


@dataclass(frozen=True, eq=False)
class UnknownForce:
    """The slow force along an axis that a log shows beside the forces of the model, as the filter follows it."""

    axis: Axis
    file: str
    time: Array
    """n: the times of the log, s."""
    force: Array
    """n: N or N m."""
    deviation: Array
    """n: its standard deviation."""


@dataclass(frozen=True)
class Logging:
    """How a log tells the time of its commands."""

    file: str
    interval: float
    """The usual time between two rows of commands, s."""
    offset: float
    """How much later than its row a command acts, s; negative where rows are late."""
    offset_interval: Interval
    width: float
    """The time within which a change of the command is known, s."""


@dataclass(frozen=True)
class SensorNoise:
    """The noise of a sensor in all logs, SI units."""

    axis: Axis
    quantity: str
    unit: str
    white: float
    """The standard deviation of the white noise."""
    coloured: float
    """The standard deviation of the coloured noise."""
    correlation: float
    """The correlation time of the coloured noise, s."""
    samples: int
    outliers: float = 0.0
    """The share of the samples that are far from their predictions."""
    wander: float = 0.0
    """The standard deviation of what wanders of the velocity of an estimator, which its position does not have."""


@dataclass(frozen=True)
class MeasuredPoint:
    """A row of a table of tank tests, and what the model says about it."""

    subject: str
    """The curve or the axis."""
    quantity: Literal["force", "V_ss", "Tau"]
    unit: str
    file: str
    command: float
    measured: float
    model: float
    held_out: float
    """The value by the information of all data but the rows of the same command. NaN where it is not determined."""
    counts: bool
    """False outside the window of rov.toml."""


def relative_error(points: Iterable[MeasuredPoint], of: Literal["model", "held_out"], quantity: str = "") -> float:
    """Return the RMS of the relative errors of the points that count, or of those of a quantity; NaN without any."""
    some = (p for p in points if p.quantity == (quantity or p.quantity))
    off = [getattr(p, of) / p.measured - 1.0 for p in some if p.counts and p.measured]
    off = [error for error in off if isfinite(error)]
    return sqrt(sum(error**2 for error in off) / len(off)) if off else nan


@dataclass(frozen=True)
class Verdict:
    """Whether the model of an axis may be trusted, and why."""

    word: Word
    reasons: tuple[str, ...]
    """Sentences, the worst first: what keeps it from being better, or for `good` what it rests on."""
    remedy: str = ""
    """The one thing to do about the first reason, as a sentence; empty where nothing has to be done."""

    def of(self, axis: Axis) -> str:
        """Return the verdict of an axis as a sentence: `surge: good. The 95% bands contain 97% ...`."""
        stop = ":" if self.word == "not identified" else "."
        return f"{axis.name}: {self.word}{stop} {' '.join(map(with_stop, self.reasons))}"


def with_stop(sentence: str) -> str:
    """Return a sentence that ends with a full stop or a question mark."""
    return sentence if sentence.endswith((".", "?", "!")) else f"{sentence}."


@dataclass(frozen=True)
class AxisOfBase:
    """An axis of the base or of rov.toml that no test identifies."""

    axis: Axis
    source: str
    """The base, or rov.toml; empty where nothing is known about the axis, so that the vehicle lacks it."""
    reason: str
    """Such as `nothing in the logs shows it`."""
    thrusters: tuple[str, ...] = ()
    """The thrusters that the vehicle lacks with it, because they drive no other axis."""

    @property
    def verdict(self) -> Verdict:
        """The word, with where its coefficients are from."""
        lacking = f"{self.reason}, so {without((self.axis,), self.thrusters)}"
        return Verdict("not identified", (f"from {self.source} ({self.reason})" if self.source else lacking,))


def without(axes: Iterable[Axis], thrusters: Sequence[str]) -> str:
    """Return what a vehicle lacks, such as `the vehicle has no surge, no sway and no thruster 6`."""
    words = [f"thruster{'s' if thrusters[1:] else ''} {listed(thrusters)}"] if thrusters else []
    return f"the vehicle has {listed(f'no {one}' for one in [*(axis.name for axis in axes), *words])}"


def is_extrapolated(command: float, tested: Tested) -> bool:
    """Return True if a command is stronger than those of the tests, or in a direction without a test."""
    strongest = tested[command > 0.0]
    return abs(command) > _ABOUT * strongest or strongest < LEAST_TESTED


def is_whole(tested: Tested) -> bool:
    """Return True if full command was tested in both directions."""
    return not any(is_extrapolated(command, tested) for command in (-1.0, 1.0))


def are_alike(value: float, other: float) -> bool:
    """Return True if two commands are about the same."""
    return value * other > 0.0 and max(value / other, other / value) <= _ABOUT


def half_width(estimate: Estimate) -> float:
    """Return the larger half of the interval of a number, relative to the number."""
    value, interval = estimate
    return max(abs(end / value - 1.0) for end in interval)


def is_known(half_width: float) -> bool:
    """Return False for the relative half-width of an interval that is wider than its number, which is then not told."""
    return half_width <= 1.0


@dataclass(frozen=True)
class Slip:
    """A mistake of unit or sign, with which a file would fit much better."""

    file: str
    quantity: str
    """Such as `depth`, `force` or `commands`."""
    words: str
    """The mistake as a question, such as `is it in mm`."""
    evidence: float
    """2 ln of the Bayes factor of the mistake against the file as it stands."""


@dataclass(frozen=True, eq=False)
class AxisResult:
    """All that concerns one axis: what its verdict rests on, and the verdict."""

    axis: Axis
    verdict: Verdict = Verdict("not identified", ())
    answers: tuple[Answer, ...] = ()
    tested: Tested = (1.0, 1.0)
    """Answers to stronger commands, and those in a direction that no test has, are extrapolated, and do not count for
    the verdict."""
    known: tuple[IdentifiedCoefficient, ...] = ()
    """The coefficients of the axis; those of curves stand in `Identification.curves`."""
    predictions: tuple[Prediction, ...] = ()
    """Held-out predictions; empty where the axis has only tables or a single short log."""
    points: tuple[MeasuredPoint, ...] = ()
    structure: float = 0.0
    """The error R of the fit to all data over 10 s, relative to what noise explains (`search.structure`)."""
    soon: float = 0.0
    """That over 2 s, relative to the noise (`search.with_steps`); 0 where nothing tells it."""
    disturbances: Sequence[Disturbance] = ()
    effects: Sequence[IdentifiedEffect] = ()
    slips: Sequence[Slip] = ()
    """The mistakes in the logs that show the axis, in what concerns it."""
    has_voltage: bool = False
    """True if a log has the voltage of the battery."""
    misfits: Sequence[str] = ()
    """The logs whose motors are not the thrusters along the axis."""
    inertia: float = inf
    """The upper end of the interval of the effective inertia, relative to that of the vehicle in air."""
    alone: Sequence[str] = ()
    """The logs that drive no other axis."""
    mixed: Sequence[str] = ()
    """The logs that drive other axes, too."""
    is_assumed: bool = False
    """True if nobody described the vehicle, so that its mass and its thrusters are those of a base."""
    difference: float = 0.0
    """How much larger J is at the end of the second start, if that differs along the axis."""

    @property
    def moving(self) -> list[Prediction]:
        """The predictions that are judged of quantities that move."""
        return [p for p in self.predictions if p.is_judged and p.moves]

    @property
    def worse(self) -> list[Prediction]:
        """Those that a prediction of no change would be better than."""
        return [p for p in self.moving if p.is_worse]

    @property
    def unknown(self) -> list[Disturbance]:
        """What is unknown: the disturbances with strong evidence."""
        return [d for d in self.disturbances if d.kept]

    @property
    def unusual(self) -> list[IdentifiedEffect]:
        """The effects of unusual size, but for those of the sensors of other axes."""
        own = (effect for effect in self.effects if not effect.axes or self.axis.name in effect.axes)
        return [effect for effect in own if effect.is_unusual]

    @property
    def main(self) -> Prediction | None:
        """The prediction that says most: of a position over 10 s if there is one, otherwise of a velocity."""
        return min(
            self.predictions,
            key=lambda p: (not p.is_judged, not p.is_position, -p.error / max(p.noise, 1e-12)),
            default=None,
        )


@dataclass(frozen=True, eq=False)
class Identification:
    """A vehicle, the tests that it comes from, and everything that is worth saying about both."""

    folder: Folder
    """The tests, with rov.toml."""
    vehicle: Vehicle
    axes: tuple[AxisResult, ...]
    curves: Mapping[str, tuple[IdentifiedCoefficient, ...]]
    """The coefficients of each thrust curve."""
    forces: tuple[MeasuredPoint, ...]
    """The measured forces of thrust tables."""
    effects: tuple[IdentifiedEffect, ...]
    disturbances: tuple[Disturbance, ...]
    logging: tuple[Logging, ...]
    sensors: tuple[SensorNoise, ...]
    correlation: tuple[tuple[str, ...], Array]
    """The names and the correlations of all identified coefficients."""
    objective: float
    """J at its minimum."""
    unknown_forces: tuple[UnknownForce, ...] = ()
    """The slow force along each moving axis of each log."""
    slips: tuple[Slip, ...] = ()
    """The mistakes that would explain a file better."""
    structures: tuple[Structure, ...] = ()
    """The hypotheses about the structure that won."""
    alike: tuple[tuple[str, ...], ...] = ()
    """Thrusters along one axis whose forces the logs do not tell apart."""
    has_ended: bool = False
    """True if the search for causes ended early, because the model is wrong along all axes."""
    times: tuple[str, ...] = ()
    """Times from a command to what a sensor shows that the logs do not tell apart, in words."""
    axes_of_base: tuple[AxisOfBase, ...] = ()
    """The other axes of the base and of rov.toml."""
    findings: tuple[Finding, ...] = ()
    """What to tell, in the order of its weight. The sentences and severities are in findings.py."""

    @property
    def verdicts(self) -> dict[Axis, Verdict]:
        """The verdict of every axis of the base and of rov.toml, those that are identified first."""
        verdicts = {one.axis: one.verdict for one in self.axes}
        return verdicts | {one.axis: one.verdict for one in self.axes_of_base}

    @property
    def seconds(self) -> float:
        """The length of all logs, s."""
        return sum(log.commands.end - float(log.commands.rows[0]) for log in self.folder.logs if log.commands)
