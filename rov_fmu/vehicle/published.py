"""Tables 6–8 of the paper: steady velocity and time constant as printed, as computed from the vehicle, as measured.

The printed numbers are the CSV files of the vehicle's data folder; the computed ones follow from its coefficients in
closed form. Where the two differ, that is shown as it is.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import zip_longest
from pathlib import Path

from rov_fmu.files.csv_table import DataFileError, csv_lines, number
from rov_fmu.files.messages import shown
from rov_fmu.motion.rov import COEFFICIENTS, HEAVE, SURGE, YAW, Axis, Coefficients, Inputs
from rov_fmu.vehicle.vehicle import Vehicle

Cells = tuple[Decimal | None, ...]

COMMAND = "command [%]"
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
    """Directions of motion in that table."""
    direction: str
    """The one that the responses belong to."""

    def inputs(self, command: Decimal) -> Inputs:
        """The inputs that hold a command given in %."""
        return self.axis.inputs(float(command) / 100.0)

    def response(self, coefficients: Coefficients, command: Decimal) -> tuple[float, float]:
        """V_ss and Tau (s) in closed form for a command given in %."""
        return self.axis.response(coefficients, float(command) / 100.0)


@dataclass(frozen=True)
class ResponseTable(StepTest):
    """One of Tables 6–8, and the measured steady velocities of its axis by command in % (Tables 3–5)."""

    rows: tuple[ResponseRow, ...]
    steady: Mapping[Decimal, Decimal]


STEP_TESTS = (
    StepTest(HEAVE, 6, 3, ("upward", "downward"), "downward"),
    StepTest(YAW, 7, 5, ("yaw",), "yaw"),
    StepTest(SURGE, 8, 4, ("forward",), "forward"),
)


def untuned(coefficients: Coefficients) -> Coefficients:
    """The coefficients with every α and β at 1: the paper's non-linear model."""
    return replace(coefficients, **{name: 1.0 for name, meta in COEFFICIENTS.items() if meta.tunable})


def load_tables(vehicle: Vehicle) -> tuple[ResponseTable, ...]:
    """Tables 6–8 of a vehicle, read and computed. Raises DataFileError.

    A measured V_ss that the table of responses does not hold is that of the table of steady velocities.
    """
    if vehicle.data is None:
        raise DataFileError(f"{vehicle.name}: no published tables, the vehicle file has no key vehicle.data")
    return tuple(_load_table(vehicle.data, vehicle.coefficients, experiment) for experiment in STEP_TESTS)


def read_table(path: Path, columns: Sequence[str]) -> dict[Decimal, Cells]:
    """Rows of a CSV file by command in %, its first column; an empty cell is None. Raises DataFileError.

    `columns` are the headers of the others, all magnitudes.
    """
    columns = [COMMAND, *columns]
    rows: dict[Decimal, Cells] = {}
    lines = csv_lines(path)
    line, header = next(lines, (1, []))
    for place, (name, found) in enumerate(zip_longest(columns, header), 1):
        if name != found:
            wanted = f"must be {name!r}" if name else "there is no such column"
            raise DataFileError(f"{path}, line {line}, column {place} = {shown(found or '')}: {wanted}")
    for line, texts in lines:
        cells: list[Decimal | None] = []
        for name, text in zip_longest(columns, texts):
            try:
                cells.append(_cell(name, text, rows))
            except ValueError as error:
                column = repr(name) if name else len(columns) + 1
                value = f" = {shown(text)}" if text else ""
                raise DataFileError(f"{path}, line {line}, column {column}{value}: {error}") from None
        command, *others = cells
        assert command is not None  # _cell demands it
        rows[command] = tuple(others)
    if not rows:
        raise DataFileError(f"{path}, line {line}: no rows below the header")
    return rows


def _load_table(folder: Path, coefficients: Coefficients, experiment: StepTest) -> ResponseTable:
    e = experiment
    responses = read_table(
        folder / f"table{e.number}_{e.axis.name}_response.csv",
        [f"{source} {quantity}" for source in _SOURCES for quantity in (f"V_ss [{e.axis.unit}]", "Tau [s]")],
    )
    velocities = read_table(
        folder / f"table{e.steady_number}_{e.axis.name}_steady.csv",
        [f"{direction} [{e.axis.unit}]" for direction in e.steady_columns],
    )
    place = e.steady_columns.index(e.direction)
    steady = {command: V for command, cells in velocities.items() if (V := cells[place]) is not None}

    def row(command: Decimal, cells: Cells) -> ResponseRow:
        V_non_linear, Tau_non_linear, V_scaled, Tau_scaled, V_measured, Tau_measured = cells
        if V_measured is None:
            V_measured = steady.get(command)

        def response(k: Coefficients, V_printed: Decimal | None, Tau_printed: Decimal | None) -> Response:
            V_ss, Tau = e.response(k, command)
            return Response(Cell(V_printed, V_ss, V_measured), Cell(Tau_printed, Tau, Tau_measured))

        return ResponseRow(
            command,
            response(untuned(coefficients), V_non_linear, Tau_non_linear),
            response(coefficients, V_scaled, Tau_scaled),
        )

    rows = tuple(row(command, cells) for command, cells in responses.items())
    return ResponseTable(**vars(e), rows=rows, steady=steady)


def _cell(column: str | None, text: str | None, commands: Container[Decimal]) -> Decimal | None:
    """The value of one cell; `commands` are those of the rows above. Raises ValueError with the reason alone."""
    if column is None:
        raise ValueError("there is no such column")
    if text is None or (not text and column == COMMAND):
        raise ValueError("this cell is missing")
    if not text:
        return None
    number(text)
    value = Decimal(text)
    if column == COMMAND and not 0 < value <= 100:
        raise ValueError("must be above 0 and at most 100")
    if column == COMMAND and value in commands:
        raise ValueError("there is a row of this command above")
    if value < 0:
        raise ValueError("must not be negative")
    return value


def _deviation(value: float, reference: Decimal | None) -> float | None:
    return value / float(reference) - 1.0 if reference else None
