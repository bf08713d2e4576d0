"""A system of one ROV with its parameters, for tools that read a system from file."""

from pathlib import Path

from examples.systems import Component, System
from verification.interoperability.runners.flight import FMU, OUTPUTS, parameters, steps


def dive() -> System:
    """Return the system, whose FMU is in this folder."""
    rov = Component(Path(FMU), parameters(), list(steps()[0].inputs), OUTPUTS)
    return System("dive", {"rov": rov}, step=0.1, stop=30.0)
