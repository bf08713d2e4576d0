"""Identify the vehicles of all data sets by their training recordings, and score what they predict of the others.

-o gets scores.csv and coefficients.csv. The recordings are not distributed: --data (or ROV_FMU_DATA) is the
folder with your copies of the repositories; without it, only what is simulated is run.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click
import pandas as pd
from rich.console import Console

from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output, check_targets, write_whole
from rov_fmu.process import exit_code
from verification.identification.data import DataSet, Recorded, split_of
from verification.identification.datasets import EXJOBB, TAUV
from verification.identification.datasets.simulated import CALM, ROUGH
from verification.identification.methods.identified import Identified
from verification.identification.methods.unchanged import Unchanged
from verification.identification.protocol import Method, run
from verification.identification.scores import Table, numbers, scores
from verification.identification.show import print_scores

DATA_SETS: Sequence[DataSet] = (EXJOBB, TAUV, CALM, ROUGH)
METHODS: Sequence[type[Method]] = (Unchanged, Identified)


@click.command(help=__doc__)
@click.option("--data", type=click.Path(path_type=Path), envvar="ROV_FMU_DATA", metavar="FOLDER")
@click.option("--only", multiple=True, metavar="NAME", help="Only this data set; scores.csv keeps the others' rows.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, metavar="FOLDER")
def _command(data: Path | None, only: tuple[str, ...], output: Path) -> None:
    names = [one.name for one in DATA_SETS]
    if unknown := next((name for name in only if name not in names), None):
        raise click.UsageError(f"--only {unknown}: there is no such data set, only {', '.join(names)}")
    output.mkdir(parents=True, exist_ok=True)
    files = [output / name for name in ("scores.csv", "coefficients.csv")]
    check_targets([(file, "") for file in files], force=True)
    log = Console(stderr=True)
    rows, found = [], []
    with tempfile.TemporaryDirectory(prefix="identification-") as folder:
        for one in DATA_SETS:
            if (only and one.name not in only) or (isinstance(one, Recorded) and not data):
                log.print(f"{one.name}: not run" + ("" if only else ", because --data is not given"))
                continue
            split = split_of(one, data, Path(folder))
            for method in METHODS:
                outcome = run(method(), split)
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
    write_whole(*(Output(path, text.encode()) for path, text in zip(files, texts, strict=True)), force=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 2 bad input, 130 interrupted."""
    codes: dict[type[Exception], int] = {OSError: 2, FileError: 2, click.ClickException: 2}
    name = "python -m verification.identification"
    return exit_code("identification", lambda: _command(arguments, name, standalone_mode=False), codes)


if __name__ == "__main__":
    sys.exit(main())
