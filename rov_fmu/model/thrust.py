"""The formulas from the commands to the steady thrust of the thrusters and the angles of the fins."""

from itertools import pairwise

from .formula import weighted
from .layout import REVERSE, Curve, Layout, delayed_name


def thrust_formulas(layout: Layout) -> dict[str, str]:
    """Return formulas for the steady thrust (2), (9), (10) of every thruster, and for the angles of the fins.

    Each input saturates at ±1, and so does each sum of inputs.
    """
    found: dict[str, str] = {}
    if layout.voltage is not None:
        found["battery"] = "0 if voltage < 0 else voltage"
    for name, gains in layout.gains.items():
        parts = []
        for command, gain in gains.items():
            acting = delayed_name(command) if layout.has_dead_time else command
            if layout.pulse:
                found[f"fraction_{command}"] = _fraction(acting, layout.pulse)
                acting = f"fraction_{command}"
            found[f"saturated_{command}"] = _saturated(acting)
            parts.append((gain, f"saturated_{command}"))
        if list(gains.values()) == [1.0]:
            found[f"command_{name}"] = parts[0][1]
        else:
            found[f"mixed_{name}"] = weighted(parts)
            found[f"command_{name}"] = _saturated(f"mixed_{name}")
        if name in layout.curve_of:
            found |= _steady_thrust(name, layout.curve_of[name])
    for fin in layout.fins:
        found[f"angle_{fin.name}"] = f"{fin.coefficient('angle_max')} * command_{fin.name}"
    return found


def curve_formulas(curve: Curve) -> dict[str, str]:
    """Return formulas from the command u_one of a thruster to its steady thrust, which is the last."""
    return {
        "battery": "0 if voltage < 0 else voltage",
        "command_one": _saturated("u_one"),
        **_steady_thrust("one", curve),
    }


def _fraction(name: str, pulse: tuple[float, float, float]) -> str:
    """Return the formula from a pulse width to its fraction. Above and below neutral, the scale may differ.

    A pulse of 0 means that there is no signal, and stops the thruster as speed controllers do.
    """
    low, neutral, high = pulse
    below, above = neutral - low, high - neutral
    span = repr(above) if below == above else f"({above!r} if {name} > {neutral!r} else {below!r})"
    return f"0 if {name} == 0 else ({name} - {neutral!r}) / {span}"


def _saturated(name: str) -> str:
    return f"1 if {name} > 1 else -1 if {name} < -1 else {name}"


def _steady_thrust(name: str, curve: Curve) -> dict[str, str]:
    """Return formulas from the command of a thruster to its steady thrust, which is the last of them."""
    share = f" * {1.0 / curve.together!r}" if curve.together != 1 else ""
    found, signed = _from_tables(name, curve) if curve.tables else _from_coefficients(name, curve, share)
    if "V_0" in curve.keys:
        signed = f"{signed} * pow(battery / {curve.coefficient('V_0')}, {curve.coefficient('n_V')})"
    if "d" in curve.keys:
        found[f"loss_{name}"] = f"{_by_direction(name, curve, 'd')} * abs(command_{name}){share}"
    # + 0 makes 0.0 of -0.0
    return found | {f"steady_{name}" if curve.has_lag else f"F_{name}": f"{signed}{share if curve.tables else ''} + 0"}


def _by_direction(name: str, curve: Curve, key: str) -> str:
    """Return the coefficient of a curve for the direction of a thruster's command."""
    forward, reverse = curve.coefficient(key), curve.coefficient(key + REVERSE)
    return forward if forward == reverse else f"({reverse} if command_{name} < 0 else {forward})"


def _from_tables(name: str, curve: Curve) -> tuple[dict[str, str], str]:
    """Return the formula of the force of the tables, and the formula of the force times the scale.

    Between two voltages, the force is interpolated linearly.
    """
    command = f"command_{name}"
    formula = f"{curve.tables[-1].function}({command})"
    for table, following in reversed([*pairwise(curve.tables)]):
        share = f"(battery - {table.voltage!r}) / {following.voltage - table.voltage!r}"
        low, high = f"{table.function}({command})", f"{following.function}({command})"
        formula = f"{low} + {share} * ({high} - {low}) if battery < {following.voltage!r} else {formula}"
    if len(curve.tables) > 1:
        formula = f"{curve.tables[0].function}({command}) if battery < {curve.tables[0].voltage!r} else {formula}"
    return {f"table_{name}": formula}, f"{curve.coefficient('k_t')} * table_{name}"


def _from_coefficients(name: str, curve: Curve, share: str) -> tuple[dict[str, str], str]:
    """Return the formulas of the force a_t m^2 + b_t m, and the formula of the force with its sign.

    m is the part of the command beyond the dead band.
    """
    is_reverse = f"command_{name} < 0"
    a_t, b_t = (_by_direction(name, curve, key) for key in ("a_t", "b_t"))
    signed = f"(-magnitude_{name} if {is_reverse} else magnitude_{name})"
    beyond, dead = f"beyond_{name}", ""
    if "c_0" in curve.keys:
        c_0 = _by_direction(name, curve, "c_0")
        dead = f" - {c_0}"
        signed = f"(0 if {beyond} < 0 or {beyond} == 0 and {c_0} > 0 else {signed})"
    return {
        beyond: f"abs(command_{name}){dead}",
        f"magnitude_{name}": f"({a_t} * {beyond} + {b_t}) * {beyond}{share}",
    }, signed
