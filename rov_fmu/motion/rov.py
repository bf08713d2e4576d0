"""A vehicle in motion: thrust, axes, derivatives and the exact step (standard library only).

Values go by name, as rov_fmu/motion/layout.py declares them: inputs, state, coefficients.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import cos, expm1, inf, sin

from . import series
from .layout import ARM, HEAVE, SURGE, SWAY, YAW, Axis, Curve, Layout, Thruster, VehicleAxis, arm
from .riccati import Riccati

Values = Mapping[str, float]


def saturate(command: float) -> float:
    """A command within ±1."""
    return max(-1.0, min(1.0, command))


@dataclass(frozen=True)
class Rov:
    """What a vehicle has, and its numbers: every coefficient of the layout by name."""

    layout: Layout
    coefficients: Values

    def __getitem__(self, name: str) -> float:
        """A coefficient."""
        return self.coefficients[name]

    def replaced(self, values: Values) -> "Rov":
        """With other values of some coefficients."""
        return Rov(self.layout, {**self.coefficients, **values})

    def extended(self, values: Values) -> "Rov":
        """With these coefficients, which its layout may not have yet."""
        return Rov(self.layout.extended(values), {**self.coefficients, **values})

    # ---- Thrust ----

    def curve_force(self, curve: Curve, command: float) -> float:
        """Thrust (2) of one thruster in N: a_t m^2 + b_t m, m beyond the dead band, of the direction's curve."""
        c = saturate(command)
        end = "_reverse" if c < 0.0 else ""
        a_t, b_t = (self[curve.coefficient(key + end)] for key in ("a_t", "b_t"))
        dead = self[curve.coefficient("c_0" + end)] if "c_0" in curve.keys else 0.0
        m = abs(c) - dead
        if m <= 0.0:
            return 0.0
        force = (a_t * m + b_t) * m / curve.together
        return -force if c < 0.0 else force

    def commanded(self, inputs: Values) -> dict[str, float]:
        """The steady thrust of every thruster (N), by its name, for the commands."""
        found = {}
        for thruster in self.layout.thrusters:
            gains = self.layout.gains[thruster.name]
            command = sum(gain * saturate(inputs[name]) for name, gain in gains.items())
            found[thruster.name] = self.curve_force(self.layout.curve_of[thruster.name], command)
        return found

    def forces(self, inputs: Values, state: Values) -> dict[str, float]:
        """The thrust of every thruster (N), by its name: the state where it lags behind the commands."""
        lagging = self.layout.lagging
        return {name: state[key] if (key := f"F_{name}") in lagging else force
                for name, force in self.commanded(inputs).items()}  # fmt: skip

    def thrust(self, inputs: Values, state: Values) -> dict[str, float]:
        """The calculated variables of the thrusters by name."""
        F = self.forces(inputs, state)
        found = {f"F_{name}": force for name, force in F.items()}
        for curve in self.layout.turning_curves:
            found[f"tau_{curve.name}"] = sum(
                self.effect(t, YAW) * F[t.name] for t in self.layout.thrusters if t.curve == curve.name
            )
        return {name: found[name] for name in self.layout.thrust}

    def effect(self, thruster: Thruster, axis: Axis) -> float:
        """Force along an axis, or torque (m), of 1 N of a thruster."""
        found = thruster.effect(axis)
        by_arm = axis is YAW and thruster.position is None and thruster.arm
        return found * arm(*(self[name] for name in ARM)) if by_arm else found

    # ---- Motion ----

    def inertia(self, form: VehicleAxis) -> float:
        """Mass or moment of inertia, with the added mass."""
        added = self[form.coefficient("m_a")] if "m_a" in form.keys else 0.0
        return self[form.axis.inertia] + added

    def gain(self, form: VehicleAxis) -> float:
        """β/m: acceleration by force."""
        return self[form.axis.coefficient("beta")] / self.inertia(form)

    def effective_inertia(self, form: VehicleAxis) -> float:
        """m/β, which resists acceleration."""
        beta = self[form.axis.coefficient("beta")]
        return self.inertia(form) / beta if beta > 0.0 else inf

    def load(self, form: VehicleAxis) -> float:
        """Constant load F_0 (N, N.m), where the axis has one."""
        return self[form.coefficient("F_0")] if "F_0" in form.keys else 0.0

    def acceleration_of(self, form: VehicleAxis, thrust: float, load: float = 0.0) -> Riccati:
        """An axis under a held thrust (before α) and load, (18): m v' = β (α F + F_ext + F_0 - a_d |v| v - b_d v)."""
        gain = self.gain(form)
        A, B = (gain * self[form.coefficient(key)] for key in ("a_d", "b_d"))
        reverse = None
        if "a_d_reverse" in form.keys:
            reverse = gain * self[form.coefficient("a_d_reverse")], gain * self[form.coefficient("b_d_reverse")]
        return Riccati(A, B, gain * (self[form.axis.coefficient("alpha")] * thrust + load + self.load(form)), reverse)

    def axes(self, inputs: Values, F: Values) -> tuple[Riccati, ...]:
        """Every axis under held inputs and forces of the thrusters."""
        return tuple(
            self.acceleration_of(
                form,
                sum(self.effect(t, form.axis) * F[t.name] for t in self.layout.drivers(form.axis) if t.name in F),
                inputs[form.axis.external],
            )
            for form in self.layout.axes
        )

    @cached_property
    def coupling(self) -> series.Coupling | None:
        """Of surge, sway and yaw, where the vehicle has it."""
        if not self.layout.coupled:
            return None
        M_u, M_v, M_r = (self.effective_inertia(self.layout.kinds[axis.name]) for axis in (SURGE, SWAY, YAW))
        return series.Coupling(M_v / M_u, M_u / M_v, (M_v - M_u) / M_r)

    def derivatives(self, inputs: Values, state: Values) -> dict[str, float]:
        """Time derivatives of the state by its names: (18), the coupling, the kinematics with the current, the lags."""
        layout, F = self.layout, self.forces(inputs, state)
        axes = zip(layout.axes, self.axes(inputs, F), strict=True)
        rates = {form.axis.velocity: motion.acceleration(state[form.axis.velocity]) for form, motion in axes}
        u, v, r, psi = (state.get(name, 0.0) for name in ("u", "v", "r", "psi"))
        if k := self.coupling:
            rates["u"] += k.c_u * v * r
            rates["v"] -= k.c_v * u * r
            rates["r"] -= k.c_r * u * v
        if layout.has(SURGE, SWAY):
            rates["x"] = u * cos(psi) - v * sin(psi) + inputs["V_N"]
            rates["y"] = u * sin(psi) + v * cos(psi) + inputs["V_E"]
        if layout.has(HEAVE):
            rates["z"] = state["w"]
        if layout.has(YAW):
            rates["psi"] = r
        steady = self.commanded(inputs)
        for name in layout.lagging:
            thruster = name.removeprefix("F_")
            rates[name] = (steady[thruster] - state[name]) / self._lag(layout.curve_of[thruster])
        return rates

    def step(self, inputs: Values, state: Values, h: float) -> dict[str, float]:
        """The state after h > 0 seconds with the inputs held, exact up to rounding whatever the length of h."""
        layout, steady = self.layout, self.commanded(inputs)
        after = {}
        for name in layout.lagging:
            T, target = self._lag(layout.curve_of[name.removeprefix("F_")]), steady[name.removeprefix("F_")]
            after[name] = state[name] + (state[name] - target) * expm1(-h / T)
        names = [form.axis.velocity for form in layout.axes]
        fades, held = self._fades(steady, state)
        axes, velocities = self.axes(inputs, held), [state[name] for name in names]
        u, v, r = (names.index(name) if name in names else None for name in ("u", "v", "r"))
        flow = series.Flow(axes, fades, self.coupling, u, v, r)
        moved = series.advance(flow, velocities, h)
        if flow.is_free:  # the track alone has no closed form
            ends = [motion.advance(velocity, h) for motion, velocity in zip(axes, velocities, strict=True)]
            moved = series.Moved(tuple(v for v, _ in ends), tuple(s for _, s in ends), moved.track)
        way = dict(zip(names, moved.distances, strict=True))
        after |= zip(names, moved.velocities, strict=True)
        track = moved.track * complex(cos(state.get("psi", 0.0)), sin(state.get("psi", 0.0)))
        if layout.has(SURGE, SWAY):
            after["x"] = state["x"] + track.real + inputs["V_N"] * h
            after["y"] = state["y"] + track.imag + inputs["V_E"] * h
        if layout.has(HEAVE):
            after["z"] = state["z"] + way["w"]
        if layout.has(YAW):
            after["psi"] = state["psi"] + way["r"]
        return {name: after[name] for name in layout.state}

    def _lag(self, curve: Curve) -> float:
        return self[curve.coefficient("T")]

    def _fades(self, steady: Values, state: Values) -> tuple[tuple[series.Fade, ...], dict[str, float]]:
        """The forces that a lag still changes, as acceleration of each axis; and those of all other thrusters (N)."""
        fades, held = [], dict(steady)
        for curve in (curve for curve in self.layout.curves if curve.has_lag):
            now = {t.name: state[f"F_{t.name}"] for t in self.layout.thrusters if t.curve == curve.name}
            if any(force != steady[name] for name, force in now.items()):
                then = {name: held.pop(name) for name in now}
                fades.append(series.Fade(1.0 / self._lag(curve), self._pushed(now), self._pushed(then)))
        return tuple(fades), held

    def _pushed(self, F: Values) -> tuple[float, ...]:
        """Acceleration of each axis by forces of some thrusters."""
        return tuple(
            self[form.axis.coefficient("alpha")]
            * sum(self.effect(t, form.axis) * F[t.name] for t in self.layout.drivers(form.axis) if t.name in F)
            * self.gain(form)
            for form in self.layout.axes
        )

    # ---- One axis alone ----

    def held_inputs(self, axis: Axis, command: float) -> dict[str, float]:
        """All inputs, with the commands that drive an axis at a fraction of full thrust."""
        signs = self.layout.signs(axis)
        return {name: command * signs.get(name, 0.0) for name in self.layout.inputs}

    def force(self, axis: Axis, command: float) -> float:
        """Thrust (N) or torque (N.m) along an axis before the tuning α, by (9), (10) and (4), once it is steady."""
        F = self.commanded(self.held_inputs(axis, command))
        return sum(self.effect(t, axis) * F[t.name] for t in self.layout.drivers(axis))

    def strongest(self, axis: Axis) -> float:
        """The strongest thrust or torque along an axis, before the tuning α, whichever way."""
        return max(abs(self.force(axis, c)) for c in (1.0, -1.0))

    def held(self, axis: Axis, command: float) -> Riccati:
        """The motion along an axis under a held command, (18), once the thrust is steady."""
        return self.acceleration_of(self.layout.kinds[axis.name], self.force(axis, command))

    def response(self, axis: Axis, command: float) -> tuple[float, float]:
        """Signed V_ss, and Tau (17) in s from rest, in closed form."""
        motion = self.held(axis, command)
        return motion.steady_velocity(), motion.time_constant()
