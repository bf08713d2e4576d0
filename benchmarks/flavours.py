"""The native FMU against the one in pure Python, both stepped by FMPy."""

import statistics
import tempfile
import time
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from rich.console import Console
from rich.table import Table

from build_fmu import build
from fmu_src.compile import host_platform
from models.vehicle import VIDEORAY, load_vehicle

STEPS = 100_000
_REPETITIONS = 3
_H = 0.01


def print_flavours(console: Console) -> None:
    """Build both, step both in turn through the same commands, print seconds and their ratio."""
    host = host_platform()
    assert host is not None
    vehicle = load_vehicle(VIDEORAY)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        seconds: dict[str, list[float]] = {}
        slaves: dict[str, FMU2Slave] = {}
        for name, platforms in (("native", [host]), ("PythonFMU", None)):
            build(vehicle, Path(folder, f"{name}.fmu"), platforms, Console(quiet=True))
            slaves[name] = _instance(fmpy.extract(str(Path(folder, f"{name}.fmu")), str(Path(folder, name))))
        for _ in range(_REPETITIONS):
            for name, slave in slaves.items():
                seconds.setdefault(name, []).append(_run(slave))
    table = Table(
        title=f"{STEPS:,} steps of {_H:g} s through FMPy, median of {_REPETITIONS} in turn", title_justify="left"
    )
    for column in ("flavour", "s", "times native"):
        table.add_column(column, justify="left" if column == "flavour" else "right")
    for name, times in seconds.items():
        ratio = statistics.median(t / n for t, n in zip(times, seconds["native"], strict=True))
        table.add_row(name, f"{statistics.median(times):.2f}", f"{ratio:.1f}")
    console.print(table)


def _instance(folder: str) -> FMU2Slave:
    description = fmpy.read_model_description(folder)
    identifier = description.coSimulation.modelIdentifier
    slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName="rov")
    slave.instantiate()
    return slave


def _run(slave: FMU2Slave) -> float:
    """Seconds for all steps: a turn at changing thrust, the commands set and the velocities read at each."""
    slave.reset()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    start = time.perf_counter()
    for n in range(STEPS):
        thrust = 0.3 if n // 1000 % 2 else 0.5
        slave.setReal([0, 1], [thrust, 0.4])
        slave.doStep(currentCommunicationPoint=n * _H, communicationStepSize=_H)
        slave.getReal([8, 9, 10])
    return time.perf_counter() - start
