"""Our steps have the accuracy that the benchmarks say, and the command prints all of them."""

import subprocess
import sys
from math import inf
from pathlib import Path

import pytest
from lxml import etree

from rov_fmu.vehicle.vehicle import Vehicle
from verification.benchmarks import taylor
from verification.benchmarks.jobs import Job, Measured
from verification.benchmarks.kalman import Case
from verification.benchmarks.plain_c import (
    CORE,
    FMU,
    FMU_3,
    FMU_3_SET,
    PlainC,
    measurable,
)
from verification.benchmarks.runs import Variations
from verification.benchmarks.work import Work
from verification.references import reference

ROOT = Path(__file__).parent.parent.parent
COMMANDS = 8
_OURS = (CORE, FMU, FMU_3, FMU_3_SET)

in_plain_c = pytest.mark.skipif(not measurable(), reason="the C programs are written for Linux on x86-64")


@pytest.fixture(scope="module")
def plain_c(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> PlainC:
    return PlainC(vehicle, tmp_path_factory.mktemp("plain C"))


class Small:
    """Our steps on a few commands, with and without reversals."""

    def __init__(self, vehicle: Vehicle, plain_c: PlainC) -> None:
        self.work = Work(vehicle, 1.0, COMMANDS, COMMANDS)
        self.long = Work(vehicle, 100.0, COMMANDS, 4)
        jobs = [self.ours(method, h) for method in _OURS for h in (0.01, 1.0, 100.0)]
        self.measured = Measured(plain_c, jobs, 2)

    def ours(self, method: str, h: float) -> Job:
        return Job(method, 1.0, self.long if h > 1.0 else self.work, h)


@pytest.fixture(scope="module")
def small(vehicle: Vehicle, plain_c: PlainC) -> Small:
    return Small(vehicle, plain_c)


@pytest.mark.long
@in_plain_c
def test_our_steps_are_exact_to_rounding(small: Small) -> None:
    assert small.measured.error(small.ours(FMU, 0.01)) < 1e-13
    assert small.measured.error(small.ours(FMU, 1.0)) < 1e-14


@pytest.mark.long
@in_plain_c
def test_our_long_steps_are_exact_to_rounding_of_the_way(small: Small) -> None:
    """In 100 s the vehicle turns by up to 480 rad. The reference says what scales each state: speed, path or turn."""
    names, work = list(small.long.rov.layout.state), small.long
    for start, command, end in zip(
        work.states, work.sequence, small.measured.ends[small.ours(FMU, 100.0)], strict=False
    ):
        exact = reference.step(work.rov, command, dict(zip(names, start.tolist(), strict=True)), work.hold)
        for name, value in zip(names, end, strict=True):
            assert abs(value - exact.state[name]) < 1e-14 * exact.scale[name], name


@pytest.mark.long
@in_plain_c
def test_the_step_without_fmi_is_that_of_the_fmu_of_either_version(small: Small) -> None:
    for h in (0.01, 1.0, 100.0):
        bare, *fmus = (small.measured.ends[small.ours(method, h)] for method in _OURS)
        assert fmus == [bare] * 3


@pytest.mark.long
@in_plain_c
def test_runs_with_other_parameters_end_where_the_model_does(vehicle: Vehicle, plain_c: PlainC) -> None:
    runs = Variations(vehicle, 20).in_c(plain_c, 2)
    assert runs.count == 20
    assert 0.0 < runs.rate < inf
    assert 0.0 < runs.error < 1e-11  # at 0 the C would be compared with itself


@pytest.mark.weekly
@in_plain_c
def test_one_command_prints_it_all(tmp_path: Path) -> None:
    picture = tmp_path / "cost_error.svg"
    command = [sys.executable, "-m", "verification.benchmarks", "--quick", "--picture", str(picture)]
    printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, encoding="utf-8").stdout
    parts = (
        "turning",
        "fmi3SetFloat64",
        "RK4",
        "memory of each",
        "A study by two workers",
        "MuJoCo with the plug-in",
    )
    for part in (*parts, "heyoka / ours" if taylor.installed() else taylor.NOT_INSTALLED[0]):
        assert part in printed, printed
    times_ours = next(line.split()[4] for line in printed.splitlines() if line.startswith("CVODE BDF  "))
    assert float(times_ours) > 10.0, printed
    assert etree.parse(str(picture)).getroot().tag.endswith("svg")


@pytest.mark.long
def test_the_filters_of_the_benchmark_have_the_same_innovations(vehicle: Vehicle) -> None:
    """The filter in C, in lanes and alone, and one that is written with NumPy."""
    case = Case(vehicle, held=2)
    lanes, alone, by_hand = case.ours(8)(), case.ours(1)(), case.by_hand()
    assert len(lanes) == 8
    for found in (*lanes, *alone):
        assert found == pytest.approx(by_hand[0], abs=1e-5)
