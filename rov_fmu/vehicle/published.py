"""Tables 6–8 of the paper: steady velocity and time constant as printed, as computed from the vehicle, as measured.

The printed numbers are the CSV files of the vehicle's data folder; the computed ones follow from its coefficients in
closed form. Where the two differ, that is shown as it is.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from rov_fmu.io.csv_table import Column, DataFileError, read_columns
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.form import TABLES
from rov_fmu.vehicle.vehicle import Vehicle

Cells = tuple[Decimal | None, ...]

_SOURCES = ("non-linear", "scaled", "experiment")


@dataclass(frozen=True)
class Cell:
    """One quantity at one command, as printed, computed and measured. Decimals keep the digits of the paper."""

    printed: Decimal | None
    computed: float
    measured: Decimal | None

    @property
    def from_printed(self) -> float | None:
        """Deviation of the computed from the printed value, relative to the printed one."""
        return _deviation(self.computed, self.printed)

    @property
    def from_measured(self) -> float | None:
        """Deviation of the computed from the measured value, relative to the measured one."""
        return _deviation(self.computed, self.measured)

    @property
    def rounds_to_printed(self) -> bool:
        """Whether the printed value is the computed one rounded to the printed digits; true of a lost one."""
        if self.printed is None:
            return True
        half_unit = Decimal(5).scaleb(int(self.printed.as_tuple().exponent) - 1)
        return abs(Decimal(self.computed) - self.printed) <= half_unit


@dataclass(frozen=True)
class Response:
    """The response of one axis to a held command, from rest: V_ss in the unit of the table, Tau (17) in s."""

    V_ss: Cell
    Tau: Cell


@dataclass(frozen=True)
class ResponseRow:
    """One row: the command in % of full thrust and the response of both models."""

    command: Decimal
    non_linear: Response
    """α = β = 1."""
    scaled: Response
    """With the vehicle's α and β, (18)."""


@dataclass(frozen=True)
class StepTest:
    """How the responses of one axis were recorded."""

    axis: Axis
    number: int
    """Of the table of responses."""
    steady_number: int
    """Of the table of measured steady velocities."""
    steady_columns: tuple[str, ...]
    """Directions of motion in that table; the responses belong to the last."""

    def response(self, rov: Rov, command: Decimal) -> tuple[float, float]:
        """V_ss and Tau (s) in closed form for a command given in %."""
        return rov.response(self.axis, float(command) / 100.0)


@dataclass(frozen=True)
class ResponseTable(StepTest):
    """One of Tables 6–8, and the measured steady velocities of its axis by command in % (Tables 3–5)."""

    rows: tuple[ResponseRow, ...]
    steady: Mapping[Decimal, Decimal]


STEP_TESTS = (
    StepTest(HEAVE, 6, 3, ("upward", "downward")),
    StepTest(YAW, 7, 5, ("yaw",)),
    StepTest(SURGE, 8, 4, ("forward",)),
)


def untuned(rov: Rov) -> Rov:
    """The vehicle with every α and β at 1: the paper's non-linear model."""
    return rov.replaced({name: 1.0 for name, meta in rov.layout.coefficients.items() if meta.tunable})


def load_tables(vehicle: Vehicle) -> tuple[ResponseTable, ...]:
    """Tables 6–8 of a vehicle, read and computed. Raises DataFileError.

    A measured V_ss that the table of responses does not hold is that of the table of steady velocities.
    """
    if vehicle.data is None:
        raise DataFileError(f"{vehicle.name}: no published tables, the vehicle file has no key vehicle.data")
    if missing := [test.axis.name for test in STEP_TESTS if not vehicle.layout.has(test.axis)]:
        raise DataFileError(f"{vehicle.name}: Tables 6-8 are of surge, heave and yaw, it has no {', '.join(missing)}")
    return tuple(_load_table(vehicle.data, vehicle.rov, test) for test in STEP_TESTS)


def _read_table(path: Path, units: Mapping[str, str]) -> dict[Decimal, Cells]:
    """Rows of a CSV file by command in %; an empty cell is None. `units` are those of the other columns, by name."""
    others = {name: Column({unit: 1.0}, blanks=True) for name, unit in units.items()}
    table = read_columns(path, {"command": Column({"%": 1.0}), **others})
    rows: dict[Decimal, Cells] = {}
    for n, (text, *texts) in enumerate(table.texts("command", *units)):
        command = Decimal(text)
        if not 0 < command <= 100:
            raise table.error(n, "command", "must be above 0 and at most 100")
        if command in rows:
            raise table.error(n, "command", "there is a row of this command above")
        if negative := next((name for name in units if table.values[name][n] < 0.0), None):
            raise table.error(n, negative, "must not be negative")
        rows[command] = tuple(Decimal(text) if text else None for text in texts)
    return rows


def _load_table(folder: Path, rov: Rov, test: StepTest) -> ResponseTable:
    of_responses, of_velocities = (folder / name for name in TABLES[test.axis.name])
    units = {"V_ss": test.axis.unit, "Tau": "s"}
    responses = _read_table(of_responses, {f"{s} {quantity}": units[quantity] for s in _SOURCES for quantity in units})
    velocities = _read_table(of_velocities, dict.fromkeys(test.steady_columns, test.axis.unit))
    steady = {command: V for command, cells in velocities.items() if (V := cells[-1]) is not None}

    rows = []
    for command, (*printed, V_measured, Tau_measured) in responses.items():
        measured = steady.get(command) if V_measured is None else V_measured, Tau_measured
        models = [
            Response(*map(Cell, printed[place : place + 2], test.response(k, command), measured))
            for place, k in ((0, untuned(rov)), (2, rov))
        ]
        rows.append(ResponseRow(command, *models))
    return ResponseTable(**vars(test), rows=tuple(rows), steady=steady)


def _deviation(value: float, reference: Decimal | None) -> float | None:
    return value / float(reference) - 1.0 if reference else None
