"""The main findings of an identification: prediction errors, known coefficients, and other effects on the motion."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.identification import AxisResult, Comparison, Identification
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.recordings.prediction_errors import Errors, Key, Quantity, Span, shown_in
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, count
from rov_fmu.model.layout import Axis

EXPLAINED = {
    "Warnings": "Something contradicts the model or other data. Check each of these before you use the model.",
    "Doubts": "The data leave these questions open. More or other tests would answer them.",
    "Facts": "What was found, and what was done with the data. No action is needed.",
}
"""An explanation of each group of findings, by its heading (rov_fmu/identify/findings.py)."""


@dataclass(frozen=True)
class Unseen:
    """A prediction of data of an axis that the model was not fitted to.

    Recordings have `errors`, and points an `error`. There are neither where no prediction can be computed.
    """

    axis: Axis
    what: str
    """The predicted data, in words."""
    by: str
    """The fit that predicts them, in words."""
    error: float | None = None
    """The RMS relative error."""
    errors: tuple["Accuracy", ...] = ()
    """The errors of the predictions of recordings."""
    parts: Mapping[str, tuple["Accuracy", ...]] = field(default_factory=dict)
    """The errors of each recording, or of each half of a single one."""


@dataclass(frozen=True)
class Accuracy:
    """The RMS errors of predictions, with two references: the errors of predicting no change, and the sensor's
    noise."""

    span: Span
    of: str
    """The predicted quantity: depth, velocity ..."""
    unit: str
    predicted: float
    unchanged: float
    noise: float
    explained: float
    """The share of the change beyond the noise that is predicted, see `Errors`."""


@dataclass(frozen=True)
class MeasuredAndFitted:
    """A coefficient that both tables and recordings determine. The vehicle has the value of the recordings."""

    name: str
    unit: str
    measured: float
    measured_interval: tuple[float, float] | None
    by: str
    """The tables that give the measured value."""
    fitted: float
    fitted_interval: tuple[float, float] | None
    reason: str
    """What the two values are, and why they may differ."""

    @property
    def differ(self) -> bool:
        """True when the intervals have no value in common."""
        if not self.measured_interval or not self.fitted_interval:
            return False
        return max(self.measured_interval[0], self.fitted_interval[0]) > min(
            self.measured_interval[1], self.fitted_interval[1]
        )


@dataclass(frozen=True)
class Inertia:
    """The identified inertia m/β along an axis, and the part of it that is added mass, in kg or kg.m2."""

    axis: Axis
    unit: str
    total: float
    interval: tuple[float, float]
    added: float
    added_interval: tuple[float, float]


@dataclass(frozen=True)
class Known:
    """A coefficient that was to be identified from the tests."""

    name: str
    value: float
    interval: tuple[float, float] | None
    """The 95 % interval, or None if the tests do not determine the coefficient."""
    unit: str
    assumed: bool
    """True if the value was assumed because no test determines it."""

    @property
    def relative(self) -> tuple[float, float] | None:
        """The ends of the interval divided by the value, or None if there is no interval or the value is 0."""
        if self.interval is None or self.value == 0.0:
            return None
        low, high = sorted(end / self.value for end in self.interval)
        return low, high


def unseen(results: Identification, comparisons: Sequence[Comparison]) -> Iterator[Unseen]:
    """Yield the predictions for each tested axis.

    Recordings are predicted by fits to the other recordings, and points by fits without the points of their thrust.
    """
    for result in results.axes:
        if held_out := result.held_out:
            files = [p.recording.file for p in held_out.predictions]
            what, by = count(len(files), "recording"), "each by a fit to the others"
            if held_out.by_halves:
                what, by = f"halves of {files[0]}", "each by a fit to the other"
                files = ["first half", "second half"][: len(files)]
            parts = {
                file: accuracies(result.axis, p.errors) for file, p in zip(files, held_out.predictions, strict=True)
            }
            yield Unseen(result.axis, what, by, errors=accuracies(result.axis, held_out.errors), parts=parts)
        elif result.recordings:
            yield Unseen(result.axis, count(len(result.recordings.simulations), "recording"), "cannot be computed")
        elif result.response:
            for c in (c for c in comparisons if c.result is result):
                points = count(c.counts, "point")
                by = "each by a fit without its thrust"
                yield Unseen(result.axis, f"{c.quantity} of {points}", by, error=c.rms(c.leave_one_out))


def accuracies(axis: Axis, errors: Mapping[Key, Errors]) -> tuple[Accuracy, ...]:
    """Return the errors in the units of a report, the short predictions first."""
    spans: tuple[Span, ...] = ("10 s", "whole recording")
    quantities: tuple[Quantity, ...] = ("position", "velocity")
    found = []
    for span, quantity in ((span, quantity) for span in spans for quantity in quantities):
        if here := errors.get((span, quantity)):
            factor, unit = shown_in(axis, quantity)
            predicted, unchanged, noise = (factor * rms for rms in here.rms)
            name = axis.position if quantity == "position" else "velocity"
            found.append(Accuracy(span, name, unit, predicted, unchanged, noise, here.explained))
    return tuple(found)


def measured_and_fitted(results: Identification) -> Iterator[MeasuredAndFitted]:
    """Yield the coefficients that recordings determine and that thrust tests or tables of points determine, too."""
    given: dict[str, MeasuredAndFitted] = {}
    units = {name: declaration.unit for name, declaration in results.vehicle.layout.coefficients.items()}

    def compare(measured: Estimate, fitted: Estimate, by: str, reason: str) -> Iterator[MeasuredAndFitted]:
        for name in measured.names:
            if name in fitted.names and name not in given:
                values = [(e[name], e.interval(name)) for e in (measured, fitted)]
                given[name] = MeasuredAndFitted(name, units[name], *values[0], by, *values[1], reason)
                yield given[name]

    for result in (r for r in results.axes if r.recordings):
        assert result.recordings
        fitted = result.recordings.estimate
        for curve, thrust in results.thrust.items():
            yield from compare(thrust.estimate, fitted, f"thrust tests of {curve}", _OF_THRUST)
        if result.response:
            yield from compare(result.response.estimate, fitted, f"points of {result.axis.name}", _OF_POINTS)


_OF_THRUST = (
    "The measured value is that of the forces alone. The fitted one explains the forces and the "
    "recordings together. They may differ by chance. Forces alone hardly distinguish a dead band "
    "from the shape of the curve. A thruster may also push less in motion than when it is held, or "
    "the scale may be wrong, or the battery may differ"
)
_OF_POINTS = (
    "The measured value comes from the tables alone. Their numbers include the effects of load, "
    "delay, lag and current. The fitted one explains the tables and the recordings together, and "
    "these effects are separate from drag and β"
)


def known(results: Identification) -> tuple[Known, ...]:
    """Return the coefficients that were fitted or had to be assumed, in the order of the vehicle."""
    vehicle = results.vehicle
    estimates = [fit.estimate for fit in results.thrust.values()] + [r.estimate for r in results.axes if r.estimate]
    fitted = {name for estimate in estimates for name in estimate.names}
    alphas = {
        result.axis.coefficient("alpha") for result in results.axes
    }  # they are 1 by convention, not because a test is missing
    assumed = {name for result in results.axes for name in result.assumed} - fitted - alphas
    return tuple(
        Known(name, vehicle.rov[name], vehicle.intervals.get(name), declaration.unit, name in assumed)
        for name, declaration in vehicle.layout.coefficients.items()
        if name in fitted | assumed
    )


def inertias(results: Identification) -> Iterator[Inertia]:
    """Yield the inertia of each axis whose β was identified."""
    rov, layout = results.vehicle.rov, results.vehicle.layout
    of = {c.name: c for c in known(results)}
    for form in layout.axes:
        beta = of.get(form.coefficient("beta"))
        if beta and beta.interval and beta.interval[0] > 0.0:
            own, given = rov[form.axis.inertia], rov.inertia(form)
            total, high, low = (given / value for value in (beta.value, *beta.interval))
            unit = layout.coefficients[form.axis.inertia].unit
            yield Inertia(form.axis, unit, total, (low, high), total - own, (low - own, high - own))


def effects(result: AxisResult) -> tuple[FittedEffect, ...]:
    """Return the effects that were looked for along an axis, the kept ones first."""
    found = result.recordings.effects if result.recordings else ()
    return tuple(sorted(found, key=lambda effect: not effect.kept))


def acting(effect: FittedEffect) -> str:
    """Return an effect in words."""
    return EFFECTS[effect.kind].words


def verdict(effect: FittedEffect) -> str:
    """Return whether an effect was kept, in words."""
    return "kept" if effect.kept else f"left at {EFFECTS[effect.kind].neutral:g}"
