"""Write a vehicle as a model for Gazebo (SDFormat 1.10), with the plugins of gz-sim: Hydrodynamics, Buoyancy, Thruster.

The vehicle file has axes forward, starboard, down and an earth frame north-east-down. Gazebo has forward, left, up and
east-north-up. Both body frames differ by half a turn about the forward axis, so components along and about the second
and third axis change their signs, and nothing else does.

The plugins take loads in newtons and coefficients that do not depend on commands. What a vehicle file says beyond that
becomes a note of the model. Sources: gz-sim, src/systems; the specification of SDFormat, sdf/1.10.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from math import pi
from pathlib import Path

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rov_fmu.equation.catalogue import AXES, BODY, BY_VELOCITY, HEAVE, REVERSE, UPWARD, cross_name
from rov_fmu.equation.forces import (
    COUPLING,
    DEAD_BAND,
    LIFT,
    LINEAR,
    LOAD,
    QUADRATIC,
    RESTORING,
    THRUST,
    WEIGHT,
    left_out,
)
from rov_fmu.equation.parts import FAINT, Thruster, VehicleAxis
from rov_fmu.io.messages import InputError
from rov_fmu.io.program import program
from rov_fmu.io.templates import render
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]

DENSITY = 1000.0
"""The density of the water, kg/m3, the default of the Buoyancy plugin."""
_GRAVITY = 9.8
"""Gravity where a vehicle file has no weight, m/s2, the default of SDFormat."""
_SIGNS = np.array(UPWARD)
"""The signs of the components along and about the axes in Gazebo's frame, by those in the vehicle's frame."""
_PLACES = {v: n for n, v in enumerate(BY_VELOCITY)}
"""The rows of the axes in a vector or a matrix of six, by their velocities."""
_HELD_TIME = 0.02
"""The time constant, s, with which an axis that the vehicle lacks comes to rest."""
_HELD_INERTIA = 1000.0
"""The moment of inertia about an axis that the vehicle lacks, relative to one that it has."""
_PROPELLER = 1e-5, 0.05
"""The mass of a propeller's link relative to the vehicle, and its radius of inertia in m."""
_COMMANDS = tuple(n / 4.0 for n in range(-4, 5))
"""The commands whose thrust the file lists."""


BESIDE_THRUST = (THRUST, LOAD, WEIGHT, LINEAR, QUADRATIC, LIFT, RESTORING, COUPLING, DEAD_BAND)
"""The effects that a simulator of bodies or the sender of its thrust has, or that have notes of their own."""


@dataclass(frozen=True)
class GazeboModel:
    """A model for Gazebo: the text of its file, and what the reader of the console should know."""

    text: str
    notes: tuple[str, ...]
    """What the vehicle file says and Gazebo does otherwise, and how the tuning was folded in, without a full stop."""
    warnings: tuple[str, ...]
    """What makes the simulation diverge."""


@dataclass(frozen=True)
class _Propeller:
    """A thruster in Gazebo's frame: where it must stand so that the plugin's force has its force and moments."""

    name: str
    description: str
    direction: Array
    position: Array
    scale: float
    """The newtons of the plugin per newton of the vehicle file's thrust curve: alpha."""
    newtons: Mapping[float, float]
    """The thrust for some commands."""
    lost: float
    """The moment per newton that no position can give, m."""


@dataclass(frozen=True)
class Link:
    """The rigid body of a link: mass, centre of mass and moments of inertia about it."""

    mass: float
    centre: Array
    inertia: Array

    @property
    def moments(self) -> dict[str, float]:
        """The entries of the matrix of inertia by their names in SDFormat."""
        return {f"i{'xyz'[i]}{'xyz'[j]}": self.inertia[i, j] for i, j in combinations_with_replacement(range(3), 2)}

    @property
    def matrix(self) -> Array:
        """The 6x6 mass matrix about the origin."""
        first_moment = self.mass * _cross(self.centre)
        about_origin = self.inertia + _of_point(self.mass, self.centre)
        return np.block([[self.mass * np.eye(3), first_moment.T], [first_moment, about_origin]])


def gazebo_model(vehicle: Vehicle, *, in_world: bool = False, explicit: bool = False) -> GazeboModel:
    """Return the model of a vehicle, alone or in a world with water.

    The added mass stands in the link, in <fluid_added_mass>, or if it is `explicit`, in the Hydrodynamics plugin.
    Raises InputError about a vehicle that Gazebo cannot have at all.
    """
    check_possible(vehicle)
    link = link_of(vehicle)
    added = added_mass(vehicle, link.matrix)
    propellers = [propeller for propeller in (_propeller(vehicle, t) for t in vehicle.layout.thrusters) if propeller]
    notes = (
        *_notes_of_tuning(vehicle, added, propellers, explicit=explicit),
        *_notes_of_commands(vehicle),
        *_notes_of_motion(vehicle, propellers, explicit=explicit),
    )
    small, radius = _PROPELLER
    text = rendered_model(
        "model.sdf.j2",
        vehicle,
        notes,
        in_world=in_world,
        gravity=gravity(vehicle),
        north=pi / 2.0,
        body=Link(link.mass * (1.0 - small * len(propellers)), link.centre, link.inertia),
        propeller=Link(link.mass * small, np.zeros(3), link.mass * small * radius**2 * np.eye(3)),
        explicit=explicit,
        added=added,
        buoyancy={"centre": _centre(vehicle, "B"), "size": [_volume(vehicle) ** (1.0 / 3.0)] * 3},
        hydrodynamics=hydrodynamics(vehicle, link) | (dict(in_plugin(added)) if explicit else {}),
        thrusters=propellers,
    )
    return GazeboModel(text, notes, tuple(_divergence(added, link.matrix)) if explicit else ())


def rendered_model(template: str, vehicle: Vehicle, notes: tuple[str, ...], **content: object) -> str:
    """Render the template of a vehicle's model, with what the model lacks as comments."""
    common = {"number": _number, "vector": _vector, "comment": _comment, "program": program(), "density": DENSITY}
    folder = Path(__file__).parent / "templates"
    return render(template, folder, vehicle=vehicle, notes=notes, **common, **content)


def check_possible(vehicle: Vehicle) -> None:
    """Raise InputError about a vehicle that Gazebo cannot have."""
    check_body(vehicle, "Gazebo")
    if mistake := next(_impossible(vehicle), None):
        raise InputError(f"{vehicle.identifier}: {mistake}")


def check_body(vehicle: Vehicle, simulator: str) -> None:
    """Raise InputError about a vehicle that lacks the mass of a body in a simulator, or has an infinite one."""
    if "m_rov" not in vehicle.coefficients:
        reason = f"no surge, sway or heave, and so no mass m_rov, which a body in {simulator} must have"
        raise InputError(f"{vehicle.identifier}: has {reason}")
    for name in (part.axis.coefficient("beta") for part in vehicle.layout.axes):
        if vehicle[name] == 0.0:
            reason = f"must be more than 0 for {simulator}, because m/{name} is a mass"
            raise InputError(f"{vehicle.identifier}: {name} = 0: {reason}")


def _impossible(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line about each reason why Gazebo cannot have the vehicle, which has a mass."""
    thrusters = {thruster.name for thruster in vehicle.layout.thrusters}
    for name in (t.name for t in vehicle.layout.thrusters if f"{t.name}_joint" in thrusters):
        yield f"thruster.{name}_joint: choose another name for Gazebo, where the joint of {name} has this name"
    if _volume(vehicle) <= 0.0:
        weight = vehicle["m_rov"] * gravity(vehicle)
        least = "must be less than the weight for Gazebo, because the Buoyancy plugin only pushes upwards"
        yield f"the net weight of {net_weight(vehicle):g} N {least}: {weight:g} N"


# ---- Mass ------------------------------------------------------------------------------------------------------------


def _cross(vector: Array) -> Array:
    """Return the matrix S with S v = vector x v."""
    return np.cross(np.eye(3), vector)


def _of_point(mass: float, position: Array) -> Array:
    """Return the matrix of inertia of a point mass about the origin."""
    return mass * _cross(position).T @ _cross(position)


def net_weight(vehicle: Vehicle) -> float:
    """Return the load that acts downwards in the earth frame, N: weight less buoyancy, and F_0 of a level vehicle."""
    if not vehicle.layout.has(HEAVE):
        return 0.0
    weight = vehicle["W"] - vehicle["B"] if vehicle.layout.restoring else 0.0
    if vehicle.layout.has_attitude:
        return weight
    return weight + vehicle.coefficients.get(HEAVE.coefficient("F_0"), 0.0)


def gravity(vehicle: Vehicle) -> float:
    """Return the gravity of the world, m/s2: that of the vehicle file's weight."""
    return vehicle.coefficients.get("W", 0.0) / vehicle["m_rov"] or _GRAVITY


def _volume(vehicle: Vehicle) -> float:
    """Return the volume of the displaced water, m3, which gives the net weight."""
    return (vehicle["m_rov"] - net_weight(vehicle) / gravity(vehicle)) / DENSITY


def _centre(vehicle: Vehicle, of: str) -> Array:
    """Return the centre of mass (G) or of buoyancy (B) in Gazebo's frame; the origin if the vehicle stays level."""
    if not vehicle.layout.has_attitude:
        return np.zeros(3)
    return _SIGNS[:3] * [vehicle.coefficients.get(f"{axis}_{of}", 0.0) for axis in "xyz"]


def link_of(vehicle: Vehicle, held: float = _HELD_INERTIA) -> Link:
    """Return the body of a vehicle, without added mass.

    About an axis that the vehicle lacks, its moment of inertia is `held` times a usual one, so that it hardly turns.
    """
    mass, centre = vehicle["m_rov"], _centre(vehicle, "G")
    own = [vehicle.coefficients.get(axis.inertia) for axis in AXES.values() if axis.is_rotation]
    typical = max((moment for moment in own if moment), default=mass * _volume(vehicle) ** (2.0 / 3.0) / 6.0)
    about_origin = np.diag([held * typical if moment is None else moment for moment in own])
    inertia = about_origin - _of_point(mass, centre)
    least, middle, most = np.linalg.eigvalsh(inertia)
    if least <= 0.0 or least + middle < most:  # no body has these moments, and SDFormat refuses them
        inertia = most * np.eye(3)
    return Link(mass, centre, inertia)


def added_mass(vehicle: Vehicle, rigid: Array) -> Array:
    """Return the 6x6 matrix that the rigid body lacks to the vehicle's effective mass matrix, in Gazebo's frame."""
    added = np.zeros((6, 6))
    forms, entries = vehicle.layout.by_velocity, vehicle.parameters
    for a, b in product(forms, repeat=2):
        i, j = _PLACES[a], _PLACES[b]
        mass = entries.get(f"mass_{a}{b}", entries.get(f"mass_{b}{a}", 0.0))
        mass = vehicle.effective_inertia(BY_VELOCITY[a]) if a == b else mass
        added[i, j] = _SIGNS[i] * _SIGNS[j] * mass - rigid[i, j]
    size = np.sqrt(np.diag(rigid))
    return np.where(np.abs(added) < FAINT * np.outer(size, size), 0.0, added)


def in_plugin(added: Array) -> Iterator[tuple[str, float]]:
    """Yield the added mass for the Hydrodynamics plugin, which has Fossen's sign: xDotU is -m_a."""
    axes = [*BY_VELOCITY.values()]
    for i, j in np.argwhere(added):
        yield f"{axes[i].letter.lower()}Dot{axes[j].velocity.upper()}", -added[i, j]


def _divergence(added: Array, rigid: Array) -> Iterator[str]:
    """Yield a line if the plugin's added mass makes the simulation diverge (gz-sim issue 1923).

    The plugin computes its force from the acceleration of the step before, so what remains of an error after a step is
    the added mass by the mass of the link. It grows when the added mass is not less.
    """
    if max(abs(np.linalg.eigvals(np.linalg.solve(rigid, added)))) < 1.0:
        return
    too_large = [
        f"{name} ({added[n, n]:.4g} of {rigid[n, n]:.4g} {BODY[axis.inertia].unit})"
        for n, (name, axis) in enumerate(AXES.items())
        if abs(added[n, n]) >= rigid[n, n]
    ]
    yield (
        "the simulation diverges, because the Hydrodynamics plugin computes the added mass explicitly, and it is not "
        f"less than the link's own: {', '.join(too_large) or 'the axes together'} (gz-sim issue 1923); use "
        "--added-mass link, with the physics engine DART"
    )


# ---- Damping ---------------------------------------------------------------------------------------------------------


def hydrodynamics(vehicle: Vehicle, link: Link) -> dict[str, float]:
    """Return the terms of the Hydrodynamics plugin: xU of U, xUabsU of U|U|, xUU of U U, yUR of U R.

    U|U| and U U together give quadratic drag that depends on the direction.
    """
    terms: dict[str, float] = {}

    def add(axis: str, value: float, first: str, second: str = "", *, magnitude: bool = False) -> None:
        """Add a force along an axis: a value times a velocity, and times another or its magnitude."""
        signs = [_SIGNS[_PLACES[v]] for v in (axis, first, *([] if magnitude else second))]
        letter = BY_VELOCITY[axis].letter.lower()
        name = f"{letter}{first.upper()}{'abs' if magnitude else ''}{second.upper()}"
        terms[name] = terms.get(name, 0.0) + value * np.prod(signs)

    for v, n in _PLACES.items():
        part = vehicle.layout.by_velocity.get(v)
        if part is None:
            add(v, -link.matrix[n, n] / _HELD_TIME, v)
            continue
        b, a = (both_ways(vehicle, part, key) for key in ("b_d", "a_d"))
        add(v, -sum(b) / 2.0, v)
        add(v, -sum(a) / 2.0, v, v, magnitude=True)
        if a[0] != a[1]:
            add(v, (a[1] - a[0]) / 2.0, v, v)
    for key, axis, *others in vehicle.layout.cross:
        value = vehicle[cross_name(key, axis, *others)]
        if key == "b_d":
            add(axis, -value, others[0])
        elif key == "a_d":
            add(axis, -value, others[0], others[0], magnitude=True)
        elif key == "lift":
            add(axis, value, *others)
    return terms


def both_ways(vehicle: Vehicle, part: VehicleAxis, key: str) -> tuple[float, float]:
    """Return a drag coefficient for positive and for negative velocities."""
    return vehicle[part.coefficient(key)], vehicle[part.coefficient(key + REVERSE)]


# ---- Thrusters -------------------------------------------------------------------------------------------------------


def _propeller(vehicle: Vehicle, thruster: Thruster) -> _Propeller | None:
    """Return a thruster with alpha folded in, or None if it has no force.

    Its force along each axis is multiplied by alpha of the axis, so is its moment about each axis, and a moment about
    an axis that the vehicle lacks is 0. The thruster stands at the place where the force has these moments.
    """
    effects = np.zeros(6)
    for n, (v, axis) in enumerate(BY_VELOCITY.items()):
        if v in vehicle.layout.by_velocity:
            effects[n] = vehicle[axis.coefficient("alpha")] * vehicle.effect(thruster, axis)
        elif not axis.is_rotation:
            effects[n] = thruster.effect(axis)
    effects *= _SIGNS
    force, moment = effects[:3], effects[3:]
    scale = float(np.linalg.norm(force))
    if not scale:
        return None
    direction = force / scale
    given = _SIGNS[:3] * thruster.place
    curve = vehicle.layout.curve_of[thruster.name]
    return _Propeller(
        name=thruster.name,
        description=thruster.description or f"thruster {thruster.name}",
        direction=direction,
        position=np.cross(force, moment) / scale**2 + direction * (direction @ given),
        scale=scale,
        newtons={c: scale * vehicle[thruster.coefficient("health")] * vehicle.curve_force(curve, c) for c in _COMMANDS},
        lost=abs(float(direction @ moment)) / scale,
    )


# ---- What Gazebo does otherwise --------------------------------------------------------------------------------------


def _notes_of_tuning(vehicle: Vehicle, added: Array, propellers: list[_Propeller], *, explicit: bool) -> Iterator[str]:
    """Yield how alpha and beta were folded in."""
    scaled = [
        f"{propeller.scale:.4g} F_{propeller.name}" for propeller in propellers if abs(propeller.scale - 1.0) > FAINT
    ]
    if scaled:
        yield f"alpha: the plugins take {', '.join(scaled)} newtons, and the thrusters' places scale the moments"
    if idle := {thruster.name for thruster in vehicle.layout.thrusters} - {propeller.name for propeller in propellers}:
        yield f"left out: thrusters whose force alpha makes 0: {', '.join(sorted(idle))}"
    place = "the Hydrodynamics plugin" if explicit else "<fluid_added_mass>"
    for part in vehicle.layout.axes:
        axis, beta = part.axis, part.axis.coefficient("beta")
        if vehicle[beta] != 1.0:
            n, unit = _PLACES[axis.velocity], BODY[axis.inertia].unit
            yield (
                f"{beta} = {vehicle[beta]:g}: the effective inertia in {axis.name} "
                f"is {vehicle.effective_inertia(axis):.4g} {unit}, of which {place} has {added[n, n]:.4g} {unit}"
            )


def _notes_of_commands(vehicle: Vehicle) -> Iterator[str]:
    """Yield what stands between a command and the thrust, which the Thruster plugin takes in newtons."""
    layout = vehicle.layout
    keys = {key for curve in layout.curves for key in curve.keys}
    parts = {
        "the thrust curve": True,
        "its dead band": "c_0" in keys,
        "its curve in reverse": any(key.endswith(REVERSE) for key in keys),
        "the voltage of the battery": layout.voltage is not None,
        "the inputs that drive several thrusters": bool(layout.mix),
        "the pulse widths": layout.pulse is not None,
    }
    has = [part for part, is_there in parts.items() if is_there]
    yield f"the Thruster plugin takes newtons, so these are left to the sender: {', '.join(has)}"
    yield from (f"left out: {words}" for words in left_out(layout, BESIDE_THRUST))


def _notes_of_motion(vehicle: Vehicle, propellers: list[_Propeller], *, explicit: bool) -> Iterator[str]:
    """Yield what the plugins and Gazebo's rigid body do otherwise with the motion."""
    layout = vehicle.layout
    for part in layout.axes:
        forward, back = both_ways(vehicle, part, "b_d")
        if forward != back:
            names = f"{part.coefficient('b_d')} and {part.coefficient('b_d' + REVERSE)}"
            yield f"{names}: linear drag has their mean in both directions"
        if vehicle.coefficients.get(part.coefficient("F_0")):
            if part.axis is HEAVE and not layout.has_attitude:
                yield "the constant load F_0_w is in the buoyancy"
            else:
                yield f"left out: the constant load {part.coefficient('F_0')}"
    if missing := layout.lacking:
        yield f"the vehicle file has no {', '.join(missing)}: damping holds it there, in rotation with a large inertia"
    if not layout.has_attitude:
        yield "thrusters stand where their force has no moment in roll and pitch"
    if lost := [propeller.name for propeller in propellers if propeller.lost > FAINT]:
        yield f"left out: the moment about its own direction of each of the thrusters {', '.join(lost)}"
    if not layout.coupled and len(layout.axes) > 1:
        yield "the vehicle file has no Coriolis and Munk terms, but Gazebo's bodies have them"
    if layout.coupled and explicit:
        yield "the plugin computes Coriolis and Munk terms of the added mass from its diagonal only"


# ---- Text ------------------------------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """Return a number with 12 digits, without a negative zero."""
    return f"{value + 0.0:.12g}"


def _vector(values: Array) -> str:
    """Return the components of a vector."""
    return " ".join(map(_number, values))


def _comment(text: str) -> Markup:
    """Return a text for an XML comment, which must not contain two hyphens in a row."""
    return Markup(re.sub("-(?=-)", "- ", text.rstrip(".")))
