"""Command line: python -m models tables [VEHICLE.toml]."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from decimal import Decimal
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from .tables import Cell, DataFileError, ResponseTable, load_tables
from .vehicle import VIDEORAY, Vehicle, VehicleFileError, load_vehicle

_MIN_WIDTH = 100  # rich takes 80 columns in a pipe, and cuts digits off to fit a table into them


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except (VehicleFileError, DataFileError) as error:
        print(f"models: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m models", description="What is known of a vehicle.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    tables = commands.add_parser("tables", help="Tables 6-8 of the paper: printed, computed, measured")
    tables.add_argument("vehicle", nargs="?", type=Path, default=VIDEORAY, metavar="VEHICLE.toml",
                        help="vehicle file (default: the VideoRay Pro 4)")  # fmt: skip
    tables.set_defaults(run=_print_tables)
    return parser


def _print_tables(options: argparse.Namespace) -> None:
    vehicle = load_vehicle(options.vehicle)
    tables = load_tables(vehicle)
    console = Console(markup=False, highlight=False, emoji=False)
    console.width = max(console.width, _MIN_WIDTH)
    console.print(f"{vehicle.name}. {vehicle.source}", soft_wrap=True)
    for table in tables:
        console.print()
        console.print(_side_by_side(vehicle, table))
    console.print(
        "\nnon-linear: every alpha and beta is 1; scaled: those of the vehicle file; computed in closed form.\n"
        "dev.: the computed value against the printed one; under test, the scaled model against the test.\n"
        "*: the printed value is not the computed one rounded to its digits. -: not printed, not measured."
    )


def _side_by_side(vehicle: Vehicle, table: ResponseTable) -> Table:
    tuning = (f"{name}_{table.velocity}" for name in ("alpha", "beta"))
    values = ", ".join(f"{name} = {getattr(vehicle.coefficients, name):g}" for name in tuning)
    result = Table(
        title=f"Table {table.number}. {table.axis.capitalize()}, {values}",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    result.add_column("\ncommand", no_wrap=True)
    for header in (
        "non-linear\nprinted", "\ncomputed", "\ndev.",
        "scaled\nprinted", "\ncomputed", "\ndev.",
        "test\nmeasured", "\ndev.",
    ):  # fmt: skip
        result.add_column(header, justify="right", no_wrap=True)
    for quantity, unit in (("V_ss", table.unit), ("Tau", "s")):
        result.add_section()
        result.add_row(f"{quantity} [{unit}]")
        for row in table.rows:
            scaled: Cell = getattr(row.scaled, quantity)
            result.add_row(
                f"{row.command} %",
                *_model(getattr(row.non_linear, quantity)),
                *_model(scaled),
                _text(scaled.measured),
                _percent(scaled.from_measured),
            )
    return result


def _model(cell: Cell) -> Iterator[str]:
    """Printed, computed, deviation."""
    yield _text(cell.printed)
    yield f"{cell.computed:.4f}"
    yield _percent(cell.from_printed) + (" " if cell.rounds_to_printed else "*")


def _text(value: Decimal | None) -> str:
    return "-" if value is None else str(value)


def _percent(ratio: float | None) -> str:
    return "-" if ratio is None else f"{ratio:+.1%}"


if __name__ == "__main__":
    sys.exit(main())
