"""Run videoray.fmu through independent importers with one manoeuvre, and compare them with rov_fmu.motion.rov."""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.table import Column, Table

from rov_fmu import cli

from .importers import HERE, KITS, chosen
from .install import InstallError, install
from .manoeuvre import reference
from .run import Outcome, Verdict, run

STYLES = {Verdict.DIFFERS: "red", Verdict.FAILED: "red", Verdict.NOT_RUN: "yellow"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 all that ran agree, 1 one does not, 2 bad arguments."""
    parser = argparse.ArgumentParser(prog="python -m interop", description=__doc__)
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help=f"importer (see --list) or kit: {', '.join(KITS)}; what is named must "
        "run (default: all that are installed)")  # fmt: skip
    add("--fmu", type=Path, metavar="FILE", help="FMU of the VideoRay (default: built for this)")
    add("--install", action="store_true", help="install the kits instead of running (Linux)")
    add("--list", action="store_true", help="list the importers instead of running them")
    add("--tools", type=Path, default=HERE / ".tools", metavar="FOLDER", help="where the importers are installed "
        "(default: interop/.tools)")  # fmt: skip
    options = parser.parse_args(arguments)
    try:
        importers = chosen(options.names)
        if options.fmu and not options.fmu.is_file():
            raise LookupError(f"{options.fmu}: there is no such file")
    except LookupError as error:
        print(f"interop: {error.args[0]}", file=sys.stderr)
        return 2
    tools, console = options.tools.resolve(), Console(highlight=False)
    if options.list:
        for importer in importers:
            print(f"{importer.name:<14}{importer.kit:<8}{importer.title} {importer.version}, {importer.interface}")
        return 0
    if options.install:
        # All kits, whether or not one fails.
        return max([_install(kit, tools, console) for kit in dict.fromkeys(importer.kit for importer in importers)])
    with tempfile.TemporaryDirectory() as folder:
        fmu = options.fmu or _built(Path(folder))
        expected, outcomes = reference(), []
        for importer in importers:
            with console.status(f"{importer.title}, {importer.interface}"):
                outcomes.append(run(importer, fmu, tools, expected))
    _show(outcomes, console)
    # What was asked for by name must run.
    bad = {Verdict.DIFFERS, Verdict.FAILED, *([Verdict.NOT_RUN] if options.names else [])}
    return int(any(outcome.verdict in bad for outcome in outcomes))


def _install(kit: str, tools: Path, console: Console) -> int:
    try:
        with console.status(f"installing {kit}"):
            install(kit, tools, console.print)
    except InstallError as error:
        print(f"interop: {error}", file=sys.stderr)
        return 1
    return 0


def _built(folder: Path) -> Path:
    fmu = folder / "videoray.fmu"
    with redirect_stdout(StringIO()):
        code = cli.main(["build", "--platform", "host", "-o", str(fmu)])
    if code:
        raise SystemExit(code)
    return fmu


def _show(outcomes: Sequence[Outcome], console: Console) -> None:
    table = Table("importer", "version", "FMI interface", Column("max. difference", justify="right"), "verdict",
                  title="The same manoeuvre, 30 s, in every importer; SI units", title_justify="left")  # fmt: skip
    for outcome in outcomes:
        importer, size = outcome.importer, outcome.difference
        shown = "" if size is None else f"{size:.1e}" if size else "0"
        table.add_row(importer.title, importer.version, importer.interface, shown, outcome.verdict.value,
                      style=STYLES.get(outcome.verdict))  # fmt: skip
    console.print(table)
    for outcome in outcomes:
        if outcome.reason:
            console.print(f"{outcome.importer.name} {outcome.verdict.value}: {outcome.reason}")
        for line in outcome.log.strip().splitlines()[-15:]:
            console.print(f"    {line}", markup=False)


if __name__ == "__main__":
    sys.exit(main())
