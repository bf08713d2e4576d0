"""python -m verification.tables [VEHICLE]: Tables 6-8 of the paper beside what the coefficients of a vehicle give.

VEHICLE is a vehicle file or the name of a vehicle that ships; the default is the VideoRay Pro 4.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence

from rich.table import Table

from rov_fmu.io.messages import FileError
from rov_fmu.process import exit_code
from rov_fmu.report.console import DEVIATION, console, paragraph, print_table, table, text
from rov_fmu.vehicle.shipped import find_vehicle
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.published import Cell, ResponseTable, load_tables


def main(arguments: Sequence[str]) -> int:
    """Print the tables of a vehicle, and return the exit code: 0, or 2 for bad input."""

    def run() -> None:
        vehicle = load_vehicle(find_vehicle(arguments[0] if arguments else "videoray"))
        print_tables(vehicle, load_tables(vehicle))

    return exit_code("tables", run, {FileError: 2})


def print_tables(vehicle: Vehicle, tables: Iterable[ResponseTable]) -> None:
    """Print Tables 6-8 of the paper beside the values computed for the vehicle."""
    out = console()
    paragraph(out, f"{vehicle.name}. {vehicle.source}")
    for t in tables:
        out.print()
        print_table(_side_by_side(vehicle, t), out)
    out.print()
    for line in (
        (
            "non-linear: every alpha and beta is 1. scaled: alpha and beta of the vehicle file. model: "
            "computed in closed form."
        ),
        ("dev.: deviation of the model from the printed value; in the last column, of the scaled model from the test."),
        ("*: the printed value differs from the rounded value of the model. -: not printed, or not measured."),
    ):
        paragraph(out, line)


def _side_by_side(vehicle: Vehicle, t: ResponseTable) -> Table:
    """Return a published table with the printed, computed and measured values side by side."""
    values = ", ".join(f"{name} = {vehicle[name]:g}" for name in map(t.axis.coefficient, ("alpha", "beta")))
    compared = [f"{model}\nprinted|\nmodel|\ndev." for model in ("non-linear", "scaled")]
    headers = "|".join([*compared, "\ntest|\ndev."]).split("|")
    title = f"Table {t.number}. {t.axis.name.capitalize()}, {values}; V_ss in {t.axis.unit}, Tau in s"
    result = table(title, "\ncommand", headers)
    for quantity in ("V_ss", "Tau"):
        result.add_section()
        result.add_row(quantity)
        for row in t.rows:
            scaled: Cell = getattr(row.scaled, quantity)
            result.add_row(
                f"{row.command} %",
                *_model(getattr(row.non_linear, quantity)),
                *_model(scaled),
                text(scaled.measured),
                text(scaled.from_measured, DEVIATION),
            )
    return result


def _model(cell: Cell) -> Iterator[str]:
    """Yield the printed value, the computed value and their deviation."""
    yield text(cell.printed)
    yield f"{cell.computed:.4f}"
    yield text(cell.from_printed, DEVIATION) + (" " if cell.rounds_to_printed else "*")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
