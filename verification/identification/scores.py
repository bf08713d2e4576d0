"""The scores: errors, bands, time and coefficients, one row each, which is also the row of a CSV file."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from io import StringIO
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from rov_fmu.tank.arrays import Array
from verification.identification.protocol import Outcome

_HALF = {level: float(norm.ppf(0.5 + 0.5 * level)) for level in (0.5, 0.95)}
"""Half the width of a band in standard deviations."""


@dataclass(frozen=True)
class Score:
    """How well a method predicts one quantity over one span, in SI units."""

    data: str
    method: str
    quantity: str
    unit: str
    span: float
    """s; infinite for open loop."""
    samples: int
    error: float
    """Root mean square of measured minus predicted."""
    noise: float
    """The standard deviation of the sensor's white noise."""
    inside_50: float
    inside_95: float
    """The share of the samples in the bands."""
    width_50: float
    width_95: float
    """The mean width of the bands."""
    seconds: float
    """Processor time of the method with this data set: fit and all predictions."""
    edits: int
    """The number of values that a person entered into rov.toml for this method."""


@dataclass(frozen=True)
class Number:
    """A coefficient beside its true value."""

    data: str
    method: str
    axis: str
    name: str
    true: float
    value: float
    low: float
    high: float
    """The ends of the 95 % interval."""


def bands(error: Array, deviation: Array) -> tuple[float, float, float, float, float]:
    """Return the RMS error, the shares of samples in the bands of 50 and 95 %, and the mean widths of these bands."""
    inside = [float(np.mean(np.abs(error) <= half * deviation)) for half in _HALF.values()]
    widths = [float(np.mean(2.0 * half * deviation)) for half in _HALF.values()]
    return float(np.sqrt(np.mean(error**2))), inside[0], inside[1], widths[0], widths[1]


def scores(outcome: Outcome) -> Iterator[Score]:
    """Yield a row for each quantity and span. The samples of all test recordings count equally."""
    found: dict[tuple[str, str, float], list[tuple[Array, Array, float]]] = {}
    for one in outcome.predictions:
        for number, m in enumerate(one.recording.channels):
            own = one.counts & (one.recording.log.record.sensor == number)
            key = m.channel.quantity.name, m.channel.quantity.unit, one.span
            found.setdefault(key, []).append((one.error[own], one.deviation[own], m.noise))
    method, split = outcome.method, outcome.split
    for (quantity, unit, span), some in found.items():
        error, deviation = (np.concatenate([one[k] for one in some]) for k in (0, 1))
        noise = float(np.median([one[2] for one in some]))
        rms, *shares = bands(error, deviation)
        in_50, in_95, width_50, width_95 = shares
        who, edits = (split.name, method.name, quantity, unit), split.edits[method.uses_thrust]
        yield Score(*who, span, len(error), rms, noise, in_50, in_95, width_50, width_95, outcome.seconds, edits)


def numbers(outcome: Outcome) -> Iterator[Number]:
    """Yield a row for each coefficient whose true value is known."""
    for axis in outcome.split.known.fitted:
        true = {name: value for (of, name), value in outcome.split.truth.items() if of == axis.name}
        known = outcome.method.coefficients(axis) if true else {}
        for name, values in known.items():
            yield Number(outcome.split.name, outcome.method.name, axis.name, name, true[name], *values)


@dataclass(frozen=True)
class Summary:
    """A method with one data set: over all quantities."""

    errors: dict[float, float]
    """By span: the geometric mean over the quantities of the error relative to that of no change."""
    inside_50: float
    inside_95: float
    """The mean share over quantities and spans."""
    lowest: tuple[float, str, float]
    """The least share in the 95 % bands with its quantity and span."""
    seconds: float
    edits: int


def summary(rows: Sequence[Score], data: str, method: str, reference: str) -> Summary:
    """Return the summary of a method, relative to the errors of a reference."""
    own = [row for row in rows if (row.data, row.method) == (data, method)]
    usual = {(row.quantity, row.span): row.error for row in rows if (row.data, row.method) == (data, reference)}
    ratios: dict[float, list[float]] = {}
    for row in own:
        ratios.setdefault(row.span, []).append(row.error / usual.get((row.quantity, row.span), nan))
    lowest = min((row.inside_95, row.quantity, row.span) for row in own)
    return Summary(
        {span: float(np.exp(np.mean(np.log(some)))) for span, some in ratios.items()},
        float(np.mean([row.inside_50 for row in own])),
        float(np.mean([row.inside_95 for row in own])),
        lowest,
        own[0].seconds,
        own[0].edits,
    )


def to_csv(rows: Iterable[Score | Number]) -> str:
    """Return a CSV file."""
    text = StringIO()
    several = [asdict(row) for row in rows]
    writer = csv.DictWriter(text, [*several[0]] if several else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in several)
    return text.getvalue()


def from_csv(path: Path) -> list[Score]:
    """Read the scores of an earlier run."""
    kinds: dict[str, Any] = {field.name: field.type for field in fields(Score)}
    with path.open(encoding="utf-8", newline="") as file:
        return [Score(**{name: kinds[name](text) for name, text in row.items()}) for row in csv.DictReader(file)]
