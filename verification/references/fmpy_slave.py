"""Instances of an FMU in FMPy."""

import ctypes
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave


def fmpy_slave(folder: Path, callbacks: Any = None) -> FMU2Slave:
    """Return an instance of an unzipped FMU for Co-Simulation. With callbacks, logging is on."""
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
    """Keep the library of a PythonFMU FMU loaded: loading it a second time may crash the Python interpreter."""
    for library in (folder / "binaries" / fmpy.platform).iterdir():
        ctypes.CDLL(str(library))
