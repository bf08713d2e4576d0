"""Studies: their cost beyond the simulation alone, and the cost per run of few and many runs."""

import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from rov_fmu.study.plan.model import read_model
from rov_fmu.study.plan.plan import load_plan
from rov_fmu.study.plan.prepared import prepare
from rov_fmu.study.run.cluster import Progress
from rov_fmu.study.run.run_study import run_study
from rov_fmu.study.run.simulator import Simulator

STOP, STEP = 30.0, 0.1
_PLAN = """fmu = "{fmu}"
stop_time = {stop}
step = {step}
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


@dataclass(frozen=True)
class Cost:
    """The cost of runs, from the time at which the workers have started."""

    runs: int
    processor: float
    """Seconds of processor time of all processes that simulate."""
    clock: float
    """Seconds of elapsed time."""
    started: float = 0.0
    """Seconds until the workers had started."""
    growth: float = 0.0
    """The growth of the memory of all processes (bytes), from a tenth of the runs to the end."""


@dataclass(frozen=True)
class _Look:
    """The resources of the processes of a study at one time."""

    time: float
    workers: float
    """Processor time (s)."""
    memory: int
    """The memory of all processes (bytes)."""


class Study:
    """A study of the VideoRay with runs of 30 s, two outputs every 0.1 s and three figures."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        self._fmu, self._folder = fmu, folder

    def pairs(self, runs: int, repetitions: int) -> Iterator[tuple[Cost, Cost]]:
        """Yield the cost of the runs alone, in a loop in this process, and of the study with one worker."""
        for _ in range(repetitions):
            yield self._alone(runs), self.cost(runs, workers=1)

    def cost(self, runs: int, workers: int) -> Cost:
        """Return the cost of a study."""
        looks: list[_Look] = []
        later: list[int] = []

        def see(now: Progress) -> None:
            looks.append(_look())
            if 10 * now.done >= now.total:
                later.append(looks[-1].memory)

        with tempfile.TemporaryDirectory(dir=self._folder) as results:
            spent, _ = run_study(self._plan(runs), Path(results, "results"), workers, None, see)
        first, last = looks[0], looks[-1]
        clock = last.time - first.time
        return Cost(runs, last.workers - first.workers, clock, spent.started, later[-1] - later[0])

    def _alone(self, runs: int) -> Cost:
        """Return the cost of the same runs in a loop in this process."""
        path = self._plan(runs)
        plan, model = load_plan(path), read_model(self._fmu)
        prepared = prepare(plan, path, model)
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            description = model.unpack(Path(folder))
            simulator = Simulator(folder, description, prepared.job)
            rows = prepared.design.rows(0, runs)
            processor, clock = time.process_time(), time.perf_counter()
            for values in rows:
                simulator.run(values)
                simulator.reset()
            cost = Cost(runs, time.process_time() - processor, time.perf_counter() - clock)
            simulator.free()
        return cost

    def _plan(self, runs: int) -> Path:
        path = self._folder / "plan.toml"
        fmu = Path(shutil.copy(self._fmu, self._folder / "study.fmu"))
        path.write_text(_PLAN.format(fmu=fmu.name, stop=STOP, step=STEP, runs=runs))
        return path


def overhead(pairs: Iterable[tuple[Cost, Cost]], of: str) -> float:
    """Return the median relative cost that a study adds to the runs alone, for one field of their costs."""
    return float(np.median([getattr(by_one, of) / getattr(alone, of) - 1.0 for alone, by_one in pairs]))


def _look() -> _Look:
    here = psutil.Process()
    started = here.children(recursive=True)
    spent = [process.cpu_times() for process in started]
    memory = sum(process.memory_info().rss for process in (here, *started))
    return _Look(time.perf_counter(), sum(cpu.user + cpu.system for cpu in spent), memory)
