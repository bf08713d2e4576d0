"""A study: what the engine adds to the simulation alone, and whether many runs cost as much each as few."""

import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from rov_fmu.studies.engine import Progress, Spent
from rov_fmu.studies.model import read_model, unpack
from rov_fmu.studies.plan import load_plan
from rov_fmu.studies.prepared import prepare
from rov_fmu.studies.run import run_study
from rov_fmu.studies.simulator import Simulator

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
    """What a study took."""

    runs: int
    spent: Spent
    processor: float
    """Seconds of processor time of all processes, from when the workers were there."""
    growth: float
    """Bytes of all processes together, from a tenth of the runs to the end."""


class Study:
    """Runs of 30 s of the VideoRay, of which two outputs are kept each 0.1 s and three figures computed."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        self._fmu, self._folder = fmu, folder

    def pairs(self, runs: int, repetitions: int) -> Iterator[tuple[float, Cost]]:
        """In turn: seconds of processor time of the runs alone, in a loop here; the study with one worker."""
        for _ in range(repetitions):
            yield self._alone(runs), self.cost(runs, workers=1)

    def cost(self, runs: int, workers: int) -> Cost:
        """Of a study from its beginning."""
        seen: list[tuple[float, int]] = []
        later: list[int] = []

        def see(now: Progress) -> None:
            seen.append(_used())
            if 10 * now.done >= now.total:
                later.append(seen[-1][1])

        with tempfile.TemporaryDirectory(dir=self._folder) as results:
            spent, _ = run_study(self._plan(runs), Path(results, "results"), workers, None, see)
        return Cost(runs, spent, seen[-1][0] - seen[0][0], later[-1] - later[0])

    def _alone(self, runs: int) -> float:
        path = self._plan(runs)
        plan, model = load_plan(path), read_model(self._fmu)
        prepared = prepare(plan, path, model)
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            description = unpack(model.content, Path(folder))
            simulator = Simulator(folder, description, model, prepared.job.manoeuvre)
            rows = prepared.design.rows(0, runs)
            start = time.process_time()
            for values in rows:
                simulator.run(values)
                simulator.reset()
            taken = time.process_time() - start
            simulator.free()
        return taken

    def _plan(self, runs: int) -> Path:
        path = self._folder / "plan.toml"
        path.write_text(_PLAN.format(fmu=self._fmu.as_posix(), stop=STOP, step=STEP, runs=runs))
        return path


def overhead(pairs: Iterable[tuple[float, Cost]]) -> float:
    """Of the engine, by the simulation alone: the median of the pairs."""
    return float(np.median([cost.processor / alone - 1.0 for alone, cost in pairs]))


def _used() -> tuple[float, int]:
    """Processor time (s) and resident memory (bytes) of this process and those that it has started."""
    here = psutil.Process()
    both = [(process.cpu_times(), process.memory_info()) for process in (here, *here.children(recursive=True))]
    return sum(cpu.user + cpu.system for cpu, _ in both), sum(memory.rss for _, memory in both)
