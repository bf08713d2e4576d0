"""Ten thousand instances, a million steps, a thousand loads: as good as the first, and memory stays flat."""

import sys
from pathlib import Path

import pytest

from tests.fmi2 import Fmu
from verification.references.c_programs import compile_c, run_program

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is counted by glibc and /proc")

PROGRAM = Path(__file__).parent / "numbers.c"
ROUNDS = ("instances", "steps", "lives", "resets", "saves", "refusals", "loads")


@pytest.fixture(scope="module")
def program(videoray_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_c(PROGRAM, tmp_path_factory.mktemp("numbers") / "numbers", videoray_dir / "sources", "-ldl")


@pytest.fixture(
    scope="module",
    params=[(10_000, 1_000_000, 1_000), pytest.param((50_000, 5_000_000, 5_000), marks=pytest.mark.weekly)],
    ids="{0[0]} instances, {0[1]} steps, {0[2]} loads".format,
)
def numbers(request: pytest.FixtureRequest, program: Path, videoray_dir: Path) -> dict[str, float]:
    """What the program measured."""
    run = run_program(program, Fmu(videoray_dir).library, *map(str, request.param))
    assert run.code == 0, run.errors
    return {name: float(value) for name, value in run.lines}


def test_each_of_ten_thousand_instances_gets_what_it_gets_alone(numbers: dict[str, float]) -> None:
    assert numbers["different"] == 0


def test_an_instance_takes_at_most_one_kibibyte(numbers: dict[str, float]) -> None:
    assert 0 < numbers["bytes_of_an_instance"] <= 1024


@pytest.mark.parametrize("rounds", ROUNDS)
def test_memory_does_not_grow_after_the_first_round(numbers: dict[str, float], rounds: str) -> None:
    """Not by a byte that is allocated, not by a page of the process."""
    assert numbers[f"{rounds}.allocated"] == 0
    assert numbers[f"{rounds}.pages"] == 0
