"""Thousands of instances and steps give the same results as the first ones, and memory does not grow."""

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
    params=[
        (2_000, 100_000, 100),
        pytest.param((10_000, 1_000_000, 1_000), marks=pytest.mark.long),
        pytest.param((50_000, 5_000_000, 5_000), marks=pytest.mark.weekly),
    ],
    ids="{0[0]} instances, {0[1]} steps, {0[2]} loads".format,
)
def numbers(request: pytest.FixtureRequest, program: Path, videoray_dir: Path) -> dict[str, float]:
    """The numbers that the program measured, by their names."""
    run = run_program(program, Fmu(videoray_dir).library, *map(str, request.param))
    assert run.code == 0, run.errors
    return {name: float(value) for name, value in run.lines}


def test_each_of_many_instances_computes_what_it_computes_alone(numbers: dict[str, float]) -> None:
    assert numbers["different"] == 0


def test_an_instance_takes_at_most_one_kibibyte(numbers: dict[str, float]) -> None:
    assert 0 < numbers["bytes_of_an_instance"] <= 1024


@pytest.mark.parametrize("rounds", ROUNDS)
def test_memory_does_not_grow_after_the_first_round(numbers: dict[str, float], rounds: str) -> None:
    """Neither the allocated bytes nor the pages of the process increase."""
    assert numbers[f"{rounds}.allocated"] == 0
    assert numbers[f"{rounds}.pages"] == 0
