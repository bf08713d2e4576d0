"""FMPy. cs: a slave stepped by hand, its state saved and restored on the way; me: Model Exchange, CVode, in one call;
compile: the FMU compiled from its sources (`fmpy compile`), Co-Simulation in one call."""

import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from zipfile import ZipFile

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv, write_csv

from interop.runners.flight import FMU, OUTPUTS, Step, detour, fly, parameters


class Slave:
    """A slave, variables by name."""

    def __init__(self, fmu: str, values: Mapping[str, float]) -> None:
        """Start with these parameters."""
        description = read_model_description(fmu)
        self.reference = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.fmu = FMU2Slave(guid=description.guid, unzipDirectory=extract(fmu), instanceName="rov",
                             modelIdentifier=description.coSimulation.modelIdentifier)  # fmt: skip
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.put(values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def put(self, values: Mapping[str, float]) -> None:
        self.fmu.setReal([self.reference[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getReal([self.reference[name] for name in names]))

    def step(self, start: float, length: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=start, communicationStepSize=length)

    def end(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def by_hand() -> None:
    """Step the FMU; the detour leaves no trace."""
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


def in_one_call(fmu: str, **options: object) -> None:
    """Let FMPy simulate, the inputs from an array with two rows where they jump."""
    result = simulate_fmu(fmu, stop_time=30.0, output_interval=0.1, start_values=parameters(),
                          input=read_csv("jumps.csv"), output=OUTPUTS, **options)  # fmt: skip
    write_csv("result.csv", result)


def compiled() -> str:
    """The FMU without its binaries, compiled."""
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
        case "me":
            in_one_call(FMU, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-9)
        case "compile":
            in_one_call(compiled())
