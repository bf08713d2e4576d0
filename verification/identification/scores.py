"""The scores as tables of pandas, which are also the CSV files: errors, bands, time and coefficients.

`scores` has a row for each quantity and span: `error` is the root mean square of measured minus predicted and `noise`
the standard deviation of the sensor's white noise, in SI units; `inside_50` and `inside_95` are the shares of the
samples in the bands, and `width_50` and `width_95` the mean widths of these; `seconds` is the processor time of the
method with this data set. The span of open loop is infinite.
"""

from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import norm

from rov_fmu.tank.arrays import Array
from verification.identification.protocol import Outcome

_COLUMNS = ["data", "method", "quantity", "unit", "span", "samples", "error", "noise"]
_COLUMNS += ["inside_50", "inside_95", "width_50", "width_95", "seconds"]
Table = Any
"""A DataFrame. Its published types do not know what its groups and rows have."""
REFERENCE = "no change"
"""The method that errors are relative to."""


def bands(error: Array, deviation: Array) -> dict[str, float]:
    """Return the RMS error, the shares of samples in the bands of 50 and 95 %, and the mean widths of these bands."""
    found = {"error": float(np.sqrt(np.mean(error**2)))}
    for level in (50, 95):
        half = norm.ppf(0.5 + 0.005 * level) * deviation
        found[f"inside_{level}"] = float(np.mean(np.abs(error) <= half))
        found[f"width_{level}"] = float(np.mean(2.0 * half))
    return found


def scores(outcome: Outcome) -> Table:
    """Return the scores of a method with a data set. The samples of all test recordings count equally."""
    samples = []
    for one in outcome.predictions:
        channels, sensor = one.log.measured, one.log.record.sensor
        of_sensor: dict[str, Any] = {
            "quantity": [m.channel.quantity.name for m in channels],
            "unit": [m.channel.quantity.unit for m in channels],
            "noise": [m.noise for m in channels],
        }
        columns = {name: np.array(values)[sensor] for name, values in of_sensor.items()}
        made = pd.DataFrame({**columns, "span": one.span, "error": one.error, "deviation": one.deviation})
        samples.append(made[one.counts])
    rows = []
    for (quantity, unit, span), own in pd.concat(samples).groupby(["quantity", "unit", "span"], sort=False):
        row = {"data": outcome.split.name, "method": outcome.method.name, "quantity": quantity, "unit": unit}
        row |= {"span": span, "samples": len(own), "noise": own.noise.drop_duplicates().median()}
        row |= bands(own.error.to_numpy(), own.deviation.to_numpy())
        rows.append(row | {"seconds": outcome.seconds})
    return pd.DataFrame(rows, columns=_COLUMNS)


def numbers(outcome: Outcome) -> Table:
    """Return a row for each coefficient whose true value is known: this, the value, and its 95 % interval."""
    rows = []
    for axis in outcome.split.known.fitted:
        true = {name: value for (of, name), value in outcome.split.truth.items() if of == axis.name}
        for name, (value, low, high) in (outcome.method.coefficients(axis) if true else {}).items():
            row = {"data": outcome.split.name, "method": outcome.method.name, "axis": axis.name, "name": name}
            rows.append(row | {"true": true[name], "value": value, "low": low, "high": high})
    return pd.DataFrame(rows)


def relative_errors(rows: Table) -> Table:
    """Return the errors of each method (row) and span (column) with one data set, relative to those of no change.

    It is the geometric mean over the quantities.
    """
    logs: Any = np.log(rows.pivot(index=["span", "quantity"], columns="method", values="error"))
    means = np.exp(logs.sub(logs[REFERENCE], axis=0).groupby("span").mean()).T
    return means.reindex(rows.method.unique())
