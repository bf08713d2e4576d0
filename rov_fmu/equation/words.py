"""What people read about coefficients and variables, and where the vehicle file has the coefficients."""

from collections.abc import Mapping
from typing import NamedTuple

from rov_fmu.io.messages import listed

from .catalogue import (
    CURVE,
    FIN,
    HEAVE,
    LAGS,
    SURGE,
    SWAY,
    THRUSTER,
    TUNING,
    Declaration,
    axis_words,
    cited,
)
from .parts import FAINT, Actuator, Curve, Fin, Thruster, VehicleAxis


class CoefficientTable(NamedTuple):
    """A table of the vehicle file with coefficients."""

    place: tuple[str, ...]
    """The tables around it, and its own name."""
    names: Mapping[str, str]
    """The names of its coefficients, by key."""
    declarations: Mapping[str, Declaration]
    words: Mapping[str, str]
    """What fills the fields in their texts."""


def table_of_curve(curve: Curve) -> CoefficientTable:
    words = {"curve": curve.description or f"curve {curve.name}", "equation": cited(curve.equation)}
    words["lag"] = LAGS[curve.lag]
    names = {key: curve.coefficient(key) for key in CURVE if key in curve.keys}
    return CoefficientTable(("curves", curve.name), names, CURVE, words)


def table_of_axis(vehicle_axis: VehicleAxis, declarations: Mapping[str, Declaration]) -> CoefficientTable:
    names = {
        key: vehicle_axis.coefficient(key) for key in declarations if declarations is TUNING or key in vehicle_axis.keys
    }
    return CoefficientTable(("axes", vehicle_axis.axis.name), names, declarations, axis_words(vehicle_axis.axis))


def table_of_fin(fin: Fin) -> CoefficientTable:
    names = {key: fin.coefficient(key) for key in FIN if key != "drag" or fin.has_drag}
    return CoefficientTable(("fin", fin.name), names, FIN, {"fin": _words(fin)})


def table_of_thruster(thruster: Thruster) -> CoefficientTable:
    names = {key: thruster.coefficient(key) for key in THRUSTER}
    return CoefficientTable(("thruster", thruster.name), names, THRUSTER, {"thruster": _words(thruster)})


def _words(actuator: Actuator) -> str:
    """Return what a thruster or a fin is called."""
    kind = "fin" if isinstance(actuator, Fin) else "thruster"
    return actuator.description or f"{kind} {actuator.name}"


def _pushes(direction: tuple[float, float, float]) -> str:
    """Return the direction of a positive force in words."""
    words = [
        axis.positive if part > 0.0 else axis.negative
        for axis, part in zip((SURGE, SWAY, HEAVE), direction, strict=True)
        if abs(part) > FAINT
    ]
    return listed(words)


def command_words(actuator: Actuator) -> str:
    return f"Command u_{actuator.name}: {_words(actuator)}, positive {_pushes(actuator.direction.value)}"


def thrust_declaration(thruster: Thruster, curve: Curve) -> Declaration:
    words = f"Thrust F_{thruster.name}: {_words(thruster)}"
    share = {1: "", 2: ", half of the pair's"}.get(curve.n_thrusters, f", 1/{curve.n_thrusters} of their curve")
    rest = ", in water at rest" if "d" in curve.keys else ""
    return Declaration(
        "N", f"{words}{share}{rest}, positive {_pushes(thruster.direction.value)}{cited(curve.equation)}"
    )


def rotor_declaration(thruster: Thruster) -> Declaration:
    words = f"Speed n_{thruster.name} of the rotor of {thruster.description or f'thruster {thruster.name}'}"
    rest = "the part beyond the dead band of the command that holds it"
    return Declaration("1", f"{words}: {rest}, positive {_pushes(thruster.direction.value)}", is_share=True)


def torque_declaration(curve: Curve) -> Declaration:
    of = f"of the {curve.description}" if curve.description else curve.name
    return Declaration("N.m", f"Torque τ_{curve.name} of the thrusters with the curve {of}, positive bow to starboard")
