"""Independent importers agree with the step in Python, and the comparison notices when one does not."""

import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from tests.commands import ROOT
from tests.conftest import Made
from verification.interoperability.__main__ import main
from verification.interoperability.importers import EXACT, HERE, IMPORTERS, RUNNERS, Importer, pinned
from verification.interoperability.manoeuvre import MANOEUVRES
from verification.interoperability.run import Verdict, fmu_for_host, run

TOOLS = HERE / ".tools"
SIMPLE = MANOEUVRES["videoray"]


# ---- The comparison --------------------------------------------------------------------------------------------------


def write_result(path: Path, rows: list[dict[str, float]]) -> Path:
    pd.DataFrame(rows).to_csv(path, index=False)
    return path


def test_difference_is_noticed(tmp_path: Path) -> None:
    for name in SIMPLE.outputs:
        rows = [*SIMPLE.reference]
        rows[-1] = rows[-1] | {name: rows[-1][name] + 1e-6}
        assert SIMPLE.difference(write_result(tmp_path / "result.csv", rows)) == pytest.approx(1e-6), name


# ---- The command -----------------------------------------------------------------------------------------------------

PRETEND = Importer(
    "pretend", "Pretend", "CS", "python", "fmpy", "pretend", "requirements.txt", "pretend", ("{python}", "-c", "pass")
)
COPY = "import shutil; shutil.copy({source!r}, 'result.csv')"


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "pretend").touch()
    return tmp_path / "tools"


@pytest.mark.parametrize(
    ("program", "tolerance", "verdict"),
    [
        ("agree", EXACT, Verdict.AGREES),
        ("differ", EXACT, Verdict.DIFFERS),
        ("pass", None, Verdict.NO_FINDING),
        ("raise SystemExit(3)", None, Verdict.FAILED),
    ],
)
def test_verdict(
    tmp_path: Path,
    tools: Path,
    monkeypatch: pytest.MonkeyPatch,
    program: str,
    tolerance: float | None,
    verdict: Verdict,
) -> None:
    rows = [*SIMPLE.reference]
    if program == "differ":
        rows[200] = rows[200] | {"w": rows[200]["w"] + 1e-7}
    if program in {"agree", "differ"}:
        program = COPY.format(source=str(write_result(tmp_path / "given.csv", rows)))
    fmu = tmp_path / "any.fmu"
    fmu.touch()
    importer = replace(PRETEND, command=("{python}", "-c", program), tolerance=tolerance)
    outcome = run(importer, fmu, tools, SIMPLE)
    assert outcome.verdict is verdict
    monkeypatch.setattr("verification.interoperability.importers.IMPORTERS", (importer,))
    arguments = ["--vehicle", "videoray", "--fmi", "2", "--fmu", str(fmu), "--tools", str(tools)]
    assert main(arguments) == (0 if verdict.is_good else 1)


# ---- The declarations ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("importer", IMPORTERS, ids=lambda importer: importer.name)
def test_importer_is_pinned_and_its_runner_is_there(importer: Importer) -> None:
    assert re.fullmatch(r"\d+(\.\d+)+(rc\d+)?", importer.version)
    for part in importer.command_line(TOOLS):
        if part.startswith("verification.interoperability."):
            assert (ROOT / Path(*part.split("."))).with_suffix(".py").is_file()
        elif part.startswith(str(RUNNERS)):
            assert Path(part).is_file()


@pytest.mark.parametrize("file", sorted(HERE.glob("requirements*.txt")), ids=lambda file: file.name)
def test_every_requirement_is_pinned(file: Path) -> None:
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    assert lines
    assert all(re.fullmatch(r"[\w-]+==[\d.]+(rc\d+)?( +#.*)?", line) for line in lines)
    with pytest.raises(LookupError):
        pinned("requirements.txt", "fmp")


def test_the_page_of_the_importers_has_all_of_them() -> None:
    """It is written by a run of all; an importer or a version that is new needs another run."""
    page = (ROOT / "docs" / "importers.md").read_text(encoding="utf-8")
    for importer in IMPORTERS:
        title, interface = re.escape(f"{importer.title} {importer.version}"), re.escape(importer.interface)
        row = rf"\| {title} \| [\d., ]+ \| {interface} \|"
        (found,) = re.findall(f"{row}.*", page)
        assert f"{importer.fmi}.0" in found
        assert not re.search("differs|failed|not run", found)


def test_the_readme_names_only_importers_that_were_run() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (named,) = re.findall(r"battery in ([\w, ]+) and\s\[other tools\]\(docs/importers.md\)", readme)
    assert {*named.split(", ")} <= {importer.title for importer in IMPORTERS}


def test_no_registry_is_named() -> None:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", str(HERE)]
    files = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert files
    known = {"maven.apache.org"}  # an XML name space
    for name in files:
        hosts = set(re.findall(r"\w+://([^/\s\"']+)", (ROOT / name).read_text()))
        assert Path(name).name != "Cargo.lock"
        assert hosts <= known, name


# ---- The matrix ------------------------------------------------------------------------------------------------------


@pytest.fixture
def fmu(made_once: Made) -> Callable[[str, int], Path]:
    """Return a function that builds the FMU of a vehicle for a version of FMI, once in a run."""

    def built(vehicle: str, fmi: int) -> Path:
        folder = made_once(f"{vehicle} für FMI {fmi}", partial(fmu_for_host, vehicle, fmi))
        return folder / f"{vehicle}{fmi}.fmu"

    return built


HARDEST = ("every_option", "bluerov2_heavy")
"""The vehicles of the run on every change: an importer flies the first of these that it can. weekly.yml flies all."""


@pytest.mark.interop
@pytest.mark.parametrize("importer", IMPORTERS, ids=lambda importer: importer.name)
def test_importer(importer: Importer, fmu: Callable[[str, int], Path]) -> None:
    manoeuvre = next(m for name in HARDEST if importer.suits((m := MANOEUVRES[name]).rov.layout))
    outcome = run(importer, fmu(manoeuvre.vehicle, importer.fmi), TOOLS, manoeuvre)
    if outcome.verdict is Verdict.NOT_RUN:
        pytest.skip(outcome.reason)
    assert outcome.verdict.is_good, f"{outcome.reason} {outcome.difference} {outcome.log[-2000:]}"
