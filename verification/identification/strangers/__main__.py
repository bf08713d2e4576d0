"""Identify vehicles that break the equation, and as many that obey it, and print how often a verdict was wrong.

A seed is used once: a method that has been changed after a look at the folders of a seed is judged by other seeds.
Each folder is a line of JSON in the file -o, and a folder that this file has is not run again. The exit code is 1 if
too many verdicts are wrong. --sample judges the same few seeds each time, to notice a change that spoils something.
"""

import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

import click

from rov_fmu.io.messages import FileError
from rov_fmu.process import exit_code
from rov_fmu.report.console import console, print_table, table
from verification.identification.strangers import gates
from verification.identification.strangers.judge import Judged, judged, judged_case, name_of, read
from verification.identification.strangers.kinds import BY_NAME

SAMPLE = 9240001, 10
"""The first seed of a sample, and the number of its seeds."""


class BrokenError(Exception):
    """Too many verdicts are wrong."""


@click.command(help=__doc__)
@click.option("--seed", type=int, default=None, metavar="FIRST", help="The first seed.")
@click.option("--folders", type=click.IntRange(1), default=1, metavar="N", help="So many seeds from the first one on.")
@click.option("--axes", type=click.Choice(["2", "4"]), default="2", help="The axes of each vehicle.")
@click.option("--kind", type=click.Choice([*BY_NAME]), default=None, help="All seeds have this kind.")
@click.option("--processes", type=click.IntRange(1), default=1, metavar="P")
@click.option("--sample", is_flag=True, help=f"{SAMPLE[1]} seeds of two axes by two processes: about a minute.")
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FILE.jsonl")
@click.option("--keep", metavar="STAGE", help="Keep the table of this file under this name, for the documentation.")
@click.argument("cases", nargs=-1, type=click.Path(path_type=Path, exists=True, file_okay=False))
def _command(
    seed: int | None,
    folders: int,
    axes: str,
    kind: str | None,
    processes: int,
    sample: bool,
    output: Path | None,
    keep: str | None,
    cases: Sequence[Path],
) -> None:
    """Judge the folders of seeds, or CASES, each with train/ and truth.json or with such folders."""
    if sample:
        (seed, folders), processes = SAMPLE, 2
    try:
        lines = output.read_text(encoding="utf-8").splitlines() if output and output.exists() else []
        done = [read(line) for line in lines]
    except (TypeError, ValueError, KeyError):
        raise click.UsageError(f"-o {output}: it exists, and has other lines than this program writes") from None
    if output:
        output.open("a", encoding="utf-8").close()  # before the work, in case it cannot be written
    names = {one.name for one in done}
    work: list[tuple[str, Callable[[], Judged]]] = [
        (path.name, partial(judged_case, path)) for case in cases for path in _with_truth(case)
    ]
    for n in range(folders if seed is not None else 0):
        assert seed is not None
        work.append((name_of(seed + n, int(axes), kind), partial(judged, seed + n, int(axes), kind)))
    jobs = [job for name, job in work if name not in names]
    for number, one in enumerate(_run(jobs, processes), 1):
        console(stderr=True).print(f"{number} of {len(jobs)}: {one.name}, {one.kind}, {one.seconds:.0f} s")
        done.append(one)
        if output:
            with output.open("a", encoding="utf-8") as file:
                file.write(f"{one.line()}\n")
    _print(gates.cases(done))
    if drawn := [one for one in done if one.count]:
        now = [gates.stage(keep or "now", drawn)]
        for rows in (gates.gates(now), gates.by_kind(now), gates.by_kind(now, hidden=True)):
            _print(rows)
        if keep:
            gates.keep(now[0])
        if broken := gates.broken(now[0]):
            raise BrokenError("; ".join(broken))


def _with_truth(folder: Path) -> list[Path]:
    """Return the folders with a truth: the folder, or those in it."""
    found = [path.parent for path in (folder / "truth.json", *sorted(folder.glob("*/truth.json"))) if path.exists()]
    if not found:
        raise click.UsageError(f"{folder}: neither it nor a folder in it has a truth.json")
    return found


def _run(jobs: Sequence[Callable[[], Judged]], processes: int) -> Iterator[Judged]:
    """Yield the folders as they are done."""
    if processes == 1:
        yield from (job() for job in jobs)
        return
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting: list[Future[Judged]] = [pool.submit(job) for job in jobs]
        yield from (one.result() for one in as_completed(waiting))


def _print(rows: gates.Table) -> None:
    heads, *others = rows
    found = table("", heads[0], [], heads[1:])
    for row in others:
        found.add_row(*row)
    print_table(found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 measured, 1 a gate is broken, 2 bad input, 130 interrupted."""
    codes: dict[type[Exception], int] = {BrokenError: 1, OSError: 2, FileError: 2, click.ClickException: 2}
    name = "python -m verification.identification.strangers"
    return exit_code("strangers", lambda: _command(arguments, name, standalone_mode=False), codes)


if __name__ == "__main__":
    sys.exit(main())
