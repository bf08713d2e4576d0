"""Ecos. cs: a structure of one ROV with its parameters as a named set; ssp: the same system from an SSP archive."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ecospy import EcosSimulation, EcosSimulationStructure

from rov_fmu.bridges.system.ssp import PARAMETER_SET, ssp_content
from verification.interoperability.runners.flight import FMU, OUTPUTS, Step, fly, parameters
from verification.interoperability.runners.system import dive

with ExitStack() as stack:
    source: dict[str, Any]
    if sys.argv[1] == "cs":
        structure = stack.enter_context(EcosSimulationStructure())
        structure.add_model("rov", FMU)
        structure.add_parameter_set(PARAMETER_SET, {f"rov::{name}": value for name, value in parameters().items()})
        source = {"structure": structure}
    else:
        Path("dive.ssp").write_bytes(ssp_content(dive()))
        source = {"ssp_path": "dive.ssp"}
    simulation = stack.enter_context(EcosSimulation(step_size=0.1, **source))
    simulation.init(parameter_set=PARAMETER_SET)

    def advance(step: Step) -> None:
        for name, value in step.inputs.items():
            simulation.set_real(f"rov::{name}", value)
        simulation.step()

    fly(advance, lambda: [simulation.get_real(f"rov::{name}") for name in OUTPUTS])
    simulation.terminate()
