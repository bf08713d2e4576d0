"""The formulas from the commands to the steady thrust of the thrusters and the angles of the fins."""

from itertools import pairwise
from math import inf

from .catalogue import REVERSE
from .expression import (
    Expression,
    Name,
    Names,
    beyond_dead_band,
    call,
    directed,
    equal,
    of,
    product,
    saturated,
    total,
    where,
    with_positive_zero,
)
from .layout import Layout
from .parts import Curve

Formulas = dict[str, Expression]
_VOLTAGE = Name("voltage")


def thrust_formulas(layout: Layout, names: Names) -> Formulas:
    """Return formulas for the steady thrust (2), (9), (10) of every thruster, and for the angles of the fins.

    Each input saturates at ±1, and so does each sum of inputs.
    """
    formulas: Formulas = {}
    if layout.voltage is not None:
        formulas |= _battery(names)
    for name, gains in layout.gains.items():
        parts: list[tuple[float, Expression]] = []
        for command, gain in gains.items():
            acting = Name(layout.acting.get(command, command))
            if layout.pulse:
                fraction = names("fraction", command)
                formulas[fraction.identifier] = _fraction(acting, layout.pulse)
                acting = fraction
            limited = names("saturated", command)
            formulas[limited.identifier] = saturated(acting)
            parts.append((gain, limited))
        command_of = names("command", name).identifier
        if list(gains.values()) == [1.0]:
            formulas[command_of] = parts[0][1]
        else:
            mixed = names("mixed", name)
            formulas[mixed.identifier] = total(gain * part for gain, part in parts)
            formulas[command_of] = saturated(mixed)
        if name in layout.curve_of:
            formulas |= _steady_thrust(name, layout.curve_of[name], names, Name(layout.health[name]))
    for fin in layout.fins:
        angle = Name(fin.coefficient("angle_max")) * names("command", fin.name)
        formulas[names("angle", fin.name).identifier] = angle
    return formulas


def curve_formulas(curve: Curve) -> Formulas:
    """Return formulas from the command u_one of a thruster to its steady thrust, which is the last."""
    names = Names(curve.coefficient(key) for key in curve.keys)
    command = {names("command", "one").identifier: saturated(Name("u_one"))}
    battery = _battery(names) if "V_0" in curve.keys or len(curve.tables) > 1 else {}
    return {**battery, **command, **_steady_thrust("one", curve, names, of(1.0))}


def steady_name(thruster: str, curve: Curve, names: Names) -> Name:
    """Return the name of the steady thrust of a thruster, which is its force unless it lags."""
    return names("steady", thruster) if curve.has_lag else Name(f"F_{thruster}")


def _battery(names: Names) -> Formulas:
    return {names("battery").identifier: where(_VOLTAGE < 0.0, 0.0, _VOLTAGE)}


def _fraction(command: Name, pulse: tuple[float, float, float]) -> Expression:
    """Return the formula from a pulse width to its fraction. Above and below neutral, the scale may differ.

    A pulse of 0 means that there is no signal, and stops the thruster as speed controllers do.
    """
    low, neutral, high = pulse
    below, above = neutral - low, high - neutral
    span = of(above) if below == above else where(command > neutral, above, below)
    return where(equal(command, 0.0), 0.0, (command - neutral) / span)


def _steady_thrust(name: str, curve: Curve, names: Names, health: Expression) -> Formulas:
    """Return formulas from the command of a thruster to its steady thrust, which is the last of them.

    The health multiplies the whole force, with what it loses by the speed of advance.
    """
    command, share = names("command", name), 1.0 / curve.n_thrusters
    if curve.has_rotors:
        return _steady_speed(name, curve, names, health)
    formulas, force = (_from_tables if curve.tables else _from_coefficients)(name, curve, names, health)
    if "V_0" in curve.keys:
        force = force * _by_voltage(curve, names)
    if "d" in curve.keys:
        loss = product(health, by_direction(command, curve, "d"), call("abs", command), share)
        formulas[names("loss", name).identifier] = loss
    if curve.tables:
        force = product(force, share)
    return formulas | {steady_name(name, curve, names).identifier: with_positive_zero(force)}


def _by_voltage(curve: Curve, names: Names) -> Expression:
    return call("pow", names("battery") / Name(curve.coefficient("V_0")), Name(curve.coefficient("n_V")))


def by_direction(command: Name, curve: Curve, key: str) -> Expression:
    """Return the coefficient of a curve for the direction of a thruster's command, or of its rotor."""
    return directed(command, Name(curve.coefficient(key)), Name(curve.coefficient(key + REVERSE)))


def _from_tables(name: str, curve: Curve, names: Names, health: Expression) -> tuple[Formulas, Expression]:
    """Return formulas of F = h k_t F_table(c), with F_table interpolated linearly in the voltage."""
    battery, (first, *_) = names("battery"), curve.tables
    forces = [call(table.function, names("command", name)) for table in curve.tables]
    force: Expression = forces[-1]
    for (table, low), (following, high) in reversed([*pairwise(zip(curve.tables, forces, strict=True))]):
        share = (battery - table.voltage) / (following.voltage - table.voltage)
        force = where(battery < following.voltage, low + share * (high - low), force)
    if len(forces) > 1:
        force = where(battery < first.voltage, forces[0], force)
    measured = names("table", name)
    return {measured.identifier: force}, health * Name(curve.coefficient("k_t")) * measured


def _from_coefficients(name: str, curve: Curve, names: Names, health: Expression) -> tuple[Formulas, Expression]:
    """Return the formulas of the force h (a_t m^2 + b_t m), and the formula of the force with its sign.

    m is the part of the command beyond the dead band.
    """
    command, beyond, size = (names(kind, name) for kind in ("command", "beyond", "magnitude"))
    a_t, b_t, c_0 = (by_direction(command, curve, key) for key in ("a_t", "b_t", "c_0"))
    has_dead_band = "c_0" in curve.keys
    force = directed(command, size, -size)
    return {
        beyond.identifier: call("abs", command) - c_0 if has_dead_band else call("abs", command),
        size.identifier: product(health, a_t * beyond + b_t, beyond, 1.0 / curve.n_thrusters),
    }, beyond_dead_band(beyond, c_0, force) if has_dead_band else force


# ---- Rotors whose speed lags -----------------------------------------------------------------------------------------

_FAINT = 8.0 * 2.0**-52
"""A speed below this share of the steady one is a rounding error, and has no direction."""


def _steady_speed(name: str, curve: Curve, names: Names, health: Expression) -> Formulas:
    """Return formulas from the command of a thruster to the steady speed of its rotor, and to its steady thrust.

    The speed is the part of the command beyond the dead band, with its sign.
    """
    command, beyond, speed = (names(kind, name) for kind in ("command", "beyond", "speed"))
    formulas: Formulas = {speed.identifier: command}
    if "c_0" in curve.keys:
        c_0 = by_direction(command, curve, "c_0")
        steady = beyond_dead_band(beyond, c_0, directed(command, beyond, -beyond))
        formulas = {beyond.identifier: call("abs", command) - c_0, speed.identifier: steady}
    if "V_0" in curve.keys:
        formulas[names("by_voltage", name).identifier] = _by_voltage(curve, names)
    thrust = _of_rotor(name, curve, names, health, _per_speed(speed, speed, curve), speed)
    return formulas | {steady_name(name, curve, names).identifier: with_positive_zero(thrust)}


def _per_speed(n: Name, direction: Name, curve: Curve, times: float = 1.0) -> Expression:
    a_t, b_t = (by_direction(direction, curve, key) for key in ("a_t", "b_t"))
    return product(times, a_t, call("abs", n)) + b_t


def _of_rotor(name: str, curve: Curve, names: Names, *factors: Expression) -> Expression:
    """Return a product for one of the thrusters that share a curve, at the present voltage."""
    by_voltage = [names("by_voltage", name)] if "V_0" in curve.keys else []
    return product(*factors, *by_voltage, 1.0 / curve.n_thrusters)


def rotor_formulas(name: str, curve: Curve, names: Names, health: Name) -> Formulas:
    """Return formulas of the thrust F = h (a_t |n| + b_t) n of a thruster, and of the loss h d |n| by its advance.

    The speed n of the rotor follows n_c. With the arrived fraction p, it is n + (n_c - n) p. Until the rotor reverses,
    the thrust then changes by `rise` p + `bend` p^2, and the loss by `loss_rise` p.
    """
    n, n_c, heads = Name(curve.lagging(name)), names("speed", name), names("heads", name)
    change, share = n_c - n, 1.0 / curve.n_thrusters

    def signed(key: str) -> Expression:
        """Return a coefficient with the sign of the direction in which the rotor turns next."""
        return directed(heads, Name(curve.coefficient(key)), -Name(curve.coefficient(key + REVERSE)))

    formulas: Formulas = {
        heads.identifier: where(call("abs", n) > _FAINT * call("abs", n_c), n, n_c),
        f"F_{name}": with_positive_zero(_of_rotor(name, curve, names, health, _per_speed(n, heads, curve), n)),
        names("rise", name).identifier: _of_rotor(name, curve, names, health, _per_speed(n, heads, curve, 2.0), change),
        names("bend", name).identifier: _of_rotor(name, curve, names, health, signed("a_t"), change, change),
    }
    if "d" in curve.keys:
        loss = product(health, by_direction(heads, curve, "d"), call("abs", n), share)
        formulas[names("loss", name).identifier] = loss
        formulas[names("loss_rise", name).identifier] = product(health, signed("d"), change, share)
    return formulas


def until_reversal(name: str, curve: Curve, names: Names) -> Expression:
    """Return x, if the rotor reverses when log(1 + x) of the time constants have passed; infinite if it does not."""
    n, n_c, heads = Name(curve.lagging(name)), names("speed", name), names("heads", name)
    return where(heads * n_c < 0.0, -(n / n_c), inf)
