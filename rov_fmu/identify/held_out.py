"""What is held out: parts of logs and rows of tables, which a fit to the other data predicts.

Data that know nothing of an axis predict it with bands as wide as the prior, which contain everything. So a log is held
out by the others only where these inform the axis, and otherwise each half of it by a fit that has the other half.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.identify.assess import logarithms
from rov_fmu.identify.beginning import table_rows
from rov_fmu.identify.given import Tests
from rov_fmu.identify.likelihood.curves import QUADRATIC_DRAG
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.objective import DataPart, Objective, TableRow, cost, modelled
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import Posterior, variances_of
from rov_fmu.identify.likelihood.records import unchanged
from rov_fmu.identify.likelihood.search import SETTLING
from rov_fmu.identify.likelihood.solve import Minimum, information_of, refits
from rov_fmu.identify.result import MeasuredPoint, Prediction
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.vehicle.uncertainty import NORMAL
from rov_fmu.vehicle.vehicle import Vehicle

INFORMED = 0.5
"""The least share of what all data tell of an axis that a fit must know to hold out the rest."""
_CENTRAL = (0.5,)
"""The command whose answers tell what data know of an axis."""
_STEPS = 0.3, 0.03, 0.003
"""The steps of the derivatives of predictions, relative to standard errors: the first to leave all motions finite."""
_LOST = 1.8
"""The largest standard deviation of a heading, rad: that of a direction about which nothing is known."""

Values = Mapping[tuple[str, str, float], float]
"""The value of a row by a fit without it, by the quantity, the curve or axis, and the command."""


# ---- Fits without a part of the data ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A part of a log that is held out, and the fit to other data that predicts it."""

    log: int
    chosen: slice
    by: str
    """The data of the fit in words, such as `the other 2 logs` or `the first half`."""
    axes: tuple[Axis, ...]
    """The axes of which these data know enough."""
    part: DataPart
    fit: Posterior
    """With all effects."""


class Knowledge:
    """How much of what all data tell of some numbers a part of them tells."""

    def __init__(self, objective: Objective, best: Minimum) -> None:
        self.objective, self.best = objective, best
        self._all = Posterior.of(objective.table, best.z, best.information)

    def share(self, logarithms: Callable[[Array], Array], part: DataPart) -> Array:
        """Return ln(s_prior / s_part) / ln(s_prior / s_all), with the standard deviations s of each of m logarithms.

        The function returns m x n logarithms for p x n coordinates. The share is 0 where all data tell nothing.
        """
        information = information_of(self.objective, self.best, part)
        of_part = Posterior.of(self.objective.table, self.best.z, information)
        with np.errstate(all="ignore"):
            _, every, prior = self._all.numbers(logarithms)
            _, some, _ = of_part.numbers(logarithms)
            nats = [np.nan_to_num(np.log(np.diag(prior) / np.diag(C))) for C in (some, every)]
        return np.asarray(nats[0] / np.maximum(nats[1], 1e-9))

    def informs(self, axis: Axis, part: DataPart) -> bool:
        """Return True if a part of the data tells half of what all tell of the speed, time and way at half command."""
        return float(np.mean(self.share(logarithms(self.objective.table, axis, _CENTRAL), part))) >= INFORMED


def held_out(objective: Objective, best: Minimum) -> list[HeldOut]:
    """Return what is held out, with the fits to other data.

    An axis of a log is predicted by all other logs if these know enough of it, otherwise each half of the log by the
    other logs and the other half. Where that does not know enough either, nothing is held out. Neither is an axis that
    the log does not drive: its motion says little about the model, and may be smaller than the errors of a right one.
    """
    logs, rows = objective.whole.logs, objective.whole.rows
    known, found = Knowledge(objective, best), list[tuple[int, slice, str, tuple[Axis, ...], DataPart]]()
    for n in logs:
        others = [m for m in logs if m != n]
        words = "the other log" if len(others) == 1 else f"the other {len(others)} logs"
        rest, middle = list(objective.logs[n].driven), len(objective.records[n].time) // 2
        halves = slice(middle), slice(middle, None)
        with_others = f" and {words}" if others else ""
        parts = [(slice(None), words if others else "the tables", DataPart(others, rows))]
        parts += [
            (out, f"the {name} half{with_others}", DataPart(logs, rows, {n: used}))
            for out, used, name in zip(halves[::-1], halves, ("first", "second"), strict=True)
        ]
        for out, by, part in parts:
            if axes := tuple(axis for axis in rest if known.informs(axis, part)):
                found.append((n, out, by, axes, part))
                if part.logs is others:
                    rest = [axis for axis in rest if axis not in axes]
    ends = refits(objective, best, [part for *_, part in found])
    fits = [Posterior.of(objective.table, end.z, end.information) for end in ends]
    return [HeldOut(*one, fit) for one, fit in zip(found, fits, strict=True)]


# ---- Predictions -----------------------------------------------------------------------------------------------------


def predictions(objective: Objective, best: Minimum, out: Sequence[HeldOut]) -> Iterator[Prediction]:
    """Yield the prediction of each quantity that is held out."""
    for held in out:
        covariance = held.fit.covariance
        if held.log not in held.part.logs:
            covariance = _of_unseen(objective, best, covariance, held.log)
        yield from _predicted(objective, held, cautious(objective, held.fit.z), covariance)


def _of_unseen(objective: Objective, best: Minimum, covariance: Array, number: int) -> Array:
    """Return the covariance with the variance of what differs from log to log in an unseen log, such as the current."""
    found = covariance.copy()
    for n, p in enumerate(objective.table.parameters):
        if p.of_kind.differs_by_log and p.log == number:
            found[n], found[:, n] = 0.0, 0.0
            found[n, n] = unseen_variance(objective.table, best.z, covariance, p)
    return found


def unseen_variance(table: Table, z: Array, covariance: Array, unseen: Parameter) -> float:
    """Return the variance of a current, or of an offset, of an unseen log: as large as in the other logs of a table.

    Where no other log has one, it is that of the prior.
    """
    alike = [(n, p) for n, p in enumerate(table.parameters) if (p.kind, p.unit) == (unseen.kind, unseen.unit)]
    others = [z[n] ** 2 + covariance[n, n] for n, p in alike if p.of != unseen.of]
    return unseen.of_kind.least_unseen**2 + float(np.mean(others or [p.deviation**2 for _, p in alike]))


def cautious(objective: Objective, z: Array) -> Array:
    """Return the parameters with no size below its least one on unseen data: thrust is never predicted to better."""
    sizes = (p.of_kind.least_unseen if p.of_kind.is_size else 0.0 for p in objective.table.parameters)
    return np.maximum(z, [log(size) if size else -inf for size in sizes])


def _predicted(objective: Objective, out: HeldOut, z: Array, covariance: Array) -> Iterator[Prediction]:
    """Yield the predictions of what is held out: over its whole length, and over a shorter time.

    Velocities are predicted over one of the two: over the shorter time if commands are lost between the rows.
    """
    sampled, record = objective.logs[out.log], objective.records[out.log]
    inside = np.zeros(len(record.time), bool)
    inside[out.chosen] = True
    begin = max(float(record.time[inside][0] - record.time[0]), 0.0) + SETTLING
    for span in (inf, sampled.horizon):
        try:
            off_all, deviations = ahead(objective, out.log, z, covariance, begin, span)
        except DivergedError:
            continue
        later = inside & record.after(begin)
        for number, m in enumerate(sampled.measured):
            at = later & (record.sensor == number)
            is_left_out = m.sensor.is_velocity and (span < inf) != bool(sampled.lost)
            if at.sum() < 10 or is_left_out or m.axis not in out.axes:
                continue
            off, deviation = off_all[at], deviations[at]
            measured = record.value[at]
            yield Prediction(
                axis=m.axis,
                file=sampled.file,
                quantity=m.quantity.name,
                unit=m.quantity.unit,
                is_position=not m.sensor.is_velocity,
                span=span,
                by=out.by,
                time=record.time[at],
                measured=measured,
                predicted=measured - off,
                deviation=deviation,
                unchanged=unchanged(record.time[at], measured, span),
                noise=objective.table.noise(z, m.quantity.name)[0],
                error=rms(off),
                coverage=float(np.mean(np.abs(off) <= NORMAL * deviation)),
                loss=cost(off, deviation**2) / len(off),
            )


def ahead(
    objective: Objective, number: int, z: Array, covariance: Array, begin: float, span: float
) -> tuple[Array, Array]:
    """Return measured minus predicted for each sample of a log, and the standard deviation of each prediction.

    The predictions start anew at `begin` (s after the first sample) and after each `span`. The deviations contain the
    noise and the uncertainty of the parameters. Raises DivergedError.
    """
    run = objective.run(z, number, begin=begin, span=span)
    parameters = enumerate(objective.table.parameters)
    indices = [k for k, p in parameters if p.of_motion and objective.concerns(p, number)]
    errors = np.sqrt(np.maximum(np.diag(covariance)[indices], 0.0))
    slopes = np.zeros((len(run.innovations), len(z)))
    for share in _STEPS:
        try:
            slopes[:, indices] = objective.changes(z, number, indices, share * errors + 1e-9, run, begin, span)
            break
        except DivergedError:
            if share is _STEPS[-1]:
                raise
    deviations = np.sqrt(run.variances + variances_of(slopes, covariance))
    wraps = np.array([m.quantity.wraps for m in objective.logs[number].measured])
    lost = wraps[objective.records[number].sensor]
    return run.innovations, np.where(lost, np.minimum(deviations, _LOST), deviations)


# ---- Rows of tables --------------------------------------------------------------------------------------------------


def points_of(tests: Tests, values: Values, vehicle: Vehicle) -> Iterator[MeasuredPoint]:
    """Yield the rows of all tables with what the vehicle says about them, also held out."""
    for row, file, counts in table_rows(tests, vehicle.layout):
        subject = row.subject.name
        unit = {"force": "N", "Tau": "s"}.get(row.quantity) or AXES[subject].unit
        out = values.get((row.quantity, subject, row.command), np.nan)
        numbers = row.command, row.measured, float(modelled([row], vehicle, QUADRATIC_DRAG)[0]), out
        yield MeasuredPoint(subject, row.quantity, unit, file, *numbers, counts)  # type: ignore[arg-type]


def held_out_rows(objective: Objective, best: Minimum) -> Values:
    """Return the value of each row of the tables by a fit without all rows of the same size of the command.

    It is NaN where the other data do not know enough of it.
    """
    rows, known = objective.rows, Knowledge(objective, best)
    found: dict[tuple[str, str, float], float] = {}
    groups = grouped(((row.quantity == "force", row.subject.name, abs(row.command)), n) for n, row in enumerate(rows))
    parts = [
        DataPart(objective.whole.logs, [n for n in objective.whole.rows if n not in out]) for out in groups.values()
    ]
    for members, part, without in zip(groups.values(), parts, refits(objective, best, parts), strict=True):
        some = [rows[n] for n in members]

        def logarithms(z: Array, some: Sequence[TableRow] = some) -> Array:
            with np.errstate(divide="ignore"):
                return np.log(np.abs(modelled(some, *objective.table.model(z))))

        values = modelled(some, *objective.table.model(without.z))
        values = np.where(known.share(logarithms, part) < INFORMED, np.nan, values)
        found |= zip([(row.quantity, row.subject.name, row.command) for row in some], values.tolist(), strict=True)
    return found
