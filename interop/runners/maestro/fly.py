"""Maestro, Co-Simulation: a specification in MaBL, its co-simulation language, filled in and interpreted.

MaBL, because a multi-model (JSON) takes inputs from other FMUs only, and no model without connections.
"""

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from string import Template
from zipfile import ZipFile

from interop.runners.flight import FMU, OUTPUTS, parameters, steps


def main(jar: str) -> None:
    """Fly the manoeuvre."""
    description = ET.fromstring(ZipFile(FMU).read("modelDescription.xml"))
    reference = {v.attrib["name"]: v.attrib["valueReference"] for v in description.iter("ScalarVariable")}
    flight = list(steps())
    inputs = list(flight[0].inputs)

    def listed(values: object) -> str:
        return ", ".join(map(str, values))  # type: ignore[call-overload]

    filled = Template(Path(__file__).with_name("fly.mabl").read_text()).substitute(
        guid=description.attrib["guid"],
        fmu=Path(FMU).resolve().as_uri(),
        n_parameters=len(parameters()),
        parameters=listed(reference[name] for name in parameters()),
        values=listed(parameters().values()),
        n_inputs=len(inputs),
        inputs=listed(reference[name] for name in inputs),
        n_outputs=len(OUTPUTS),
        outputs=listed(reference[name] for name in OUTPUTS),
        names=listed(f'"{name}"' for name in OUTPUTS),
        shown=listed(f"shown[{n}]" for n in range(len(OUTPUTS))),
        n_flight=len(flight) * len(inputs),
        flight=listed(value for step in flight for value in step.inputs.values()),
        n_steps=len(flight),
        detour=[step.detour for step in flight].index(True),
    )
    Path("fly.mabl").write_text(filled)
    subprocess.run(["java", "-jar", jar, "interpret", "fly.mabl"], check=True)
    Path("outputs.csv").rename("result.csv")


if __name__ == "__main__":
    main(sys.argv[1])
