"""The closed loop in three engines, and in a plain loop.

All are Jacobi masters: at each communication point they pass on the outputs, then both FMUs step with what they got.
So a command acts one step after the depth that it answers to.

Each function gives the outputs at the end of every step, named as "rov.z".
"""

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from examples.systems import PARAMETER_SET
from rov_fmu.c.stepper import Stepper
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

from .autopilot import Autopilot
from .system import OUTPUTS, STEP, STEPS, STOP, parameter_sets, system_files

Trajectory = dict[str, NDArray[np.float64]]
NAMES = [(component, name) for component, names in OUTPUTS.items() for name in names]


def plain(parameters: str, *, sequential: bool = False) -> Trajectory:
    """The engine and the autopilot's class in a loop; sequential: the ROV gets the commands without delay."""
    values = parameter_sets()[parameters]
    rov = load_vehicle(VIDEORAY)
    layout, given = rov.layout, values["rov"]
    rov = rov.with_(**{name: given[name] for name in layout.coefficients})
    inputs = dict.fromkeys(layout.inputs, 0.0) | {name: given[name] for name in layout.inputs if name in given}
    stepper, state = Stepper(rov, inputs, [*layout.state]), dict.fromkeys(layout.state, 0.0)
    autopilot = Autopilot(instance_name="autopilot")
    for name, value in values["autopilot"].items():
        setattr(autopilot, name, value)

    def commands() -> list[float]:
        return [getattr(autopilot, name) for name in layout.commands]

    rows = []
    for n in range(STEPS):
        autopilot.z, autopilot.psi = state["z"], state["psi"]
        before = commands()
        autopilot.do_step(n * STEP, STEP)
        after = stepper.step(commands() if sequential else before, STEP)
        state = dict(zip(layout.state, after, strict=True))
        now = {"rov": state, "autopilot": vars(autopilot)}
        rows.append([now[component][name] for component, name in NAMES])
    return _trajectory(rows)


def fmpy(folder: Path, parameters: str) -> Trajectory:
    """FMPy takes the parameters of all components as one set, and labels a row with the start of its step.

    At the first step it sets each connected input to zero, not to the output at its other end: the ROV starts at the
    surface, heading north.
    """
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

    path = str(system_files(folder, parameters)[0])
    together = ParameterSet(name=parameters)
    for component in read_ssd(path).system.elements:
        for p in component.parameterBindings[0].parameterValues[0].parameters:
            together.parameters.append(Parameter(name=f"{component.name}.{p.name}", type=p.type, value=p.value))
    result = simulate_ssp(path, stop_time=STOP, step_size=STEP, parameter_set=together)
    return {f"{c}.{name}": np.array(result[f"{c}.{name}"][:STEPS]) for c, name in NAMES}


def libcosim(folder: Path, parameters: str, *, osp: bool = False) -> Trajectory:
    """libcosim from the SSP archive, or from the OSP configuration, connected by variable groups.

    It counts time in nanoseconds, so its steps are off by the last bits, and with them the results.
    """
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    open_file = CosimExecution.from_osp_config_file if osp else CosimExecution.from_ssp_file
    execution = open_file(str(system_files(folder, parameters)[osp]))
    index = {component: execution.slave_index_from_instance_name(component) for component in OUTPUTS}
    reference = {c: {v.name.decode(): v.reference for v in execution.slave_variables(i)} for c, i in index.items()}
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    rows = []
    for _ in range(STEPS):
        assert execution.step()
        rows.append([observer.last_real_values(index[c], [reference[c][name]])[0] for c, name in NAMES])
    return _trajectory(rows)


def ecos(folder: Path, parameters: str) -> Trajectory:
    """Run Ecos from the SSP archive. It uses the parameter sets of the given name."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(system_files(folder, parameters)[0]), step_size=STEP) as simulation:
        assert simulation.init(parameter_set=PARAMETER_SET)
        rows = []
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(f"{component}::{name}") for component, name in NAMES])
        simulation.terminate()
    return _trajectory(rows)


def _trajectory(rows: Sequence[Sequence[float]]) -> Trajectory:
    return {f"{component}.{name}": column for (component, name), column in zip(NAMES, np.array(rows).T, strict=True)}


class Engine(NamedTuple):
    """A way to run the system, and the module that it needs."""

    run: Callable[[Path, str], Trajectory]
    module: str

    def missing(self) -> str:
        """Return the reason why it cannot run here, or an empty text."""
        try:
            import_module(self.module)
        except (ImportError, OSError) as error:  # the module, or a library that it loads
            return str(error)
        return ""


ENGINES = {
    "FMPy, SSP": Engine(fmpy, "fmpy"),
    "libcosim, SSP": Engine(libcosim, "libcosimpy.CosimExecution"),
    "libcosim, OSP": Engine(partial(libcosim, osp=True), "libcosimpy.CosimExecution"),
    "Ecos, SSP": Engine(ecos, "ecospy"),
}
