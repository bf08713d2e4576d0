"""The FMU as FMPy drives it."""

import ctypes
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave


def fmpy_slave(folder: Path, callbacks: Any = None) -> FMU2Slave:
    """An instance of an unzipped FMU for Co-Simulation; all is logged where callbacks are given."""
    description = fmpy.read_model_description(str(folder))
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="rov",
    )
    slave.instantiate(callbacks=callbacks, loggingOn=callbacks is not None)
    return slave


def keep_loaded(folder: Path) -> None:
    """Hold the library of a PythonFMU FMU: to unload it and load it again may crash the interpreter it shares."""
    for library in (folder / "binaries" / fmpy.platform).iterdir():
        ctypes.CDLL(str(library))
