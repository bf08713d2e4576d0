"""The closed loop in three engines, and in a plain loop.

All are Jacobi masters: at each communication point they pass on the outputs, then all FMUs step with what they got.
So a command acts one step after the depth that it answers to.

Each function gives the outputs at the end of every step, named as "rov.z".
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rov_fmu.autopilot.gains import autopilot_of
from rov_fmu.autopilot.law import AXES, SENSORS
from rov_fmu.autopilot.pilot import Pilot
from rov_fmu.bridges.system.ssp import PARAMETER_SET
from rov_fmu.c.stepper import Stepper
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

from .system import CONNECTIONS, OUTPUTS, SLAVES, STEP, STEPS, STOP, Values, parameter_sets, system_file
from .with_fmpy import fly

Trajectory = dict[str, NDArray[np.float64]]
NAMES = [(component, name) for component, names in OUTPUTS.items() for name in names if not name.startswith("F_")]
"""What is compared. Thrust follows a command at once, and Ecos has passed on the next commands when it is read."""


class Rov:
    """The vehicle with the interface of the slaves: attributes for its variables, and a step."""

    def __init__(self, values: Values) -> None:
        rov = load_vehicle(VIDEORAY)
        layout = rov.layout
        self._inputs = list(layout.inputs)
        vars(self).update({name: values.get(name, 0.0) for name in (*self._inputs, *OUTPUTS["rov"])})
        rov = rov.with_(**{name: values[name] for name in layout.coefficients})
        self._stepper = Stepper(rov, {}, OUTPUTS["rov"])

    def do_step(self, current_time: float, step_size: float) -> None:  # noqa: ARG002
        """Hold the inputs for a step."""
        results = self._stepper.step([getattr(self, name) for name in self._inputs], step_size)
        vars(self).update(zip(OUTPUTS["rov"], results, strict=True))


class Held:
    """The autopilot of the vehicle with the same interface."""

    def __init__(self, values: Values) -> None:
        self._pilot = Pilot(autopilot_of(load_vehicle(VIDEORAY), STEP))
        names = (*SENSORS, *OUTPUTS["autopilot"], "sag")
        vars(self).update({**dict.fromkeys(names, 0.0), **values})
        for n, axis in enumerate(AXES):
            mode = int(values.get(f"mode_{axis.velocity}", 0))
            aim = (f"stick_{axis.velocity}", f"ref_{axis.velocity}", f"ref_{SENSORS[n]}")[mode]
            self._pilot.modes[n], self._pilot.aims[n] = mode, values.get(aim, 0.0)

    def do_step(self, current_time: float, step_size: float) -> None:  # noqa: ARG002
        """Take the sensors at the start of the step; the commands are there at its end."""
        vars(self).update(self._pilot.step(vars(self), step_size, 1.0 - vars(self)["sag"]))


def plain(parameters: str, *, sequential: bool = False) -> Trajectory:
    """Run the slaves and the vehicle in a loop; sequential: each gets the newest outputs of the others."""
    values = parameter_sets()[parameters]
    parts: dict[str, Any] = {name: SLAVES[name](instance_name=name) for name in values if name in SLAVES}
    for name, slave in parts.items():
        vars(slave).update(values[name])
    parts |= {"rov": Rov(values["rov"]), "autopilot": Held(values["autopilot"])}

    def pass_on(components: Iterable[str]) -> None:
        for (start, output), (end, name) in CONNECTIONS.items():
            if end in components:
                setattr(parts[end], name, getattr(parts[start], output))

    rows = []
    for n in range(STEPS):
        pass_on(parts)
        for name, part in parts.items():
            if sequential:
                pass_on([name])
            part.do_step(n * STEP, STEP)
        rows.append([getattr(parts[component], name) for component, name in NAMES])
    return _trajectory(rows)


def fmpy(folder: Path, parameters: str) -> Trajectory:
    """FMPy takes the parameters of all components as one set, and labels a row with the start of its step.

    At the first step it sets each connected input to zero, not to the output at its other end. Here all outputs start
    at zero.
    """
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

    path = str(system_file(folder, parameters))
    together = ParameterSet(name=parameters)
    for component in read_ssd(path).system.elements:
        for p in (one for binding in component.parameterBindings for one in binding.parameterValues[0].parameters):
            together.parameters.append(Parameter(name=f"{component.name}.{p.name}", type=p.type, value=p.value))
    result = simulate_ssp(path, stop_time=STOP, step_size=STEP, parameter_set=together)
    return {f"{c}.{name}": np.array(result[f"{c}.{name}"][:STEPS]) for c, name in NAMES}


def in_30_lines(folder: Path, parameters: str) -> Trajectory:
    """Run FMPy from the SSP archive by with_fmpy.py."""
    rows = list(fly(str(system_file(folder, parameters)), STEP, STEPS))
    return {f"{c}.{name}": np.array([row[f"{c}.{name}"] for row in rows]) for c, name in NAMES}


def libcosim(folder: Path, parameters: str) -> Trajectory:
    """libcosim from the SSP archive."""
    return by_libcosim(system_file(folder, parameters), NAMES, STEPS)


def by_libcosim(
    file: Path,
    names: Sequence[tuple[str, str]],
    steps: int,
    *,
    starts: Mapping[tuple[str, str], float] = MappingProxyType({}),
) -> Trajectory:
    """Return some outputs of a system by libcosim, which knows the step.

    It counts time in nanoseconds, so its steps are off by the last bits, and with them the results. It ignores the
    start values of outputs in an SSP, so they are given by `starts`.
    """
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(str(file))
    index = {component: execution.slave_index_from_instance_name(component) for component, _ in names}
    reference = {c: {v.name.decode(): v.reference for v in execution.slave_variables(i)} for c, i in index.items()}
    for (component, name), value in starts.items():
        assert execution.real_initial_value(index[component], reference[component][name], value)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    rows = []
    for _ in range(steps):
        assert execution.step()
        rows.append([observer.last_real_values(index[c], [reference[c][name]])[0] for c, name in names])
    return _trajectory(rows, names)


def ecos(folder: Path, parameters: str) -> Trajectory:
    """Run Ecos from the SSP archive."""
    return by_ecos(system_file(folder, parameters), NAMES, STEPS, STEP)


def by_ecos(file: Path, names: Sequence[tuple[str, str]], steps: int, step: float) -> Trajectory:
    """Return some outputs of a system by Ecos, with the parameter sets of the name that all have."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(file), step_size=step) as simulation:
        assert simulation.init(parameter_set=PARAMETER_SET)
        rows = []
        for _ in range(steps):
            simulation.step()
            rows.append([simulation.get_real(f"{component}::{name}") for component, name in names])
        simulation.terminate()
    return _trajectory(rows, names)


def _trajectory(rows: Sequence[Sequence[float]], names: Sequence[tuple[str, str]] = NAMES) -> Trajectory:
    return {f"{component}.{name}": column for (component, name), column in zip(names, np.array(rows).T, strict=True)}


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
    "FMPy, 30 lines": Engine(in_30_lines, "fmpy"),
    "libcosim, SSP": Engine(libcosim, "libcosimpy.CosimExecution"),
    "Ecos, SSP": Engine(ecos, "ecospy"),
}
