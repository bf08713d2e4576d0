"""What half the step changes in a run of a system: whether its numbers are to be trusted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rov_fmu.bridges.system.master import Name
from rov_fmu.fmus.instance import Array

_TRUSTED = 0.05
"""The largest root mean square of what half the step changes, relative to a variable's range, for numbers that may be
trusted: the error is about twice as large."""


class HalfStep(NamedTuple):
    """How much half the step changes the variables that are connected.

    Each output arrives a step late, so the error is of first order in the step, and about twice these changes.
    """

    largest: Array
    """The largest change of each variable."""
    typical: Array
    """The root mean square of the change of each variable, relative to the variable's range in the run."""
    shares: Array
    """The largest change of all variables at each time, relative to their ranges."""

    def words(self, names: Sequence[Name]) -> str:
        """Return a line that begins with whether numbers may be trusted, and names what half the step changes most."""
        worst = int(self.typical.argmax())
        of = f"half the step changes {'.'.join(names[worst])} by {self.typical[worst]:.1%} of its range"
        if self.typical[worst] > _TRUSTED:
            return f"untrustworthy: {of}: take a smaller step"
        return f"trustworthy: {of}, and other connected variables by less"


def half_step(rows: Array, halved: Array, units: Sequence[str]) -> HalfStep:
    """Compare the rows of a run with those of one that took half the step, where both are finite.

    A turn is no change of an angle.
    """
    both = np.isfinite(rows) & np.isfinite(halved)
    changes = np.abs(np.subtract(halved, rows, out=np.zeros(rows.shape), where=both))
    ranges = rows.max(axis=0, where=both, initial=-np.inf) - rows.min(axis=0, where=both, initial=np.inf)
    angles = [unit == "rad" for unit in units]
    changes[:, angles] = np.abs(np.remainder(changes[:, angles] + np.pi, 2.0 * np.pi) - np.pi)
    shares = np.divide(changes, ranges, out=np.zeros_like(changes), where=ranges > 0.0)
    return HalfStep(changes.max(axis=0), np.sqrt((shares**2).mean(axis=0)), shares.max(axis=1))
