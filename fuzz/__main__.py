"""python -m fuzz: random calls of the FMI functions, under sanitizers, until there are enough of them."""

import argparse
import shutil
import tempfile
import time
from base64 import b64encode
from collections.abc import Sequence
from os import cpu_count
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rov_fmu.export.archive import native_content
from rov_fmu.export.compile import BuildError
from rov_fmu.files.messages import FileError
from rov_fmu.process import exit_code, run_process
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

from .campaign import Counts, FindingError, build_target, fuzz, pack_corpus, replay, unpack_corpus

_ROUND = 60  # s


def _positive(text: str) -> int:
    try:
        number = int(float(text))
    except (ValueError, OverflowError):
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 on")
    return number


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m fuzz",
        description="Turn random bytes into calls of the FMI functions on several instances, and look after each call "
        "whether it kept its promises, under AddressSanitizer and UndefinedBehaviorSanitizer (clang).",
    )
    parser.add_argument("inputs", nargs="*", type=Path, help="run these inputs once, instead of fuzzing")
    parser.add_argument("--calls", type=_positive, help="go on until so many calls were made, e.g. 1e8")
    parser.add_argument("--seconds", type=_positive, help="go on for so long; without either, a minute")
    parser.add_argument("--jobs", type=_positive, default=cpu_count() or 1, help="processes (default: one a processor)")
    parser.add_argument("--keep", action="store_true", help="put what led to new places into the corpus")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 nothing was found, 1 a finding, 2 bad input, 130 interrupted."""
    return exit_code("fuzz", lambda: _run(arguments), {FindingError: 1, FileError: 2, BuildError: 2, OSError: 2})


def _run(arguments: Sequence[str] | None) -> None:
    options = _parser().parse_args(arguments)
    if missing := [path for path in options.inputs if not path.exists()]:
        raise FileError(f"{missing[0]}: there is no such file")
    with tempfile.TemporaryDirectory(prefix="fuzz-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        target, corpus = folder / "target", folder / "corpus"
        build_target(native_content(load_vehicle(VIDEORAY)).sources, target)
        try:
            if options.inputs:
                print(f"{replay(target, options.inputs, folder).calls:,} calls, nothing found")
            else:
                unpack_corpus(corpus)
                _print_counts(*_campaign(target, corpus, folder, options))
        except FindingError as finding:
            raise FindingError("\n".join([str(finding), *map(_keep, finding.inputs)])) from None
        if options.keep and not options.inputs:
            print(f"the corpus now has {pack_corpus(target, corpus)} inputs")


def _keep(found: Path) -> str:
    """Copy an input here, and say what is in it: on a machine that is thrown away, what is printed is what is left."""
    copy = shutil.copy(found, ".")
    return f"again with: python -m fuzz {copy}, in base64:\n{b64encode(found.read_bytes()).decode()}"


def _campaign(target: Path, corpus: Path, folder: Path, options: argparse.Namespace) -> tuple[Counts, float]:
    total, start = Counts(), time.monotonic()
    limit = options.seconds or (None if options.calls else _ROUND)
    while True:
        spent = time.monotonic() - start
        length = _ROUND if limit is None else max(1, min(_ROUND, round(limit - spent)))
        total.include(fuzz(target, corpus, folder, length, options.jobs))
        spent = time.monotonic() - start
        print(f"{spent:6.0f} s {total.calls:15,} calls, nothing found", flush=True)
        if (limit is not None and spent >= limit - 0.5) or (options.calls and total.calls >= options.calls):
            return total, spent


def _print_counts(counts: Counts, seconds: float) -> None:
    table = Table(title=f"{counts.calls:,} calls in {seconds:.0f} s, nothing found", title_justify="left")
    table.add_column("function")
    table.add_column("accepted", justify="right")
    table.add_column("refused", justify="right")
    for name in counts.refused:
        table.add_row(name, f"{counts.accepted[name]:,}", f"{counts.refused[name]:,}")
    Console().print(table)


if __name__ == "__main__":
    run_process(main)
