"""libcosim, with inputs from a manipulator.

cs: one slave; ssp: an SSP archive, which contains the parameters.
"""

import sys
from pathlib import Path

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from rov_fmu.bridges.system.ssp import ssp_content
from verification.interoperability.runners.flight import AT_START, FMU, OUTPUTS, Step, fly, parameters
from verification.interoperability.runners.system import dive

STEP = 100_000_000  # ns

log_output_level(CosimLogLevel.WARNING)
match sys.argv[1]:
    case "cs":
        execution = CosimExecution.from_step_size(STEP)
        slave = CosimLocalSlave(fmu_path=FMU, instance_name="rov")  # must live as long as the execution
        execution.add_local_slave(slave)
    case "ssp":
        Path("dive.ssp").write_bytes(ssp_content(dive()))
        execution = CosimExecution.from_ssp_file("dive.ssp", STEP)

rov = execution.slave_index_from_instance_name("rov")
reference = {variable.name.decode(): variable.reference for variable in execution.slave_variables(rov)}
if sys.argv[1] == "cs":
    for name, value in parameters().items():
        if not execution.real_initial_value(rov, reference[name], value):
            raise RuntimeError(f"{name} was refused")
commands, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
execution.add_manipulator(commands)
execution.add_observer(observer)


stepped: list[Step] = []


def advance(step: Step) -> None:
    stepped.append(step)
    commands.slave_real_values(rov, [reference[name] for name in step.inputs], list(step.inputs.values()))
    if not execution.step():
        raise RuntimeError(f"the step to {step.end} s failed")


def outputs() -> list[float]:
    """Return the outputs. Before the first step, libcosim shows 0 for all of them."""
    if not stepped:
        return [AT_START.get(name, 0.0) for name in OUTPUTS]
    values: list[float] = observer.last_real_values(rov, [reference[name] for name in OUTPUTS])
    return values


fly(advance, outputs)
