"""Instances of an FMU in FMPy."""

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class Slave:
    """An instance for Co-Simulation of an unzipped FMU of FMI 2.0 or 3.0, whose variables are set and read by name."""

    def __init__(self, folder: str | Path, **options: object) -> None:
        description = fmpy.read_model_description(str(folder), validate=False)
        self.reference = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.is_2 = description.fmiVersion == "2.0"
        self.fmu: Any = (FMU2Slave if self.is_2 else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rov",
        )
        self.fmu.instantiate(**options)

    def initialize(self, values: Mapping[str, float]) -> None:
        """Set some variables, and initialize the instance."""
        if self.is_2:
            self.fmu.setupExperiment(startTime=0.0)
        self.put(values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def put(self, values: Mapping[str, float]) -> None:
        """Set variables."""
        put = self.fmu.setReal if self.is_2 else self.fmu.setFloat64
        put([self.reference[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        """Return the values of variables."""
        get = self.fmu.getReal if self.is_2 else self.fmu.getFloat64
        return list(get([self.reference[name] for name in names]))

    def step(self, start: float, length: float) -> None:
        """Take a step."""
        self.fmu.doStep(currentCommunicationPoint=start, communicationStepSize=length)

    def saved(self) -> bytes:
        """Return the state as bytes."""
        state = self.fmu.getFMUState()
        data: bytes = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return data

    def restore(self, data: bytes) -> None:
        """Restore a state from its bytes."""
        state = self.fmu.deserializeFMUState(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    def end(self) -> None:
        """Terminate and free the instance."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def keep_loaded(folder: Path) -> None:
    """Keep the library of a PythonFMU FMU loaded: loading it a second time may crash the Python interpreter."""
    for library in (folder / "binaries" / fmpy.platform).iterdir():
        ctypes.CDLL(str(library))
