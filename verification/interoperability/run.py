"""Run each importer in its own folder, and compare its result with the reference."""

import os
import re
import shutil
import signal
import tempfile
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path

from rov_fmu.build import build_fmu
from rov_fmu.vehicle.vehicle import load_vehicle
from verification.checkouts import ROOT
from verification.references.limited import run_limited

from .importers import Importer
from .manoeuvre import VEHICLES, Manoeuvre, ResultError

TIMEOUT = 300.0
"""Seconds for one importer; the slowest takes 5."""


class Verdict(Enum):
    """The verdict on an importer."""

    AGREES = "agrees"
    NO_FINDING = "no finding"
    DIFFERS = "differs"
    FAILED = "failed"
    NOT_RUN = "not run"

    @property
    def is_good(self) -> bool:
        """True when the importer ran and agrees or found nothing."""
        return self in {Verdict.AGREES, Verdict.NO_FINDING}


@dataclass(frozen=True)
class Outcome:
    """One cell of the table."""

    importer: Importer
    vehicle: str
    verdict: Verdict
    difference: float | None = None
    reason: str = ""
    log: str = ""


def fmu_for_host(vehicle: str, fmi: int, folder: Path) -> Path:
    """Build the FMU of a vehicle, for this machine. Raises BuildError."""
    return build_fmu(load_vehicle(VEHICLES[vehicle]), folder / f"{vehicle}{fmi}.fmu", platforms=["host"], fmi=fmi).path


def run(importer: Importer, fmu: Path, tools: Path, manoeuvre: Manoeuvre) -> Outcome:
    """Let an importer fly the manoeuvre, or check the FMU."""
    outcome = partial(Outcome, importer, manoeuvre.vehicle)
    if reason := obstacle(importer, tools):
        return outcome(Verdict.NOT_RUN, reason=reason)
    with tempfile.TemporaryDirectory(prefix="interop-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        shutil.copy(fmu, folder / "rov.fmu")
        manoeuvre.write_files(folder)
        code, log = _call(importer, folder, tools)
        log = without_places(log, folder, tools)
        if code != 0:
            return outcome(Verdict.FAILED, reason=code_name(code), log=log)
        if (tolerance := importer.tolerance_for(manoeuvre.rov.layout)) is None:
            return outcome(Verdict.NO_FINDING)
        try:
            results = sorted(folder.glob("result*.csv")) or [folder / "result.csv"]
            largest = max(map(manoeuvre.difference, results))
        except ResultError as error:
            return outcome(Verdict.FAILED, reason=str(error), log=log)
    verdict = Verdict.AGREES if largest <= tolerance else Verdict.DIFFERS
    return outcome(verdict, largest)


def obstacle(importer: Importer, tools: Path) -> str:
    """Return the reason why an importer cannot run, or an empty text."""
    if not importer.is_installed(tools):
        return f"python -m verification.interoperability --install {importer.kit}"
    missing = [name for name in (importer.command[0], *importer.needs) if "{" not in name and not shutil.which(name)]
    return f"there is no {missing[0]}" if missing else ""


def code_name(code: int) -> str:
    """Return an exit code in words."""
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name


def without_places(text: str, folder: Path, tools: Path) -> str:
    """Return a log without the folders of this machine and the hosts of packages."""
    for path, name in ((folder, "."), (tools, "tools"), (ROOT, "."), (Path.home(), "~")):
        if path.name:  # not the root
            text = text.replace(str(path), name)
    return re.sub(r"(\w+://)[^\s/]+", r"\1...", text)


def _call(importer: Importer, folder: Path, tools: Path) -> tuple[int, str]:
    """Run an importer; return its exit code and its log."""
    temporary = folder / "tmp"  # several importers leave the unzipped FMU behind
    temporary.mkdir()
    bins = [tools / "python" / "bin", *sorted(tools.glob("rust/*/bin"))]
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([*map(str, bins), os.environ.get("PATH", "")]),
        "PYTHONPATH": str(ROOT),
        "TMPDIR": str(temporary),
        "LD_LIBRARY_PATH": str(tools / "python" / "lib"),  # TBB for Ecos
    }
    code, log = run_limited(importer.command_line(tools), folder, environment, TIMEOUT)
    return -signal.SIGKILL if code is None else code, log
