"""A vehicle with its coefficients: thrust, derivatives, the exact step, and the closed form of one axis.

Inputs, states and coefficients have the names that rov_fmu/model/layout.py declares. Standard library only.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from math import inf
from typing import TypeVar

from .alone import AxisAlone, alone_formulas
from .catalogue import ARM, YAW, Axis, delayed_name
from .equation import equation_of
from .expression import compiled
from .layout import Curve, Layout, Thruster, VehicleAxis, arm
from .printed import model_of
from .step import DelayLine, heading, step
from .thrust import curve_formulas, steady_name

Values = Mapping[str, float]
Self = TypeVar("Self", bound="Rov")


class _Formulas:
    """The compiled equation of a layout."""

    def __init__(self, layout: Layout) -> None:
        equation = equation_of(layout)
        rates = {f"der_{name}": rate for name, rate in equation.rates.items()}
        self.names = equation.names
        self.model = model_of(layout)
        self.parameters = compiled(equation.parameters)
        self.thrust = compiled(equation.thrust, equation.measured)
        self.alone = {
            form.axis.name: compiled(alone_formulas(layout, form.axis.velocity), equation.measured)
            for form in layout.axes
        }
        self.calculate = compiled({**equation.program, **rates, **equation.outputs}, equation.measured)


_formulas_of = lru_cache(maxsize=100)(_Formulas)
_thrust_of = cache(
    lambda curve: compiled(curve_formulas(curve), {table.function: table.force for table in curve.tables})
)


@dataclass(frozen=True)
class Rov:
    """A vehicle: its layout, and the value of every coefficient of the layout by name."""

    layout: Layout
    coefficients: Values

    def __getitem__(self, name: str) -> float:
        """Return a coefficient."""
        return self.coefficients[name]

    def replaced(self: Self, values: Values) -> Self:
        """Return the vehicle with other values of some coefficients, which are not checked. It is cheap."""
        return replace(self, coefficients={**self.coefficients, **values})

    def extended(self: Self, values: Values) -> Self:
        """Return the vehicle with other or additional coefficients."""
        return replace(self, layout=self.layout.extended(values), coefficients={**self.coefficients, **values})

    @cached_property
    def _formulas(self) -> _Formulas:
        return _formulas_of(self.layout)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """The numbers that follow from the coefficients, by their names in rov_fmu/model/equation.py: gain_u ..."""
        return self._formulas.parameters(self.coefficients)

    # ---- Thrust ----

    def curve_force(self, curve: Curve, command: float) -> float:
        """Return the steady thrust (2) of one thruster (N) for a fraction of the full command, at the usual voltage."""
        values = {"u_one": command, "voltage": self.layout.voltage or 0.0}
        *_, force = _thrust_of(curve)({**self.coefficients, **values}).values()
        return float(force)

    def commanded(self, inputs: Values) -> dict[str, float]:
        """Return the steady thrust of every thruster (N), by its name, for the commands."""
        found = self._steady(inputs)
        names = self._formulas.names
        return {name: found[steady_name(name, curve, names).identifier] for name, curve in self.layout.curve_of.items()}

    def _steady(self, inputs: Values) -> dict[str, float]:
        """Return the values of all formulas from the commands to the steady thrust."""
        return self._formulas.thrust({**self.coefficients, **inputs, **self._acting(inputs)})

    def _acting(self, inputs: Values) -> dict[str, float]:
        """Return the commands that act after the dead time: those that are given, or else the present ones."""
        if not self.layout.has_dead_time:
            return {}
        return {delayed_name(name): inputs.get(delayed_name(name), inputs[name]) for name in self.layout.commands}

    def _values(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the coefficients, the inputs and the states by name. Other names in the mappings are left out."""
        return {
            **self.coefficients,
            **{name: inputs[name] for name in self.layout.inputs},
            **self._acting(inputs),
            **{name: state[name] for name in self.layout.state},
            **{name: state[name] for name in self.layout.continued if name in state},
        }

    def calculated(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the values of `layout.calculated` by name: thrust, torque and Euler angles."""
        found = self._formulas.calculate(self._values(inputs, state))
        for name in self.layout.continued:
            found[name] = heading(found, state.get(name, found[name]))
        return {name: found[name] for name in self.layout.calculated}

    def effect(self, thruster: Thruster, axis: Axis) -> float:
        """Return the force along an axis per newton of a thruster, or the torque per newton (m)."""
        found = thruster.effect(axis)
        by_arm = axis is YAW and thruster.position is None and thruster.arm
        return found * arm(*(self[name] for name in ARM)) if by_arm else found

    # ---- Motion ----

    def derivatives(self, inputs: Values, state: Values) -> dict[str, float]:
        """Return the time derivatives of the states by their names."""
        found = self._formulas.calculate(self._values(inputs, state))
        return {name: found[f"der_{name}"] for name in self.layout.state}

    def step(self, inputs: Values, state: Values, h: float) -> dict[str, float]:
        """Return the states after h > 0 seconds with the inputs held, and the heading of a vehicle with an attitude.

        The result is exact up to rounding. It is not finite when the motion overflows or takes too many substeps
        (rov_fmu/model/step.py).
        """
        after = step(self._formulas.model, self._values(inputs, state), h)
        return {name: after[name] for name in (*self.layout.state, *self.layout.continued)}

    def delay_line(self) -> DelayLine:
        """Return the commands that act before the first one, and nothing that waits for the dead time."""
        commands = self.layout.commands if self.layout.has_dead_time else {}
        return DelayLine(
            {name: declaration.start for name, declaration in commands.items()},
            {name: delayed_name(name) for name in commands},
        )

    # ---- One axis alone ----

    def effective_inertia(self, form: VehicleAxis) -> float:
        """Return the effective inertia m/β (kg, kg.m2): the load per acceleration along an axis alone."""
        gain = self.parameters[self._formulas.names("gain", form.axis.velocity).identifier]
        return 1.0 / gain if gain > 0.0 else inf

    def alone(self, axis: Axis, inputs: Values) -> AxisAlone:
        """Return the motion of an axis alone, (18), under held inputs, once the thrust is steady."""
        return self._alone(axis, {**self._steady(inputs), **self.parameters})

    def _alone(self, axis: Axis, values: Values) -> AxisAlone:
        found = self._formulas.alone[axis.name](values)
        drag, reverse = (found["A"], found["B"]), (found["A_reverse"], found["B_reverse"])
        return AxisAlone(*drag, found["C"], reverse if reverse != drag else None)

    def motions(self, inputs: Values) -> tuple[AxisAlone, ...]:
        """Return the motion of each axis alone under held inputs, once the thrust is steady."""
        values = {**self._steady(inputs), **self.parameters}
        return tuple(self._alone(form.axis, values) for form in self.layout.axes)

    def held_inputs(self, axis: Axis, command: float) -> dict[str, float]:
        """Return all inputs: an axis driven at a fraction of the full command, the other inputs as usual."""
        return self.layout.usual_inputs | self.layout.driving(axis, command)

    def force(self, axis: Axis, command: float) -> float:
        """Return the steady thrust (N) or torque (N.m) along an axis before the tuning α: (9), (10), (4)."""
        return self.along(axis, self.commanded(self.held_inputs(axis, command)))

    def along(self, axis: Axis, F: Values) -> float:
        """Return the thrust (N) or torque (N.m) along an axis of thrusters with some forces, N."""
        return sum(self.effect(t, axis) * F[t.name] for t in self.layout.drivers(axis))

    def strongest(self, axis: Axis) -> float:
        """Return the larger of the thrusts or torques at full command in both directions, before the tuning α."""
        return max(abs(self.force(axis, c)) for c in (1.0, -1.0))

    def held(self, axis: Axis, command: float) -> AxisAlone:
        """Return the motion of an axis alone, (18), under a held command, once the thrust is steady."""
        return self.alone(axis, self.held_inputs(axis, command))

    def response(self, axis: Axis, command: float) -> tuple[float, float]:
        """Return the signed V_ss, and Tau (17) from rest in s, in closed form."""
        motion = self.held(axis, command)
        return motion.steady_velocity(), motion.time_constant()


def parameters_of(layout: Layout, coefficients: Values) -> dict[str, float]:
    """Return the numbers that follow from the coefficients alone, by their names in rov_fmu/model/equation.py."""
    return _formulas_of(layout).parameters(coefficients)
