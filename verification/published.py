"""Tables 6–8 of the paper: printed, computed and measured steady velocities and time constants.

The printed and measured numbers come from the CSV files of the vehicle's data folder; the computed ones follow from its
coefficients in closed form. Differences between them are shown, not adjusted.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.io.columns import Column, read_columns
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.description import TABLES
from rov_fmu.vehicle.vehicle import Vehicle

Cells = tuple[Decimal | None, ...]

_SOURCES = ("non-linear", "scaled", "experiment")


@dataclass(frozen=True)
class Cell:
    """The printed, computed and measured value of a quantity at a command. Decimals keep the digits of the paper."""

    printed: Decimal | None
    computed: float
    measured: Decimal | None

    @property
    def from_printed(self) -> float | None:
        """The relative deviation of the computed from the printed value."""
        return _deviation(self.computed, self.printed)

    @property
    def from_measured(self) -> float | None:
        """The relative deviation of the computed from the measured value."""
        return _deviation(self.computed, self.measured)

    @property
    def rounds_to_printed(self) -> bool:
        """True if the computed value, rounded to the printed digits, is the printed one.

        True as well if no value is printed.
        """
        if self.printed is None:
            return True
        half_unit = Decimal(5).scaleb(int(self.printed.as_tuple().exponent) - 1)
        return abs(Decimal(self.computed) - self.printed) <= half_unit


@dataclass(frozen=True)
class Response:
    """The response of an axis from rest to a held command: V_ss in the unit of the table, and Tau (17) in s."""

    V_ss: Cell
    Tau: Cell


@dataclass(frozen=True)
class ResponseRow:
    """A row of a table: the command in % of the full command, and the responses of both models."""

    command: Decimal
    non_linear: Response
    """The response with α = β = 1."""
    scaled: Response
    """The response with the vehicle's α and β, (18)."""


@dataclass(frozen=True)
class StepTest:
    """The published step tests of an axis."""

    axis: Axis
    number: int
    """The number of the table of responses."""
    steady_number: int
    """The number of the table of measured steady velocities."""
    steady_columns: tuple[str, ...]
    """The directions of motion in that table; the responses belong to the last one."""

    def response(self, vehicle: Vehicle, command: Decimal) -> tuple[float, float]:
        """Return V_ss and Tau (s) in closed form for a command in %."""
        return vehicle.response(self.axis, float(command) / 100.0)


@dataclass(frozen=True)
class ResponseTable(StepTest):
    """One of Tables 6–8, with the measured steady velocities of its axis from Tables 3–5."""

    rows: tuple[ResponseRow, ...]
    steady: Mapping[Decimal, Decimal]
    """The measured steady velocities by command in %."""


STEP_TESTS = (
    StepTest(HEAVE, 6, 3, ("upward", "downward")),
    StepTest(YAW, 7, 5, ("yaw",)),
    StepTest(SURGE, 8, 4, ("forward",)),
)


def load_tables(vehicle: Vehicle) -> tuple[ResponseTable, ...]:
    """Return Tables 6–8 of a vehicle. Raises DataFileError.

    If the table of responses has no measured V_ss, the one in the table of steady velocities is used.
    """
    if vehicle.data is None:
        raise DataFileError(f"{vehicle.name}: no published tables, the vehicle file has no key vehicle.data")
    if missing := [test.axis.name for test in STEP_TESTS if not vehicle.layout.has(test.axis)]:
        raise DataFileError(f"{vehicle.name}: Tables 6-8 are of surge, heave and yaw, it has no {', '.join(missing)}")
    return tuple(_load_table(vehicle.data, vehicle, test) for test in STEP_TESTS)


def tables_by_axis(vehicle: Vehicle) -> dict[str, ResponseTable]:
    """Return the published tables of a vehicle by axis; there are none without a data folder. Raises DataFileError."""
    return {table.axis.name: table for table in load_tables(vehicle)} if vehicle.data else {}


def _read_table(path: Path, units: Mapping[str, str]) -> dict[Decimal, Cells]:
    """Return the rows of a CSV file by command in %, with None for empty cells. `units` has the other columns."""
    columns = {name: Column({unit: 1.0}, blanks=True) for name, unit in units.items()}
    table = read_columns(path, {"command": Column({"%": 1.0}), **columns})
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


def _load_table(folder: Path, vehicle: Vehicle, test: StepTest) -> ResponseTable:
    """Return one of Tables 6–8."""
    responses_file, velocities_file = (folder / name for name in TABLES[test.axis.name])
    units: dict[str, str] = {}
    for source in _SOURCES:
        units |= {f"{source} V_ss": test.axis.unit, f"{source} Tau": "s"}
    responses = _read_table(responses_file, units)
    velocities = _read_table(velocities_file, dict.fromkeys(test.steady_columns, test.axis.unit))
    steady = {command: V for command, cells in velocities.items() if (V := cells[-1]) is not None}

    rows = []
    for command, (*printed, V_measured, Tau_measured) in responses.items():
        measured = steady.get(command) if V_measured is None else V_measured, Tau_measured
        non_linear = Response(*map(Cell, printed[:2], test.response(vehicle.untuned, command), measured))
        scaled = Response(*map(Cell, printed[2:], test.response(vehicle, command), measured))
        rows.append(ResponseRow(command, non_linear, scaled))
    return ResponseTable(**vars(test), rows=tuple(rows), steady=steady)


def _deviation(value: float, reference: Decimal | None) -> float | None:
    """Return the relative deviation from a reference, or None if that is missing or zero."""
    return value / float(reference) - 1.0 if reference else None
