"""fmu-manipulation-toolbox: a container FMU of two ROVs, which FMPy runs; both fly the manoeuvre."""

import json
import subprocess
import sys
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from interop.runners.flight import FMU, OUTPUTS, parameters, steps, write

ROVS = ("port", "starboard")


def main() -> None:
    """Build the container and fly the manoeuvre."""
    inputs = list(next(steps()).inputs)
    pair = {
        "name": "pair.fmu",
        "step_size": 0.1,
        "fmu": [f"{rov}.fmu" for rov in ROVS],
        "path": {f"{rov}.fmu": FMU for rov in ROVS},
        "start": [[f"{rov}.fmu", name, value] for rov in ROVS for name, value in parameters().items()],
        "input": [[f"{rov}_{name}", f"{rov}.fmu", name] for rov in ROVS for name in inputs],
        "output": [[f"{rov}.fmu", name, f"{rov}_{name}"] for rov in ROVS for name in OUTPUTS],
    }
    Path("pair.json").write_text(json.dumps(pair, indent=2))
    tool = Path(sys.executable).with_name("fmucontainer")
    subprocess.run([tool, "-container", "pair.json", "-no-auto-link", "-no-auto-input", "-no-auto-output"], check=True)
    fly("pair.fmu")


def fly(container: str) -> None:
    """Step the container, and write what each ROV does."""
    description = read_model_description(container)
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    pair = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(container),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="pair",
    )

    def outputs(rov: str, time: float) -> dict[str, float]:
        values = pair.getReal([reference[f"{rov}_{name}"] for name in OUTPUTS])
        return {"time": time, **dict(zip(OUTPUTS, values, strict=True))}

    pair.instantiate()
    pair.setupExperiment(startTime=0.0)
    pair.enterInitializationMode()
    pair.exitInitializationMode()
    result = {rov: [outputs(rov, 0.0)] for rov in ROVS}
    for step in steps():
        for rov in ROVS:
            pair.setReal([reference[f"{rov}_{name}"] for name in step.inputs], list(step.inputs.values()))
        pair.doStep(currentCommunicationPoint=step.start, communicationStepSize=step.end - step.start)
        for rov in ROVS:
            result[rov].append(outputs(rov, step.end))
    pair.terminate()
    pair.freeInstance()
    for rov in ROVS:
        write(result[rov], f"result_{rov}.csv")


if __name__ == "__main__":
    main()
