"""Run videoray.fmu through independent importers with one manoeuvre, and compare them with rov_fmu.motion.rov."""

import argparse
import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rov_fmu import cli

from .importers import HERE, KITS, chosen
from .install import InstallError, install
from .manoeuvre import reference
from .run import Outcome, Verdict, run

STYLES = {Verdict.DIFFERS: "red", Verdict.FAILED: "red", Verdict.NOT_RUN: "yellow"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 all that ran agree, 1 one does not, 2 bad arguments."""
    options = _parser().parse_args(arguments)
    console = Console()
    try:
        importers = chosen(options.names)
        if options.fmu and not options.fmu.is_file():
            raise LookupError(f"{options.fmu}: there is no such file")
    except LookupError as error:
        print(f"interop: {error.args[0]}", file=sys.stderr)
        return 2
    tools = options.tools.resolve()
    if options.list:
        for importer in importers:
            print(f"{importer.name:<14}{importer.kit:<8}{importer.title} {importer.version}, {importer.interface}")
        return 0
    if options.install:
        return _install(dict.fromkeys(importer.kit for importer in importers), tools, console)
    with tempfile.TemporaryDirectory() as folder:
        fmu = options.fmu or _built(Path(folder))
        expected = reference()
        outcomes = []
        for importer in importers:
            with console.status(f"{importer.title}, {importer.interface}"):
                outcomes.append(run(importer, fmu, tools, expected))
    _show(outcomes, console)
    # What was asked for by name must run.
    bad = {Verdict.DIFFERS, Verdict.FAILED, *([Verdict.NOT_RUN] if options.names else [])}
    return int(any(outcome.verdict in bad for outcome in outcomes))


def _install(kits: Iterable[str], tools: Path, console: Console) -> int:
    code = 0
    for kit in kits:
        try:
            with console.status(f"installing {kit}"):
                install(kit, tools, lambda text: console.print(text, highlight=False))
        except InstallError as error:
            print(f"interop: {error}", file=sys.stderr)
            code = 1
    return code


def _built(folder: Path) -> Path:
    fmu = folder / "videoray.fmu"
    with redirect_stdout(StringIO()):
        code = cli.main(["build", "--platform", "host", "-o", str(fmu)])
    if code:
        raise SystemExit(code)
    return fmu


def _show(outcomes: Sequence[Outcome], console: Console) -> None:
    table = Table(title="The same manoeuvre, 30 s, in every importer; SI units", title_justify="left")
    table.add_column("importer")
    table.add_column("version")
    table.add_column("FMI interface")
    table.add_column("max. difference", justify="right")
    table.add_column("verdict")
    for outcome in outcomes:
        importer, size = outcome.importer, outcome.difference
        shown = "" if size is None else f"{size:.1e}" if size else "0"
        table.add_row(importer.title, importer.version, importer.interface, shown, outcome.verdict.value,
                      style=STYLES.get(outcome.verdict))  # fmt: skip
    console.print(table)
    for outcome in outcomes:
        if outcome.reason:
            console.print(f"{outcome.importer.name} {outcome.verdict.value}: {outcome.reason}", highlight=False)
        for line in outcome.log.strip().splitlines()[-15:]:
            console.print(f"    {line}", highlight=False, markup=False)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m interop", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME",
                        help=f"importer (see --list) or kit: {', '.join(KITS)}; what is named must run "
                             "(default: all that are installed)")  # fmt: skip
    parser.add_argument("--fmu", type=Path, metavar="FILE", help="FMU of the VideoRay (default: built for this)")
    parser.add_argument("--install", action="store_true", help="install the kits instead of running (Linux)")
    parser.add_argument("--list", action="store_true", help="list the importers instead of running them")
    parser.add_argument("--tools", type=Path, default=HERE / ".tools", metavar="FOLDER",
                        help="where the importers are installed (default: interop/.tools)")  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
