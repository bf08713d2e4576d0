"""The FMU in pure Python: connect a vehicle's equation and rov_fmu/equation/python/step.py to PythonFMU's Fmi2Slave.

In the FMU this file is the slave module. In its folder lie variables.json (the declaration), step.py, and the equation
of the vehicle, which equation/python/printed.py prints. PythonFMU 0.7 cannot return fmi2Discard. An exception must not
reach it, because PythonFMU then releases its objects twice, and a later call ends the importer. When a value is
refused, a message with the status is logged, the old value is kept, and the call returns fmi2OK.
"""

import importlib
import json
from collections.abc import Mapping
from math import inf, isfinite
from pathlib import Path
from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

from rov_fmu.equation.python import step

_TOO_LATE = "must not be set after the initialization"


def _limited(variable: dict[str, Any], value: float) -> float:
    """Return the value, or the bound of a variable that it is beyond."""
    low, high = variable["minimum"], variable["maximum"]
    return float(max(-inf if low is None else low, min(inf if high is None else high, value)))


def _time_tolerance(t: float, h: float) -> float:
    """Return the rounding error that communication points may have, as in instance.c."""
    return min(1e-9 * (abs(t) + h), 0.5 * h)


class _Vehicle(dict[str, float]):
    """A vehicle as the memory moves it: the values of all variables by name, and the equation."""

    equation: Any

    def step(self, inputs: Mapping[str, float], state: Mapping[str, float], h: float) -> dict[str, float]:
        """Return the states after h seconds."""
        return step.step(self.equation, {**self, **inputs, **state}, h)


class Rov(Fmi2Slave):  # type: ignore[misc]
    """The slave. A value reference is the place of a variable in `declared`: see rov_fmu/fmu/variables.py."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        declaration = json.loads(Path(arguments["resources"], "variables.json").read_text(encoding="utf-8"))
        self.modelName = declaration["identifier"]
        self.log_categories = declaration["log_categories"]
        self.declared: list[dict[str, Any]] = declaration["variables"]
        self.equation = importlib.import_module(f"{self.modelName}_model.equation")
        self.voltage_ranges = declaration["voltage_ranges"]
        self.left_water = declaration["left_water"]
        self.values = _Vehicle({v["name"]: v["start"] or 0.0 for v in self.declared})
        self.values.equation = self.equation
        self._set_attitude()
        self.time = 0.0
        self.is_initialized = False
        self.stop_time: float | None = None
        commands = declaration["commands"]
        self.memory = step.Memory({name: self.values[name] for name in commands}, commands, declaration["before"])
        self.values |= self.memory.delayed
        self.warned: set[str] = set()
        for reference, v in enumerate(self.declared):
            self.register_variable(
                Real(
                    v["name"],
                    start=v["start"],
                    description=v["description"],
                    causality=Fmi2Causality[v["causality"]],
                    variability=Fmi2Variability[v["variability"]],
                    initial=Fmi2Initial[v["initial"]] if v["initial"] else None,
                    getter=lambda reference=reference: self.get_real([reference])[0],
                    setter=lambda value, reference=reference: self.set_real([reference], [value]),
                ),
                nested=False,
            )

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:  # noqa: ARG002
        """Keep the start and stop time. A step past the stop time is an error."""
        self.time, self.stop_time = start_time, stop_time

    def exit_initialization_mode(self) -> None:
        """Begin the simulation. From now on, only inputs and tunable parameters change."""
        self.is_initialized = True

    def set_real(self, references: list[int], values: list[float]) -> None:
        """Set all values, or none if one is refused."""
        pairs = [(self.declared[reference], value) for reference, value in zip(references, values, strict=True)]
        if any(self._is_refused(v, value) for v, value in pairs):
            return
        parameters = {v["name"]: value for v, value in pairs if v["causality"] == "parameter"}
        if self.is_initialized and parameters and not self._has_mass(parameters):
            words = "the mass matrix of these parameters is not positive definite; all of them stay as they are."
            self.log(words, Fmi2Status.discard)
            return
        for v, value in pairs:
            if self._may_set(v):
                is_silent = v["unit"] == "us" and value == 0.0  # a pulse of 0 means that there is no signal
                self.values[v["name"]] = _limited(v, value) if v["causality"] == "input" and not is_silent else value
                self._warn_of_input(v, value)
            else:
                self._warn_once("again", f"{v['name']} {_TOO_LATE}, but it has this value already")
        if not self.memory.current:  # until the first step, the current before it is the present one
            self.values |= {before: self.values[name] for name, before in self.memory.names_before.items()}
        if not self.is_initialized:
            self._set_attitude()
        for v, value in pairs:
            if v["initial"] == "approx" and value != self.values[v["name"]]:
                words = f"{v['name']} = {value!r} is replaced by {self.values[v['name']]!r}"
                self._warn_once(
                    "guess", f"{words}, because phi_0, theta_0 and psi_0 determine the attitude at the start"
                )

    def _is_refused(self, v: dict[str, Any], value: float) -> bool:
        """Return True, with a message, if a variable must not have a value. One that it has already is accepted."""
        name, is_calculated = v["name"], v["initial"] == "calculated"
        if not self._may_set(v) and (is_calculated or value != self.values[name]):
            words = "is calculated and must not be set" if is_calculated else _TOO_LATE
            self.log(f"{name} {words}; it was not.", Fmi2Status.error)
            return True
        if not isfinite(value) or (v["causality"] == "parameter" and _limited(v, value) != value):
            self.log(f"{name} = {value!r} is refused; it stays {self.values[name]!r}.", Fmi2Status.discard)
            return True
        return False

    def _has_mass(self, changed: Mapping[str, float]) -> bool:
        """Return True if the mass matrix is positive definite with some parameters changed."""
        try:
            numbers = self.equation.numbers({**self.values, **changed})
        except ZeroDivisionError:
            return False
        return all(numbers[name] > 0.0 for name in self.equation.PIVOTS)

    def get_real(self, references: list[int]) -> list[float]:
        """Return values, and calculate those that depend on others."""
        variables = [self.declared[reference] for reference in references]
        if any(v["initial"] == "calculated" for v in variables):
            self._calculate()
        return [self.values[v["name"]] for v in variables]

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Take one exact step. Return False when it is refused."""
        end = current_time + step_size
        if not (step_size > 0.0 and isfinite(end)):
            self.log(f"step size {step_size!r} at t = {current_time!r} is not a step forward.", Fmi2Status.error)
            return False
        if self.stop_time is not None and end > self.stop_time + _time_tolerance(self.stop_time, step_size):
            self.log(f"a step of {step_size!r} s passes the stop time {self.stop_time!r}.", Fmi2Status.error)
            return False
        try:
            after = self.memory.step(self.values, self.values, {}, self.time, step_size)
        except ValueError as error:
            self.log(f"{error}.", Fmi2Status.error)
            return False
        if not all(map(isfinite, after.values())):
            self.log(
                f"the motion overflows within {step_size!r} s, or takes too many substeps: it is too fast or long.",
                Fmi2Status.error,
            )
            return False
        if abs(current_time - self.time) > _time_tolerance(self.time, step_size):
            self._warn_once("time", f"the step from t = {current_time!r} does not begin at t = {self.time!r}")
        self.values |= {**after, **self.memory.delayed, **self.memory.current}
        self.time = end
        if self.left_water and self.values["z"] < -self.left_water[0]:
            self._warn_once("water", self.left_water[1].format(f"{end:g}"))
        return True

    def _set_attitude(self) -> None:
        """Set the quaternion and the heading to those of the Euler angles at the start."""
        if self.equation.QUATERNION:
            attitude = self.equation.attitude(self.values)
            self.values |= {**{name: attitude[name] for name in self.equation.QUATERNION}, "psi": attitude["psi_0"]}

    def _calculate(self) -> None:
        """Calculate the variables that follow from the inputs, states and parameters."""
        outputs = self.equation.outputs(self.values)
        if self.equation.QUATERNION:
            outputs["psi"] = step.heading(outputs, self.values["psi"])
        for v in self.declared:
            if v["initial"] == "calculated" and v["variability"] == "continuous":
                self.values[v["name"]] = outputs[step.formula_name(v["name"])]

    def _warn_of_input(self, v: dict[str, Any], value: float) -> None:
        """Warn once about a command without a signal, and about an input that saturates."""
        name = v["name"]
        if v["unit"] == "us" and value == 0.0:
            self._warn_once("signal", f"{name} = 0 means that there is no signal: it acts as neutral")
        elif name == "voltage" and self.voltage_ranges:
            for low, high, curves in self.voltage_ranges:
                if not low <= value <= high:
                    limit = low if value < low else high
                    self._warn_once(curves, f"{name} = {value!r} saturates at {limit:g} for the thrust curve {curves}")
        elif v["causality"] == "input" and _limited(v, value) != value:
            self._warn_once(name, f"{name} = {value!r} saturates at {_limited(v, value):g}")

    def _warn_once(self, what: str, text: str) -> None:
        if what not in self.warned:
            self.warned.add(what)
            self.log(f"{text}; logged once.", Fmi2Status.warning)

    def _may_set(self, v: dict[str, Any]) -> bool:
        if self.is_initialized:
            return bool(v["causality"] == "input" or v["variability"] == "tunable")
        return bool(v["initial"] != "calculated")

    def _get_fmu_state(self) -> dict[str, Any]:
        kept = {
            "acting": dict(self.memory.acting),
            "waiting": list(self.memory.waiting),
            "current": dict(self.memory.current),
        }
        own = {"values": dict(self.values), "time": self.time, "stop_time": self.stop_time}
        return {**own, "is_initialized": self.is_initialized, **kept}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.time, self.stop_time = state["time"], state["stop_time"]
        self.values |= state["values"]
        self.is_initialized = state["is_initialized"]
        self.memory.acting, self.memory.current = dict(state["acting"]), dict(state["current"])
        self.memory.waiting = [step.Change(*change) for change in state["waiting"]]  # a serialized state has lists
