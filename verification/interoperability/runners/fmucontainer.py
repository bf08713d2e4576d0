"""fmu-manipulation-toolbox: FMPy runs a container FMU of two ROVs, and both fly the manoeuvre."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

from fmpy import extract, read_model_description

from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters, steps
from verification.references.fmpy_slave import Slave

ROVS = ("port", "starboard")


def build() -> str:
    """Build the container and return its name."""
    container = {
        "name": "pair.fmu",
        "step_size": 0.1,
        "fmu": [f"{rov}.fmu" for rov in ROVS],
        "path": {f"{rov}.fmu": FMU for rov in ROVS},
        "start": [[f"{rov}.fmu", name, value] for rov in ROVS for name, value in parameters().items()],
        "input": [[f"{rov}_{name}", f"{rov}.fmu", name] for rov in ROVS for name in steps()[0].inputs],
        "output": [[f"{rov}.fmu", name, f"{rov}_{name}"] for rov in ROVS for name in OUTPUTS],
    }
    Path("pair.json").write_text(json.dumps(container, indent=2))
    tool = Path(sys.executable).with_name("fmucontainer")
    version = read_model_description(FMU).fmiVersion.partition(".")[0]
    subprocess.run(
        [tool, "-container", "pair.json", "-fmi", version, "-no-auto-link", "-no-auto-input", "-no-auto-output"],
        check=True,
    )
    return "pair.fmu"


if __name__ == "__main__":
    pair = Slave(extract(build()))
    pair.initialize({})

    def advance(step: Step) -> None:
        pair.put({f"{rov}_{name}": value for rov in ROVS for name, value in step.inputs.items()})
        pair.step(step.start, step.length)

    fly(
        advance,
        partial(pair.get, *(f"{rov}_{name}" for rov in ROVS for name in OUTPUTS)),
        [f"result_{rov}.csv" for rov in ROVS],
    )
    pair.end()
