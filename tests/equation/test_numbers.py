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


@pytest.mark.parametrize(
    ("instances", "cycles", "loads"),
    [
        (2_000, 100_000, 100),
        pytest.param(10_000, 1_000_000, 1_000, marks=pytest.mark.long),
        pytest.param(50_000, 5_000_000, 5_000, marks=pytest.mark.weekly),
    ],
)
def test_many_instances_compute_what_each_computes_alone_and_memory_does_not_grow(
    program: Path, videoray_dir: Path, instances: int, cycles: int, loads: int
) -> None:
    """Neither the allocated bytes nor the pages of the process increase after the first round."""
    run = run_program(program, Fmu(videoray_dir).library, str(instances), str(cycles), str(loads))
    assert run.code == 0, run.errors
    numbers = {name: float(value) for name, value in run.lines}
    assert numbers["different"] == 0
    assert 0 < numbers["bytes_of_an_instance"] <= 1024
    growth = {name: numbers[name] for rounds in ROUNDS for name in (f"{rounds}.allocated", f"{rounds}.pages")}
    assert growth == dict.fromkeys(growth, 0.0)
