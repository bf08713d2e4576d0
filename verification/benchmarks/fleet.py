"""Many instances, and many runs of one: in plain C and through FMPy, on one core."""

import time
from dataclasses import dataclass

import numpy as np
from fmpy.fmi2 import FMU2Slave

from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle

from .importer import restart
from .plain_c import PlainC, Reals
from .work import Work

INSTANCES = (1, 100, 10_000)
_HOLD, _COMMANDS = 10.0, 10
_STEPS, _CHECKED = 200_000, 10


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
        self.work = Work(rov, False, _HOLD, _COMMANDS, 1)
        declared = {variable.name: variable.value_reference for variable in variables(rov)}
        self.references, self.inputs, self.outputs = (
            [declared[name] for name in names] for names in (self.parameters, layout.commands, layout.state)
        )

    def error(self, ends: Reals) -> float:
        """Return the largest difference of the first runs from the step in Python.

        The engine is no reference here, because it uses the C that is measured.
        """
        exact = []
        for values in self.values[:_CHECKED].tolist():
            rov = self.rov.replaced(dict(zip(self.parameters, values, strict=True)))
            state = dict.fromkeys(rov.layout.state, 0.0)
            for command in self.work.sequence:
                state = rov.step(command, state, _HOLD)
            exact.append(list(state.values()))
        return float(np.abs(ends[:_CHECKED] - exact).max())


def instances(plain_c: PlainC, repetitions: int) -> Reals:
    """Return, for each number in INSTANCES, the median seconds per step of 10 ms and the bytes per instance."""
    return np.median([[plain_c.step_in_turn(n, _STEPS) for n in INSTANCES] for _ in range(repetitions)], axis=0)


def in_c(plain_c: PlainC, variations: Variations, repetitions: int) -> Runs:
    """Measure the runs in C, a part of them in each repetition."""
    shares = np.array_split(variations.values, repetitions)
    found = [plain_c.run_each(variations.references, share, variations.work.array) for share in shares]
    rates = [len(share) / seconds for share, (seconds, _) in zip(shares, found, strict=True)]
    error = variations.error(np.concatenate([ends for _, ends in found]))
    return Runs(len(variations.values), float(np.median(rates)), error)


def through_fmpy(slave: FMU2Slave, variations: Variations, runs: int, repetitions: int) -> Runs:
    """Measure the first runs through FMPy's functions."""
    seconds: list[float] = []
    for _ in range(repetitions):
        ends = []
        start = time.process_time()
        for values in variations.values[:runs].tolist():
            restart(slave, variations.references, values)
            for n, command in enumerate(variations.work.array.tolist()):
                slave.setReal(variations.inputs, command)
                slave.doStep(currentCommunicationPoint=n * _HOLD, communicationStepSize=_HOLD)
            ends.append(slave.getReal(variations.outputs))
        seconds.append(time.process_time() - start)
    return Runs(runs, runs / float(np.median(seconds)), variations.error(np.array(ends)))
