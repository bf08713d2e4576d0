"""FMPy, FMI 2.0 and 3.0.

cs: a slave is stepped, and its state is saved and restored once. events: inputs are set in Event Mode, and an
intermediate update ends each step early. me: Model Exchange with CVode, in one call. compile: Co-Simulation in one
call, with the FMU compiled from its sources (`fmpy compile`).
"""

import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from fmpy import extract, simulate_fmu
from fmpy.util import read_csv, write_csv

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, detour, fly, parameters
from verification.references.fmpy_slave import Slave


def started(**options: object) -> Slave:
    """Return an instance with the parameters of the manoeuvre."""
    rov = Slave(extract(FMU), **options)
    rov.initialize(parameters())
    return rov


def by_hand() -> None:
    """Step the FMU, with the detour."""
    rov = started()

    def advance(step: Step) -> None:
        if step.detour:
            kept = rov.saved()
            rov.put(detour())
            rov.step(step.start, 1.0)
            rov.restore(kept)
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

    rov = started(eventModeUsed=True, earlyReturnAllowed=True, intermediateUpdate=update)
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
