"""The formulas from the commands to the steady thrust of the thrusters and the angles of the fins."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf

from .catalogue import REVERSE
from .expression import (
    Expression,
    Formulas,
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


def thrust_formulas(layout: Layout, names: Names) -> Formulas:
    """Return formulas for the steady thrust (2), (9), (10) of every thruster, and for the angles of the fins.

    Each input saturates at ±1, and so does each sum of inputs.
    """
    formulas = Formulas(names)
    if layout.voltage is not None:
        _add_battery(formulas, *layout.voltage_range)
    for name, gains in layout.gains.items():
        parts: list[tuple[float, Expression]] = []
        for command, gain in gains.items():
            acting = Name(layout.acting.get(command, command))
            if layout.pulse:
                acting = formulas.define(_fraction(acting, layout.pulse), "fraction", command)
            parts.append((gain, formulas.define(saturated(acting), "saturated", command)))
        formula = parts[0][1]
        if list(gains.values()) != [1.0]:
            formula = saturated(formulas.define(total(gain * part for gain, part in parts), "mixed", name))
        formulas.define(formula, "command", name)
        if name in layout.curve_of:
            _add_steady_thrust(formulas, name, layout.curve_of[name], Name(layout.health[name]))
    for fin in layout.fins:
        formulas.define(Name(fin.coefficient("angle_max")) * names("command", fin.name), "angle", fin.name)
    return formulas


def curve_formulas(curve: Curve) -> Formulas:
    """Return formulas from the command u_one of a thruster to its steady thrust, which is the last."""
    formulas = Formulas(Names(curve.coefficient(key) for key in curve.keys))
    if "V_0" in curve.keys or len(curve.tables) > 1:
        _add_battery(formulas, 0.0, inf)
    formulas.define(saturated(Name("u_one")), "command", "one")
    _add_steady_thrust(formulas, "one", curve, of(1.0))
    return formulas


def steady_name(thruster: str, curve: Curve, names: Names) -> Name:
    """Return the name of the steady thrust of a thruster, which is its force unless it lags."""
    return names("steady", thruster) if curve.has_lag else Name(f"F_{thruster}")


def _add_battery(formulas: Formulas, low: float, high: float) -> None:
    voltage = Name("voltage")
    held = where(voltage < low, low, voltage)
    formulas.define(held if high == inf else where(voltage > high, high, held), "battery")


def _fraction(command: Name, pulse: tuple[float, float, float]) -> Expression:
    """Return the formula from a pulse width to its fraction. Above and below neutral, the scale may differ.

    A pulse of 0 means that there is no signal, and stops the thruster as speed controllers do.
    """
    low, neutral, high = pulse
    below, above = neutral - low, high - neutral
    span = of(above) if below == above else where(command > neutral, above, below)
    return where(equal(command, 0.0), 0.0, (command - neutral) / span)


def _add_steady_thrust(formulas: Formulas, name: str, curve: Curve, health: Expression) -> None:
    """Add formulas from the command of a thruster to its steady thrust, which is the last of them.

    The health multiplies the whole force, with what it loses by the speed of advance.
    """
    command, share = formulas.names("command", name), 1.0 / curve.n_thrusters
    if curve.has_rotors:
        force = _from_speed(formulas, name, curve, health)
    else:
        force = (_from_tables if curve.tables else _from_coefficients)(formulas, name, curve, health)
        if "V_0" in curve.keys:
            force = force * _by_voltage(curve, formulas.names)
        if "d" in curve.keys:
            at_voltage = [_of_speed(curve, formulas.names)] if "V_0" in curve.keys else []
            loss = product(health, by_direction(command, curve, "d"), abs(command), *at_voltage, share)
            formulas.define(loss, "loss", name)
        if curve.tables:
            force = product(force, share)
    formulas[steady_name(name, curve, formulas.names).identifier] = with_positive_zero(force)


def _by_voltage(curve: Curve, names: Names) -> Expression:
    """Return the factor of the thrust at the present voltage."""
    return _power_of_voltage(curve, names, Name(curve.coefficient("n_V")))


def _of_speed(curve: Curve, names: Names) -> Expression:
    """Return the factor of the speed of a rotor at the present voltage, and so of what it loses by its advance.

    The thrust is proportional to the square of that speed, and the loss to the speed (Fossen 2021).
    """
    return _power_of_voltage(curve, names, 0.5 * Name(curve.coefficient("n_V")))


def _power_of_voltage(curve: Curve, names: Names, exponent: Expression) -> Expression:
    return call("pow", names("battery") / Name(curve.coefficient("V_0")), exponent)


def by_direction(command: Name, curve: Curve, key: str) -> Expression:
    """Return the coefficient of a curve for the direction of a thruster's command, or of its rotor."""
    return directed(command, Name(curve.coefficient(key)), Name(curve.coefficient(key + REVERSE)))


def _from_tables(formulas: Formulas, name: str, curve: Curve, health: Expression) -> Expression:
    """Return the formula of F = h k_t F_table(c), with F_table interpolated linearly in the voltage."""
    battery, (first, *_) = formulas.names("battery"), curve.tables
    forces = [call(table.function, formulas.names("command", name)) for table in curve.tables]
    force: Expression = forces[-1]
    for (table, low), (following, high) in reversed([*pairwise(zip(curve.tables, forces, strict=True))]):
        share = (battery - table.voltage) / (following.voltage - table.voltage)
        force = where(battery < following.voltage, low + share * (high - low), force)
    if len(forces) > 1:
        force = where(battery < first.voltage, forces[0], force)
    return health * Name(curve.coefficient("k_t")) * formulas.define(force, "table", name)


def _from_coefficients(formulas: Formulas, name: str, curve: Curve, health: Expression) -> Expression:
    """Return the formula of the force h (a_t m^2 + b_t m), with its sign, where m is as in `_beyond`."""
    command = formulas.names("command", name)
    beyond = _beyond(formulas, name, curve)
    a_t, b_t = (by_direction(command, curve, key) for key in ("a_t", "b_t"))
    size = formulas.define(product(health, a_t * beyond + b_t, beyond, 1.0 / curve.n_thrusters), "magnitude", name)
    return _outside_dead_band(command, beyond, size, curve)


def _beyond(formulas: Formulas, name: str, curve: Curve) -> Name:
    """Add and return the size of the part of a command that is beyond the dead band, which is negative within it."""
    command = formulas.names("command", name)
    size: Expression = abs(command)
    return formulas.define(size - by_direction(command, curve, "c_0") if "c_0" in curve.keys else size, "beyond", name)


def _outside_dead_band(command: Name, beyond: Name, size: Name, curve: Curve) -> Expression:
    """Return a size with the sign of the command, or 0 within the dead band."""
    signed = directed(command, size, -size)
    return beyond_dead_band(beyond, by_direction(command, curve, "c_0"), signed) if "c_0" in curve.keys else signed


# ---- Rotors whose speed lags -----------------------------------------------------------------------------------------

_FAINT = 8.0 * 2.0**-52
"""A speed below this share of the steady one is a rounding error, and has no direction."""


def _from_speed(formulas: Formulas, name: str, curve: Curve, health: Expression) -> Expression:
    """Return the formula of the steady thrust of a thruster from the steady speed of its rotor.

    The speed is the part of the command beyond the dead band, with its sign.
    """
    command: Expression = formulas.names("command", name)
    if "c_0" in curve.keys:
        beyond = _beyond(formulas, name, curve)
        command = _outside_dead_band(formulas.names("command", name), beyond, beyond, curve)
    speed = formulas.define(command, "speed", name)
    if "V_0" in curve.keys:
        formulas.define(_by_voltage(curve, formulas.names), "by_voltage", name)
        if "d" in curve.keys:
            formulas.define(_of_speed(curve, formulas.names), "speed_by_voltage", name)
    return _of_rotor(name, curve, formulas.names, health, _per_speed(speed, speed, curve), speed)


def _per_speed(n: Name, direction: Name, curve: Curve, times: float = 1.0) -> Expression:
    a_t, b_t = (by_direction(direction, curve, key) for key in ("a_t", "b_t"))
    return product(times, a_t, abs(n)) + b_t


def _of_rotor(name: str, curve: Curve, names: Names, *factors: Expression) -> Expression:
    """Return a product for one of the thrusters that share a curve, at the present voltage."""
    by_voltage = [names("by_voltage", name)] if "V_0" in curve.keys else []
    return product(*factors, *by_voltage, 1.0 / curve.n_thrusters)


def add_rotor(formulas: Formulas, name: str, curve: Curve, health: Name) -> None:
    """Add formulas of the thrust F = h (a_t |n| + b_t) n of a thruster, and of the loss h d |n| by its advance.

    The speed n of the rotor follows n_c. With the arrived fraction p, it is n + (n_c - n) p. Until the rotor reverses,
    the thrust then changes by `rise` p + `bend` p^2, and the loss by `loss_rise` p.
    """
    names = formulas.names
    n, n_c = Name(curve.lagging(name)), names("speed", name)
    heads = formulas.define(where(abs(n) > _FAINT * abs(n_c), n, n_c), "heads", name)
    change, share = n_c - n, 1.0 / curve.n_thrusters

    def signed(key: str) -> Expression:
        """Return a coefficient with the sign of the direction in which the rotor turns next."""
        return directed(heads, Name(curve.coefficient(key)), -Name(curve.coefficient(key + REVERSE)))

    def of_rotor(*factors: Expression) -> Expression:
        return _of_rotor(name, curve, names, health, *factors)

    formulas[f"F_{name}"] = with_positive_zero(of_rotor(_per_speed(n, heads, curve), n))
    formulas.define(of_rotor(_per_speed(n, heads, curve, 2.0), change), "rise", name)
    formulas.define(of_rotor(signed("a_t"), change, change), "bend", name)
    if "d" in curve.keys:
        of_speed = [names("speed_by_voltage", name)] if "V_0" in curve.keys else []
        loss = product(health, by_direction(heads, curve, "d"), abs(n), *of_speed, share)
        formulas.define(loss, "loss", name)
        formulas.define(product(health, signed("d"), change, *of_speed, share), "loss_rise", name)


@dataclass(frozen=True)
class Lag:
    """The lag of the thrusters with one curve, whose forces F, or speeds of rotors n, follow the steady ones.

    The arrived fraction p rises from 0 towards 1 during a piece of a step, p' = (1 - p) / T. Each force is then
    F + (steady - F) p, and so is each speed. A thrust that follows from a speed is quadratic in p until the rotor
    reverses.
    """

    curve: Curve
    arrived: str
    """The identifier of the arrived fraction, which is a state of the table of terms."""
    rate: Name
    """The rate 1/T."""
    steady: Mapping[str, str]
    """The forces, or the speeds of rotors, each with the steady one that it approaches."""
    reversals: tuple[Expression, ...]
    """x for each rotor, which reverses when log(1 + x) of the time constants have passed; infinite if it does not."""


def lags_of(layout: Layout, names: Names) -> tuple[Lag, ...]:
    """Return the lags of a vehicle, one for each curve with a time constant."""

    def lag(curve: Curve) -> Lag:
        own = [t.name for t in layout.thrusters if t.curve == curve.name]
        steady = {name: names("speed", name) if curve.has_rotors else steady_name(name, curve, names) for name in own}
        return Lag(
            curve,
            names("arrived", curve.name).identifier,
            names("rate", curve.name),
            {curve.lagging(name): one.identifier for name, one in steady.items()},
            tuple(_until_reversal(name, curve, names) for name in own) if curve.has_rotors else (),
        )

    return tuple(map(lag, (curve for curve in layout.curves if curve.has_lag)))


def _until_reversal(name: str, curve: Curve, names: Names) -> Expression:
    n, n_c, heads = Name(curve.lagging(name)), names("speed", name), names("heads", name)
    return where(heads * n_c < 0.0, -(n / n_c), inf)
