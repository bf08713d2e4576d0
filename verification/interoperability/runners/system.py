"""A system of one ROV with its parameters, for tools that read a system from file."""

from pathlib import Path

from rov_fmu.bridges.system.ssp import Component, System
from verification.interoperability.runners.flight import FMU, OUTPUTS, parameters, steps


def dive() -> System:
    """Return the system, whose FMU is in this folder."""
    rov = Component(FMU, Path(FMU).read_bytes(), parameters(), list(steps()[0].inputs), OUTPUTS)
    return System("dive", {"rov": rov}, step=0.1, stop=30.0)
