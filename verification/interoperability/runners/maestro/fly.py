"""Maestro, Co-Simulation: a specification in MaBL, its co-simulation language, filled in and interpreted.

MaBL, because a multi-model (JSON) takes inputs from other FMUs only, and no model without connections.
"""

import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from string import Template
from zipfile import ZipFile

from verification.interoperability.runners.flight import FMU, OUTPUTS, detour, parameters, steps


def listed(values: Iterable[object]) -> str:
    """An array in MaBL."""
    return ", ".join(map(str, values))


description = ET.fromstring(ZipFile(FMU).read("modelDescription.xml"))
reference = {v.attrib["name"]: v.attrib["valueReference"] for v in description.iter("ScalarVariable")}
flight = steps()
references = {"parameters": parameters(), "commands": detour(), "inputs": flight[0].inputs, "outputs": OUTPUTS}
filled = Template(Path(__file__).with_name("fly.mabl").read_text()).substitute(
    {name: listed(reference[variable] for variable in variables) for name, variables in references.items()},
    **{f"n_{name}": len(variables) for name, variables in references.items()},
    guid=description.attrib["guid"],
    fmu=Path(FMU).resolve().as_uri(),
    values=listed(parameters().values()),
    full=listed(detour().values()),
    names=listed(f'"{name}"' for name in OUTPUTS),
    shown=listed(f"shown[{n}]" for n in range(len(OUTPUTS))),
    n_flight=len(flight) * len(flight[0].inputs),
    flight=listed(value for step in flight for value in step.inputs.values()),
    n_steps=len(flight),
    detour=[step.detour for step in flight].index(True),
)
Path("fly.mabl").write_text(filled)
subprocess.run(["java", "-jar", sys.argv[1], "interpret", "fly.mabl"], check=True)
Path("outputs.csv").rename("result.csv")
