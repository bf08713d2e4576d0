"""The rows of tables of tank tests: what the vehicle says about each, and what a fit without it says."""

from collections.abc import Iterator, Mapping

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.parts import Curve
from rov_fmu.identify.beginning import QUANTITIES, Tests
from rov_fmu.identify.likelihood.curves import NO_SHAPES
from rov_fmu.identify.likelihood.fit import Fit
from rov_fmu.identify.likelihood.objective import Part, TableRow, modelled
from rov_fmu.identify.likelihood.solve import refits
from rov_fmu.identify.result import Point
from rov_fmu.vehicle.vehicle import Vehicle

HeldOut = Mapping[tuple[str, str, float], float]
"""The value of a row by a fit without it, by the quantity, the curve or axis, and the command."""


def points_of(tests: Tests, held_out: HeldOut, vehicle: Vehicle, kind: str, only: str | None = None) -> Iterator[Point]:
    """Yield the rows of tables with what the vehicle says about them, also held out."""
    quantity = QUANTITIES[kind]
    for subject, rows in tests.rows(kind):
        if only and subject != only:
            continue
        for row in rows:
            of: Curve | Axis = (
                next(c for c in vehicle.layout.curves if c.name == subject)
                if kind == "thrust"
                else vehicle.layout.by_name[subject].axis
            )
            one = TableRow(f"{quantity} of {subject}", of, quantity, row.command, row.value, 1.0)
            unit = (
                "N"
                if kind == "thrust"
                else "s"
                if kind == "time_constant"
                else vehicle.layout.by_name[subject].axis.unit
            )
            out = held_out.get((quantity, subject, row.command), np.nan)
            counts = tests.counts(kind, subject, row.command)
            numbers = row.command, row.value, float(modelled([one], vehicle, NO_SHAPES)[0]), out
            yield Point(subject, quantity, unit, row.file, *numbers, counts)  # type: ignore[arg-type]


def held_out_rows(fit: Fit) -> HeldOut:
    """Return the value of each row of the tables by a fit without all rows of the same size of the command."""
    objective, rows = fit.objective, fit.objective.rows
    found: dict[tuple[str, str, float], float] = {}
    groups: dict[tuple[str, str, float], list[int]] = {}
    for n, row in enumerate(rows):
        kind = "force" if row.quantity == "force" else "motion"
        groups.setdefault((kind, row.subject.name, abs(row.command)), []).append(n)
    parts = [Part(objective.whole.logs, [n for n in objective.whole.rows if n not in out]) for out in groups.values()]
    for members, without in zip(groups.values(), refits(objective, fit.best, parts), strict=True):
        some = [rows[n] for n in members]
        for row, value in zip(some, modelled(some, *objective.table.model(without.z)).tolist(), strict=True):
            found[row.quantity, row.subject.name, row.command] = value
    return found
