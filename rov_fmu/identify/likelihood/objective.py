"""The objective of the identification, which everything else follows from.

The model of a log is a stochastic differential equation around the vehicle's equation of motion (Kristensen, Madsen and
Jorgensen 2004, doi:10.1016/j.automatica.2003.10.001; Ljung, System Identification, 1999, chapter 7):

    x' = f(x, exp(g) F(c), theta) + slow force      y_k = h(x(t_k)) + n_k + e_k

An extended Kalman filter (fmu_src/engine/filter.c) predicts each sample from the samples before it, and gives the
innovation eps_k and its variance S_k. The coefficients theta and the noise phi minimise together

    J(theta, phi) = sum_k [ log S_k + rho(eps_k^2 / S_k) ]  -  2 log prior(theta, phi)

where rho(u^2) = u^2 up to |u| = c = 3, and c^2 (1 + log(u^2 / c^2)) beyond, so that outliers count hardly more the
farther they are. The rows of the tables of tank tests are samples too: their innovation is measured minus model, and S
is the square of their noise.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from rov_fmu.c.simulation import usable_cores
from rov_fmu.equation.catalogue import REVERSE, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, Thruster
from rov_fmu.identify.likelihood.curves import Drags, forces_of_curve, measured_time_constant
from rov_fmu.identify.likelihood.filter import DivergedError, Filter, FilterRun
from rov_fmu.identify.likelihood.parameters import HORIZONTAL, Parameter, Table, table_of
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.vehicle.vehicle import Vehicle

_QUICK_STEPS = {"changing": 0.025, "share": 1.0}
"""Longer steps of the filter for a quick fit to fewer samples."""
_Result = TypeVar("_Result")
Samples = tuple[Array, Array]
"""Innovations and their variances."""
_TOGETHER = 8
"""The number of parameters whose derivatives one thread computes at once: a multiple of the lanes of the filter."""
_REACHED = 0.98
"""The quantile of the speeds that tells what a log tests: what lasts shorter is no test."""
_LEAST_DELAY = 1e-9
"""A lag that differs from none, s."""
OUTLYING = 3.0
"""The size of an innovation, in standard deviations, from which it counts less (as in filter.c)."""


@dataclass(frozen=True)
class TableRow:
    """A row of a table of tank tests."""

    noise: str
    """The name of its noise among the parameters."""
    subject: Curve | Axis
    quantity: str
    """force, V_ss or Tau."""
    command: float
    measured: float
    scale: float
    """What the noise is relative to: the largest force of the table, or the measured value."""

    def depends_on(self, parameter: Parameter, layout: Layout) -> bool:
        """Return True if a parameter changes the value by the model."""
        parts = {self.subject.name}
        if not isinstance(self.subject, Curve):
            parts |= {"", *(name for t in layout.thrusters_along(self.subject) for name in (t.curve, t.name))}
        return parameter.of_motion and not parameter.is_fixed and parameter.of in parts


def _half_speed(vehicle: Vehicle, curve: Curve, commands: Array) -> Array:
    """Return the commands that hold half of the speeds of rotors, which lack the dead bands of their commands."""
    bands = [float(np.mean(vehicle.coefficients.get(curve.coefficient(f"c_0{end}"), 0.0))) for end in ("", REVERSE)]
    band = np.where(commands < 0.0, bands[1] or bands[0], bands[0])
    return np.asarray(np.sign(commands) * 0.5 * (np.abs(commands) + np.minimum(band, np.abs(commands))))


def modelled(rows: Sequence[TableRow], vehicle: Vehicle, shapes: Drags, least_lag: float = 0.0) -> Array:
    """Return the values of m rows by the model, in the unit of each row; m x n for n vehicles.

    A measured time constant contains the lag of the thrusters. `least_lag` is the lag of a vehicle without one.
    """
    found: dict[int, Array] = {}
    for subject, indices in grouped((row.subject, n) for n, row in enumerate(rows)).items():
        commands = np.array([rows[n].command for n in indices])
        if isinstance(subject, Curve):
            found |= zip(indices, forces_of_curve(vehicle, subject, commands), strict=True)
            continue
        motions = shapes.motions(vehicle, subject, commands)
        V_ss, Tau = motions.response()
        curves = {vehicle.layout.curve_of[thruster.name] for thruster in vehicle.layout.thrusters_along(subject)}
        lags = [vehicle[curve.coefficient("T")] - least_lag for curve in curves if curve.has_lag]
        lag = np.broadcast_to(np.max(lags, axis=0) if lags else 0.0, Tau.shape)
        if np.any(lag > 0.0) and any(rows[n].quantity == "Tau" for n in indices):
            load = shapes.motions(vehicle, subject, np.zeros(1)).of["C"]
            linear: Array | float = 1.0
            if rotors := [curve for curve in curves if curve.has_rotors]:  # F(n/2) = a n²/4 + b n/2
                half = shapes.motions(vehicle, subject, _half_speed(vehicle, rotors[0], commands)).of["C"]
                linear = 4.0 * (half - load) / (motions.of["C"] - load) - 1.0
            lagged = measured_time_constant(motions, load, np.maximum(lag, _LEAST_DELAY), linear)
            Tau = np.where(lag > 0.0, lagged, Tau)
        for n, *pair in zip(indices, V_ss, Tau, strict=True):
            found[n] = pair[rows[n].quantity == "Tau"]
    return np.array([found[n] for n in range(len(rows))])


@dataclass(frozen=True, eq=False)
class Data:
    """The innovations of one log, or those of all rows of tables, with their derivatives.

    n samples, and the k of p parameters that may change them.
    """

    innovations: Array
    variances: Array
    slopes: Array
    """n x k: the derivatives of the innovations."""
    log_slopes: Array
    """n x k: the derivatives of log S."""
    indices: Sequence[int]
    """k: the parameters."""
    parameters: int
    """p."""

    @classmethod
    def of(cls, run: FilterRun, indices: Sequence[int], parameters: int) -> "Data":
        """Return the innovations of a run, with derivatives of 0."""
        empty = np.zeros((len(run.innovations), len(indices)))
        return cls(run.innovations, run.variances, empty, empty.copy(), indices, parameters)

    def part(self, chosen: Sequence[int]) -> "Data":
        """Return some of the samples."""
        keys = ("innovations", "variances", "slopes", "log_slopes")
        return replace(self, **{key: getattr(self, key)[[*chosen]] for key in keys})

    def leading(self, scales: Array) -> dict[int, int]:
        """Return the parameters that lead the directions that change these data, with the numbers of these."""
        return leading(np.where(np.isin(np.arange(self.parameters), self.indices), scales, 0.0))

    def separate(self, scales: Array) -> None:
        """Replace the derivatives of the leading parameters, which are with respect to directions, by their own."""
        for first, n in self.leading(scales).items():
            column, share = self.indices.index(first), scales[n, [*self.indices]] / scales[n, first]
            share[column] = 0.0
            for slopes in (self.slopes, self.log_slopes):
                slopes[:, column] -= slopes @ share

    @property
    def normalised(self) -> Array:
        return self.innovations / np.sqrt(self.variances)

    def information(self, chosen: slice) -> tuple[Array, Array]:
        """Return the gradient and the Fisher information of the part of J that some samples contribute: p, p x p."""
        u = self.normalised[chosen]
        weight = np.minimum(1.0, OUTLYING**2 / np.maximum(u * u, 1e-300))
        A = self.slopes[chosen] / np.sqrt(self.variances[chosen])[:, None]
        B = self.log_slopes[chosen]
        gradient, information = np.zeros(self.parameters), np.zeros((self.parameters, self.parameters))
        gradient[self.indices] = 2.0 * A.T @ (weight * u) + B.T @ (1.0 - weight * u * u)
        information[np.ix_(self.indices, self.indices)] = 2.0 * (A.T * weight) @ A + B.T @ B
        return gradient, information


def with_samples(data: Iterable[Data], samples: Iterable[Samples]) -> list[Data]:
    """Return other samples with the same derivatives."""
    return [replace(one, innovations=off, variances=S) for one, (off, S) in zip(data, samples, strict=True)]


def changed(z: Array, moves: Sequence[tuple[int, float]]) -> Array:
    """Return a column of coordinates for each move of one of them."""
    found = np.repeat(z[:, None], len(moves), axis=1)
    for n, (k, step) in enumerate(moves):
        found[k, n] += step
    return found


def derivatives(function: Callable[[Array], Array], z: Array, indices: Sequence[int], steps: Array) -> Array:
    """Return the derivatives of m numbers with respect to k of the coordinates, by steps to both sides: m x k.

    The function returns m x n numbers for p x n coordinates.
    """
    moves = [(k, sign * step) for k, step in zip(indices, steps.tolist(), strict=True) for sign in (1.0, -1.0)]
    found = function(changed(z, moves))
    return (found[:, ::2] - found[:, 1::2]) / (2.0 * steps)


def leading(directions: Array) -> dict[int, int]:
    """Return the coordinates that lead some directions (k x p), with the numbers of these.

    That is the one that changes most of those that no other direction changes. A direction without any is left out.
    """
    own = np.where(np.count_nonzero(directions, axis=0) == 1, np.abs(directions), 0.0)
    return {int(np.argmax(sizes)): n for n, sizes in enumerate(own) if sizes.any()}


def cost(innovations: Array, variances: Array) -> float:
    """Return the sum over the samples of log S + rho(eps^2 / S)."""
    if not np.all(variances > 0.0):  # rounding, where a motion is about to diverge
        return np.inf
    with np.errstate(over="ignore"):  # far from the minimum, a velocity may be any number
        u = innovations**2 / variances
    beyond = OUTLYING**2 * (1.0 + np.log(np.maximum(u, OUTLYING**2) / OUTLYING**2))
    return float(np.sum(np.log(variances) + np.where(u > OUTLYING**2, beyond, u)))


@dataclass(frozen=True, eq=False)
class DataPart:
    """A part of the data: logs and rows by their indices, and the samples that count of logs of which not all do."""

    logs: Sequence[int]
    rows: Sequence[int]
    chosen: Mapping[int, slice] = field(default_factory=dict)


def in_threads(jobs: Sequence[Callable[[], _Result]]) -> list[_Result]:
    """Return the results of functions, which run on all cores."""
    if min(len(jobs), cores := usable_cores()) < 2:
        return [job() for job in jobs]
    with ThreadPoolExecutor(cores) as pool:
        return [future.result() for future in [pool.submit(job) for job in jobs]]


class Objective:
    """J for some logs and rows of tables."""

    def __init__(
        self, table: Table, logs: Sequence[SampledLog], rows: Sequence[TableRow], *, thinned: bool = False
    ) -> None:
        """Make the filters. Raises BuildError."""
        self.table, self.logs, self.rows, self.is_thinned = table, logs, rows, thinned
        self.records = [one.thinned if thinned else one.record for one in logs]
        self.filters = self._filters()
        self.mean, self.deviation, self.low, self.high = map(table.each, ("mean", "deviation", "low", "high"))
        self.whole = DataPart(range(len(logs)), range(len(rows)))

    @classmethod
    def of_known(
        cls, known: Prior, logs: Sequence[SampledLog], rows: Sequence[TableRow], *, thinned: bool = False
    ) -> "Objective":
        """Return J of what is known before the fit, some logs and rows of tables. Raises BuildError."""
        return cls(table_of(known, logs, sorted({row.noise for row in rows})), logs, rows, thinned=thinned)

    def of(self, part: DataPart) -> "Objective":
        """Return J for a part of the data."""
        found = copy(self)
        found.logs, found.records = [self.logs[n] for n in part.logs], [self.records[n] for n in part.logs]
        found.filters, found.rows = [self.filters[n] for n in part.logs], [self.rows[n] for n in part.rows]
        chosen = {index: part.chosen[n] for index, n in enumerate(part.logs) if n in part.chosen}
        found.whole = DataPart(range(len(part.logs)), range(len(part.rows)), chosen)
        found.__dict__.pop("_of_rows", None)
        return found

    def _filters(self) -> list[Filter]:
        steps = _QUICK_STEPS if self.is_thinned else {}
        filters = {one.layout: Filter(one.vehicle(self.table.base), **steps) for one in self.logs}
        return [filters[one.layout] for one in self.logs]

    def with_thrusters(self, thrusters: Iterable[Thruster]) -> "Objective":
        """Return J of a vehicle whose thrusters, by their names, surely have these directions and places.

        It is a copy where they were certain before."""
        now = {t.name: t for t in thrusters}

        def changed(layout: Layout) -> Layout:
            pairs = ((t, now[t.name]) for t in layout.thrusters)
            placed = (replace(t, direction=own.direction, position=own.position) for t, own in pairs)
            return replace(layout, thrusters=tuple(placed), is_uncertain=False)

        found = copy(self)
        if not self.table.layout.is_uncertain:
            return found
        found.table = replace(self.table, layout=changed(self.table.layout))
        found.logs = [replace(one, layout=changed(one.layout)) for one in self.logs]
        found.filters = found._filters()
        return found

    def without(self, absent: Iterable[int]) -> "Objective":
        """Return J where some effects are absent, by their indices: they are fixed there, and have no prior."""
        found = copy(self)
        found.low, found.high = self.low.copy(), self.high.copy()
        for n in absent:
            found.low[n] = found.high[n] = self.table.parameters[n].null
        return found

    # ---- One log ----

    def run(self, z: Array, number: int, **how: object) -> FilterRun:
        """Run the filter through a log, with the options of `Filter.run`. Raises DivergedError."""
        parameters = self.table.of_log(z, self.logs[number])
        return self.filters[number].run(self.records[number], parameters, **how)  # type: ignore[arg-type]

    def reached(self, z: Array, number: int) -> dict[Axis, tuple[float, float]]:
        """Return the largest speeds astern and ahead along the axes that a log measures; 0 without any.

        They are those reached for long enough, so that the log tests them.
        """
        states = self.run(z, number, with_states=True).states.T
        velocities = dict(zip(self.filters[number].vehicle_states, states, strict=False))

        def largest(speeds: Array) -> float:
            return float(np.quantile(speeds[speeds > 0.0], _REACHED)) if np.any(speeds > 0.0) else 0.0

        measured = {m.axis: velocities[m.axis.velocity] for m in self.logs[number].measured}
        return {axis: (largest(-v), largest(v)) for axis, v in measured.items()}

    def changes(
        self, z: Array, n: int, indices: Sequence[int], steps: Array, run: FilterRun, begin: float, span: float
    ) -> Array:
        """Return the derivatives of the predictions of a log with respect to some parameters, by steps to both sides.

        They are those of `run`, whose gains the filter keeps. Raises DivergedError.
        """

        def innovations(sets: Array) -> Array:
            def some(first: int) -> list[FilterRun | None]:
                parameters = self.table.of_log(sets[:, first : first + _TOGETHER], self.logs[n])
                return self.filters[n].run_many(self.records[n], parameters, run, frozen=True, begin=begin, span=span)

            jobs = [partial(some, first) for first in range(0, sets.shape[1], _TOGETHER)]
            ends = [one.innovations for runs in in_threads(jobs) for one in runs if one]
            if len(ends) < sets.shape[1]:
                raise DivergedError
            return np.reshape(ends, (len(ends), len(run.innovations))).T

        return derivatives(innovations, z, indices, steps)

    def concerns(self, parameter: Parameter, number: int) -> bool:
        """Return False where a parameter certainly does not change what is predicted of a log."""
        sampled = self.logs[number]
        if parameter.log is not None:
            return parameter.of == sampled.file
        quantities = {m.quantity.name for m in sampled.measured}
        layout = sampled.layout
        names = {"", HORIZONTAL, *layout.by_name, *layout.curves_by_name, *layout.curve_of, *quantities}
        return parameter.of in names and not parameter.is_fixed

    # ---- All data ----

    def runs(self, z: Array, earlier: Sequence[FilterRun] | None = None) -> list[FilterRun]:
        """Run the filter through all logs, with the steps of earlier runs if they are given."""
        return in_threads(
            [partial(self.run, z, n, repeated=earlier[n] if earlier else None) for n in range(len(self.logs))]
        )

    def row_values(self, z: Array) -> tuple[Array, Array]:
        """Return the innovations of m rows of tables and their variances; m x n for n sets."""
        measured = np.array([row.measured for row in self.rows])
        off = (measured - modelled(self.rows, *self.table.model(z), self.table.least_lag).T).T
        noise = np.array([self.table.row_noise(z, row.noise) * row.scale for row in self.rows])
        return off, noise**2

    @property
    def free(self) -> Flags:
        """True for each parameter that a fit may change."""
        return self.low < self.high

    def prior(self, z: Array) -> float:
        """Return the part of J that the priors contribute."""
        return float(np.sum(((z - self.mean) / self.deviation)[self.free] ** 2))

    def samples(self, z: Array, runs: Sequence[FilterRun]) -> list[Samples]:
        """Return the samples of the runs of some parameters, and then those of the rows of tables, if any."""
        found = [(run.innovations, run.variances) for run in runs]
        return [*found, self.row_values(z)] if self.rows else found

    def value(self, z: Array, runs: Sequence[FilterRun]) -> float:
        """Return J for the runs of some parameters."""
        return self._sum(z, self.samples(z, runs))

    def chosen(self, n: int) -> slice:
        """Return the samples of a log that count; all rows of tables, which follow the logs, do."""
        part = self.whole.chosen.get(n, slice(0, None))
        return slice(max(part.start or 0, self.records[n].uncounted if n < len(self.records) else 0), part.stop)

    def _sum(self, z: Array, samples: Sequence[Samples]) -> float:
        """Return J for the samples of each log, and then those of the rows."""
        costs = [cost(off[self.chosen(n)], S[self.chosen(n)]) for n, (off, S) in enumerate(samples)]
        total = self.prior(z) + sum(costs)
        return total if np.isfinite(total) else np.inf

    def trials(
        self, z: Array, parts: Sequence[DataPart], earlier: Sequence[FilterRun]
    ) -> list[tuple[float, list[Samples]]]:
        """Return J for n sets of parameters (p x n), each for a part of the data, with the samples of this part.

        The filter takes the steps of earlier runs. All sets run through a log together, in the lanes of vectors. J is
        infinite where a motion diverges.
        """
        of_log = [[k for k, part in enumerate(parts) if n in part.logs] for n in range(len(self.logs))]
        jobs = [
            (n, some[at : at + _TOGETHER]) for n, some in enumerate(of_log) for at in range(0, len(some), _TOGETHER)
        ]

        def run(n: int, indices: Sequence[int]) -> list[FilterRun | None]:
            parameters = self.table.of_log(z[:, indices], self.logs[n])
            return self.filters[n].run_many(self.records[n], parameters, earlier[n], frozen=False)

        runs: list[list[FilterRun | None]] = [[] for _ in parts]
        for (_, indices), found in zip(jobs, in_threads([partial(run, *job) for job in jobs]), strict=True):
            for k, of_set in zip(indices, found, strict=True):
                runs[k].append(of_set)
        off, S = self.row_values(z) if self.rows else (np.zeros((0, 0)), np.zeros((0, 0)))
        trials = []
        for k, part in enumerate(parts):
            samples = [(one.innovations, one.variances) for one in runs[k] if one]
            rows = [(off[[*part.rows], k], S[[*part.rows], k])] if part.rows else []
            is_whole = len(samples) == len(part.logs)
            value = self.of(part)._sum(z[:, k], [*samples, *rows]) if is_whole else np.inf
            trials.append((value, [*samples, *rows]))
        return trials

    def data(
        self,
        z: Array,
        runs: Sequence[FilterRun],
        *,
        exact: bool = True,
        of_noise: Sequence[Data] = (),
    ) -> list[Data]:
        """Return the innovations with their derivatives, for each log and then for the rows of tables, if any.

        Exact ones are differences to both sides, and the others, which guide the steps of a fit, to one side. Those
        with respect to the noise are of earlier data, if these are given. All contain the changes of the gains of the
        filter. Without these, the scales of forces that the motion does not tell would look determined, and where the
        model does not explain a log, half of a gradient would have the wrong sign.

        A scale would also look determined by the errors of differences, which are large at a kink of the motion. One of
        its parameters therefore moves together with all others, and its own derivatives are what is left.
        """
        parameters, scales = self.table.parameters, self.table.scales_of_forces(z)
        found, work = [], list[Callable[[], None]]()
        for n, run in enumerate(runs):
            indices = [k for k, parameter in enumerate(parameters) if self.concerns(parameter, n)]
            found.append(Data.of(run, indices, len(z)))
            columns = []
            for column, k in enumerate(indices):
                if parameters[k].of_motion or not of_noise:
                    columns.append(column)
                else:
                    found[n].slopes[:, column] = of_noise[n].slopes[:, column]
                    found[n].log_slopes[:, column] = of_noise[n].log_slopes[:, column]
            for first in range(0, len(columns), _TOGETHER):
                some = columns[first : first + _TOGETHER]
                work.append(partial(self.differentiate, z, n, some, run, found[n], scales, exact=exact))
        in_threads(work)
        for data in found:
            data.separate(scales)
        if self.rows:
            found.append(self._rows_data(z))
        return found

    def differentiate(
        self,
        z: Array,
        n: int,
        columns: Sequence[int],
        run: FilterRun,
        into: Data,
        scales: Array,
        *,
        exact: bool,
    ) -> None:
        """Compute some columns of the derivatives of the innovations of a log, within the lower bounds of parameters.

        The filter runs with the changes of all these parameters at once. Exact derivatives are differences to both
        sides. Those of the leading parameter of a scale of forces are with respect to this scale.
        """
        parameters = [self.table.parameters[into.indices[column]] for column in columns]
        moves = [(into.indices[c], own.step_at(z[into.indices[c]])) for c, own in zip(columns, parameters, strict=True)]
        if exact:
            moves += [(k, -step) for k, step in moves if z[k] - step >= self.table.parameters[k].low]
        moved, led = changed(z, moves), into.leading(scales)
        for column, (k, step) in enumerate(moves):
            if k in led:
                along = np.eye(len(scales))[led[k]] * step / scales[led[k], k]
                moved[:, column] = self.table.with_scales(z, along)
        sets = self.table.of_log(moved, self.logs[n])
        runs = dict(zip(moves, self.filters[n].run_many(self.records[n], sets, run, frozen=False), strict=True))
        for column, (k, step) in zip(columns, moves, strict=False):
            above, below = runs[k, step], runs.get((k, -step), run)
            if above is None or below is None:
                raise DivergedError
            width = step if below is run else 2.0 * step
            into.slopes[:, column] = (above.innovations - below.innovations) / width
            with np.errstate(invalid="ignore"):  # a variance that is lost in rounding makes the step diverge
                into.log_slopes[:, column] = np.log(above.variances / below.variances) / width

    def _rows_data(self, z: Array) -> Data:
        indices, steps = self._of_rows, np.array([self.table.parameters[k].step for k in self._of_rows])
        off, variances = self.row_values(z)
        inside = z.copy()  # a lag at its bound is absent, and a shorter one changes nothing
        inside[indices] = np.maximum(z[indices], self.low[indices] + steps)
        of_motion = derivatives(lambda sets: self.row_values(sets)[0], inside, indices, steps)
        own = {row.noise for row in self.rows}
        noises = {k: p.of for k, p in enumerate(self.table.parameters) if p.of in own}
        of_noise = np.array([[2.0 * (row.noise == name) for name in noises.values()] for row in self.rows])
        slopes = np.hstack([of_motion, np.zeros_like(of_noise)])
        log_slopes = np.hstack([np.zeros((len(off), len(indices))), of_noise])
        return Data(off, variances, slopes, log_slopes, [*indices, *noises], len(z))

    @cached_property
    def _of_rows(self) -> list[int]:
        """The indices of the parameters of the motion that change the values of rows."""
        layout, rows = self.table.layout, {(row.subject, row.quantity): row for row in self.rows}.values()
        return [k for k, p in enumerate(self.table.parameters) if any(row.depends_on(p, layout) for row in rows)]
