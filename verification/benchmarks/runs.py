"""Many instances, and many runs: in plain C, and as studies."""

import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from rov_fmu.fmu.variables import variables
from rov_fmu.study.run.run_study import do_study
from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, digits, duration, error
from .plain_c import PlainC, Reals
from .work import Work

INSTANCES = (1, 100, 10_000)
_HOLD, _COMMANDS = 10.0, 10
_STEPS, _CHECKED = 200_000, 10


def instances(plain_c: PlainC, repetitions: int) -> Section:
    """Return the cost of a step of 10 ms with many instances, which are stepped in turn, and their memory."""
    found = np.median([[plain_c.step_in_turn(n, _STEPS) for n in INSTANCES] for _ in range(repetitions)], axis=0)
    return [
        ["Instances in turn, straight and down", *(f"{n:,}" for n in INSTANCES)],
        ["a step of 10 ms", *map(duration, found[:, 0])],
        ["memory of each", *(f"{memory:,.0f} B" for memory in found[:, 1])],
    ]


# ---- Variations ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Runs:
    """The number of runs, the median of runs per second, and the largest error of the first runs (SI units)."""

    count: int
    rate: float
    error: float


class Variations:
    """Runs of 100 s with ten commands of 10 s. Each has its own α and β, within 30 % of the vehicle's."""

    def __init__(self, rov: Vehicle, count: int) -> None:
        self.rov, layout = rov, rov.layout
        self.parameters = [*layout.tuning]
        self.values = np.random.default_rng(1).uniform(0.7, 1.3, (count, len(self.parameters)))
        self.values *= [rov[name] for name in self.parameters]
        self.work = Work(rov, _HOLD, _COMMANDS, 1)
        declared = {variable.name: variable.value_reference for variable in variables(rov)}
        self.references = [declared[name] for name in self.parameters]

    def in_c(self, plain_c: PlainC, repetitions: int) -> Runs:
        """Measure the runs in C, a part of them in each repetition."""
        shares = np.array_split(self.values, repetitions)
        found = [plain_c.run_each(self.references, share, self.work.array) for share in shares]
        rates = [len(share) / seconds for share, (seconds, _) in zip(shares, found, strict=True)]
        return Runs(len(self.values), float(np.median(rates)), self._error(np.concatenate([ends for _, ends in found])))

    def _error(self, ends: Reals) -> float:
        """Return the largest difference of the first runs from the step in Python.

        The engine is no reference here, because it uses the C that is measured.
        """
        exact = []
        for values in self.values[:_CHECKED].tolist():
            rov = self.rov.with_(**dict(zip(self.parameters, values, strict=True)))
            state = dict.fromkeys(rov.layout.state, 0.0)
            for command in self.work.sequence:
                state = rov.step(command, state, _HOLD)
            exact.append(list(state.values()))
        return float(np.abs(ends[:_CHECKED] - exact).max())


def variations(runs: Runs) -> Section:
    """Return the cost of runs with varied parameters."""
    cells = [f"{runs.count:,}", duration(1.0 / runs.rate), digits(runs.rate), error(runs.error)]
    return [["Variations of α and β, 100 s, turning", "runs", "a run", "runs a second", "error"], ["plain C", *cells]]


# ---- Studies ---------------------------------------------------------------------------------------------------------

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
    return [[head, "a run", "on the clock", "until it starts"], *(_study(folder, runs) for runs in counts)]


def _study(folder: Path, runs: int) -> list[str]:
    looks: list[tuple[float, float]] = []
    plan = folder / "plan.toml"
    plan.write_text(_PLAN.format(runs=runs), encoding="utf-8")
    with tempfile.TemporaryDirectory(dir=folder) as results:
        work = do_study(plan, Path(results, "results"), lambda _: looks.append(_look()), workers=2)
    processor, clock = (last - first for first, last in zip(looks[0], looks[-1], strict=True))
    return [f"{runs:,} runs", duration(processor / runs), duration(clock), duration(work.started)]


def _look() -> tuple[float, float]:
    """Return the processor time of all workers, and the time on the clock, s."""
    spent = [process.cpu_times() for process in psutil.Process().children(recursive=True)]
    return sum(cpu.user + cpu.system for cpu in spent), time.perf_counter()
