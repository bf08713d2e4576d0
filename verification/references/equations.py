"""The equations of motion as a reference: written out independently of the package, in numbers of any kind.

They use a vehicle's declarations (axes, curves, thrusters, inputs) and numbers, but no formula of rov_fmu/equation/.
The functions take the kind of the numbers as `numbers`: mpmath's `mp`, with its current precision, or FLOATS.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from rov_fmu.equation.parts import CommandTable, Curve, Thruster
from rov_fmu.vehicle.vehicle import Vehicle

Number = Any  # a float, or a number of mpmath or gmpy2
FLOATS = SimpleNamespace(mpf=float, zero=0.0, one=1.0, inf=math.inf, fsum=math.fsum, sin=math.sin, cos=math.cos)
"""Floats, behind the names that mpmath uses."""
PLACES = {"u": 0, "v": 1, "w": 2}
"""The component of a thruster's direction along each velocity."""


@dataclass(frozen=True)
class Axis:
    """An axis without coupling: v' = push + load - B v - A |v| v + the accelerations by the lagging forces."""

    ahead: tuple[Number, Number]
    """A and B for v > 0."""
    astern: tuple[Number, Number]
    """A and B for v < 0."""
    push: Number
    """The acceleration by the thrusters without lag."""
    load: Number
    """The acceleration by loads."""
    lagging: Sequence[Number]
    """The acceleration by 1 N of each thruster with a lag."""
    inertia: Number
    """m/β."""

    @property
    def constant(self) -> Number:
        """The acceleration at rest, without lagging forces."""
        return self.push + self.load


@dataclass(frozen=True)
class Lag:
    """The lag of a force: F' = (target - F)/T."""

    target: Number
    T: Number


@dataclass(frozen=True)
class Equations:
    """The numbers of a vehicle with held commands: axes by velocity, and lags by thruster.

    A state is a list: the velocities, x, y, z, psi, and the forces with a lag. Its numbers may be of any kind.
    """

    axes: Mapping[str, Axis]
    lags: Mapping[str, Lag]
    coupled: bool
    points: Sequence[tuple[Sequence[Number], Sequence[Number]]] = ()
    """Positions in the body frame at which forces act, m, and the forces in the earth frame, N."""

    @cached_property
    def places(self) -> list[int]:
        """The places of u, v, w and r among the velocities; -1 for an axis that there is not."""
        names = [*self.axes]
        return [names.index(name) if name in names else -1 for name in ("u", "v", "w", "r")]

    def level(self, velocities: Sequence[Number]) -> list[Number]:
        """Return u, v, w and r."""
        return [velocities[n] if n >= 0 else 0 for n in self.places]

    def accelerations(
        self, velocities: Sequence[Number], forces: Sequence[Number], signs: Sequence[int] = (), thrust: Number = 1
    ) -> list[Number]:
        """Return the accelerations with some forces of the lagging thrusters.

        The signs are those of the velocities, which choose the drag. `thrust` is a factor of the thrust without lag.
        """
        signs = signs or [-1 if V < 0 else 1 for V in velocities]
        found = []
        for axis, V, sign in zip(self.axes.values(), velocities, signs, strict=True):
            A, B = axis.astern if sign < 0 else axis.ahead
            lagging = sum(gain * F for gain, F in zip(axis.lagging, forces, strict=True))
            found.append(thrust * axis.push + axis.load + lagging - (B + sign * A * V) * V)
        if self.coupled:
            (u, v, _, r), (U, S, _, R) = self.level(velocities), self.places
            M_u, M_v, M_r = (self.axes[name].inertia for name in ("u", "v", "r"))
            found[U] += M_v / M_u * v * r
            found[S] -= M_u / M_v * u * r
            found[R] -= (M_v - M_u) / M_r * u * v
        return found

    def derivatives(
        self, y: Sequence[Number], sin_cos: Callable[[Number], tuple[Number, Number]], signs: Sequence[int] = ()
    ) -> list[Number]:
        """Return the time derivatives of a state without a current. `sin_cos` is that of the heading."""
        n = len(self.axes)
        u, v, w, r = self.level(y[:n])
        s, c = sin_cos(y[n + 3])
        lagging = [(lag.target - F) / lag.T for lag, F in zip(self.lags.values(), y[n + 4 :], strict=True)]
        accelerations = self.accelerations(y[:n], y[n + 4 :], signs)
        for (x, y_, _), (N, E, D) in self.points:
            X, Y = c * N + s * E, c * E - s * N
            for place, load, axis in zip(self.places, (X, Y, D, x * Y - y_ * X), "uvwr", strict=True):
                if place >= 0:
                    accelerations[place] += load / self.axes[axis].inertia
        return [*accelerations, u * c - v * s, u * s + v * c, w, r, *lagging]

    def rates(self, state: Mapping[str, Number], inputs: Mapping[str, float], numbers: Any) -> dict[str, Number]:
        """Return the time derivatives of a state by name."""
        names = [*self.axes, "x", "y", "z", "psi", *(f"F_{name}" for name in self.lags)]
        y = [state.get(name, numbers.zero) for name in names]
        found = dict(zip(names, self.derivatives(y, lambda psi: (numbers.sin(psi), numbers.cos(psi))), strict=True))
        for name, current in (("x", "V_N"), ("y", "V_E")):
            found[name] += inputs.get(current, 0)
        return {name: found[name] for name in state if name in found}


def _limited(command: Number, numbers: Any) -> Number:
    return min(numbers.one, max(-numbers.one, command))


def thrust(rov: Vehicle, curve: Curve, command: Number, numbers: Any, voltage: Number = 0) -> Number:
    """Return the steady force of a thruster: by its tables or by its coefficients, at the voltage of the battery."""
    by_voltage, voltage = of_voltage(rov, curve, voltage, numbers), max(numbers.mpf(voltage), numbers.zero)
    if not curve.tables:
        return by_voltage * _quadratic(rov, curve, command, numbers)
    measured = [_interpolated(table, command, numbers) for table in curve.tables]
    for (low, low_force), (high, high_force) in pairwise(zip(curve.tables, measured, strict=True)):
        if low.voltage <= voltage <= high.voltage:
            share = (voltage - numbers.mpf(low.voltage)) / (numbers.mpf(high.voltage) - numbers.mpf(low.voltage))
            force = (1 - share) * low_force + share * high_force
            break
    else:
        force = measured[0] if voltage < curve.tables[0].voltage else measured[-1]
    return numbers.mpf(rov.coefficients[f"k_t_{curve.name}"]) * by_voltage * force / curve.n_thrusters


def of_voltage(rov: Vehicle, curve: Curve, voltage: Number, numbers: Any, power: int = 2) -> Number:
    """Return the factor of a power of the speed of a rotor at a voltage. The thrust is proportional to its square."""
    if "V_0" not in curve.keys:
        return numbers.one
    V_0, n_V = (numbers.mpf(rov.coefficients[f"{key}_{curve.name}"]) for key in ("V_0", "n_V"))
    return (max(numbers.mpf(voltage), numbers.zero) / V_0) ** (n_V * power / 2)


def _interpolated(table: CommandTable, command: Number, numbers: Any) -> Number:
    """Return the force of the monotone cubic, which SciPy computes, at a command."""
    slopes = [
        numbers.mpf(float(x)) for x in PchipInterpolator(table.commands, table.values).derivative()(table.commands)
    ]
    c, F = ([numbers.mpf(x) for x in row] for row in (table.commands, table.values))
    n = next(n for n in range(len(c) - 1) if command <= c[n + 1])
    h = c[n + 1] - c[n]
    t = (command - c[n]) / h
    first, last = F[n] * (1 + 2 * t) + h * slopes[n] * t, F[n + 1] * (3 - 2 * t) - h * slopes[n + 1] * (1 - t)
    return first * (1 - t) ** 2 + last * t**2


def rotor_speed(rov: Vehicle, curve: Curve, command: Number, numbers: Any) -> Number:
    """Return the steady speed of a rotor under a command: what is beyond the dead band, with the command's sign."""
    beyond = max(abs(command) - of_direction(rov, curve, "c_0", command, numbers), numbers.zero)
    return -beyond if command < 0 else beyond


def _quadratic(rov: Vehicle, curve: Curve, command: Number, numbers: Any) -> Number:
    """Return F(c) = a (c - c0)^2 + b (c - c0) beyond the dead band; for c < 0, -F(-c) with the reverse coefficients."""
    c_0, a, b = (of_direction(rov, curve, key, command, numbers) for key in ("c_0", "a_t", "b_t"))
    beyond = abs(command) - c_0
    if beyond <= 0:
        return numbers.zero
    size = (a * beyond**2 + b * beyond) / curve.n_thrusters
    return -size if command < 0 else size


def of_direction(rov: Vehicle, curve: Curve, key: str, command: Number, numbers: Any) -> Number:
    """Return a coefficient of a curve for the sign of a command; 0 if the curve does not have it."""
    astern = "_reverse" if command < 0 and f"{key}_reverse" in curve.keys else ""
    return numbers.mpf(rov.coefficients.get(f"{key}_{curve.name}{astern}", 0.0))


def commands(rov: Vehicle, inputs: Mapping[str, Number], numbers: Any) -> dict[str, Number]:
    """Return the command of every thruster, from -1 to 1."""
    found = {}
    for thruster in rov.layout.thrusters:
        if rov.layout.mix:
            command = numbers.fsum(
                numbers.mpf(gains[thruster.name]) * _limited(numbers.mpf(inputs[f"u_{name}"]), numbers)
                for name, gains in rov.layout.mix.items()
                if thruster.name in gains
            )
        else:
            command = numbers.mpf(inputs[f"u_{thruster.name}"])
        found[thruster.name] = _limited(command, numbers)
    return found


def steady_forces(rov: Vehicle, inputs: Mapping[str, Number], numbers: Any) -> dict[str, Number]:
    """Return the force of every thruster under the commands, with its health, after its lag has died out."""
    of_thruster = rov.layout.curve_of
    voltage = inputs.get("voltage", 0)
    return {
        name: numbers.mpf(rov.coefficients[f"health_{name}"])
        * thrust(rov, of_thruster[name], command, numbers, voltage)
        for name, command in commands(rov, inputs, numbers).items()
    }


def effect(rov: Vehicle, thruster: Thruster, velocity: str, numbers: Any) -> Number:
    """Return the force along an axis, or the yaw torque, by 1 N of a thruster.

    The torque is x Y - y X for a thruster with a position, and R sin γ for one with an arm (4).
    """
    if velocity != "r":
        return numbers.mpf(thruster.direction.value[PLACES[velocity]])
    if thruster.position is not None:
        x, y, _ = map(numbers.mpf, thruster.position.value)
        return x * numbers.mpf(thruster.direction.value[1]) - y * numbers.mpf(thruster.direction.value[0])
    if not thruster.arm:
        return numbers.zero
    return thruster.side * numbers.mpf(rov.coefficients["R"]) * numbers.sin(numbers.mpf(rov.coefficients["gamma"]))


def equations(rov: Vehicle, inputs: Mapping[str, Number], numbers: Any) -> Equations:
    """Return the equations of a vehicle with these inputs."""
    return driven(rov, steady_forces(rov, inputs, numbers), inputs, numbers)


def driven(rov: Vehicle, F: Mapping[str, Number], loads: Mapping[str, Number], numbers: Any) -> Equations:
    """Return the equations of a vehicle with these steady forces of the thrusters and loads such as X_ext."""
    k = {name: numbers.mpf(value) for name, value in rov.coefficients.items()}
    lag_of = {curve.name: k[f"T_{curve.name}"] for curve in rov.layout.curves if "T" in curve.keys}
    lags = {t.name: Lag(F[t.name], lag_of[t.curve]) for t in rov.layout.thrusters if t.curve in lag_of}
    axes = {}
    for velocity in (form.axis.velocity for form in rov.layout.axes):
        mass = (k["I_r"] if velocity == "r" else k["m_rov"]) + k.get(f"m_a_{velocity}", 0)
        alpha, beta = k[f"alpha_{velocity}"], k[f"beta_{velocity}"]
        external = {"u": "X_ext", "v": "Y_ext", "w": "Z_ext", "r": "N_ext"}[velocity]
        by = {t.name: alpha * effect(rov, t, velocity, numbers) for t in rov.layout.thrusters}
        held = numbers.fsum(gain * F[name] for name, gain in by.items() if name not in lags)
        load = numbers.mpf(loads.get(external, 0)) + k.get(f"F_0_{velocity}", 0)
        drag = [k[f"{key}_{velocity}"] for key in ("a_d", "b_d")]
        reverse = (k.get(f"{key}_{velocity}_reverse") for key in ("a_d", "b_d"))
        astern = [forward if other is None else other for forward, other in zip(drag, reverse, strict=True)]
        axes[velocity] = Axis(
            (beta * drag[0] / mass, beta * drag[1] / mass),
            (beta * astern[0] / mass, beta * astern[1] / mass),
            beta * held / mass,
            beta * load / mass,
            [beta * by[name] / mass for name in lags],
            mass / beta if beta else numbers.inf,
        )
    points = [
        ([k[f"r_{axis}_{p.name}"] for axis in "xyz"], [numbers.mpf(loads[f"F_{d}_{p.name}"]) for d in "NED"])
        for p in rov.layout.points
    ]
    return Equations(axes, lags, rov.layout.coupled, points)


def calculated(rov: Vehicle, values: Mapping[str, Number], numbers: Any) -> dict[str, Number]:
    """Return every output and every derivative, for values of all inputs, states and coefficients."""
    k = Vehicle(rov.layout, {name: values[name] for name in rov.coefficients})
    state = {name: numbers.mpf(values[name]) for name in rov.layout.state}
    rates = equations(k, values, numbers).rates(state, values, numbers)
    forces = steady_forces(k, values, numbers) | {
        n.removeprefix("F_"): numbers.mpf(values[n]) for n in rov.layout.lagging
    }
    found = {name: numbers.mpf(values[name]) for name in rov.layout.state} | {f"F_{n}": F for n, F in forces.items()}
    for curve in rov.layout.turning_curves:
        turning = (effect(k, t, "r", numbers) * forces[t.name] for t in rov.layout.thrusters if t.curve == curve.name)
        found[f"tau_{curve.name}"] = numbers.fsum(turning)
    of_states = {f"der({name})": rate for name, rate in rates.items()}
    return found | with_over_ground(of_states) | electric(k, values, numbers)


def electric(rov: Vehicle, values: Mapping[str, Number], numbers: Any) -> dict[str, Number]:
    """Return the electric current and power of the thrusters, by their tables, between whose points they are linear."""
    found: dict[str, Number] = {}
    driven, voltage = commands(rov, values, numbers), max(values.get("voltage", 0.0), 0.0)
    for name, curve in rov.layout.curve_of.items():
        if table := curve.electric_current:
            found[f"electric_current_{name}"] = np.interp(float(driven[name]), table.commands, table.values)
            volts = table.voltage if rov.layout.voltage is None else voltage
            found[f"electric_power_{name}"] = found[f"electric_current_{name}"] * volts
    kinds = ("electric_current", "electric_power") if found else ()
    return found | {kind: math.fsum(x for name, x in found.items() if name.startswith(kind)) for kind in kinds}


def with_over_ground(rates: Mapping[str, Number]) -> dict[str, Number]:
    """Return the derivatives of all states, with those of the position also as the velocity over ground."""
    return {
        **rates,
        **{f"vg_{d}": rates[f"der({x})"] for d, x in zip("NED", "xyz", strict=True) if f"der({x})" in rates},
    }
