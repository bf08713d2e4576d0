"""What people read about variables."""

from collections.abc import Sequence

from rov_fmu.io.messages import listed

from .catalogue import EARTH, HEAVE, LAGS, SURGE, SWAY, Declaration, cited, over_ground_name
from .parts import FAINT, Actuator, Curve, Fin, Point, Thruster

AFLOAT = 1e-9
"""A height above the surface that is no rounding error, m."""
LEFT_WATER = "the vehicle has left the water at {} s, and goes on as under water, because its file has no [surface]"
"""What commands and FMUs say about a vehicle with `Layout.has_only_water`, with the time."""


def curve_words(curve: Curve) -> dict[str, str]:
    """Return the texts of a curve for the fields of CURVE."""
    words = {"curve": curve.description or f"curve {curve.name}", "equation": cited(curve.equation)}
    return words | {"lag": LAGS[curve.lag]}


def actuator_words(actuator: Actuator) -> dict[str, str]:
    """Return the text of a thruster or a fin for the field of THRUSTER or FIN: what it is called."""
    kind = "fin" if isinstance(actuator, Fin) else "thruster"
    return {kind: actuator.description or f"{kind} {actuator.name}"}


def point_words(point: Point) -> dict[str, str]:
    """Return what a point is called, for the field of POINT."""
    return {"point": point.description or f"point {point.name}"}


def point_declarations(point: Point) -> tuple[dict[str, Declaration], dict[str, Declaration]]:
    """Return the declarations of the force at a point, and of its position and velocity."""
    of = point_words(point)["point"]
    forces, coordinates, velocities = {}, {}, {}
    for x, (direction, words) in EARTH.items():
        forces[point.force(direction)] = Declaration(
            "N", f"Force on the vehicle at the {of}, positive {words}", nominal=10.0
        )
        coordinates[point.coordinate(x)] = Declaration("m", f"Position of the {of}, {words}", nominal=10.0)
        velocities[point.coordinate(over_ground_name(direction))] = Declaration(
            "m/s", f"Velocity over ground of the {of}, {words}"
        )
    return forces, coordinates | velocities


def name_in_words(actuator: Actuator) -> str:
    """Return what a thruster or a fin is called."""
    return " ".join(actuator_words(actuator).values())


def _pushes(direction: tuple[float, float, float]) -> str:
    """Return the direction of a positive force in words."""
    words = [
        axis.positive if part > 0.0 else axis.negative
        for axis, part in zip((SURGE, SWAY, HEAVE), direction, strict=True)
        if abs(part) > FAINT
    ]
    return listed(words)


def command_words(actuator: Actuator) -> str:
    return f"Command u_{actuator.name}: {name_in_words(actuator)}, positive {_pushes(actuator.direction.value)}"


def thrust_declaration(thruster: Thruster, curve: Curve) -> Declaration:
    words = f"Thrust F_{thruster.name}: {name_in_words(thruster)}"
    share = {1: "", 2: ", half of the pair's"}.get(curve.n_thrusters, f", 1/{curve.n_thrusters} of their curve")
    rest = ", in water at rest" if "d" in curve.keys else ""
    return Declaration(
        "N", f"{words}{share}{rest}, positive {_pushes(thruster.direction.value)}{cited(curve.equation)}"
    )


def rotor_declaration(thruster: Thruster) -> Declaration:
    words = f"Speed n_{thruster.name} of the rotor of {thruster.description or f'thruster {thruster.name}'}"
    rest = "the part beyond the dead band of the command that holds it"
    return Declaration("1", f"{words}: {rest}, positive {_pushes(thruster.direction.value)}", is_share=True)


def electric_declarations(thrusters: Sequence[Thruster]) -> dict[str, Declaration]:
    """Return the declarations of the electric current and the power of each thruster, and of all together."""
    named = {f"_{t.name}": name_in_words(t) for t in thrusters} | {"": "all thrusters"}
    kinds = {"current": "A", "power": "W"}
    return {
        f"electric_{kind}{suffix}": Declaration(unit, f"Electric {kind} of {words}", nominal=10.0)
        for kind, unit in kinds.items()
        for suffix, words in named.items()
    }


def torque_declaration(curve: Curve) -> Declaration:
    of = f"of the {curve.description}" if curve.description else curve.name
    return Declaration("N.m", f"Torque τ_{curve.name} of the thrusters with the curve {of}, positive bow to starboard")
