"""A manoeuvre of 100 s through FMPy: the native FMU, the flavour of PythonFMU, and Model Exchange with CVode."""

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from verification.references.fmpy_slave import fmpy_slave, keep_loaded

from .plain_c import Reals
from .work import Work, flight

STOP, INTERVAL = 100.0, 0.01
NATIVE, PYTHONFMU, MODEL_EXCHANGE = "native", "PythonFMU flavour", "Model Exchange, CVode 1e-6"
_OPTIONS: dict[str, dict[str, Any]] = {
    NATIVE: {"fmi_type": "CoSimulation"},
    PYTHONFMU: {"fmi_type": "CoSimulation"},
    MODEL_EXCHANGE: {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": 1e-6},
}


def restart(slave: FMU2Slave, references: Sequence[int] = (), values: Sequence[float] = ()) -> None:
    """Reset an instance, set parameters, and initialize it."""
    slave.reset()
    slave.setupExperiment(startTime=0.0)
    slave.setReal(references, values)
    slave.enterInitializationMode()
    slave.exitInitializationMode()


def simulate(folders: Mapping[str, Path], manoeuvre: Work, repetitions: int) -> dict[str, tuple[Reals, float]]:
    """Simulate the extracted FMUs in turn: commands that change every second, the state recorded every 10 ms.

    Return the seconds of processor time in each repetition, and the largest error of a state at the end (SI units).
    """
    keep_loaded(folders[PYTHONFMU])
    end = flight(manoeuvre.rov, manoeuvre.sequence, manoeuvre.hold)[-1]
    # FMPy needs two rows at each change.
    rows = [((n + k) * manoeuvre.hold, *c.values()) for n, c in enumerate(manoeuvre.sequence) for k in (0, 1)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in manoeuvre.rov.layout.inputs)])
    seconds, errors = defaultdict(list), {}
    for _ in range(repetitions):
        for name, options in _OPTIONS.items():
            folder = str(folders.get(name, folders[NATIVE]))
            description = fmpy.read_model_description(folder)
            start = time.process_time()
            result = fmpy.simulate_fmu(
                folder,
                stop_time=STOP,
                output_interval=INTERVAL,
                input=signals,
                output=list(end),
                validate=False,
                model_description=description,
                **options,
            )
            seconds[name].append(time.process_time() - start)
            errors[name] = float(max(abs(result[n][-1] - value) for n, value in end.items()))
    return {name: (np.array(times), errors[name]) for name, times in seconds.items()}


def step_through(folders: Mapping[str, Path], manoeuvre: Work, repetitions: int) -> dict[str, Reals]:
    """Return the seconds of processor time in each repetition when only the functions of a step are called."""
    slaves = {name: fmpy_slave(folder) for name, folder in folders.items()}
    seconds, rows = defaultdict(list), manoeuvre.array.tolist()
    # Both FMUs have the same value references.
    description = fmpy.read_model_description(str(folders[NATIVE]))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    commands, velocities = ([references[name] for name in names] for names in (manoeuvre.names, ("u", "w", "r")))
    for _ in range(repetitions):
        for name, slave in slaves.items():
            restart(slave)
            start = time.process_time()
            for n in range(round(STOP / INTERVAL)):
                command = rows[int(n * INTERVAL / manoeuvre.hold)]
                slave.setReal(commands, command)
                slave.doStep(currentCommunicationPoint=n * INTERVAL, communicationStepSize=INTERVAL)
                slave.getReal(velocities)
            seconds[name].append(time.process_time() - start)
    for slave in slaves.values():
        slave.freeInstance()
    return {name: np.array(times) for name, times in seconds.items()}
