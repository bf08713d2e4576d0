"""Fit all methods to the training recordings of all data sets, predict the test recordings, and print the scores.

-o gets scores.csv, coefficients.csv and scores.svg. The recordings are not distributed: --data (or ROV_FMU_DATA) is the
folder with your copies of the repositories; without it, only what is simulated is run.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name

import click
import pandas as pd
from rich.console import Console

from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.process import exit_code
from verification.identification.data import DataSet, Recorded, split_of
from verification.identification.datasets import EXJOBB, TAUV
from verification.identification.datasets.simulated import CALM, ROUGH
from verification.identification.protocol import Method, run
from verification.identification.scores import Table, numbers, scores
from verification.identification.show import picture, print_scores

DATA_SETS: Sequence[DataSet] = (EXJOBB, TAUV, CALM, ROUGH)


METHODS = (
    "unchanged:Unchanged",
    "unchanged:ConstantVelocity",
    "least_squares:LeastSquares",
    "output_error:OutputError",
    "gaussian_process:GaussianProcess",
    "neural_ode:NeuralODE",
    "identified:Identified",
)
"""The modules and classes of the methods. They are imported when they are made, because some need an extra."""


def make(name: str) -> Method:
    """Return a new method."""
    return resolve_name(f"verification.identification.methods.{name}")()  # type: ignore[no-any-return]


@click.command(help=__doc__)
@click.option("--data", type=click.Path(path_type=Path), envvar="ROV_FMU_DATA", metavar="FOLDER")
@click.option("--only", multiple=True, metavar="NAME", help="Only this data set; scores.csv keeps the others' rows.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, metavar="FOLDER")
def _command(data: Path | None, only: tuple[str, ...], output: Path) -> None:
    names = [one.name for one in DATA_SETS]
    if unknown := next((name for name in only if name not in names), None):
        raise click.UsageError(f"--only {unknown}: there is no such data set, only {', '.join(names)}")
    output.mkdir(parents=True, exist_ok=True)
    files = [output / name for name in ("scores.csv", "coefficients.csv", "scores.svg")]
    check_targets([(file, "") for file in files], force=True)
    log = Console(stderr=True)
    rows, found = [], []
    with tempfile.TemporaryDirectory(prefix="identification-") as folder:
        for one in DATA_SETS:
            if (only and one.name not in only) or (isinstance(one, Recorded) and not data):
                log.print(f"{one.name}: not run" + ("" if only else ", because --data is not given"))
                continue
            split = split_of(one, data, Path(folder))
            for name in METHODS:
                outcome = run(make(name), split)
                log.print(f"{one.name}: {outcome.method.name}, {outcome.seconds:.1f} s")
                rows.append(scores(outcome))
                found.append(numbers(outcome))
    if not rows:
        raise click.UsageError("nothing was run")
    if only and files[0].exists():
        before = pd.read_csv(files[0])
        rows.insert(0, before[~before.data.isin(only)])
    tables: list[Table] = [pd.concat(rows), pd.concat(found)]
    print_scores(*tables)
    texts = [table.to_csv(index=False, float_format="%.6g", lineterminator="\n") for table in tables]
    texts.append(picture(tables[0]))
    write_whole(*(Output(path, text.encode()) for path, text in zip(files, texts, strict=True)), force=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 2 bad input, 130 interrupted."""
    codes: dict[type[Exception], int] = {OSError: 2, FileError: 2, click.ClickException: 2}
    name = "python -m verification.identification"
    return exit_code("identification", lambda: _command(arguments, name, standalone_mode=False), codes)


if __name__ == "__main__":
    sys.exit(main())
