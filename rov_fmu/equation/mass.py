"""The mass matrix of a vehicle in formulas: its inverse, and the Coriolis and Munk terms that follow from it.

The effective mass matrix has the entries M_ij = (rigid body + added mass)_ij / sqrt(beta_i beta_j), which is m/beta of
(18) for an axis alone. With the momentum (P, L) = M (v, omega), Kirchhoff's equations are

    P' = P x omega + force,    L' = L x omega + P x v + moment.

An axis without entries off the diagonal has the acceleration per load gain_i = beta_i/m_i. The other axes form blocks.
The inverse of a block follows from its factors M = L D L^T.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from .catalogue import BY_VELOCITY
from .expression import Expression, Formulas, Name, Names, product, total

_KIRCHHOFF = {
    "u": ((1, "v", "r"), (-1, "w", "q")),
    "v": ((1, "w", "p"), (-1, "u", "r")),
    "w": ((1, "u", "q"), (-1, "v", "p")),
    "p": ((1, "q", "r"), (-1, "r", "q"), (1, "v", "w"), (-1, "w", "v")),
    "q": ((1, "r", "p"), (-1, "p", "r"), (1, "w", "u"), (-1, "u", "w")),
    "r": ((1, "p", "q"), (-1, "q", "p"), (1, "u", "v"), (-1, "v", "u")),
}
"""For each axis, the products of a momentum and a velocity: the sign, the axis of the momentum, and the velocity."""
_Pair = tuple[str, str]
"""Two axes, by their velocities."""


@dataclass(frozen=True)
class MassMatrix:
    """The mass matrix of the axes that a vehicle has."""

    gains: Mapping[str, Expression]
    """For each axis, by its velocity: the formula of beta/m from the entry on the diagonal."""
    entries: Mapping[_Pair, Expression]
    """The formulas of the effective entries off the diagonal, by two velocities in the order of the axes.

    The vehicle may lack one of the two axes. The entry then gives a momentum along or about the missing axis."""
    names: Names

    @cached_property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """The groups of two or more axes that entries off the diagonal connect."""
        blocks: list[set[str]] = []
        for pair in (pair for pair in self.entries if set(pair) <= self.gains.keys()):
            joined_blocks = [block for block in blocks if block & set(pair)]
            blocks = [block for block in blocks if block not in joined_blocks] + [set(pair).union(*joined_blocks)]
        return tuple(tuple(name for name in self.gains if name in block) for block in blocks)

    def _is_uncoupled(self, axis: str) -> bool:
        return not any(axis in block for block in self.blocks)

    def inverse(self, axis: str) -> dict[str, Name]:
        """Return the entries of a row of M^-1 by their names.

        A force F_j along axis j accelerates this axis by (M^-1)_ij F_j.
        """
        for block in self.blocks:
            if axis in block:
                return {other: self._name("inverse", *_sorted(axis, other)) for other in block}
        return {axis: self.names("gain", axis)}

    def _name(self, kind: str, row: str, column: str) -> Name:
        return self.names(kind, row + column)

    def parameters(self) -> Formulas:
        """Return the formulas of the names in `inverse` and of the entries."""
        formulas, entries = Formulas(self.names), dict(self.entries)
        for axis, formula in self.gains.items():
            formulas.define(formula, "gain", axis)
        for block in self.blocks:
            for axis in block:
                formulas.define(1.0 / self.names("gain", axis), "mass", axis + axis)
            for a, b in [pair for pair in entries if {*pair} <= {*block}]:
                formulas.define(entries.pop((a, b)), "mass", a + b)
            self._add_inverse(formulas, block)
        for (a, b), formula in entries.items():
            formulas.define(formula, "mass", a + b)
        return formulas

    def _add_inverse(self, formulas: Formulas, block: tuple[str, ...]) -> None:
        """Add formulas for the inverse of a block, K^T D^-1 K with M = L D L^T and K = L^-1."""
        pivot, factor = self._decomposed(formulas, block)
        for n, row in enumerate(block):  # K L = 1, from the diagonal outwards; K has the names undo_..
            for m in reversed(range(n)):
                column = block[m]
                parts = (
                    -(factor[k, column] if k == row else self._name("undo", row, k) * factor[k, column])
                    for k in block[m + 1 : n + 1]
                    if (k, column) in factor
                )
                formulas.define(total(parts), "undo", row + column)
        for n, row in enumerate(block):  # K^T D^-1 K
            for column in block[n:]:
                parts = (
                    product(*(self._name("undo", k, axis) for axis in (row, column) if axis != k)) / pivot[k]
                    for k in block[block.index(column) :]
                )
                formulas.define(total(parts), "inverse", row + column)

    def _decomposed(self, formulas: Formulas, block: tuple[str, ...]) -> tuple[dict[str, Name], dict[_Pair, Name]]:
        """Add formulas for M = L D L^T, row by row. Return the names of the pivots in D, and of the factors in L."""
        pivot: dict[str, Name] = {}
        factor: dict[_Pair, Name] = {}
        for n, row in enumerate(block):
            for m, column in enumerate(block[:n]):
                parts: list[Expression] = [self._name("mass", column, row)] if (column, row) in self.entries else []
                parts += [
                    -(factor[row, k] * factor[column, k] * pivot[k])
                    for k in block[:m]
                    if {(row, k), (column, k)} <= factor.keys()
                ]
                if parts:
                    factor[row, column] = formulas.define(total(parts) / pivot[column], "factor", row + column)
            squares = [-(factor[row, k] * factor[row, k] * pivot[k]) for k in block[:n] if (row, k) in factor]
            pivot[row] = formulas.define(total([self._name("mass", row, row), *squares]), "pivot", row)
        return pivot, factor

    def coriolis(self, axis: str) -> dict[_Pair, Expression]:
        """Return the coefficients of products of two velocities in the acceleration of an axis, as formulas."""
        by_pair: dict[_Pair, list[Expression]] = {}
        for other, inverse in self.inverse(axis).items():
            for pair, entries in self.products(other).items():
                parts = (sign * self._term(inverse, entry) for sign, entry in entries)
                by_pair.setdefault(pair, []).extend(parts)
        return {pair: total(parts) for pair, parts in sorted(by_pair.items(), key=lambda item: _places(item[0]))}

    def _term(self, inverse: Name, entry: _Pair) -> Expression:
        a, b = entry
        is_uncoupled = a == b and self._is_uncoupled(a)
        return inverse / self.names("gain", a) if is_uncoupled else inverse * self._name("mass", a, b)

    def products(self, axis: str) -> dict[_Pair, list[tuple[int, _Pair]]]:
        """Return the right side of Kirchhoff's equations for an axis.

        For each product of two velocities, it has entries of the mass matrix with their signs.
        """
        by_pair: dict[_Pair, list[tuple[int, _Pair]]] = {}
        for sign, momentum, velocity in _KIRCHHOFF[axis]:
            if velocity not in self.gains:
                continue
            for other in self.gains:
                entry = _sorted(momentum, other)
                if momentum == other or entry in self.entries:
                    signed = by_pair.setdefault(_sorted(other, velocity), [])
                    if (-sign, entry) in signed:
                        signed.remove((-sign, entry))
                    else:
                        signed.append((sign, entry))
        ordered = sorted(by_pair.items(), key=lambda item: _places(item[0]))
        return {pair: entries for pair, entries in ordered if entries}


def _sorted(a: str, b: str) -> _Pair:
    return (a, b) if _places(a) <= _places(b) else (b, a)


def _places(names: Iterable[str]) -> tuple[int, ...]:
    return tuple(map([*BY_VELOCITY].index, names))
