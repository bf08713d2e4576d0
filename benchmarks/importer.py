"""A manoeuvre of 100 s through FMPy: the native FMU, the flavour of PythonFMU, and Model Exchange with CVode."""

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from checks.fmi2 import fmpy_slave, keep_loaded
from rov_fmu.motion.rov import Inputs

from .work import STATES, Work, flight

STOP, INTERVAL = 100.0, 0.01
NATIVE, PYTHONFMU, MODEL_EXCHANGE = "native", "PythonFMU", "Model Exchange"
RELATIVE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Simulated:
    """Seconds of processor time in each repetition; the largest error of a state at the end (SI units)."""

    seconds: NDArray[Any]
    error: float


def simulate(folders: Mapping[str, Path], manoeuvre: Work, repetitions: int) -> dict[str, Simulated]:
    """Simulate the extracted FMUs in turn: commands that change every second, the state recorded every 10 ms."""
    end = astuple(flight(manoeuvre.coefficients, manoeuvre.sequence, manoeuvre.hold)[-1])
    keep_loaded(folders[PYTHONFMU])
    signals = _signals(manoeuvre.sequence, manoeuvre.hold)
    ways: dict[str, tuple[Path, dict[str, Any]]] = {
        NATIVE: (folders[NATIVE], {"fmi_type": "CoSimulation"}),
        PYTHONFMU: (folders[PYTHONFMU], {"fmi_type": "CoSimulation"}),
        MODEL_EXCHANGE: (
            folders[NATIVE],
            {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": RELATIVE_TOLERANCE},
        ),
    }
    seconds, errors = defaultdict(list), {}
    for _ in range(repetitions):
        for name, (folder, options) in ways.items():
            description = fmpy.read_model_description(str(folder))
            start = time.process_time()
            result = fmpy.simulate_fmu(
                str(folder), stop_time=STOP, output_interval=INTERVAL, input=signals, output=STATES, validate=False,
                model_description=description, **options,
            )  # fmt: skip
            seconds[name].append(time.process_time() - start)
            errors[name] = max(abs(result[n][-1] - value) for n, value in zip(STATES, end, strict=True))
    return {name: Simulated(np.array(times), float(errors[name])) for name, times in seconds.items()}


def step_through(folders: Mapping[str, Path], manoeuvre: Work, repetitions: int) -> dict[str, NDArray[Any]]:
    """Seconds of processor time in each repetition for the same, with nothing but the functions of a step."""
    keep_loaded(folders[PYTHONFMU])
    slaves = {name: fmpy_slave(folders[name]) for name in (NATIVE, PYTHONFMU)}
    seconds = defaultdict(list)
    # both flavours have the same references
    description = fmpy.read_model_description(str(folders[NATIVE]))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    commands = [references[name] for name in ("u_l", "u_r", "u_t")]
    velocities = [references[name] for name in ("u", "w", "r")]
    for _ in range(repetitions):
        for name, slave in slaves.items():
            slave.reset()
            slave.setupExperiment(startTime=0.0)
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            start = time.process_time()
            for n in range(round(STOP / INTERVAL)):
                command = manoeuvre.sequence[int(n * INTERVAL / manoeuvre.hold)]
                slave.setReal(commands, (command.u_l, command.u_r, command.u_t))
                slave.doStep(currentCommunicationPoint=n * INTERVAL, communicationStepSize=INTERVAL)
                slave.getReal(velocities)
            seconds[name].append(time.process_time() - start)
    for slave in slaves.values():
        slave.freeInstance()
    return {name: np.array(times) for name, times in seconds.items()}


def _signals(commands: list[Inputs], hold: float) -> NDArray[Any]:
    """FMPy's input: two rows at each change."""
    rows = [((n + end) * hold, *astuple(command)) for n, command in enumerate(commands) for end in (0, 1)]
    return np.array(rows, dtype=[("time", float), *((field.name, float) for field in fields(Inputs))])
