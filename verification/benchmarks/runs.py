"""Many runs, as studies."""

import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import psutil

from rov_fmu.study.run import do_study

from .page import Section, duration

_PLAN = """fmu = "study.fmu"
stop_time = 30.0
step = 0.1
runs = {runs}
[inputs]
u_l.steps = [[0.0, 0.5], [10.0, 0.0]]
u_r.steps = [[0.0, 0.5], [10.0, 0.0]]
[vary]
alpha_u.normal = {{ mean = 1.1, sd = 0.1 }}
m_rov.uniform = [6.0, 7.0]
V_N.uniform = [0.0, 0.2]
[keep]
outputs = ["u", "x"]
[figures]
stopping_distance = "x[-1] - at(x, 10)"
V = "V_ss(u, 0, 10)"
T = "Tau(u, 0, 10)"
"""


def studies(fmu: Path, folder: Path, counts: Sequence[int]) -> Section:
    """Return the cost of studies of the VideoRay by two workers, from the time at which these have started."""
    shutil.copy(fmu, folder / "study.fmu")
    head = "A study by two workers: 30 s, two outputs each 0.1 s, three figures"
    return [[head, "a run", "on the clock"], *(_study(folder, runs) for runs in counts)]


def _study(folder: Path, runs: int) -> list[str]:
    looks: list[tuple[float, float]] = []
    plan = folder / "plan.toml"
    plan.write_text(_PLAN.format(runs=runs), encoding="utf-8")
    with tempfile.TemporaryDirectory(dir=folder) as results:
        do_study(plan, Path(results, "results"), lambda _: looks.append(_look()), workers=2)
    processor, clock = (last - first for first, last in zip(looks[0], looks[-1], strict=True))
    return [f"{runs:,} runs", duration(processor / runs), duration(clock)]


def _look() -> tuple[float, float]:
    """Return the processor time of all workers, and the time on the clock, s."""
    spent = [process.cpu_times() for process in psutil.Process().children(recursive=True)]
    return sum(cpu.user + cpu.system for cpu in spent), time.perf_counter()
