"""FMPy, FMI 2.0 and 3.0.

cs: a slave is stepped, and its state is saved and restored once. events: inputs are set in Event Mode, and an
intermediate update ends each step early. me: Model Exchange with CVode, in one call. compile: Co-Simulation in one
call, with the FMU compiled from its sources (`fmpy compile`).
"""

import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.util import read_csv, write_csv

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, detour, fly, parameters


class Slave:
    """A slave whose variables are accessed by name."""

    def __init__(self, fmu: str, values: Mapping[str, float], **options: object) -> None:
        """Start with these parameters."""
        description = read_model_description(fmu)
        self.reference = {variable.name: variable.valueReference for variable in description.modelVariables}
        slave = FMU2Slave if description.fmiVersion == "2.0" else FMU3Slave
        self.fmu: Any = slave(
            guid=description.guid,
            unzipDirectory=extract(fmu),
            instanceName="rov",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate(**options)
        if slave is FMU2Slave:
            self.fmu.setupExperiment(startTime=0.0)
            self._get, self._set = self.fmu.getReal, self.fmu.setReal
        else:
            self._get, self._set = self.fmu.getFloat64, self.fmu.setFloat64
        self.put(values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def put(self, values: Mapping[str, float]) -> None:
        self._set([self.reference[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return list(self._get([self.reference[name] for name in names]))

    def step(self, start: float, length: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=start, communicationStepSize=length)

    def end(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def by_hand() -> None:
    """Step the FMU, with the detour."""
    rov = Slave(FMU, parameters())

    def advance(step: Step) -> None:
        if step.detour:
            state = rov.fmu.getFMUState()
            kept = rov.fmu.serializeFMUState(state)
            rov.fmu.freeFMUState(state)
            rov.put(detour())
            rov.step(step.start, 1.0)
            state = rov.fmu.deserializeFMUState(kept)
            rov.fmu.setFMUState(state)
            rov.fmu.freeFMUState(state)
        rov.put(step.inputs)
        rov.step(step.start, step.length)

    fly(advance, partial(rov.get, *OUTPUTS))
    rov.end()


def with_events() -> None:
    """Set the inputs in Event Mode. An intermediate update ends each step half-way, and another step completes it."""
    half = 0.0

    def update(_: object, time: float, *rest: Any) -> None:
        *_flags, may_return, early, until = rest
        if may_return and time < half:
            early[0], until[0] = True, half

    def update_discrete_states() -> None:
        if any(rov.fmu.updateDiscreteStates()[:2]):
            raise RuntimeError("the FMU asks for another event iteration, or to end")
        rov.fmu.enterStepMode()

    def advance(step: Step) -> None:
        nonlocal half
        half = step.start + step.length / 2.0
        rov.fmu.enterEventMode()
        rov.put(step.inputs)
        update_discrete_states()
        for start, expected in (step.start, half), (half, step.end):
            event, end, early, time = rov.fmu.doStep(start, step.end - start)
            if event or end or early != (expected == half) or time != expected:
                raise RuntimeError(f"a step from {start} ended at {time}, early: {early}")

    rov = Slave(FMU, parameters(), eventModeUsed=True, earlyReturnAllowed=True, intermediateUpdate=update)
    update_discrete_states()
    fly(advance, partial(rov.get, *OUTPUTS))
    rov.end()


def in_one_call(fmu: str, **options: object) -> None:
    """Let FMPy simulate with inputs from an array, which has two rows for each jump."""
    result = simulate_fmu(
        fmu,
        stop_time=30.0,
        output_interval=0.1,
        start_values=parameters(),
        input=read_csv("jumps.csv"),
        output=OUTPUTS,
        **options,
    )
    write_csv("result.csv", result)


def compiled() -> str:
    """Return the FMU with binaries that were compiled from its sources."""
    with ZipFile(FMU) as whole, ZipFile("compiled.fmu", "w") as sources:
        for name in whole.namelist():
            if not name.startswith("binaries/"):
                sources.writestr(name, whole.read(name))
    subprocess.run([Path(sys.executable).with_name("fmpy"), "compile", "compiled.fmu"], check=True)
    return "compiled.fmu"


if __name__ == "__main__":
    match sys.argv[1]:
        case "cs":
            by_hand()
        case "events":
            with_events()
        case "me":
            in_one_call(FMU, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-9)
        case "compile":
            in_one_call(compiled())
