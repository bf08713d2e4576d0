"""A coupled vehicle as the rigid body of rigid_body.py: its numbers, its outputs, and its motion.

Like equations.py, it uses a vehicle's declarations and numbers, but no formula of rov_fmu/equation/.
"""

from collections.abc import Callable, Mapping, Sequence

import gmpy2
import numpy as np
from gmpy2 import mpfr
from mpmath import mp

from rov_fmu.equation.catalogue import cross_name
from rov_fmu.vehicle.vehicle import Vehicle

from . import equations, rigid_body
from .equations import commands, of_direction, of_voltage, rotor_speed, steady_forces
from .extrapolation import BITS, plain, real, until_reversal
from .rigid_body import VELOCITIES, Array, Body, Floats, Number, euler_angles, of_point, rigid_body_mass, rotation, skew

Values = Mapping[str, Number]
QUATERNION = ("eta", "epsilon_1", "epsilon_2", "epsilon_3")
LOADS = ("X_ext", "Y_ext", "Z_ext", "K_ext", "M_ext", "N_ext")
_TOLERANCE = 1e-22  # of a step of the extrapolation


def body(rov: Vehicle, inputs: Values, number: Callable[[Number], Number] = float) -> Body:
    """Return a vehicle under held inputs as a rigid body. `number` converts numbers to those of the body."""
    layout = rov.layout
    held = {name: number(value) for name, value in {**rov.coefficients, **inputs}.items()}

    def get(name: str, otherwise: str = "", default: float = 0.0) -> Number:
        return held.get(name, held.get(otherwise, number(default)))

    def six(stem: str, default: float = 0.0) -> Array:
        return np.array([get(f"{stem}_{v}", default=default) for v in VELOCITIES])

    def astern_of(key: str) -> Array:
        return np.diag([get(f"{key}_{v}_reverse", f"{key}_{v}") for v in VELOCITIES])

    gravity, buoyancy = (np.array([get(f"{axis}_{point}") for axis in "xyz"]) for point in "GB")
    inertia = np.diag([get(f"I_{v}", default=1.0) for v in "pqr"])
    mass = rigid_body_mass(get("m_rov", default=1.0), inertia, gravity) + np.diag(six("m_a"))
    linear, back, ahead, astern = np.diag(six("b_d")), astern_of("b_d"), np.diag(six("a_d")), astern_of("a_d")
    lift = {}
    for key, first, *others in layout.cross:
        value, i, j = held[cross_name(key, first, *others)], VELOCITIES.index(first), VELOCITIES.index(others[0])
        if key == "m_a":
            mass[i, j] += value
            mass[j, i] += value
        elif key == "b_d":
            linear[i, j] = back[i, j] = value
        elif key == "a_d":
            ahead[i, j] = astern[i, j] = value
        else:
            lift[i, j, VELOCITIES.index(others[1])] = value
    beta, thrusters = six("beta", 1.0), _thrusters(rov, inputs, number)
    net, g = get("W") - get("B") if "W" in held else get("F_0_w"), number("9.80665")
    displaced = -net / g, (get("B") * buoyancy - get("W") * gravity) / g
    rotors, has_rotor = _rotors(rov, inputs, number)
    return Body(
        "".join(layout.velocities),
        mass / np.outer(beta, beta) ** 0.5,
        linear,
        back,
        ahead,
        astern,
        lift,
        np.array([number(x) for x in _fins(rov, inputs)]),
        *thrusters,
        six("alpha", 1.0),
        np.array([get(name) for name in LOADS]) + six("F_0"),
        get("W"),
        get("B"),
        gravity,
        buoyancy,
        np.array([get(name) for name in ("V_N", "V_E", "V_D")]),
        rotors,
        has_rotor,
        [(at, np.array([get(f"F_{direction}_{name}") for direction in "NED"])) for name, at in _points(rov, get)],
        displaced,
        np.array([get(name) for name in ("A_N", "A_E", "A_D")]),
    )


def _points(rov: Vehicle, get: Callable[[str], Number]) -> list[tuple[str, Array]]:
    """Return the names and the positions of the points at which forces act."""
    return [(one.name, np.array([get(f"r_{axis}_{one.name}") for axis in "xyz"])) for one in rov.layout.points]


def _wrench(place: Sequence[Number], force: Sequence[Number]) -> Array:
    """Return a force at a place, with its moment."""
    at, F = (np.array([mp.mpf(x) for x in vector]) for vector in (place, force))
    return np.concatenate([F, skew(at) @ F])


def _thrusters(rov: Vehicle, inputs: Values, number: Callable[[Number], Number]) -> tuple[Array, Array, Array, Array]:
    """Return the wrenches, the steady forces, the losses and the lags of all thrusters."""
    forces, rows = steady_forces(rov, inputs, mp), []
    for thruster, (name, command) in zip(rov.layout.thrusters, commands(rov, inputs, mp).items(), strict=True):
        curve = rov.layout.curve_of[name]
        assert thruster.position
        loss = of_direction(rov, curve, "d", command, mp)
        loss *= of_voltage(rov, curve, inputs.get("voltage", 0), mp, power=1)
        lag = mp.mpf(rov.coefficients[f"T_{curve.name}"]) if curve.has_lag else mp.zero
        wrench = _wrench(thruster.place, thruster.direction.value)
        health = mp.mpf(rov.coefficients[f"health_{name}"])
        target = rotor_speed(rov, curve, command, mp) if curve.has_rotors else forces[name]
        rows.append([*wrench, target, health * loss * abs(command) / curve.n_thrusters, lag])
    table = np.array([[number(x) for x in row] for row in rows]).reshape(-1, 9)
    return table[:, :6], table[:, 6], table[:, 7], table[:, 8]


def _rotors(rov: Vehicle, inputs: Values, number: Callable[[Number], Number]) -> tuple[Array, Array]:
    """Return a, b and d of each rotor whose speed lags, ahead and astern, and which thrusters have one."""
    curves, k, rows = rov.layout.curve_of, rov.coefficients, []
    for sign in (1, -1):
        for key in ("a_t", "b_t", "d"):
            row = []
            for name, curve in curves.items():
                value = of_direction(rov, curve, key, sign, mp)
                value *= of_voltage(rov, curve, inputs.get("voltage", 0), mp, power=1 if key == "d" else 2)
                row.append(number(mp.mpf(k[f"health_{name}"]) * value / curve.n_thrusters))
            rows.append(row)
    return np.array(rows).reshape(2, 3, -1), np.array([curve.has_rotors for curve in curves.values()], bool)


def _fins(rov: Vehicle, inputs: Values) -> Array:
    """Return the forces of the fins along each axis as factors of |u| u, at the angles for the commands."""
    found = np.full(6, mp.zero)
    for fin in rov.layout.fins:
        command = min(mp.one, max(-mp.one, mp.mpf(inputs[f"u_{fin.name}"])))
        k = {key: mp.mpf(rov.coefficients.get(f"{key}_{fin.name}", 0.0)) for key in ("lift", "drag", "angle_max")}
        angle = k["angle_max"] * command
        force = [k["lift"] * angle * mp.mpf(x) for x in fin.direction.value]
        force[0] -= k["drag"] * angle**2
        found = found + _wrench(fin.place, force)
    return found


def places(rov: Vehicle, state: Values) -> list[Number]:
    """Return the state of the rigid body for a vehicle's state.

    Without a quaternion, the attitude is that of the Euler angles at the start, or of the heading.
    """
    angles = (state.get("phi_0", 0.0), state.get("theta_0", 0.0), state.get("psi_0", state.get("psi", 0.0)))
    quaternion = [state[name] for name in QUATERNION] if "eta" in state else rigid_body.quaternion_of(*angles)
    pose = [state.get(name, 0.0) for name in "xyz"]
    lagging = (state[name] for name in rov.layout.lagging)
    return [*(state.get(v, 0.0) for v in VELOCITIES), *quaternion, *pose, *lagging]


def compared(rov: Vehicle, y: Sequence[Number]) -> list[Number]:
    """Return what two states of a rigid body are compared by: the quaternion as a rotation, only the axes there are."""
    pose = [x for name, x in zip("xyz", y[10:13], strict=True) if name in rov.layout.pose]
    return [*(y[VELOCITIES.index(v)] for v in rov.layout.velocities), *rotation(y[6:10]).flat, *pose, *y[13:]]


def integrate(rov: Vehicle, inputs: Values, y: Sequence[Number], h: float) -> Floats:
    """Return the state of the rigid body after h seconds, to some 13 digits."""
    return rigid_body.integrate(body(rov, inputs), list(map(float, y)), h)


def end(rov: Vehicle, inputs: Values, state: Values, h: float) -> list[Number]:
    """Return the vehicle's states after h seconds, to some 13 digits."""
    y = integrate(rov, inputs, places(rov, state), h).tolist()
    by_name = dict(zip((*VELOCITIES, *QUATERNION, *"xyz", *rov.layout.lagging), y, strict=True))
    return [by_name[name] for name in rov.layout.state]


def step(rov: Vehicle, inputs: Values, state: Values, h: float) -> list[Number]:
    """Return the state of the rigid body after h seconds, to some 20 digits.

    A step of the extrapolation ends where a velocity or a rotor reverses.
    """
    with mp.workdps(70), gmpy2.context(gmpy2.get_context(), precision=BITS):
        inverse = np.array([[real(x) for x in row] for row in body(rov, inputs, mp.mpf).inverse])
        of_step = body(rov, inputs, real)

        def rates_with(signs: Sequence[int]) -> Callable[[Sequence[Number]], list[Number]]:
            sides = dict(zip(of_step.reversing, signs, strict=True))

            def rates(y: Sequence[Number]) -> list[Number]:
                all_sides = np.array([sides.get(n, 1) for n in (*range(6), *range(13, len(y)))])
                return rigid_body.rates(of_step, inverse, np.array(y), all_sides).tolist()  # type: ignore[no-any-return]

            return rates

        y, rest, size = [real(x) for x in places(rov, state)], mpfr(h), mpfr(h)
        while rest > 0:
            y, taken, size = until_reversal(rates_with, y, of_step.reversing, min(size, rest), _TOLERANCE)
            rest -= taken
        return [plain(x) for x in y]


def calculated(rov: Vehicle, values: Values, number: Callable[[Number], Number] = mp.mpf) -> dict[str, Number]:
    """Return every output and every derivative of a vehicle, for values of all inputs, states and parameters.

    The attitude may be given as in `places`. The heading of a vehicle that rolls lies between -pi and pi. `number` may
    be float for a faster result with fewer digits.
    """
    layout = rov.layout
    y = np.array([number(x) for x in places(rov, values)])
    R, held = rotation(y[6:10]), {name: number(values.get(name, 0.0)) for name in ("V_N", "V_E", "V_D")}
    tied: dict[str, Number] = {}
    for name, at in _points(rov, lambda name: number(values[name])):
        outputs = (*(f"{x}_{name}" for x in "xyz"), *(f"vg_{d}_{name}" for d in "NED"))
        tied |= dict(zip(outputs, of_point(at, R, y[:6], y[10:13], np.array([*held.values()])), strict=True))
    if not layout.has_attitude:
        return equations.calculated(rov, values, mp) | tied
    k = Vehicle(layout, {name: values[name] for name in rov.coefficients})
    of_vehicle = body(k, {name: values[name] for name in layout.inputs}, number)
    rates = rigid_body.rates(of_vehicle, of_vehicle.inverse, y)
    names = [*VELOCITIES, *QUATERNION, *"xyz", *layout.lagging]
    found = {name: x for name, x in zip(names, y, strict=True) if name in layout.state}
    of_states = {f"der({name})": rate for name, rate in zip(names, rates, strict=True) if name in layout.state}
    found |= equations.with_over_ground(of_states)
    steady = steady_forces(k, values, mp)
    forces = {name: values.get(f"F_{name}", force) for name, force in steady.items()}
    for n, (name, curve) in enumerate(layout.curve_of.items()):
        if curve.has_rotors:
            speed = mp.mpf(values[f"n_{name}"])
            a, b, _ = (mp.mpf(x) for x in of_vehicle.rotors[int(speed < 0), :, n])
            forces[name] = (a * abs(speed) + b) * speed
    found |= {f"F_{name}": mp.mpf(F) for name, F in forces.items()}
    for curve in layout.turning_curves:
        own = [t for t in layout.thrusters if t.curve == curve.name]
        found[f"tau_{curve.name}"] = mp.fsum(_wrench(t.place, t.direction.value)[5] * forces[t.name] for t in own)
    found |= equations.electric(k, values, mp)
    return found | tied | dict(zip(("phi", "theta", "psi"), euler_angles(R), strict=True))
