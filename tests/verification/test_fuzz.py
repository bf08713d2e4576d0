"""The fuzzer's corpus finds nothing in the FMU's C, and it finds planted defects."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from rov_fmu.io.messages import FileError
from rov_fmu.io.toml_file import read_toml
from verification.fuzzing import __main__ as command
from verification.fuzzing.campaign import FindingError, build_target, fuzz, replay, unpack_corpus
from verification.references.c_programs import clang
from verification.references.legal import legal_modes

pytestmark = pytest.mark.skipif(clang() is None, reason="clang with its sanitizers is not installed")


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    unpack_corpus(tmp_path / "corpus")
    return tmp_path / "corpus"


NEVER = {2: {"fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"}, 3: set[str]()}
"""The legal calls that are refused, because no step is ever pending."""
MISSING = {
    2: {"fmi2CancelStep"},
    3: {
        "fmi3EnterConfigurationMode",
        "fmi3ExitConfigurationMode",
        "fmi3ActivateModelPartition",
        "fmi3GetNumberOfVariableDependencies",
        "fmi3GetVariableDependencies",
    },
}


@pytest.mark.parametrize("name", ["videoray", "videoray_autopilot"])
@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.weekly)])
def test_the_corpus_reaches_every_function(tmp_path: Path, corpus: Path, name: str, fmi: int) -> None:
    """And finds nothing. `python -m verification.fuzzing` begins with the corpus, for every vehicle and autopilot."""
    build_target(_sources(name, fmi), tmp_path / "target", fmi)
    counts = replay(tmp_path / "target", [corpus], tmp_path)
    # FMI 3.0 has one more kind of instances.
    legal = {name for kind in range(fmi) for name in legal_modes(kind, fmi)}
    assert {name for name, accepted in +counts if accepted} == legal - NEVER[fmi]
    assert {name for name, accepted in +counts if not accepted} == legal | MISSING[fmi]


@dataclass(frozen=True)
class Planted:
    """A defect of planted.toml, which explains the keys."""

    vehicle: str
    fmi: int
    file: str
    before: str
    after: str
    report: str

    @property
    def sources(self) -> dict[str, str]:
        """The sources of the FMU with the defect."""
        sources = _sources(self.vehicle, self.fmi)
        return sources | {self.file: sources[self.file].replace(self.before, self.after)}


@cache
def _sources(vehicle: str, fmi: int) -> dict[str, str]:
    return command.sources_of(vehicle, fmi)


_FILE = Path(__file__).with_name("planted.toml")
PLANTED = {name: Planted(**keys) for name, keys in read_toml(_FILE, FileError).items()}


def test_every_defect_has_a_place_to_be_planted() -> None:
    places = {name: _sources(p.vehicle, p.fmi)[p.file].count(p.before) for name, p in PLANTED.items()}
    assert [name for name, number in places.items() if number != 1] == []


@pytest.mark.weekly
@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_defect_is_found_within_a_minute(corpus: Path, tmp_path: Path, name: str) -> None:
    planted = PLANTED[name]
    build_target(planted.sources, tmp_path / "target", planted.fmi)
    with pytest.raises(FindingError) as found:
        fuzz(tmp_path / "target", corpus, tmp_path, seconds=60, jobs=2)
    assert re.search(planted.report, str(found.value))
    assert found.value.inputs
