"""The closed loop in three engines, and without one.

All are Jacobi masters: at each communication point they pass on the outputs, then both FMUs step with what they got.
So a command acts one step after the depth that it answers to.

Each function gives the outputs at the end of every step, named as "rov.z".
"""

from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rov_fmu.motion import rov

from .autopilot import Autopilot
from .system import DEFAULT, OUTPUTS, STEP, STEPS, STOP, parameter_sets

Trajectory = dict[str, NDArray[np.float64]]
NAMES = [(component, name) for component, names in OUTPUTS.items() for name in names]


def plain(folder: Path, parameters: str, *, sequential: bool = False) -> Trajectory:  # noqa: ARG001
    """`rov_fmu.motion.rov` and the autopilot's class in a loop; sequential: the ROV gets the commands without delay."""
    values = parameter_sets()[parameters]
    names = rov.COEFFICIENTS
    coefficients = rov.Coefficients(**{n: v for n, v in values["rov"].items() if n in names})
    inputs = rov.Inputs(**{n: v for n, v in values["rov"].items() if n not in names})
    state = rov.State()
    autopilot = Autopilot(instance_name="autopilot")
    for name, value in values["autopilot"].items():
        setattr(autopilot, name, value)

    def commands() -> rov.Inputs:
        return replace(inputs, u_l=autopilot.u_l, u_r=autopilot.u_r, u_t=autopilot.u_t)

    rows = []
    for n in range(STEPS):
        autopilot.z, autopilot.psi = state.z, state.psi
        before = commands()
        autopilot.do_step(n * STEP, STEP)
        state = rov.step(coefficients, commands() if sequential else before, state, STEP)
        now = {"rov": asdict(state), "autopilot": vars(autopilot)}
        rows.append([now[component][name] for component, name in NAMES])
    return _trajectory(rows)


def fmpy(folder: Path, parameters: str) -> Trajectory:
    """FMPy takes the parameters of all components as one set, and labels a row with the start of its step.

    At the first step it sets each connected input to zero, not to the output at its other end: the ROV starts at the
    surface, heading north.
    """
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

    path = str(folder / "videoray.ssp")
    together = ParameterSet(name=parameters)
    for component in read_ssd(path).system.elements:
        for binding in component.parameterBindings:
            for values in binding.parameterValues:
                if values.name == parameters:
                    together.parameters += [
                        Parameter(name=f"{component.name}.{p.name}", type=p.type, value=p.value)
                        for p in values.parameters
                    ]
    result = simulate_ssp(path, stop_time=STOP, step_size=STEP, parameter_set=together)
    return {f"{c}.{name}": np.array(result[f"{c}.{name}"][:STEPS]) for c, name in NAMES}


def libcosim_ssp(folder: Path, parameters: str) -> Trajectory:
    """libcosim from the SSP archive."""
    from libcosimpy.CosimExecution import CosimExecution

    _warnings_only()
    return _libcosim(CosimExecution.from_ssp_file(str(folder / "videoray.ssp")), parameters)


def libcosim_osp(folder: Path, parameters: str) -> Trajectory:
    """libcosim from the OSP configuration, connected by variable groups."""
    from libcosimpy.CosimExecution import CosimExecution

    _warnings_only()
    return _libcosim(CosimExecution.from_osp_config_file(str(folder)), parameters)


def _warnings_only() -> None:
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

    log_output_level(CosimLogLevel.WARNING)


def _libcosim(execution: Any, parameters: str) -> Trajectory:
    """It counts time in nanoseconds, so its steps are off by the last bits, and with them the results."""
    from libcosimpy.CosimObserver import CosimObserver

    index = {component: execution.slave_index_from_instance_name(component) for component in OUTPUTS}
    reference = {c: {v.name.decode(): v.reference for v in execution.slave_variables(i)} for c, i in index.items()}
    if parameters != DEFAULT:  # no other can be chosen in Python, so its values are set over the default ones
        for name, value in parameter_sets()[parameters]["rov"].items():
            assert execution.real_initial_value(index["rov"], reference["rov"][name], value)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    rows = []
    for _ in range(STEPS):
        assert execution.step()
        values = (
            observer.last_real_values(index[component], [reference[component][name] for name in names])
            for component, names in OUTPUTS.items()
        )
        rows.append([*chain.from_iterable(values)])
    return _trajectory(rows)


def ecos(folder: Path, parameters: str) -> Trajectory:
    """Ecos from the SSP archive, with one of its parameter sets."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(folder / "videoray.ssp"), step_size=STEP) as simulation:
        assert simulation.init(parameter_set=parameters)
        rows = []
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(f"{component}::{name}") for component, name in NAMES])
        simulation.terminate()
    return _trajectory(rows)


def _trajectory(rows: Iterable[list[float]]) -> Trajectory:
    columns = np.array(list(rows)).T
    return {f"{component}.{name}": column for (component, name), column in zip(NAMES, columns, strict=True)}


class Engine(NamedTuple):
    """How to run the system, and the module to have for it."""

    run: Callable[[Path, str], Trajectory]
    module: str

    def missing(self) -> str:
        """Why it cannot run here; empty where it can."""
        try:
            import_module(self.module)
        except (ImportError, OSError) as error:  # the module, or a library that it loads
            return str(error)
        return ""


ENGINES = {
    "FMPy, SSP": Engine(fmpy, "fmpy"),
    "libcosim, SSP": Engine(libcosim_ssp, "libcosimpy.CosimExecution"),
    "libcosim, OSP": Engine(libcosim_osp, "libcosimpy.CosimExecution"),
    "Ecos, SSP": Engine(ecos, "ecospy"),
}
