"""The fit: a start on few samples, another one if noise takes the place of the model, the better one to the end on all
samples, and the posterior there."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.likelihood.file_fit import FileFit, without_weak_effects
from rov_fmu.identify.likelihood.hypotheses import Starts, Suspect, applied
from rov_fmu.identify.likelihood.objective import Objective, TableRow
from rov_fmu.identify.likelihood.parameters import Table
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.identify.likelihood.search import (
    Misfit,
    StructureFit,
    StructureSearch,
    structure,
    unseen_errors,
    windows,
    with_shared,
    with_steps,
)
from rov_fmu.identify.likelihood.solve import (
    MOST_STEPS,
    Minimum,
    evidence,
    least_from,
    minimise,
    refined,
    scaled,
    start_of,
)
from rov_fmu.identify.progress import HYPOTHESES, REFINED, ProgressReport
from rov_fmu.identify.result import ALARM
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array

_SAME = 0.01
"""Two ends of fits are the same vehicle if they differ by less than this share of the prior's deviation."""
_STARTS = ("start 1", "start 2")
"""The kinds of the parameters say where they begin: with much noise, J has few minima far from the data."""
_UNREFINED = 2
"""The most steps on all samples of a fit that nobody should use."""
_PATIENCE = 2e6
"""After so many fits times samples and parameters, no more causes are tried for a model that is wrong along all axes:
half a minute on a usual machine."""
_LOST = 100.0
"""No cause is tried where the errors over 10 s are so many times the noise along all axes: 660 and 1900 in a log whose
commands say nothing about its motion."""
_LOUD = 2.3
"""The second start is tried if a slow process ends ten times as large as usual. The motion is then hardly explained by
the model, and another minimum may explain it."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The objective at its minimum: what is told, predicted and, without weak effects, written."""

    objective: Objective
    best: Minimum
    posterior: Posterior
    """With all effects, also those without evidence."""
    file: FileFit
    """What the vehicle file can say, without weak effects: the values of the vehicle."""
    difference: float
    """How much larger J is at the end of the second start; 0 if one was enough."""
    ends: tuple[tuple[Table, Array], tuple[Table, Array]]
    """The coordinates at the ends of both starts, which are the same if one was enough, with the table of their fit:
    that of the fit with hypotheses may have other parameters."""
    starts: Starts = field(default_factory=dict)
    """The hypotheses about the structure that won, with the coordinates of their rows."""
    odds: Mapping[Suspect, float] = field(default_factory=dict)
    """2 ln of the posterior odds of each against the best model without it."""
    alike: tuple[tuple[str, ...], ...] = ()
    """Thrusters along one axis whose forces the data do not tell apart."""
    has_ended: bool = False
    """True if the search for causes ended because nothing explained the errors along any axis."""
    structure: Mapping[Axis, Misfit] = field(default_factory=dict)
    """The errors of predictions along each axis."""

    @property
    def known(self) -> Prior:
        """What is known before the fit."""
        return self.objective.table.known

    @property
    def posteriors(self) -> tuple[Posterior, Posterior]:
        """That of the vehicle file and that with all effects. An interval of the result contains those of both."""
        return self.file.posterior, self.posterior

    @cached_property
    def most_followed(self) -> float:
        """The strongest command that the thrusters follow."""
        return min(float(self.file.posterior.table.limit(self.file.posterior.z)), 1.0)

    @cached_property
    def speeds(self) -> dict[str, float]:
        """The largest speed along each axis that logs and steady tables test, by its name, m/s or rad/s."""
        logs = (self.objective.reached(self.best.z, n) for n in range(len(self.objective.logs)))
        some = [(axis.name, max(ends)) for reached in logs for axis, ends in reached.items()]
        steady = (row for row in self.objective.rows if row.quantity == "V_ss")
        some += [(row.subject.name, abs(row.measured)) for row in steady]
        return {name: max(speeds) for name, speeds in grouped(some).items()}

    @cached_property
    def command_range(self) -> tuple[float, float]:
        """The weakest and the strongest command of the tests that the thrusters follow."""
        used = [abs(row.command) for row in self.objective.rows]
        for sampled in self.objective.logs:
            assert sampled.log.commands
            used += np.abs(sampled.log.commands.value).tolist()
        used = [round(min(c, self.most_followed), 6) for c in used if c > 1e-3]
        low, high = min(used, default=0.0), max(used, default=1.0)
        return (low, high) if low < high else (max(low - 0.05, 0.0), min(high + 0.05, 1.0))


def fit_all(
    known: Prior,
    logs: Sequence[SampledLog],
    rows: Sequence[TableRow],
    work: ProgressReport | None = None,
    is_mistaken: Callable[[Objective, Array, Array], bool] = lambda *_: False,
) -> Fit:
    """Fit all logs and tables: a start or two on thinned logs, and the better one to the end on all samples.

    Where predictions raise the alarm, `is_mistaken` tells for J, a point and its errors whether a mistake in a log is
    the reason, and not the structure. Such a fit is not refined, because nobody should use it. Neither is a fit that is
    clearly wrong along all axes: after _PATIENCE, the search for its cause ends with the round.
    """
    work = work or ProgressReport()
    quick, full = (Objective.of_known(known, logs, rows, thinned=thinned) for thinned in (True, False))
    ends = _from_starts(quick, work)
    score = evidence(quick, ends[0])
    start = StructureFit({}, quick, ends[0], score, score)
    is_mistake = start.predicted > ALARM and is_mistaken(full, ends[0].z, start.posterior.errors)
    search, now = _searched_for_structure(start, full, work, is_mistake=is_mistake)
    full, near, is_wrong = now.objective, now.minimum, is_mistake or search.now.is_hopeless
    before = windows(search.plain.objective, search.plain.minimum.z)
    best = near
    if not is_wrong:
        # Other parameters move a little with the scale that the priors prefer, such as the sizes of slow forces.
        work.steps(REFINED)(0)
        best = refined(full, near)
    posterior = Posterior.of(full.table, best.z, best.information)
    difference = ends[-1].value - ends[0].value
    odds = search.odds
    apart = [
        abs(ends[-1].z[n] - ends[0].z[n]) / max(posterior.errors[n], _SAME * full.deviation[n])
        for n in (() if odds else posterior.of_vehicle)  # other vehicles had the wrong structure
    ]
    if max(apart, default=0.0) < 2.0:
        difference = 0.0
    misfits = with_shared(full.table.layout, with_steps(full, best, structure(full, best, late=True)))
    ratios = {axis: one.widens for axis, one in misfits.items()}
    unseen = unseen_errors(full, best.z, before, misfits)
    posterior = posterior.widened(ratios, unseen)
    # Time constants of tables contain the lag, so that tables alone need none.
    of_file = without_weak_effects(full, best, posterior.lasting if logs else (), refines=not is_wrong)
    return Fit(
        full,
        best,
        posterior,
        replace(of_file, posterior=of_file.posterior.widened(ratios, unseen)),
        float(difference),
        ((quick.table, ends[0].z), (quick.table, ends[-1].z)),
        search.now.starts,
        odds,
        search.alike,
        search.has_ended,
        misfits,
    )


def _searched_for_structure(
    start: StructureFit, full: Objective, work: ProgressReport, *, is_mistake: bool
) -> tuple[StructureSearch, StructureFit]:
    """Search for the structure from a fit to thinned logs; return the search, and the fit to all samples at its end.

    Where the model is wrong along all axes, thinned logs tell as well what explains it. All samples are fitted to the
    end only when something does.
    """
    tried, show_tried = count(), work.steps(HYPOTHESES)

    def searched(plain: StructureFit, before: StructureSearch | None = None) -> StructureSearch:
        size = len(plain.minimum.z) * sum(len(one.innovations) for one in plain.minimum.data)
        is_lost = min((one.ratio for one in plain.misfits.values()), default=0.0) > _LOST
        search = StructureSearch(plain, lambda: show_tried(next(tried)), 0.0 if is_lost else _PATIENCE / size)
        if before:
            search.begin_with(before)
        if not is_lost:
            search.run()
        return search

    search = searched(start) if start.is_hopeless and not is_mistake else StructureSearch(start)
    now, is_wrong = search.now, is_mistake or search.now.is_hopeless
    if is_wrong:
        full = applied(search.plain.objective, now.starts)
    most = _UNREFINED if is_mistake or start.is_hopeless else MOST_STEPS
    begin = scaled(full, now.minimum.z if is_wrong else start.minimum.z)
    near = minimise(full, begin, work.steps("all samples"), most=most, last=False)
    work.fits(full, near)
    if is_wrong:
        return search, replace(now, objective=full, minimum=near)
    search = searched(StructureFit({}, full, near, evidence(full, near), start.quick), search)
    if search.odds:
        work.fits(search.now.objective, search.now.minimum)
    return search, search.now


def _from_starts(quick: Objective, work: ProgressReport) -> list[Minimum]:
    """Return the minima of J of thinned logs from two starts, the least first, or from one if that is enough.

    Where the first one leaves the model wrong along all axes, the second one counts only if it becomes lower.
    """
    ends: list[Minimum] = []
    than = np.inf
    for n, words in enumerate(_STARTS):
        if ends and not _is_loud(quick.table, ends[0].z):
            break
        ends.append(least_from(quick, start_of(quick, n), work.steps(words), than))
        than = ends[0].value if StructureFit({}, quick, ends[0], 0.0, 0.0).is_hopeless else np.inf
        work.fits(quick, min(ends, key=lambda end: end.value))
    return sorted(ends, key=lambda end: end.value)


def _is_loud(table: Table, z: Array) -> bool:
    """Return True if a slow process is much larger than usual."""
    return any(p.of_kind.is_size and z[n] - p.mean > _LOUD for n, p in enumerate(table.parameters))
