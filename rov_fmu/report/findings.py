"""The main findings of an identification: prediction errors, known coefficients, and other effects on the motion."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rov_fmu.identify.identification import AxisResult, Comparison, Identification
from rov_fmu.identify.recordings.recordings_fit import Effect, count
from rov_fmu.model.layout import Axis

_WORDS = {
    "load": "constant load",
    "delay": "delay from the commands to the motion",
    "current": "current along the axis",
    "current north": "current to the north",
    "current east": "current to the east",
    "lag": "lag of the thrusters",
    "reverse thrust": "thrust in reverse, by that forward",
    "reverse drag": "drag in reverse, by that forward",
    "dead band": "dead band of the command",
}


@dataclass(frozen=True)
class Unseen:
    """A prediction of data of an axis that the model was not fitted to.

    Recordings have a `fit`, and points an `error`. Both are None where no prediction was tried.
    """

    axis: Axis
    what: str
    """The predicted data, in words."""
    by: str
    """The fit that predicts them, in words."""
    fit: float | None = None
    """The fit of the velocity over time in percent: 100 is perfect, 0 is no better than the mean velocity."""
    seen: float | None = None
    """The fit in percent of the model that was fitted to all recordings, these included."""
    error: float | None = None
    """The RMS relative error."""
    parts: tuple[tuple[str, float], ...] = ()
    """Each recording (or half of one) and its fit in percent."""


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
            parts = [(p.recording.file, p.fit) for p in held_out.predictions]
            what, by = count(len(parts), "recording"), "each by a fit to the others"
            if held_out.by_halves:
                what, by = f"halves of {parts[0][0]}", "each by a fit to the other"
                parts = [(f"{half} half", fit) for half, (_, fit) in zip(("first", "second"), parts, strict=False)]
            yield Unseen(result.axis, what, by, held_out.fit, held_out.possible, parts=tuple(parts))
        elif result.recordings:
            yield Unseen(result.axis, count(len(result.recordings.simulations), "recording"), "not tried")
        elif result.response:
            for c in (c for c in comparisons if c.result is result):
                points = count(sum(p.weight > 0.0 for p in c.points), "point")
                by = "each by a fit without its thrust"
                yield Unseen(result.axis, f"{c.quantity} of {points}", by, error=c.rms(c.leave_one_out))


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
        Known(name, vehicle.rov[name], vehicle.intervals.get(name), meta.unit, name in assumed)
        for name, meta in vehicle.layout.coefficients.items()
        if name in fitted | assumed
    )


def effects(result: AxisResult) -> tuple[Effect, ...]:
    """Return the effects that were looked for along an axis, the kept ones first."""
    found = result.recordings.effects if result.recordings else ()
    return tuple(sorted(found, key=lambda effect: not effect.kept))


def acting(effect: Effect) -> str:
    """Return an effect in words."""
    return _WORDS[effect.kind]


def verdict(effect: Effect) -> str:
    """Return whether an effect was kept, in words."""
    return "kept" if effect.kept else f"left at {int(effect.kind.startswith('reverse'))}"
