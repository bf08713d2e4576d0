"""Fly a manoeuvre of each vehicle in independent importers, and compare the results with the step in Python."""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from itertools import product
from pathlib import Path

from rich.console import Console
from rich.table import Table

from .importers import HERE, KITS, VERSIONS, chosen
from .install import InstallError, install
from .manoeuvre import MANOEUVRES
from .page import PageError, matrix, write_table
from .run import Outcome, Verdict, fmu_for_host, run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 all that ran agree, 1 one does not, 2 bad arguments."""
    parser = argparse.ArgumentParser(prog="python -m verification.interoperability", description=__doc__)
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"importer (see --list) or kit: {', '.join(KITS)}; what is named must "
        "run (default: all that are installed)",
    )
    add("--vehicle", choices=MANOEUVRES, metavar="NAME", help=f"{' or '.join(MANOEUVRES)} (default: all)")
    add("--fmi", type=int, choices=VERSIONS, help="version of FMI (default: both)")
    add("--fmu", type=Path, metavar="FILE", help="FMU of that vehicle and version (default: built for this)")
    add("--install", action="store_true", help="install the kits instead of running (Linux)")
    add(
        "--page",
        type=Path,
        metavar="FILE",
        help="write the table into this page, which all importers have to be run for",
    )
    add("--list", action="store_true", help="list the importers instead of running them")
    add(
        "--tools",
        type=Path,
        default=HERE / ".tools",
        metavar="FOLDER",
        help="where the importers are installed (default: verification/interoperability/.tools)",
    )
    options = parser.parse_args(arguments)
    try:
        versions = [options.fmi] if options.fmi else VERSIONS
        importers = chosen(options.names, versions)
        if options.fmu and not (options.vehicle and options.fmi):
            raise LookupError("--fmu goes with --vehicle and --fmi")
        if options.fmu and not options.fmu.is_file():
            raise LookupError(f"{options.fmu}: there is no such file")
    except LookupError as error:
        print(f"interop: {error.args[0]}", file=sys.stderr)
        return 2
    tools, console = options.tools.resolve(), Console(highlight=False)
    if options.list:
        for importer in importers:
            row = f"{importer.name:<18}{importer.kit:<8}FMI {importer.fmi}.0  {importer.title} {importer.version}"
            print(f"{row}, {importer.interface}")
        return 0
    if options.install:
        kits = list(dict.fromkeys(importer.kit for importer in importers))
        # All at once, because they use the network and the processors at different times. The other kits are installed
        # even if one fails.
        with console.status(f"installing {', '.join(kits)}"), ThreadPoolExecutor() as pool:
            return max(pool.map(partial(_install, tools=tools, console=console), kits))
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        vehicles = [options.vehicle] if options.vehicle else MANOEUVRES
        built = cache(partial(fmu_for_host, folder=Path(folder)))
        for vehicle, importer in product(vehicles, importers):
            if not importer.suits(MANOEUVRES[vehicle].rov.layout):
                continue
            fmu = options.fmu or built(vehicle, importer.fmi)
            with console.status(f"{importer.title}, FMI {importer.fmi}.0, {importer.interface}: {vehicle}"):
                outcomes.append(run(importer, fmu, tools, MANOEUVRES[vehicle]))
    _show(outcomes, console)
    if options.page:
        try:
            write_table(outcomes, options.page)
        except (PageError, OSError) as error:
            print(f"interop: {error}", file=sys.stderr)
            return 2
    # An importer that was named must run.
    bad = {Verdict.DIFFERS, Verdict.FAILED, *([Verdict.NOT_RUN] if options.names else [])}
    return int(any(outcome.verdict in bad for outcome in outcomes))


def _install(kit: str, tools: Path, console: Console) -> int:
    """Install a kit and return the exit code."""
    try:
        install(kit, tools, console.print)
    except InstallError as error:
        print(f"interop: {error}", file=sys.stderr)
        return 1
    return 0


def _show(outcomes: Sequence[Outcome], console: Console) -> None:
    """Print the table of the page, then the reasons and logs."""
    heads, *rows = matrix(outcomes)
    table = Table(*heads, title="The largest difference, 30 s, SI units", title_justify="left")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    for outcome in outcomes:
        if outcome.reason:
            reason = f"{outcome.importer.name} {outcome.verdict.value}, {outcome.vehicle}: {outcome.reason}"
            console.print(reason, soft_wrap=True)  # so that a command in it can be copied
        for line in outcome.log.strip().splitlines()[-15:]:
            console.print(f"    {line}", markup=False)


if __name__ == "__main__":
    sys.exit(main())
