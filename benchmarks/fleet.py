"""Many instances, and many runs of one: in plain C and through FMPy, on one core."""

import time
from collections import defaultdict
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from rov_fmu.export.interface import variables
from rov_fmu.motion.rov import COEFFICIENTS, Coefficients

from .plain_c import Programs
from .work import STATES, Work, flight

PARAMETERS = tuple(name for name, meta in COEFFICIENTS.items() if meta.tunable)
"""Those that vary: every α and β."""
_HOLD, _COMMANDS = 10.0, 10
_CHECKED = 10


@dataclass(frozen=True)
class Instances:
    """Medians for so many instances, stepped in turn: seconds a step of 10 ms, bytes of memory each."""

    seconds: float
    bytes: float


@dataclass(frozen=True)
class Runs:
    """How many, and how many a second, the median; the first ones' largest difference from models/dynamics.py (SI)."""

    count: int
    rate: float
    error: float


class Variations:
    """Runs of 100 s, ten commands of 10 s, each with another α and β: within 30 % of the vehicle's."""

    def __init__(self, k: Coefficients, count: int) -> None:
        self.coefficients = k
        self.values: NDArray[Any] = np.random.default_rng(1).uniform(0.7, 1.3, (count, len(PARAMETERS)))
        self.values *= [getattr(k, name) for name in PARAMETERS]
        self.commands = Work(k, False, _HOLD, _COMMANDS, 1).sequence
        declared = {variable.name: variable.value_reference for variable in variables(k)}
        self.references = [declared[name] for name in PARAMETERS]
        self.inputs = [declared[name] for name in ("u_l", "u_r", "u_t")]
        self.outputs = [declared[name] for name in STATES]

    def error(self, ends: list[list[float]]) -> float:
        """Of the first runs."""
        worst = 0.0
        for values, end in zip(self.values, ends, strict=False):
            k = replace(self.coefficients, **dict(zip(PARAMETERS, values.tolist(), strict=True)))
            state = astuple(flight(k, self.commands, _HOLD)[-1])
            worst = max([worst, *(abs(a - b) for a, b in zip(state, end, strict=True))])
        return worst


def in_c(programs: Programs, variations: Variations, repetitions: int) -> tuple[dict[int, Instances], Runs]:
    """Instances by their number, and the runs."""
    commands = [(c.u_l, c.u_r, c.u_t) for c in variations.commands]
    file = Path(programs.folder, "values")
    file.write_bytes(np.array(commands).tobytes() + variations.values.tobytes())
    references = ",".join(map(str, variations.references))
    instances: dict[int, list[tuple[float, float]]] = defaultdict(list)
    rates: list[float] = []
    ends: list[list[float]] = []
    for kind, *words in programs.run(["fleet.c"], str(repetitions), str(file), references):
        if kind == "instances":
            instances[int(words[0])].append((1e-9 * float(words[1]), float(words[2])))
        elif kind == "runs":
            rates.append(int(words[0]) / float(words[1]))
        else:
            ends.append([float.fromhex(word) for word in words])
    medians = {n: Instances(*np.median(found, axis=0).tolist()) for n, found in instances.items()}
    return medians, Runs(len(variations.values), float(np.median(rates)), variations.error(ends))


def through_fmpy(slave: FMU2Slave, variations: Variations, runs: int, repetitions: int) -> Runs:
    """The first runs of the same, function by function."""
    seconds: list[float] = []
    ends: list[list[float]] = []
    for _ in range(repetitions):
        ends.clear()
        start = time.process_time()
        for values in variations.values[:runs].tolist():
            slave.reset()
            slave.setupExperiment(startTime=0.0)
            slave.setReal(variations.references, values)
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            for n, command in enumerate(variations.commands):
                slave.setReal(variations.inputs, (command.u_l, command.u_r, command.u_t))
                slave.doStep(currentCommunicationPoint=n * _HOLD, communicationStepSize=_HOLD)
            ends.append(slave.getReal(variations.outputs))
        seconds.append(time.process_time() - start)
    return Runs(runs, runs / float(np.median(seconds)), variations.error(ends[:_CHECKED]))
