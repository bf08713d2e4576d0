"""The FMU in pure Python: connect a vehicle's equation and rov_fmu/equation/step.py to PythonFMU's Fmi2Slave.

In the FMU this file is the slave module. In its folder lie variables.json (the declaration), step.py, and the equation
of the vehicle, which rov_fmu/equation/printed.py prints. PythonFMU 0.7 cannot return fmi2Discard. An exception must not
reach it, because PythonFMU then releases its objects twice, and a later call ends the importer. When a value is
refused, a message with the status is logged, the old value is kept, and the call returns fmi2OK.
"""

import importlib
import json
from collections.abc import Iterable, Mapping
from math import inf, isfinite
from pathlib import Path
from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

from rov_fmu.equation import step

_TOO_LATE = "must not be set after the initialization"


def _limited(variable: dict[str, Any], value: float) -> float:
    """Return the value, or the bound of a variable that it is beyond."""
    low, high = variable["minimum"], variable["maximum"]
    return float(max(-inf if low is None else low, min(inf if high is None else high, value)))


def _time_tolerance(t: float, h: float) -> float:
    """Return the rounding error that communication points may have, as in instance.c."""
    return min(1e-9 * (abs(t) + h), 0.5 * h)


class _Vehicle:
    """A vehicle as the delay line moves it: the equation, and the values of all variables by name."""

    def __init__(self, equation: Any, values: Mapping[str, float]) -> None:
        self.equation, self.values = equation, values

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def step(self, inputs: Mapping[str, float], state: Mapping[str, float], h: float) -> dict[str, float]:
        """Return the states after h seconds."""
        return step.step(self.equation, {**self.values, **inputs, **state}, h)


class Rov(Fmi2Slave):  # type: ignore[misc]
    """The slave. Its values are ordered by value reference, as rov_fmu/fmu/variables.py declares them."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        declaration = json.loads(Path(arguments["resources"], "variables.json").read_text(encoding="utf-8"))
        self.modelName = declaration["identifier"]
        self.log_categories = declaration["log_categories"]
        self.declared: list[dict[str, Any]] = declaration["variables"]
        self.equation = importlib.import_module(f"{self.modelName}_model.equation")
        self.voltage_ranges = declaration["voltage_ranges"]
        self.place = {v["name"]: place for place, v in enumerate(self.declared)}
        self.values: list[float] = [v["start"] or 0.0 for v in self.declared]
        self._set_attitude()
        self.time = 0.0
        self.is_initialized = False
        self.stop_time: float | None = None
        commands = declaration["commands"]
        self.line = step.DelayLine(self._named(commands), commands)
        self._put(self.line.delayed)
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
        for reference, value in zip(references, values, strict=True):
            v = self.declared[reference]
            if not self._may_set(reference) and (self._is_calculated(reference) or value != self.values[reference]):
                words = "is calculated and must not be set" if self._is_calculated(reference) else _TOO_LATE
                self.log(f"{v['name']} {words}; it was not.", Fmi2Status.error)
                return
            if not isfinite(value) or (v["causality"] == "parameter" and _limited(v, value) != value):
                self.log(
                    f"{v['name']} = {value!r} is refused; it stays {self.values[reference]!r}.", Fmi2Status.discard
                )
                return
        if self.is_initialized and not self._has_mass(dict(zip(references, values, strict=True))):
            words = "the mass matrix of these parameters is not positive definite; all of them stay as they are."
            self.log(words, Fmi2Status.discard)
            return
        for reference, value in zip(references, values, strict=True):
            v = self.declared[reference]
            if not self._may_set(reference):
                self._warn_once("again", f"{v['name']} {_TOO_LATE}, but it has this value already")
                continue
            self.values[reference] = value
            self._warn_of_input(v, value)
        if not self.is_initialized:
            self._set_attitude()
        for reference, value in zip(references, values, strict=True):
            if self.declared[reference]["initial"] == "approx" and value != self.values[reference]:
                words = f"{self.declared[reference]['name']} = {value!r} is replaced by {self.values[reference]!r}"
                self._warn_once(
                    "guess", f"{words}, because phi_0, theta_0 and psi_0 determine the attitude at the start"
                )

    def _has_mass(self, changed: Mapping[int, float]) -> bool:
        """Return True if the mass matrix is positive definite with some values changed, by their references."""
        if not any(self.declared[reference]["causality"] == "parameter" for reference in changed):
            return True
        values = [changed.get(reference, value) for reference, value in enumerate(self.values)]
        try:
            found = self.equation.numbers(dict(zip(self.place, values, strict=True)))
        except ZeroDivisionError:
            return False
        return all(found[name] > 0.0 for name in self.equation.PIVOTS)

    def get_real(self, references: list[int]) -> list[float]:
        """Return values, and calculate those that depend on others."""
        if any(map(self._is_calculated, references)):
            self._calculate()
        return [self.values[reference] for reference in references]

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Take one exact step. Return False when it is refused."""
        end = current_time + step_size
        if not (step_size > 0.0 and isfinite(end)):
            self.log(f"step size {step_size!r} at t = {current_time!r} is not a step forward.", Fmi2Status.error)
            return False
        if self.stop_time is not None and end > self.stop_time + _time_tolerance(self.stop_time, step_size):
            self.log(f"a step of {step_size!r} s passes the stop time {self.stop_time!r}.", Fmi2Status.error)
            return False
        values = dict(zip(self.place, self.values, strict=True))
        try:
            after = self.line.step(_Vehicle(self.equation, values), values, {}, self.time, step_size)
        except ValueError as error:
            self.log(f"{error}.", Fmi2Status.error)
            return False
        if not all(map(isfinite, after.values())):
            self.log(
                f"the motion overflows within {step_size!r} s, or never settles and needs shorter steps.",
                Fmi2Status.error,
            )
            return False
        if abs(current_time - self.time) > _time_tolerance(self.time, step_size):
            self._warn_once("time", f"the step from t = {current_time!r} does not begin at t = {self.time!r}")
        self._put({**after, **self.line.delayed})
        self.time = end
        return True

    def _put(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.values[self.place[name]] = value

    def _set_attitude(self) -> None:
        """Set the quaternion and the heading to those of the Euler angles at the start."""
        if self.equation.QUATERNION:
            found = self.equation.attitude(dict(zip(self.place, self.values, strict=True)))
            self._put({**{name: found[name] for name in self.equation.QUATERNION}, "psi": found["psi_0"]})

    def _calculate(self) -> None:
        """Calculate the variables that follow from the inputs, states and parameters."""
        found = self.equation.outputs(dict(zip(self.place, self.values, strict=True)))
        if self.equation.QUATERNION:
            found["psi"] = step.heading(found, self.values[self.place["psi"]])
        for v in self.declared:
            if v["derivative_of"]:
                self._put({v["name"]: found[f"der_{v['derivative_of']}"]})
            elif v["causality"] == "output" and v["initial"] == "calculated":
                self._put({v["name"]: found[v["name"]]})

    def _named(self, names: Iterable[str]) -> dict[str, float]:
        return {name: self.values[self.place[name]] for name in names}

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

    def _is_calculated(self, reference: int) -> bool:
        return bool(self.declared[reference]["initial"] == "calculated")

    def _may_set(self, reference: int) -> bool:
        v = self.declared[reference]
        if self.is_initialized:
            return bool(v["causality"] == "input" or v["variability"] == "tunable")
        return not self._is_calculated(reference)

    def _get_fmu_state(self) -> dict[str, Any]:
        line = {"acting": dict(self.line.acting), "waiting": list(self.line.waiting)}
        own = {"values": list(self.values), "time": self.time, "stop_time": self.stop_time}
        return {**own, "is_initialized": self.is_initialized, **line}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.values, self.time, self.stop_time = list(state["values"]), state["time"], state["stop_time"]
        self.is_initialized = state["is_initialized"]
        self.line.acting, self.line.waiting = dict(state["acting"]), list(state["waiting"])
