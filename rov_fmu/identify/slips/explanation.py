"""Find the wrong scale that best explains the files of one axis, from the analysis of each file by itself.

A file with k times the measured values leads to m/β / k, a_d / k^2, b_d / k and k times the speed, so one analysis of
the file gives the results for all scales. The best explanation is the vehicle that agrees with all files, with or
without correction, has plausible proportions, and needs the fewest corrections. Costs are squares of standard
deviations, in decades.

The plausible proportions come from the vehicles that ship, the Otter of the examples and the paper: drag divided by
½ρ(m/ρ)^(2/3) v^2 is 0.4 to 11 from 20 to 100 % of thrust; the torque in yaw divided by ½ρ(6 I/ρ) r^2, as for a box, is
0.4 to 3.4; and m/β is 1.0 to 2.4 times m, in yaw up to 8. The assumed spread about the middle of these ranges is a
factor of about 3, or 2.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite, log10, pi, sqrt

from rov_fmu.identify.slips.single_recording import Alone
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov

FASTEST = {"m/s": 4.0, "rad/s": 8.0}
"""The highest speed of an ROV, by unit."""
CERTAIN = 15.0
"""A wrong scale is certain if it lowers the cost by at least this."""
LIKELY = 4.0
"""A wrong scale that lowers the cost by so much is worth a warning."""
_RHO = 1000.0
_ALIKE = 0.15
"""The standard deviation between two files of one vehicle in decades, due to loads, currents and inexact curves."""
_MOST = 25.0
"""The largest cost of one number."""
_SLIP, _ONE_MORE = 5.0, 0.5
"""The cost of a wrong scale, and of each file that has it."""
_LENGTHS = (0.001, 0.01, 0.1, 10.0, 100.0, 1000.0)
_ANGLES = (pi / 180.0, 0.1, 10.0, 180.0 / pi, 100.0)


@dataclass(frozen=True)
class Evidence:
    """The analysis of one file by itself."""

    file: str
    quantity: str
    alone: Alone

    def undone(self, factor: float) -> "Evidence":
        """Return the analysis, corrected if the values in the file are `factor` times too large."""
        k, one = factor, self.alone
        true = replace(one, inertia=k * one.inertia, a=k * k * one.a, b=k * one.b, speed=one.speed / k)
        return replace(self, alone=true)


@dataclass(frozen=True)
class Explanation:
    """A wrong scale and the files that have it; no files where all scales are right."""

    factor: float
    """The values in the files relative to the measured ones."""
    files: frozenset[str]
    cost: float
    vehicle: Alone


@dataclass(frozen=True, eq=False)
class Files:
    """The evidence of all files of one axis; `given` is the vehicle where it is known."""

    axis: Axis
    base: Rov
    evidence: Sequence[Evidence]
    given: Alone | None = None

    def explanations(self) -> list[Explanation]:
        """Return the best explanation for each scale and set of files, sorted by cost. One of them has no files: all
        scales are right."""
        factors = _ANGLES if self.axis.is_rotation else _LENGTHS
        found = {(e.factor, e.files): e for e in sorted(self._all((1.0, *factors)), key=lambda e: -e.cost)}
        return sorted(found.values(), key=lambda e: e.cost)

    def _all(self, factors: Sequence[float]) -> Iterator[Explanation]:
        for factor in factors:
            undone = [e.undone(factor) for e in self.evidence]
            vehicles = [self.given] if self.given else [e.alone for e in (*self.evidence, *undone)]
            for vehicle in vehicles:
                cost, files = 0.0 if self.given else self._unlike(vehicle), []
                for plain, other in zip(self.evidence, undone, strict=True):
                    as_it_is, without = (self._apart(e.alone, vehicle) for e in (plain, other))
                    if factor != 1.0 and without + _ONE_MORE < as_it_is:
                        files.append(plain.file)
                        as_it_is = without + _ONE_MORE
                    cost += as_it_is
                if files or factor == 1.0:
                    yield Explanation(factor, frozenset(files), cost + _SLIP * bool(files), vehicle)

    def _apart(self, one: Alone, vehicle: Alone) -> float:
        """Return the cost of the difference between a file and a vehicle, and of an impossible speed."""
        v = sqrt(one.speed * vehicle.speed)
        cost = max(log10(one.speed / FASTEST[self.axis.unit]), 0.0) ** 2 / 0.01
        for ratio, errors in (
            (_ratio(one.inertia, vehicle.inertia), (one.errors[0], vehicle.errors[0])),
            (_ratio(one.drag(v), vehicle.drag(v)), (one.errors[1], vehicle.errors[1])),
        ):
            spread = _ALIKE**2 + sum((error / 2.3) ** 2 for error in errors if isfinite(error))
            cost += min(ratio**2 / spread, _MOST) if isfinite(ratio) else 0.0
        return min(cost, 2.0 * _MOST)

    def _unlike(self, vehicle: Alone) -> float:
        """Return the cost of implausible proportions."""
        inertia, drag = proportions(self.axis, self.base, vehicle)
        typical, spread = (1.0, 0.25) if self._added else (2.0, 0.3)
        cost = (log10(drag / (1.0 if self.axis.is_rotation else 1.5)) / 0.45) ** 2 if drag > 0.0 else _MOST
        return min(cost, _MOST) + (min((log10(inertia / typical) / spread) ** 2, _MOST) if isfinite(inertia) else 0.0)

    @property
    def _added(self) -> bool:
        return "m_a" in self.base.layout.kinds[self.axis.name].keys


def proportions(axis: Axis, base: Rov, vehicle: Alone) -> tuple[float, float]:
    """Return m/β relative to the given mass and added mass, and drag relative to size and speed; see the module."""
    mass, v = base[axis.inertia], vehicle.speed
    size = 0.5 * _RHO * (6.0 * mass / _RHO if axis.is_rotation else (mass / _RHO) ** (2.0 / 3.0))
    return vehicle.inertia / base.inertia(base.layout.kinds[axis.name]), vehicle.drag(v) / (size * v * v)


def contradict(explanations: Sequence[Explanation]) -> Explanation | None:
    """Return another explanation about as good as the first, with other files, or None."""
    first = explanations[0]
    others = (e for e in explanations if e.files and not e.files & first.files)
    return next((e for e in others if e.cost < first.cost + LIKELY), None)


def _ratio(one: float, other: float) -> float:
    """Return the ratio in decades; 0 if one of the numbers is 0, because it then contains no scale."""
    return 0.0 if one <= 0.0 or other <= 0.0 else log10(one / other)
