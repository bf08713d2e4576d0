"""Vehicles of every kind for tests, random vehicles, and random inputs and states for them."""

import random
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations, permutations
from math import hypot, prod, sqrt
from pathlib import Path
from typing import Any, Literal, TypeVar

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES, AXIS, HEAVE, PITCH, RESTORING, ROLL, cross_name, cross_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import (
    EVERY_COMMAND,
    Actuator,
    Curve,
    Fin,
    Point,
    Range,
    SourcedVector,
    Thruster,
    Vector,
    VehicleAxis,
)
from rov_fmu.vehicle.schema import Basis, Estimated
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface

Values = Mapping[str, float]
_Vehicle = TypeVar("_Vehicle", bound=Vehicle)
State = dict[str, float]
Case = tuple[Vehicle, State, State, float]
"""A vehicle, its inputs and states, and the length of a step."""


Side = Literal["port", "starboard"] | None


def _places(direction: Vector, position: Vector | None) -> dict[str, Any]:
    x, y, z = direction
    length = hypot(x, y, z)
    along = direction if abs(length - 1.0) <= 1e-12 else (x / length, y / length, z / length)
    at = position and SourcedVector(position, "a drawing")
    return {"direction": SourcedVector(along, "a drawing"), "position": at}


def thruster(
    name: str,
    curve: str,
    direction: Vector,
    position: Vector | None = None,
    arm: Side = None,
) -> Thruster:
    """Return a thruster with a direction and a position that have a source."""
    return Thruster(name=name, curve=curve, arm=arm, **_places(direction, position))


def fin(name: str, direction: Vector, position: Vector, has_drag: bool = False) -> Fin:
    """Return a fin with a direction and a position that have a source."""
    return Fin(name=name, keys=("lift", *(["drag"] if has_drag else []), "angle_max"), **_places(direction, position))


_DRAG = ("a_d", "b_d")
_EITHER = (*_DRAG, "a_d_reverse", "b_d_reverse")
_ALL = ("m_a", *_EITHER, "F_0")
_T200 = Curve("t200", ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0"))
_LAGGING = Curve("t200", (*_T200.keys, "T"))
_S = sqrt(0.5)
_PLANAR = (  # four vectored thrusters, as ArduSub numbers them
    thruster("1", "t200", (_S, -_S, 0.0), (0.156, 0.111, 0.0)),
    thruster("2", "t200", (_S, _S, 0.0), (0.156, -0.111, 0.0)),
    thruster("3", "t200", (-_S, -_S, 0.0), (-0.156, 0.111, 0.0)),
    thruster("4", "t200", (-_S, _S, 0.0), (-0.156, -0.111, 0.0)),
)
_VERTICAL = tuple(thruster(name, "t200", (0.0, 0.0, -1.0), (0.1, 0.1, 0.0)) for name in "56")
_ALL_ROUND = (*_PLANAR, *_VERTICAL)
_PAIR = (
    thruster("l", "t200", (1.0, 0.0, 0.0), (0.0, -0.2, 0.0)),
    thruster("r", "t200", (1.0, 0.0, 0.0), (0.0, 0.2, 0.0)),
)
_MIX = {
    "ahead": {"1": 1.0, "2": 1.0, "3": -1.0, "4": -1.0},
    "aside": {"1": -1.0, "2": 1.0, "3": -1.0, "4": 1.0},
    "turn": {"1": -0.5, "2": 0.5, "3": 0.5, "4": -0.5},
}
_BODY_NUMBERS = {"m_rov": 13.5, "I_p": 0.26, "I_q": 0.23, "I_r": 0.37, "R": 0.2, "gamma": 0.5}
_BODY_NUMBERS |= {
    "W": 132.6,
    "B": 131.6,
    "x_G": 0.01,
    "y_G": -0.02,
    "z_G": 0.03,
    "x_B": 0.005,
    "y_B": 0.01,
    "z_B": -0.02,
}
_OTHER_NUMBER = 0.5
"""The value of a coefficient of a curve or an axis that the tables below do not have."""
_AXIS_NUMBERS = {
    "u": (6.3567, 141.0, 13.7, 190.0, 4.0, 0.1),
    "v": (7.1206, 217.0, 0.0, 100.0, 3.0, 0.3),
    "w": (18.6863, 190.0, 33.0, 150.0, 20.0, -1.5),
    "p": (0.189, 1.19, 0.1, 0.8, 0.3, 0.02),
    "q": (0.135, 0.47, 0.8, 0.6, 0.5, -0.03),
    "r": (0.2215, 1.5, 0.0, 0.7, 0.2, 0.01),
}
"""The coefficients of a BlueROV2 Heavy, and plausible values for those that it does not have."""
_CURVE_NUMBERS = {
    "a_t": 29.33,
    "b_t": 31.48,
    "a_t_reverse": 21.74,
    "b_t_reverse": 25.54,
    "c_0": 0.087,
    "c_0_reverse": 0.1,
    "d": 5.0,
    "d_reverse": 3.0,
    "T": 0.15,
    "k_t": 1.1,
    "V_0": 16.0,
    "n_V": 1.3,
}


def _factors(layout: Layout) -> set[str]:
    """Return the names of the coefficients that are 1 unless a vehicle file gives them."""
    return {*layout.tuning, *layout.health.values()}


def numbered(layout: Layout, **values: float) -> Vehicle:
    """Return a vehicle with the Heavy's numbers, except for the given values, and without tuning."""
    numbers = {
        curve.coefficient(key): _CURVE_NUMBERS.get(key, _OTHER_NUMBER) for curve in layout.curves for key in curve.keys
    }
    for form in layout.axes:
        row = _AXIS_NUMBERS[form.axis.velocity]
        own = dict(zip(("m_a", "a_d", "b_d", "a_d_reverse", "b_d_reverse", "F_0"), row, strict=True))
        numbers |= {form.axis.coefficient(key): own.get(key, _OTHER_NUMBER) for key in AXIS}
    for key, *axes in layout.cross:
        column = 0 if key == "m_a" else 1
        numbers[cross_name(key, *axes)] = 0.1 * sqrt(prod(_AXIS_NUMBERS[axis][column] for axis in axes[:2]))
    for point in layout.points:
        numbers |= dict(zip(map(point.coefficient, point.keys), (-0.3, 0.1, -0.2), strict=True))
    numbers |= _BODY_NUMBERS | dict.fromkeys(_factors(layout), 1.0) | values
    return Vehicle(layout, {name: numbers[name] for name in layout.coefficients})


def pulsed(rov: _Vehicle, pulse: tuple[float, float, float]) -> _Vehicle:
    """Return a vehicle whose commands are pulse widths."""
    return replace(rov, layout=replace(rov.layout, pulse=pulse))


def _axes(names: str, keys: tuple[str, ...] = _DRAG) -> tuple[VehicleAxis, ...]:
    return tuple(VehicleAxis(axis, keys) for axis in AXES.values() if axis.velocity in names)


def _rov(
    axes: str,
    curve: Curve,
    thrusters: tuple[Thruster, ...],
    keys: tuple[str, ...] = _DRAG,
    coupled: bool = False,
    mix: Mapping[str, Mapping[str, float]] | None = None,
) -> Vehicle:
    return numbered(Layout(_axes(axes, keys), (curve,), thrusters, mix or {}, coupled))


EVERYTHING = Path(__file__).parent / "vehicle" / "everything.toml"
THRUST_EFFECTS = EVERYTHING.with_name("thrust_effects.toml")
SIX_AXES = EVERYTHING.with_name("six_axes.toml")


def sources_of(driven: Actuator) -> dict[str, str]:
    """The sources of the direction and the position of a thruster or a fin."""
    places = {"direction": driven.direction, "position": driven.position}
    return {key: place.source for key, place in places.items() if place}


def carried(vehicle: Vehicle) -> tuple[object, ...]:
    """What the parts of a vehicle carry along and `==` does not compare."""
    layout = vehicle.layout
    measured = {curve.name: (*curve.tables, curve.electric_current) for curve in layout.curves}
    return {name: [table and table.path for table in own] for name, own in measured.items()}, layout.voltage_source


def four_axes(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle without roll and pitch, if it has them: its net weight is then a constant load in heave."""
    rov = vehicle
    if not rov.layout.has_attitude:
        return vehicle
    forms = tuple(
        replace(form, keys=(*form.keys, "F_0")) if form.axis is HEAVE else form
        for form in rov.layout.axes
        if form.axis not in (ROLL, PITCH)
    )
    layout = replace(rov.layout, axes=forms, restoring=())
    values = {**rov.coefficients, "F_0_w": rov["W"] - rov["B"]}
    basis = {**vehicle.basis, "F_0_w": vehicle.basis["W"]}
    return replace(
        vehicle,
        layout=layout,
        coefficients={name: values[name] for name in layout.coefficients},
        basis={name: basis[name] for name in layout.coefficients},
    )


VIDEORAY = load_vehicle(SHIPPED["videoray"])
HEAVY = four_axes(without_surface(load_vehicle(SHIPPED["bluerov2_heavy"])))
"""The BlueROV2 Heavy without roll, pitch and the surface: four axes with lag and coupling."""
VEHICLES = {
    "VideoRay": VIDEORAY,
    "Heavy": HEAVY,
    "with an input mix": _rov("uvwr", _T200, _ALL_ROUND, _ALL, mix={**_MIX, "down": {"5": -1.0, "6": -1.0}}),
    "drag by direction, coupled, late": _rov("uvwr", _LAGGING, _ALL_ROUND, _ALL, coupled=True),
    "coupled without lag, three commands, no heave": _rov(
        "uvr", Curve("t200", ("a_t", "b_t", "c_0", "c_0_reverse")), _PLANAR, _ALL, coupled=True, mix=_MIX
    ),
    "lag without coupling": _rov("uwr", _LAGGING, (*_PAIR, *_VERTICAL), _ALL),
    "heave only": _rov("w", _T200, _VERTICAL, _EITHER),
    "yaw only": _rov("r", _T200, _PAIR),
    "surge and sway without yaw": _rov("uv", _T200, _PLANAR, _EITHER),
    "surge without drag": numbered(Layout(_axes("ur"), (_T200,), _PAIR), a_d_u=0.0, b_d_u=0.0),
}

_SKEW = (
    thruster("a", "t200", (0.6, 0.0, 0.8), (0.2, 0.1, -0.05)),
    thruster("b", "t200", (0.0, 1.0, 0.0), (-0.3, 0.05, 0.1)),
    thruster("c", "t200", (0.0, 0.6, -0.8), (0.05, -0.25, 0.15)),
)
_BETWEEN = (("m_a", "u", "q"), ("m_a", "v", "r"), ("b_d", "q", "w"), ("a_d", "p", "v"), ("lift", "v", "u", "r"))
SIX = numbered(
    Layout(
        _axes("uvwpqr", _ALL),
        (Curve("t200", tuple(key for key in _CURVE_NUMBERS if key not in ("k_t", "V_0", "n_V"))),),
        _SKEW,
        coupled=True,
        cross=_BETWEEN,
        restoring=tuple(RESTORING),
    )
)
"""A vehicle with six axes and every effect."""


_AFT = (-0.5, 0.05, 0.1)
FINNED = numbered(
    replace(SIX.layout, fins=(fin("rudder", (0.0, 0.6, 0.8), _AFT, True), fin("plane", (0.0, 0.0, 1.0), _AFT))),
    lift_rudder=9.0,
    drag_rudder=4.0,
    angle_max_rudder=0.4,
    lift_plane=7.0,
    angle_max_plane=0.3,
)
"""The vehicle SIX with fins."""


def with_axes(axes: str) -> Vehicle:
    """Return the vehicle SIX with only some of its axes, nothing between them, and no weight."""
    forms = tuple(form for form in SIX.layout.axes if form.axis.velocity in axes)
    return numbered(replace(SIX.layout, axes=forms, cross=(), restoring=()))


def tied(rov: Vehicle, **points: Vector) -> Vehicle:
    """Return a vehicle with points at which forces act, at these positions in its frame, m."""
    layout = replace(rov.layout, points=tuple(Point(name=name) for name in points))
    at = {f"r_{axis}_{name}": x for name, place in points.items() for axis, x in zip("xyz", place, strict=True)}
    return replace(rov, layout=layout, coefficients={**rov.coefficients, **at})


def with_rotors(rov: _Vehicle) -> _Vehicle:
    """Return a vehicle whose rotors lag in speed, where its forces lag."""
    return replace(rov, layout=replace(rov.layout, curves=tuple(replace(c, lag="speed") for c in rov.layout.curves)))


def passed(rov: _Vehicle) -> _Vehicle:
    """Return a vehicle that a changing current passes."""
    return replace(rov, layout=replace(rov.layout, current_passes=True))


def surfaced(rov: _Vehicle, height: float = 0.25) -> _Vehicle:
    """Return a vehicle whose buoyancy and thrust fade out above the surface."""
    return replace(rov, layout=replace(rov.layout, surface=True), coefficients={**rov.coefficients, "height": height})


def in_waves(rov: _Vehicle) -> _Vehicle:
    """Return a vehicle for which the acceleration and the elevation of the water are inputs."""
    return replace(rov, layout=replace(rov.layout, waves=True))


def extended(rov: Vehicle, **values: float) -> Vehicle:
    """Return a vehicle with other or additional coefficients."""
    return rov.with_(rov.layout.extended(values), **values)


def frictionless(rov: Vehicle) -> Vehicle:
    """Return a vehicle without drag, lift and constant loads."""
    lift = {cross_name(*of) for of in rov.layout.cross if of[0] == "lift"}
    return rov.with_(**{name: 0.0 for name in rov.coefficients if name[:3] in ("a_d", "b_d", "F_0") or name in lift})


def bases(
    sources: Mapping[str, str],
    intervals: Mapping[str, tuple[float, float]] | None = None,
    estimates: Mapping[str, Estimated] | None = None,
) -> dict[str, Basis]:
    """Return what the values of some coefficients rest on, by their names."""
    intervals, estimates = intervals or {}, estimates or {}
    return {name: Basis(source, intervals.get(name), estimates.get(name)) for name, source in sources.items()}


def with_intervals(
    rov: _Vehicle, intervals: Mapping[str, tuple[float, float]], estimates: Mapping[str, Estimated] | None = None
) -> _Vehicle:
    """Return the vehicle with these intervals and estimates alone."""
    sources = dict.fromkeys(rov.coefficients, "A tank test") | rov.sources
    return replace(rov, basis=bases(sources, intervals, estimates))


def a_vehicle(rov: Vehicle) -> Vehicle:
    """Return a vehicle file's content with these coefficients and placeholders for all texts."""
    return Vehicle(
        rov.layout,
        rov.coefficients,
        name="An ROV",
        identifier="an_rov",
        version="1",
        description="A test",
        source="A tank",
        basis=bases(dict.fromkeys(rov.coefficients, "A tank test")),
        command_range=(0.1, 1.0),
    )


_RANGES = (
    Range(EVERY_COMMAND, 0.0, 0.7),
    Range("u", 0.1, 0.4),
    Range("v", -0.2, 0.2),
    Range("p", -0.3, 0.5),
    Range("phi", -0.1, 0.2),
    Range("theta", -0.3, 0.05),
    Range("z", 0.0, 3.0),
)
OUTSIDE = a_vehicle(replace(SIX, layout=replace(SIX.layout, identified=_RANGES)))
"""The vehicle SIX with ranges for which it was identified, and so with the output `outside`.

That of surge does not begin at 0, and there is one of the depth.
"""


# ---- Random vehicles ----


def spread(rng: random.Random, low: float, high: float, zero: float = 0.0) -> float:
    """Return a number from 10^low to 10^high with an evenly distributed logarithm, or 0 with the probability `zero`."""
    return 0.0 if rng.random() < zero else float(10.0 ** rng.uniform(low, high))


def random_body(rng: random.Random, axes: str) -> Vehicle:
    """Return a coupled vehicle with these axes, about as large as the Heavy, and with effects chosen at random.

    It may have entries of the mass matrix and damping between its axes, lift, weight and buoyancy with their centres,
    thrusters with lag, and loss of thrust by the speed of advance.
    """
    pairs = [(a, b) for a, b in permutations(axes, 2) if rng.random() < 0.4]
    cross: list[tuple[str, ...]] = [("m_a", a, b) for a, b in combinations(axes, 2) if rng.random() < 0.5]
    cross += [(rng.choice(["a_d", "b_d"]), a, b) for a, b in pairs]
    cross += [("lift", rng.choice(axes), "u", b) for b in axes if "u" in axes and b != "u" and rng.random() < 0.5]
    lag, advance = (rng.choice([(), keys]) for keys in (("T",), ("d", "d_reverse")))
    thrusters = []
    for n in range(3):
        direction, position = ([rng.gauss(0.0, 1.0) for _ in range(3)] for _ in range(2))
        length = sqrt(sum(x * x for x in direction))
        x, y, z = (part / length for part in direction)
        thrusters.append(
            thruster(f"t{n}", "main", (x, y, z), (0.2 * position[0], 0.2 * position[1], 0.2 * position[2]))
        )
    forms = tuple(VehicleAxis(form.axis, rng.choice([("m_a", *_DRAG), _ALL])) for form in _axes(axes))
    restoring = tuple(RESTORING) if rng.random() < 0.7 else ()
    curves = (Curve("main", (*_T200.keys, *advance, *lag)),)
    layout = Layout(forms, curves, tuple(thrusters), coupled=True, cross=tuple(cross), restoring=restoring)
    numbers = {name: value * rng.uniform(0.7, 1.3) for name, value in numbered(layout).coefficients.items()}
    signed = {
        name: value * rng.choice([-1.0, 1.0]) for name, value in numbers.items() if cross_of(name) or name[2:] in "GB"
    }
    return Vehicle(layout, numbers | signed)


def random_layout(rng: random.Random) -> Layout:
    """Return a layout with any axes, one or two curves, and thrusters in any direction and place."""
    axes = rng.choice(["u", "v", "w", "r", "ur", "uv", "vr", "uwr", "uvr", "uvwr", "uvwr"])
    curves = []
    for name in ("main", "aux")[: rng.choice([1, 2])]:
        keys = rng.choice([("a_t", "b_t"), _T200.keys, (*_T200.keys, "c_0_reverse")])
        curves.append(Curve(name, (*keys, "T") if rng.random() < 0.5 else keys, rng.choice([1, 2])))
    thrusters = []
    for n in range(rng.randint(1, 5)):
        direction = [rng.choice([0.0, rng.gauss(0.0, 1.0)]) for _ in range(3)]
        length = sqrt(sum(x * x for x in direction))
        x, y, z = (part / length for part in direction) if length else (1.0, 0.0, 0.0)
        position = (rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.0) if rng.random() < 0.7 else None
        arm: Side = rng.choice(["starboard", None, "port"]) if position is None else None
        thrusters.append(thruster(f"t{n}", rng.choice(curves).name, (x, y, z), position, arm))
    mix = {}
    if rng.random() < 0.3:
        mix = {name: {t.name: rng.uniform(-1.0, 1.0) for t in thrusters} for name in ("a", "b")}
    forms = tuple(VehicleAxis(form.axis, rng.choice([_DRAG, ("m_a", *_DRAG), _EITHER, _ALL])) for form in _axes(axes))
    return Layout(forms, tuple(curves), tuple(thrusters), mix, {"u", "v", "r"} <= set(axes) and rng.random() < 0.7)


def random_vehicle(rng: random.Random, layout: Layout | None = None) -> Vehicle:
    """Return a vehicle whose mass and drag both matter. One drag coefficient in six is zero."""
    layout = layout or random_layout(rng)
    numbers = {}
    for name, declaration in layout.coefficients.items():
        if name in _factors(layout):
            numbers[name] = spread(rng, -0.5, 0.5)
        elif name.startswith(("a_d", "b_d")):
            numbers[name] = spread(rng, -1.0, 2.0, zero=1 / 6)
        elif name.startswith("m_"):
            numbers[name] = spread(rng, 0.0, 1.5)
        elif name.startswith(("a_t", "b_t", "F_0")):
            numbers[name] = rng.uniform(-10.0, 40.0)
        elif name.startswith("c_0"):
            numbers[name] = rng.uniform(0.0, 0.3)
        elif name.startswith("T_"):
            numbers[name] = spread(rng, -2.0, 0.5)
        else:
            numbers[name] = rng.uniform(0.1, 1.5)
        assert declaration.minimum <= numbers[name] <= declaration.maximum, name
    return Vehicle(layout, numbers)


def random_inputs(rng: random.Random, rov: Vehicle) -> State:
    """Return commands of both signs, some beyond full thrust and some zero, loads, and a current."""
    found = {}
    for name in rov.layout.inputs:
        if name in rov.layout.commands:
            found[name] = rng.choice([rng.uniform(-1.1, 1.1), rng.uniform(-1.1, 1.1), 0.0])
        elif name.startswith("V_"):
            found[name] = rng.uniform(-0.5, 0.5)
        else:
            found[name] = rng.choice([0.0, rng.gauss(0.0, 0.3 if name[0] in "KMN" else 10.0)])
    return found


def random_state(rng: random.Random, rov: Vehicle) -> State:
    """Return velocities of a vehicle's usual size, some of them zero, a pose near the origin, and lagging forces."""
    sizes = {"x": 20.0, "y": 20.0, "z": 20.0, "psi": 3.0, "p": 1.5, "q": 1.5, "r": 1.5}
    found = {}
    for name in rov.layout.state:
        if name in ("x", "y", "z", "psi"):
            found[name] = rng.gauss(0.0, sizes[name])
        else:
            size = 10.0 if name.startswith("F_") else sizes.get(name, 0.8)
            found[name] = rng.choice([rng.gauss(0.0, size), rng.gauss(0.0, size), rng.gauss(0.0, size), 0.0])
    if rov.layout.has_attitude:  # all attitudes are equally likely
        parts = [rng.gauss(0.0, 1.0) for _ in QUATERNION]
        found |= {name: part / hypot(*parts) for name, part in zip(QUATERNION, parts, strict=True)}
    return found


def random_case(rng: random.Random, rov: Vehicle, shortest: float = -6.0, longest: float = 0.3) -> Case:
    """Return a step of 10^shortest to 10^longest seconds. One in six begins at rest."""
    state = at_rest(rov) if rng.random() < 1 / 6 else random_state(rng, rov)
    return rov, random_inputs(rng, rov), state, spread(rng, shortest, longest)


def at_rest(rov: Vehicle) -> State:
    """Return all states: each is 0, except for the quaternion of a level vehicle that heads north."""
    return dict(rov.layout.at_rest)


def still(rov: Vehicle) -> State:
    """Return all inputs, each 0."""
    return dict.fromkeys(rov.layout.inputs, 0.0)
