"""`rov-fmu prove --report`: every claim holds for the VideoRay, and fails for an FMU that breaks it."""

import hashlib
import re
import zipfile
from collections.abc import Callable, Mapping
from math import inf
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from lxml import html
from pythonfmu import FmuBuilder

from rov_fmu.build import build_fmu
from rov_fmu.cli import main
from rov_fmu.fmu.archive import FOLDER, META_DATA
from rov_fmu.interface.prove_command import CLAIMS_OF_VEHICLES, conservation
from rov_fmu.prove import measures
from rov_fmu.prove.claims import Proof, prove_claims
from rov_fmu.prove.measures import Evidence
from rov_fmu.prove.proof import _deviation
from rov_fmu.prove.subject import Subject, opened
from rov_fmu.report.proof_page import proof_page
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.commands import Capsys, make_key
from verification.references.vehicles import IDENTIFIED

Texts = Mapping[str, str]
Measure = Callable[[Subject], Evidence]


_SLAVE = """
import os, random, time
from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

class Slave(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.X_ext, self.u, self.noise = 0.0, 0.0, 1.0, random.random()
        parameter, output = Fmi2Causality.parameter, Fmi2Causality.output
        self.register_variable(Real("k", causality=parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Real("X_ext", causality=Fmi2Causality.input))
        self.register_variable(Real("u", causality=output, start=1.0, initial=Fmi2Initial.exact))
        self.register_variable(
            Real("der(u)", causality=output, getter=lambda: self.X_ext, setter=lambda _: None)
        )

    def do_step(self, t, h):
        STEP
        return True
"""
"""A body of 1 kg without drag. `STEP` is replaced by what it does in a step."""


def slave(step: str, folder: Path) -> Path:
    """Return an FMU that does this in a step."""
    (folder / "slave.py").write_text(_SLAVE.replace("STEP", step), encoding="utf-8")
    return Path(FmuBuilder.build_FMU(folder / "slave.py", dest=folder))


def altered(fmu: Path, changes: Mapping[str, Callable[[bytes], bytes]], path: Path) -> Path:
    """Write a copy of an FMU without hashes, in which some files are changed, and return its path."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(path, "w") as new:
        for name in {*old.namelist()} - {META_DATA}:
            content = old.read(name)
            new.writestr(name, changes[name](content) if name in changes else content)
    return path


def measured(measure: Measure, fmu: Path) -> Evidence:
    with opened(fmu) as subject:
        return measure(subject)


# ---- The VideoRay ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def progress() -> list[tuple[str, float]]:
    """What the proof told about its progress."""
    return []


@pytest.fixture(scope="module")
def proof(videoray_fmu: Path, progress: list[tuple[str, float]]) -> Proof:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(measures, "_COST_SECONDS", 0.1)
        return prove_claims(videoray_fmu, claims=CLAIMS_OF_VEHICLES, on_progress=lambda *told: progress.append(told))


def test_each_claim_begins_after_an_equal_share_of_the_proof(proof: Proof, progress: list[tuple[str, float]]) -> None:
    count = len(proof.evidence)
    assert progress == [(claim.name.lower(), n / count) for n, (claim, _) in enumerate(proof.evidence)]


def test_every_claim_that_applies_to_the_videoray_holds_and_its_page_loads_nothing(proof: Proof) -> None:
    assert [one.result for _, one in proof.evidence] == ["holds"] * 4 + ["measured", "holds"]
    figures = {claim.name: one.figure for claim, one in proof.evidence}
    assert float(figures["Expected results"]) < 1e-10
    assert float(figures["Step size"]) < 1e-14
    assert float(figures["Conservation"]) < 1e-14
    assert (figures["Repeatability"], figures["Limits"]) == ("100 of 100", "8 of 8")
    page = proof_page(proof)
    assert "default-src 'none'; style-src 'unsafe-inline'\"" in page
    assert "<script" not in page
    assert page.count("<svg") == 3
    assert "<li><b>0</b> fail</li>" in page, "a card without failures has no colour of failures"
    for claim, evidence in proof.evidence:
        assert claim.sentence in page
        assert f'<section class="claim {evidence.result.replace(" ", "-")}">' in page


QUESTIONS = tomlkit.parse(Path(__file__).with_name("ten_questions.toml").read_text("utf-8")).unwrap()["question"]
_YAW = "yaw: do not use. Two starts of the fit led to different vehicles."


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The signed FMU of an identified vehicle, whose file says that its yaw must not be used."""
    folder = tmp_path_factory.mktemp("identified")
    text = re.sub(r"yaw: good\.[^\"]*", _YAW, IDENTIFIED.read_text("utf-8"))
    (folder / "vehicle.toml").write_text(text, "utf-8")
    make_key(folder / "key")
    vehicle, path = load_vehicle(folder / "vehicle.toml"), folder / "harbour.fmu"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("rov_fmu.build.web_module", lambda _: b"")  # no question is about the page that flies
        return build_fmu(vehicle, path, platforms=["host"], sign=folder / "key").path


def _text(proof: Proof) -> str:
    """Return the words of the page of a proof."""
    root = html.fromstring(proof_page(proof))
    for drawn in root.xpath("//svg | //style"):
        drawn.drop_tree()
    return " ".join(" ".join(root.xpath("//body//text()")).split())


@pytest.mark.long
def test_the_page_answers_ten_questions(proof: Proof, identified: Path) -> None:
    """Of an FMU that must not be used for yaw it says so. That is no promise of the FMU, so nothing fails."""
    found = prove_claims(identified, claims=CLAIMS_OF_VEHICLES)
    assert found.digest == hashlib.sha256(identified.read_bytes()).hexdigest()
    results = [one.result for _, one in found.evidence]
    assert results == [*["holds"] * 4, "measured", "holds"]
    pages = {"videoray": _text(proof), "identified": _text(found)}
    assert f"Warning {_YAW} 5 hold Expected results" in pages["identified"], "on the first screen"
    assert len(QUESTIONS) == 10
    for question in QUESTIONS:
        assert question["page"] in pages[question["of"]], question["question"]


@pytest.mark.long
def test_a_vehicle_with_coupling_and_lag_keeps_its_energy(everything_dir: Path, six_dir: Path, tmp_path: Path) -> None:
    for folder in (everything_dir, six_dir):
        with zipfile.ZipFile(tmp_path / "vehicle.fmu", "w") as archive:
            for path in folder.rglob("*"):
                archive.write(path, path.relative_to(folder))
        found = measured(conservation, tmp_path / "vehicle.fmu")
        assert found.result == "holds", found.sentence


# ---- FMUs that break a claim -----------------------------------------------------------------------------------------


def test_an_altered_result_is_found(videoray_fmu: Path, tmp_path: Path) -> None:
    name = f"{FOLDER}/surge_70_tuned_expected.csv"
    fmu = altered(
        videoray_fmu, {name: lambda old: re.sub(rb"(\.\d\d\d)\d*\n$", rb"\g<1>1\n", old)}, tmp_path / "other.fmu"
    )
    found = measured(measures.expected, fmu)
    assert found.result == "fails"
    assert "18 of 19 results of 7" in found.sentence
    assert "Experiment surge_70_tuned: x deviates by" in found.sentence


def test_a_result_is_compared_by_lines_between_its_times_and_deviates_where_it_has_none() -> None:
    times = np.array([0.0, 1.0, 1.0, 2.0])
    values = [0.0, 1.0, 5.0, 7.0]
    assert _deviation(times, values, [0.0, 0.5, 1.0, 1.0, 1.5], [0.0, 0.5, 1.25, 5.0, 6.0]) == 0.25
    assert _deviation(times, values, [2.5], [8.0]) == inf


@pytest.mark.long
def test_an_answer_that_does_not_come_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "_WAIT", 1.0)
    step = "h == 0.0 and time.sleep(30.0); h < 0.0 and os.abort(); h > 1.0 and os._exit(3)"
    found = measured(measures.limits, slave(step, tmp_path))
    answers = {row[0]: row[2] for row in found.rows}
    assert answers["A step of 0 s"] == "it needs more than 1 s"
    assert answers["A step of −0.002 s"] == "it ended its process: SIGABRT"
    assert answers["A step past the stop time"] == "it ended its process: exit code 3"


# ---- Any FMU ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_strangers_fmu_that_ends_its_process_fails_the_claims_that_apply_and_gets_a_page(
    tmp_path: Path, capsys: Capsys
) -> None:
    page = tmp_path / "page.html"
    assert main(["prove", str(slave("os.abort()", tmp_path)), "--report", str(page)]) == 1
    out, err = capsys.readouterr()
    said = [line.split(": ", 2)[2] for line in err.splitlines() if " fails: " in line]
    failed = ("step size", "repeatability", "cost of a step")
    assert said == [f"{claim} fails: The FMU ended its process: SIGABRT" for claim in failed]
    text = page.read_text(encoding="utf-8")
    assert text.count("The FMU ended its process: SIGABRT.") == 3
    rows = dict(re.split("  +", line)[:2] for line in out.splitlines() if line.count("  ") > 1)
    none = [claim for claim, result in rows.items() if result == "does not apply"]
    assert none == ["expected results", "conservation"]
    assert rows["limits"] == "measured"
    assert "The FMU carries no expected results (FMI-LS-REF)." in text


def test_a_page_that_cannot_be_written_is_told_before_anything_runs(
    videoray_fmu: Path, tmp_path: Path, capsys: Capsys
) -> None:
    for target, reason in (
        (tmp_path, "cannot be written: is a folder, not a file to write"),
        (tmp_path / "page.csv", "would be a page (HTML), but .csv is the suffix of a recording or a table (CSV)"),
        (tmp_path / "none" / "page.html", f"cannot be written: there is no folder {tmp_path / 'none'}"),
        (videoray_fmu, f"cannot be written: would overwrite {videoray_fmu}, an input or another output"),
    ):
        assert main(["prove", str(videoray_fmu), "--report", str(target)]) == 2
        assert capsys.readouterr().err == f"rov-fmu: {target}: {reason}\n"
