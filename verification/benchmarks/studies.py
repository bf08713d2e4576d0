"""A study: what the engine adds to the simulation alone, and whether many runs cost as much each as few."""

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
    """What runs took, from when the workers were there."""

    runs: int
    processor: float
    """Seconds of processor time of the process that does the runs, or of all that do."""
    clock: float
    """Seconds."""
    started: float = 0.0
    """Seconds until the workers were there."""
    growth: float = 0.0
    """Bytes of all processes together, from a tenth of the runs to the end."""


@dataclass(frozen=True)
class _Look:
    """At the processes of a study."""

    time: float
    workers: float
    """Processor time, s."""
    memory: int
    """Of all, bytes."""


class Study:
    """Runs of 30 s of the VideoRay, of which two outputs are kept each 0.1 s and three figures computed."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        self._fmu, self._folder = fmu, folder

    def pairs(self, runs: int, repetitions: int) -> Iterator[tuple[Cost, Cost]]:
        """In turn: the runs alone, in a loop in this process; the study with one worker."""
        for _ in range(repetitions):
            yield self._alone(runs), self.cost(runs, workers=1)

    def cost(self, runs: int, workers: int) -> Cost:
        """Of a study from its beginning."""
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
        """By the same simulator."""
        path = self._plan(runs)
        plan, model = load_plan(path), read_model(self._fmu)
        prepared = prepare(plan, path, model)
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            description = model.unpack(Path(folder))
            simulator = Simulator(folder, description, model, prepared.job.manoeuvre)
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
    """What the engine adds to the runs alone, 0.1 is 10 %: the median over the pairs, of a field of their costs."""
    return float(np.median([getattr(by_one, of) / getattr(alone, of) - 1.0 for alone, by_one in pairs]))


def _look() -> _Look:
    here = psutil.Process()
    started = here.children(recursive=True)
    spent = [process.cpu_times() for process in started]
    memory = sum(process.memory_info().rss for process in (here, *started))
    return _Look(time.perf_counter(), sum(cpu.user + cpu.system for cpu in spent), memory)
