"""python -m verification.fuzzing: random calls of the FMI functions under sanitizers, and damaged logs."""

import shutil
import sys
import tempfile
import time
from base64 import b64encode
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import product
from os import cpu_count
from pathlib import Path

import click

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.bridges.autopilot.fmu import autopilot_model
from rov_fmu.c.compile import BuildError
from rov_fmu.fmu.content import native_content
from rov_fmu.io.messages import FileError
from rov_fmu.process import exit_code
from rov_fmu.report.console import console, table
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle, without_surface
from verification.references.vehicles import THRUST

from .campaign import Counts, FindingError, build_target, fuzz, pack_corpus, replay, unpack_corpus
from .logs import try_damaged

_PROGRAM = "python -m verification.fuzzing"
_ROUND = 60  # s
VEHICLES = {
    "bluerov2_heavy": SHIPPED["bluerov2_heavy"],
    "videoray": VIDEORAY,
    "thrust": THRUST,
    "bare": Path(__file__).with_name("bare.toml"),
}
"""The vehicles: one with six axes, lag, reverse thrust and dead band; the default; one with all that thrust can depend
on; and the smallest possible one."""
AUTOPILOTS = {f"{name}_autopilot": VEHICLES[name] for name in ("bluerov2_heavy", "videoray")}
"""The autopilots, with their vehicles: one that holds all six axes, and one without roll and pitch."""

EVERY = {"bluerov2_heavy": 20, "thrust": 4}
"""The vehicles that begin with every n-th input of the corpus, because their steps are slow under the sanitizers."""


def _positive(text: str) -> int:
    with suppress(ValueError, OverflowError):
        if (number := int(float(text))) >= 1:
            return number
    raise click.BadParameter(f"{text} is not a number from 1 on")


@click.command()
@click.argument("inputs", nargs=-1, type=click.Path(path_type=Path))
@click.option("--calls", type=_positive, metavar="N", help="Go on until so many calls were made, e.g. 1e8.")
@click.option("--seconds", type=_positive, metavar="N", help="Go on for so long; without either, a minute.")
@click.option(
    "--jobs", type=_positive, metavar="N", default=cpu_count() or 1, help="Processes (default: one a processor)."
)
@click.option(
    "--vehicle", "chosen", type=click.Choice([*VEHICLES, *AUTOPILOTS]), help="Only this one (default: all in turn)."
)
@click.option("--fmi", type=click.Choice(["2", "3"]), help="Only this version of FMI (default: both in turn).")
@click.option("--sample", is_flag=True, help="Each of them with one version of FMI in turn, for half of the compiling.")
@click.option("--logs", type=_positive, metavar="N", help="Read N damaged copies of each of INPUTS, logs or tables.")
@click.option("--keep", is_flag=True, help="Put what led to new places into the corpus.")
def _command(
    inputs: tuple[Path, ...],
    calls: int | None,
    seconds: int | None,
    jobs: int,
    chosen: str | None,
    fmi: str | None,
    sample: bool,
    logs: int | None,
    keep: bool,
) -> None:
    """Turn random bytes into calls of the FMI functions on several instances, and look after each call whether it kept
    its promises, under AddressSanitizer and UndefinedBehaviorSanitizer (clang).

    INPUTS, where there are any, are run once instead. With --logs, they are logs or tables, which are damaged and read.
    """
    if missing := [path for path in inputs if not path.exists()]:
        raise FileError(f"{missing[0]}: there is no such file")
    if logs:
        _try_logs(inputs, logs)
        return
    with tempfile.TemporaryDirectory(prefix="fuzz-", ignore_cleanup_errors=True) as name:
        corpus = Path(name) / "corpus"
        pairs = [*product([chosen] if chosen else [*VEHICLES, *AUTOPILOTS], [int(fmi)] if fmi else (2, 3))]
        if sample:
            pairs = [pair for n, pair in enumerate(pairs) if n % 4 in (0, 3)]
        targets = {(vehicle, version): Path(name) / f"{vehicle}{version}" for vehicle, version in pairs}
        with ThreadPoolExecutor(jobs) as pool:  # each thread waits for a compiler
            list(pool.map(_build, targets, targets.values()))
        unpack_corpus(corpus)
        corpora = {vehicle: corpus.with_name(f"corpus of {vehicle}") for vehicle in EVERY}
        for vehicle, folder in corpora.items():
            unpack_corpus(folder, EVERY[vehicle])
        limit, share = seconds or (None if calls else _ROUND), len(targets)
        for (vehicle, version), target in targets.items():
            what = f"{vehicle}, FMI {version}.0"
            try:
                if inputs:
                    print(f"{what}: {replay(target, inputs, Path(name)).total():,} calls, nothing found")
                    continue
                counts = _campaign(
                    target,
                    corpora.get(vehicle, corpus),
                    jobs,
                    calls and calls // share,
                    limit and max(1, limit // share),
                )
                _print_counts(what, *counts)
            except FindingError as finding:
                again = [_keep(f"{_PROGRAM} --vehicle {vehicle} --fmi {version}", found) for found in finding.inputs]
                raise FindingError("\n".join([f"{what}: {finding}", *again])) from None
        if keep and not inputs:
            print(f"the corpus now has {pack_corpus(list(targets.values()), corpus)} inputs")


def _try_logs(inputs: Sequence[Path], count: int) -> None:
    """Read damaged copies of logs and tables, and print what became of them."""
    result = table(f"{count} damaged copies of each", "file", ("read", "refused", "longest [s]", "largest [GB]"))
    for path in inputs:
        with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
            try:
                tried = try_damaged(path, range(count), Path(name))
            except FindingError as finding:
                again = [_keep("rov-fmu inspect", one) for one in finding.inputs]
                raise FindingError("\n".join([str(finding), *again])) from None
        seconds, memory = f"{tried.seconds:.1f}", f"{tried.memory / 1e9:.2f}"
        result.add_row(path.name, str(tried.read), str(tried.refused), seconds, memory)
    console().print(result)


def _build(pair: tuple[str, int], target: Path) -> None:
    vehicle, version = pair
    build_target(sources_of(vehicle, version), target, version)


def sources_of(name: str, fmi: int) -> dict[str, str]:
    """Return the C of the FMU of a vehicle or of an autopilot, which then has Model Exchange, too."""
    deep = without_surface(load_vehicle((VEHICLES | AUTOPILOTS)[name]))  # the laws are those of a vehicle under water
    subject = autopilot_model(autopilot_of(deep)) if name in AUTOPILOTS else deep
    return dict(native_content(subject, fmi=fmi).sources)


def _keep(command: str, found: Path) -> str:
    """Copy an input to this folder, and return its content as text, because the log may outlive the machine."""
    copy = shutil.copy(found, ".")
    content = b64encode(found.read_bytes()).decode()
    return f"again with: {command} {copy}, in base64:\n{content}"


def _campaign(target: Path, corpus: Path, jobs: int, calls: int | None, seconds: int | None) -> tuple[Counts, float]:
    total, start, spent = Counts(), time.monotonic(), 0.0
    while True:
        length = _ROUND if seconds is None else max(1, min(_ROUND, round(seconds - spent)))
        total.update(fuzz(target, corpus, corpus.parent, length, jobs))
        spent = time.monotonic() - start
        print(f"{spent:6.0f} s {total.total():15,} calls, nothing found", flush=True)
        if (seconds is not None and spent >= seconds - 0.5) or (calls and total.total() >= calls):
            return total, spent


def _print_counts(what: str, counts: Counts, seconds: float) -> None:
    title = f"{what}: {counts.total():,} calls in {seconds:.0f} s, nothing found"
    result = table(title, "function", ("accepted", "refused"))
    for name in dict.fromkeys(name for name, _ in counts):
        result.add_row(name, f"{counts[name, True]:,}", f"{counts[name, False]:,}")
    console().print(result)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 nothing was found, 1 a finding, 2 bad input, 130 interrupted."""
    codes = {FindingError: 1, FileError: 2, BuildError: 2, OSError: 2, click.ClickException: 2}
    return exit_code("fuzz", lambda: _command(arguments, _PROGRAM, standalone_mode=False), codes)


if __name__ == "__main__":
    sys.exit(main())
