"""What an identification is asked first: how well it predicts what it has not seen, what is known, what else acts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rov_fmu.identify.identification import AxisResult, Comparison, Identification
from rov_fmu.identify.recordings.recordings_fit import Effect, count
from rov_fmu.model.layout import Axis

_ACTS = {
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
    """How well what a fit has not seen is predicted; either a fit or an error, NaN or None where none was tried."""

    axis: Axis
    what: str
    by: str
    fit: float | None = None
    """Time-domain fit, percent: 100 is perfect, 0 is no better than the mean."""
    seen: float | None = None
    """The same of the fit to all recordings."""
    error: float | None = None
    """RMS relative error."""
    parts: tuple[tuple[str, float], ...] = ()
    """The fit of each recording, by its file."""


@dataclass(frozen=True)
class Known:
    """A coefficient that the tests were to tell."""

    name: str
    value: float
    interval: tuple[float, float] | None
    """95 %; None where the tests do not tell it."""
    unit: str
    assumed: bool

    @property
    def relative(self) -> tuple[float, float] | None:
        """The ends by the value; None where that is 0."""
        if self.interval is None or self.value == 0.0:
            return None
        low, high = sorted(end / self.value for end in self.interval)
        return low, high


def unseen(results: Identification, comparisons: Sequence[Comparison]) -> Iterator[Unseen]:
    """Of every axis that was tested: recordings by fits to the others, or points by fits to other thrusts."""
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
    """What was fitted or had to be assumed, in the order of the vehicle."""
    vehicle = results.vehicle
    estimates = [fit.estimate for fit in results.thrust.values()] + [r.estimate for r in results.axes if r.estimate]
    fitted = {name for estimate in estimates for name in estimate.names}
    alphas = {result.axis.coefficient("alpha") for result in results.axes}  # 1 by convention, not for want of a test
    assumed = {name for result in results.axes for name in result.assumed} - fitted - alphas
    return tuple(
        Known(name, vehicle.rov[name], vehicle.intervals.get(name), meta.unit, name in assumed)
        for name, meta in vehicle.layout.coefficients.items()
        if name in fitted | assumed
    )


def effects(result: AxisResult) -> tuple[Effect, ...]:
    """What else acts along an axis, or was looked for in vain; those kept first."""
    found = result.recordings.effects if result.recordings else ()
    return tuple(sorted(found, key=lambda effect: not effect.kept))


def acting(effect: Effect) -> str:
    """An effect in words."""
    return _ACTS[effect.kind]


def verdict(effect: Effect) -> str:
    """What became of it."""
    return "kept" if effect.kept else f"left at {int(effect.kind.startswith('reverse'))}"
