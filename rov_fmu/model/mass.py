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

from .formula import joined

_KIRCHHOFF = {
    "u": (("", "v", "r"), ("-", "w", "q")),
    "v": (("", "w", "p"), ("-", "u", "r")),
    "w": (("", "u", "q"), ("-", "v", "p")),
    "p": (("", "q", "r"), ("-", "r", "q"), ("", "v", "w"), ("-", "w", "v")),
    "q": (("", "r", "p"), ("-", "p", "r"), ("", "w", "u"), ("-", "u", "w")),
    "r": (("", "p", "q"), ("-", "q", "p"), ("", "u", "v"), ("-", "v", "u")),
}
"""For each axis, the products of a momentum and a velocity: the sign, the axis of the momentum, and the velocity."""
_ORDER = "uvwpqr"


@dataclass(frozen=True)
class MassMatrix:
    """The mass matrix of the axes that a vehicle has."""

    gains: Mapping[str, str]
    """For each axis, by its velocity: the formula of beta/m from the entry on the diagonal."""
    entries: Mapping[tuple[str, str], str]
    """The formulas of the effective entries off the diagonal, by two velocities in the order of the axes.

    The vehicle may lack one of the two axes. The entry then gives a momentum along or about the missing axis."""

    @cached_property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """The groups of two or more axes that entries off the diagonal connect."""
        found: list[set[str]] = []
        for pair in (pair for pair in self.entries if set(pair) <= self.gains.keys()):
            joined_blocks = [block for block in found if block & set(pair)]
            found = [block for block in found if block not in joined_blocks] + [set(pair).union(*joined_blocks)]
        return tuple(tuple(name for name in self.gains if name in block) for block in found)

    def _is_alone(self, axis: str) -> bool:
        return not any(axis in block for block in self.blocks)

    def inverse(self, axis: str) -> dict[str, str]:
        """Return a row of the inverse.

        For each axis that acts on this one, it has the name of the acceleration per load along that axis.
        """
        for block in self.blocks:
            if axis in block:
                return {other: f"inverse_{_pair(axis, other)}" for other in block}
        return {axis: f"gain_{axis}"}

    def parameters(self) -> dict[str, str]:
        """Return the formulas of the names in `inverse` and of the entries."""
        found = {f"gain_{axis}": formula for axis, formula in self.gains.items()}
        for block in self.blocks:
            found |= {f"mass_{axis}{axis}": f"1 / gain_{axis}" for axis in block}
            found |= {f"mass_{a}{b}": formula for (a, b), formula in self.entries.items() if {a, b} <= {*block}}
            found |= self._inverse_of(block)
        known = found.keys()
        return found | {
            f"mass_{a}{b}": formula for (a, b), formula in self.entries.items() if f"mass_{a}{b}" not in known
        }

    def _inverse_of(self, block: tuple[str, ...]) -> dict[str, str]:
        """Return formulas for the inverse of a block, K^T D^-1 K with M = L D L^T and K = L^-1."""
        found: dict[str, str] = {}
        has_factor: set[tuple[str, str]] = set()
        for n, row in enumerate(block):  # M = L D L^T, row by row; L has the factors, D the pivots
            for m, column in enumerate(block[:n]):
                parts = [f"mass_{column}{row}"] if (column, row) in self.entries else []
                for k in block[:m]:
                    if {(row, k), (column, k)} <= has_factor:
                        parts.append(f"-factor_{row}{k} * factor_{column}{k} * pivot_{k}")
                if parts:
                    has_factor.add((row, column))
                    found[f"factor_{row}{column}"] = f"({joined(parts)}) / pivot_{column}"
            squares = [f"-factor_{row}{k} * factor_{row}{k} * pivot_{k}" for k in block[:n] if (row, k) in has_factor]
            found[f"pivot_{row}"] = joined([f"mass_{row}{row}", *squares])
        for n, row in enumerate(block):  # K L = 1, from the diagonal outwards; K has the names undo_..
            for m in reversed(range(n)):
                column = block[m]
                parts = []
                for k in block[m + 1 : n + 1]:
                    if (k, column) in has_factor:
                        parts.append(f"-factor_{k}{column}" if k == row else f"-undo_{row}{k} * factor_{k}{column}")
                found[f"undo_{row}{column}"] = joined(parts) or "0"
        for n, row in enumerate(block):  # K^T D^-1 K
            for column in block[n:]:
                parts = []
                for k in block[block.index(column) :]:
                    factors = [f"undo_{k}{axis}" for axis in (row, column) if axis != k]
                    parts.append(" * ".join(factors) + f" / pivot_{k}" if factors else f"1 / pivot_{k}")
                found[f"inverse_{row}{column}"] = joined(parts)
        return found

    def coriolis(self, axis: str) -> dict[tuple[str, str], str]:
        """Return the coefficients of products of two velocities in the acceleration of an axis, as formulas."""
        found: dict[tuple[str, str], list[str]] = {}
        for other, inverse in self.inverse(axis).items():
            for pair, entries in self._products(other).items():
                found.setdefault(pair, []).extend(sign + self._term(inverse, entry) for sign, entry in entries)
        return {pair: joined(parts) for pair, parts in sorted(found.items(), key=lambda item: _places(item[0]))}

    def _term(self, inverse: str, entry: tuple[str, str]) -> str:
        a, b = entry
        return f"{inverse} / gain_{a}" if a == b and self._is_alone(a) else f"{inverse} * mass_{a}{b}"

    def _products(self, axis: str) -> dict[tuple[str, str], list[tuple[str, tuple[str, str]]]]:
        """Return the right side of Kirchhoff's equations for an axis.

        For each product of two velocities, it has entries of the mass matrix with their signs.
        """
        found: dict[tuple[str, str], list[tuple[str, tuple[str, str]]]] = {}
        for sign, momentum, velocity in _KIRCHHOFF[axis]:
            if velocity not in self.gains:
                continue
            for other in self.gains:
                entry = _sorted(momentum, other)
                if momentum == other or entry in self.entries:
                    signed = found.setdefault(_sorted(other, velocity), [])
                    opposite = ("" if sign else "-", entry)
                    if opposite in signed:
                        signed.remove(opposite)
                    else:
                        signed.append((sign, entry))
        return {pair: entries for pair, entries in found.items() if entries}


def _sorted(a: str, b: str) -> tuple[str, str]:
    return (a, b) if _ORDER.index(a) <= _ORDER.index(b) else (b, a)


def _pair(a: str, b: str) -> str:
    return "".join(_sorted(a, b))


def _places(names: Iterable[str]) -> tuple[int, ...]:
    return tuple(map(_ORDER.index, names))
