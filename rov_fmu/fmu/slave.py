"""The FMU in pure Python: connect rov_fmu/model/rov.py to PythonFMU's Fmi2Slave.

In the FMU this file is the slave module; variables.json (the declaration) and a copy of the model lie in its folder.
PythonFMU cannot return fmi2Discard: when a value is refused, a message with this status is logged, the old value is
kept, and the call returns fmi2OK.
"""

import json
from math import isfinite
from pathlib import Path
from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

from rov_fmu.model import layout, rov


def layout_of(given: Any) -> layout.Layout:
    """Return the layout of a vehicle from the JSON of its dataclasses.asdict."""

    def parts(kind: str) -> list[dict[str, Any]]:
        return [
            {key: tuple(value) if isinstance(value, list) else value for key, value in part.items()}
            for part in given[kind]
        ]

    return layout.Layout(
        tuple(layout.VehicleAxis(layout.AXES[form["axis"]["name"]], form["keys"]) for form in parts("axes")),
        tuple(layout.Curve(**curve) for curve in parts("curves")),
        tuple(layout.Thruster(**thruster) for thruster in parts("thrusters")),
        given["mix"],
        given["coupled"],
    )


def _time_tolerance(t: float, h: float) -> float:
    """Return the rounding error that communication points may have, as in instance.c."""
    return min(1e-9 * (abs(t) + h), 0.5 * h)


class Rov(Fmi2Slave):  # type: ignore[misc]
    """The slave. Its values are ordered by value reference: inputs, state, derivatives, thrust, coefficients."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        declaration = json.loads(Path(arguments["resources"], "variables.json").read_text(encoding="utf-8"))
        self.modelName = declaration["identifier"]
        self.log_categories = declaration["log_categories"]
        self.declared: list[dict[str, Any]] = declaration["variables"]
        self.layout = layout_of(declaration["layout"])
        inputs, states = len(self.layout.inputs), len(self.layout.state)
        self.states = slice(inputs, inputs + states)
        self.calculated = slice(inputs + states, inputs + 2 * states + len(self.layout.thrust))
        self.values: list[float] = [v["start"] or 0.0 for v in self.declared]
        self.time = 0.0
        self.stop_time: float | None = None
        self.warned: set[int | str] = set()
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

    def set_real(self, references: list[int], values: list[float]) -> None:
        """Set all values, or none if one is refused."""
        for reference, value in zip(references, values, strict=True):
            v = self.declared[reference]
            if self._is_calculated(reference):
                raise ValueError(f"{v['name']} is calculated and must not be set")
            parameter = v["causality"] == "parameter"
            if not isfinite(value) or (parameter and not v["minimum"] <= value <= v["maximum"]):
                self.log(
                    f"{v['name']} = {value!r} is refused; it stays {self.values[reference]!r}.", Fmi2Status.discard
                )
                return
        for reference, value in zip(references, values, strict=True):
            v = self.declared[reference]
            self.values[reference] = value
            if v["causality"] == "input" and v["minimum"] is not None and not v["minimum"] <= value <= v["maximum"]:
                limit = max(v["minimum"], min(v["maximum"], value))
                self._warn_once(reference, f"{v['name']} = {value!r} saturates at {limit:g}")

    def get_real(self, references: list[int]) -> list[float]:
        """Return values, and calculate those that depend on others."""
        if any(map(self._is_calculated, references)):
            model, inputs, state = self._model()
            rates, thrust = model.derivatives(inputs, state), model.thrust(inputs, state)
            self.values[self.calculated] = [*rates.values(), *thrust.values()]
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
        model, inputs, state = self._model()
        after = list(model.step(inputs, state, step_size).values())
        if not all(map(isfinite, after)):
            self.log(f"the motion overflows within {step_size!r} s.", Fmi2Status.error)
            return False
        if abs(current_time - self.time) > _time_tolerance(self.time, step_size):
            self._warn_once("time", f"the step from t = {current_time!r} does not begin at t = {self.time!r}")
        self.values[self.states], self.time = after, end
        return True

    def _warn_once(self, what: int | str, text: str) -> None:
        if what not in self.warned:
            self.warned.add(what)
            self.log(f"{text}; said once.", Fmi2Status.warning)

    def _is_calculated(self, reference: int) -> bool:
        return self.calculated.start <= reference < self.calculated.stop

    def _model(self) -> tuple[rov.Rov, dict[str, float], dict[str, float]]:
        """Return the vehicle, its inputs and its state."""
        inputs, states, k = self.layout.inputs, self.layout.state, self.layout.coefficients
        return (
            rov.Rov(self.layout, dict(zip(k, self.values[self.calculated.stop :], strict=True))),
            dict(zip(inputs, self.values, strict=False)),
            dict(zip(states, self.values[self.states], strict=True)),
        )

    def _get_fmu_state(self) -> dict[str, Any]:
        return {"values": list(self.values), "time": self.time, "stop_time": self.stop_time}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.values, self.time, self.stop_time = list(state["values"]), state["time"], state["stop_time"]
