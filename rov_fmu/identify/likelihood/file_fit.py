"""The fit of the vehicle file, which says less than the model of the fit to all data.

Effects that the data hardly show are left out: J is minimised without the weakest ones while it rises by at most
MOST_RISE in total. So the file has the numbers of a minimum of J, and not those of another vehicle that is extrapolated
from it.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.posterior import Posterior
from rov_fmu.identify.likelihood.solve import Minimum, minimise, refits
from rov_fmu.identify.result import POSITIVE

MOST_RISE = 2.0
"""The largest rise of J, twice a log likelihood, by all effects that are left out."""
_EXPECTED = 1.5
"""Effects are tried while J is expected to rise by at most so many times MOST_RISE: it is only nearly quadratic."""


@dataclass(frozen=True, eq=False)
class FileFit:
    """J where a vehicle file can be, at its minimum without weak effects."""

    objective: Objective
    minimum: Minimum
    posterior: Posterior


def without_weak_effects(
    objective: Objective, best: Minimum, lasting: Collection[int] = (), *, refines: bool = True
) -> FileFit:
    """Leave out the weakest effects, each time with a refit, while J rises by at most MOST_RISE.

    The effect that is left out next is the one without which J is expected to rise least, given that those before it
    are absent: two effects of which either explains the data are not both left out. Many refits run together, and those
    that hold tell anew what to expect of the next ones.

    An effect that needs evidence, such as the voltage, which would be an input of the FMU, is left out before, whatever
    the rise, if the evidence for it is not positive. Those that are `lasting`, by their indices, stay.

    The refits keep the derivatives of the fit that they begin at: J where they end is J, and exact derivatives follow
    at the end, with which more effects may go. If `refines` is False, only effects that need evidence are left out.
    """
    absent = _without_evidence(Posterior.of(objective.table, best.z, best.information))
    if absent:
        (best,) = refits(objective, best, [objective.whole], [absent])
    if not refines:
        posterior = Posterior.of(objective.table, best.z, best.information, absent)
        return FileFit(objective.without(absent), best, posterior)
    least, is_exact = best, not absent
    while True:
        posterior = Posterior.of(objective.table, least.z, least.information, absent)
        order = [*_weakest(posterior, least.value - best.value, lasting)]
        tried = [absent.union(order[: n + 1]) for n in range(len(order))]
        found = refits(objective, least, [objective.whole] * len(tried), tried)
        within = [n for n, one in enumerate(found) if one.value - best.value <= MOST_RISE]
        if within:
            absent, least, is_exact = tried[within[-1]], found[within[-1]], False
        elif is_exact:
            return FileFit(objective.without(absent), least, posterior)
        else:
            least, is_exact = minimise(objective.without(absent), least.z, most=1, near=least.data), True


def _without_evidence(posterior: Posterior) -> frozenset[int]:
    """Return the indices of the effects that need evidence and have none, the least of them first."""
    parameters = posterior.table.parameters
    while rest := [n for n, p in enumerate(parameters) if p.of_kind.needs_evidence and n not in posterior.absent]:
        least = min(rest, key=posterior.evidence)
        if posterior.evidence(least) >= POSITIVE:
            break
        posterior = posterior.without(least)
    return posterior.absent


def _weakest(posterior: Posterior, rise: float, lasting: Collection[int]) -> Iterator[int]:
    """Yield the indices of effects in the order in which they are left out, for a normal posterior after J rose."""
    may_go = {n for n, p in enumerate(posterior.table.parameters) if p.is_effect and not p.of_kind.is_of_structure}
    while rest := may_go - posterior.absent.union(lasting):
        rises = {n: _rise(posterior, n) for n in rest}
        least = min(rises, key=lambda n: rises[n])
        rise += rises[least]
        if rise > _EXPECTED * MOST_RISE:
            return
        yield least
        posterior = posterior.without(least)


def _rise(posterior: Posterior, index: int) -> float:
    """Return by how much J rises if an effect is absent."""
    null = posterior.table.parameters[index].null
    assert null is not None
    return float((posterior.z[index] - null) ** 2 / max(posterior.covariance[index, index], 1e-300))
