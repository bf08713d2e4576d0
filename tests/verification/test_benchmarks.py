"""Every method of the benchmarks solves the same equations, with the accuracy that it should have."""

import subprocess
import sys
from math import inf, log2
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from lxml import etree

from rov_fmu.vehicle.vehicle import Vehicle
from verification.benchmarks import taylor
from verification.benchmarks.jobs import Job, Measured
from verification.benchmarks.kalman import Case
from verification.benchmarks.plain_c import (
    ADAMS,
    BDF,
    CORE,
    EULER,
    FMU,
    FMU_3,
    FMU_3_SET,
    HEYOKA,
    RK4,
    PlainC,
    measurable,
)
from verification.benchmarks.runs import Variations, instances
from verification.benchmarks.steps import Steps
from verification.benchmarks.work import Work
from verification.references import reference

ROOT = Path(__file__).parent.parent.parent
COMMANDS = 8
_OURS = (CORE, FMU, FMU_3, FMU_3_SET)
_CVODE = (ADAMS, BDF)
_TOLERANCES = (1e-6, 1e-9)

in_plain_c = pytest.mark.skipif(not measurable(), reason="the C programs are written for Linux on x86-64")


@pytest.fixture(scope="module")
def plain_c(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> PlainC:
    return PlainC(vehicle, tmp_path_factory.mktemp("plain C"))


class Small:
    """All methods on a few commands, with and without reversals."""

    def __init__(self, vehicle: Vehicle, plain_c: PlainC) -> None:
        self.work = Work(vehicle, 1.0, COMMANDS, COMMANDS)
        self.one_way = Work(vehicle, 1.0, COMMANDS, COMMANDS, one_way=True)
        self.long = Work(vehicle, 100.0, COMMANDS, 4)
        self.jobs = [
            *(self.ours(method, h) for method in _OURS for h in (0.01, 1.0, 100.0)),
            *(self.explicit(method, steps) for method in (EULER, RK4) for steps in (50, 100)),
            *(self.solver(method, tolerance) for method in _CVODE for tolerance in _TOLERANCES),
        ]
        self.measured = Measured(plain_c, self.jobs, 2)

    def ours(self, method: str, h: float) -> Job:
        return Job(method, 1.0, self.long if h > 1.0 else self.work, h)

    def explicit(self, method: str, steps: int) -> Job:
        return Job(method, float(steps), self.one_way, 1.0)

    def solver(self, method: str, tolerance: float) -> Job:
        return Job(method, tolerance, self.work, 1.0)


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
@pytest.mark.parametrize(("method", "order"), [(EULER, 1), (RK4, 4)])
def test_explicit_methods_are_of_their_order(small: Small, method: str, order: int) -> None:
    """Where nothing turns back; the drag's kink at rest costs RK4 an order."""
    coarse, fine = (small.measured.error(small.explicit(method, steps)) for steps in (50, 100))
    assert log2(coarse / fine) == pytest.approx(order, abs=0.25)


@pytest.mark.long
@in_plain_c
@pytest.mark.parametrize("method", _CVODE)
def test_cvode_keeps_near_its_tolerance(small: Small, method: str) -> None:
    for tolerance in _TOLERANCES:
        assert 0.1 * tolerance < small.measured.error(small.solver(method, tolerance)) < 300.0 * tolerance


@pytest.mark.long
@in_plain_c
def test_runs_with_other_parameters_end_where_the_model_does(vehicle: Vehicle, plain_c: PlainC) -> None:
    runs = Variations(vehicle, 20).in_c(plain_c, 2)
    assert runs.count == 20
    assert 0.0 < runs.rate < inf
    assert 0.0 < runs.error < 1e-11  # at 0 the C would be compared with itself


@pytest.mark.long
@in_plain_c
def test_many_instances_are_stepped_and_small(plain_c: PlainC) -> None:
    (_, *numbers), _, (_, *sizes) = instances(plain_c, 2)
    assert numbers == ["1", "100", "10,000"]
    assert all(0 < int(size.removesuffix(" B").replace(",", "")) < 4096 for size in sizes)


def test_cost_at_an_error_lies_between_the_settings() -> None:
    """On logarithmic axes, of the settings that are worth their cost."""
    found = {0: (1e-8, 1.0), 1: (1e-10, 100.0), 2: (1e-7, 7.0)}
    measured = SimpleNamespace(
        error=lambda job: found[job][0],
        seconds={job: np.array([cost, 2.0 * cost]) for job, (_, cost) in found.items()},
    )
    assert Measured.cost_at(cast(Any, measured), cast(Any, list(found)), 1e-9) == pytest.approx([10.0, 20.0])


@pytest.mark.long
@in_plain_c
def test_heyoka_solves_the_same_equations(vehicle: Vehicle, heavy: Vehicle, plain_c: PlainC) -> None:
    """To rounding, in steps of every length; its cost over ours stands in the last row."""
    pytest.importorskip("heyoka")
    table = Steps(vehicle, heavy, COMMANDS, COMMANDS).one_way
    measured = Measured(plain_c, [*table.jobs.values()], 2)
    for (method, h), job in table.jobs.items():
        assert measured.error(job) < (1e-11 if h > 1.0 else 1e-12), (method, h)
    *_, heyoka, ratios = table.section(measured)
    assert heyoka[0].startswith("heyoka, loop in C++")
    assert ratios[0] == "heyoka / ours"
    job, other = table.jobs[HEYOKA, 0.01], table.jobs[CORE, 0.01]
    assert float(ratios[2]) == pytest.approx(np.median(measured.seconds[job] / measured.seconds[other]), rel=0.01)


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


@pytest.mark.parametrize("cores", [1, 2])
def test_many_vehicles_are_measured_in_each_way(vehicle: Vehicle, cores: int) -> None:
    found = taylor.many_vehicles(vehicle, 1.0, 2, cores)
    ways = {taylor.OURS, taylor.LANES, taylor.TURNING, *(taylor.BATCHES if taylor.installed() else ())}
    assert {way: len(costs) for way, costs in found.seconds.items()} == dict.fromkeys(ways, 2)
    assert all(costs.min() > 0.0 for costs in found.seconds.values())
    headings, *rows = taylor.section(vehicle.name, [found])
    assert headings[1:] == ["1 s"]
    assert [row[0] for row in rows[:3]] == [taylor.OURS, taylor.LANES, taylor.TURNING]
    assert float(rows[-1][1]) == pytest.approx(found.ratio(taylor.LANES, [taylor.OURS]), rel=0.01)


@pytest.mark.skipif(not taylor.installed(), reason="heyoka is not installed")
@pytest.mark.parametrize("size", taylor.BATCHES.values())
def test_heyoka_takes_at_least_the_steps_that_were_asked_for(vehicle: Vehicle, size: int) -> None:
    commands, start = np.full((8, 3), 0.4), np.zeros((8, len(vehicle.layout.state)))
    seconds, taken, finite = taylor.Fleet(vehicle, commands, start).step(size, 0.01, 20)
    assert seconds > 0.0
    assert taken >= 1.0
    assert finite


@pytest.mark.long
def test_the_filters_of_the_benchmark_have_the_same_innovations(vehicle: Vehicle) -> None:
    """The filter in C, in lanes and alone, and one that is written with NumPy."""
    case = Case(vehicle, held=2)
    lanes, alone, by_hand = case.ours(8)(), case.ours(1)(), case.by_hand()
    assert len(lanes) == 8
    for found in (*lanes, *alone):
        assert found == pytest.approx(by_hand[0], abs=1e-5)
