"""Vehicles of every kind for tests, random vehicles, and random inputs and states for them."""

import random
from collections.abc import Mapping
from math import sqrt
from pathlib import Path

from rov_fmu.model.layout import AXES, AXIS, CURVE, Curve, Layout, Thruster, VehicleAxis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.paper import PAPER
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

Values = Mapping[str, float]
State = dict[str, float]
Case = tuple[Rov, State, State, float]
"""A vehicle, its inputs and states, and the length of a step."""

_DRAG = ("a_d", "b_d")
_EITHER = (*_DRAG, "a_d_reverse", "b_d_reverse")
_ALL = ("m_a", *_EITHER, "F_0")
_T200 = Curve("t200", ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0"))
_LAGGING = Curve("t200", (*_T200.keys, "T"))
_S = sqrt(0.5)
_PLANAR = (  # four vectored thrusters, as ArduSub numbers them
    Thruster("1", "t200", (_S, -_S, 0.0), (0.156, 0.111, 0.0)),
    Thruster("2", "t200", (_S, _S, 0.0), (0.156, -0.111, 0.0)),
    Thruster("3", "t200", (-_S, -_S, 0.0), (-0.156, 0.111, 0.0)),
    Thruster("4", "t200", (-_S, _S, 0.0), (-0.156, -0.111, 0.0)),
)
_VERTICAL = tuple(Thruster(name, "t200", (0.0, 0.0, -1.0), (0.1, 0.1, 0.0)) for name in "56")
_ALL_ROUND = (*_PLANAR, *_VERTICAL)
_PAIR = (
    Thruster("l", "t200", (1.0, 0.0, 0.0), (0.0, -0.2, 0.0)),
    Thruster("r", "t200", (1.0, 0.0, 0.0), (0.0, 0.2, 0.0)),
)
_BOW = Thruster("b", "t200", (0.0, 1.0, 0.0), (0.5, 0.0, 0.0))
_MIX = {
    "ahead": {"1": 1.0, "2": 1.0, "3": -1.0, "4": -1.0},
    "aside": {"1": -1.0, "2": 1.0, "3": -1.0, "4": 1.0},
    "turn": {"1": -0.5, "2": 0.5, "3": 0.5, "4": -0.5},
}
_BODY_NUMBERS = {"m_rov": 13.5, "I_r": 0.37, "R": 0.2, "gamma": 0.5}
_AXIS_NUMBERS = {  # m_a, a_d, b_d, a_d_reverse, b_d_reverse, F_0
    "u": (6.3567, 141.0, 13.7, 190.0, 4.0, 0.1),
    "v": (7.1206, 217.0, 0.0, 100.0, 3.0, 0.3),
    "w": (18.6863, 190.0, 33.0, 150.0, 20.0, -1.5),
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
    "T": 0.15,
}
assert _CURVE_NUMBERS.keys() == CURVE.keys()


def numbered(layout: Layout, **values: float) -> Rov:
    """Return a vehicle with the Heavy's numbers, except for the given values, and without tuning."""
    numbers = {curve.coefficient(key): _CURVE_NUMBERS[key] for curve in layout.curves for key in curve.keys}
    for form in layout.axes:
        row = _AXIS_NUMBERS[form.axis.velocity]
        numbers |= {form.axis.coefficient(key): value for key, value in zip(AXIS, row, strict=True)}
    numbers |= _BODY_NUMBERS | values
    return Rov(layout, {name: 1.0 if meta.tunable else numbers[name] for name, meta in layout.coefficients.items()})


def _axes(names: str, keys: tuple[str, ...] = _DRAG) -> tuple[VehicleAxis, ...]:
    return tuple(VehicleAxis(axis, keys) for axis in AXES.values() if axis.velocity in names)


def _rov(
    axes: str,
    curve: Curve,
    thrusters: tuple[Thruster, ...],
    keys: tuple[str, ...] = _DRAG,
    coupled: bool = False,
    mix: Mapping[str, Mapping[str, float]] | None = None,
) -> Rov:
    return numbered(Layout(_axes(axes, keys), (curve,), thrusters, mix or {}, coupled))


EVERYTHING = Path(__file__).parent / "vehicle" / "everything.toml"
VIDEORAY, HEAVY = (load_vehicle(SHIPPED[name]).rov for name in ("videoray", "bluerov2_heavy"))
VEHICLES = {
    "VideoRay": VIDEORAY,
    "Heavy": HEAVY,
    "neither lag nor coupling": _rov("uvwr", _T200, _ALL_ROUND, ("m_a", *_DRAG)),
    "with an input mix": _rov("uvwr", _T200, _ALL_ROUND, _ALL, mix={**_MIX, "down": {"5": -1.0, "6": -1.0}}),
    "drag by direction, coupled, late": _rov("uvwr", _LAGGING, _ALL_ROUND, _ALL, coupled=True),
    "coupled without lag, three commands, no heave": _rov(
        "uvr", Curve("t200", ("a_t", "b_t", "c_0", "c_0_reverse")), _PLANAR, _ALL, coupled=True, mix=_MIX
    ),
    "lag without coupling": _rov("uwr", _LAGGING, (*_PAIR, *_VERTICAL), _ALL),
    "an arm with lag beside a swift thruster": numbered(
        Layout(_axes("uwr", ("m_a", *_DRAG)), (Curve("rear", ("a_t", "b_t", "T"), 2), Curve("top")), PAPER.thrusters)
    ),
    "sway and yaw": _rov("vr", _T200, (_BOW,)),
    "heave only": _rov("w", _T200, _VERTICAL, _EITHER),
    "yaw only": _rov("r", _T200, _PAIR),
    "yaw only, late": _rov("r", _LAGGING, _PAIR),
    "surge and sway without yaw": _rov("uv", _T200, _PLANAR, _EITHER),
    "surge without drag": numbered(Layout(_axes("ur"), (_T200,), _PAIR), a_d_u=0.0, b_d_u=0.0),
    "linear drag alone, late": numbered(Layout(_axes("ur"), (_LAGGING,), _PAIR), a_d_u=0.0, a_d_r=0.0, b_d_r=0.3),
}


def a_vehicle(rov: Rov) -> Vehicle:
    """Return a vehicle file's content with these coefficients and placeholders for all texts."""
    sources = dict.fromkeys(rov.coefficients, "A tank test")
    return Vehicle("An ROV", "an_rov", "1", "A test", "A tank", rov, sources, (0.1, 1.0), {}, None)


# ---- Random vehicles ----


def spread(rng: random.Random, low: float, high: float, zero: float = 0.0) -> float:
    """Return a number from 10^low to 10^high with an evenly distributed logarithm, or 0 with the probability `zero`."""
    return 0.0 if rng.random() < zero else float(10.0 ** rng.uniform(low, high))


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
        arm = rng.choice([-1, 0, 1]) if position is None else 0
        thrusters.append(Thruster(f"t{n}", rng.choice(curves).name, (x, y, z), position, arm))
    mix = {}
    if rng.random() < 0.3:
        mix = {name: {t.name: rng.uniform(-1.0, 1.0) for t in thrusters} for name in ("a", "b")}
    forms = tuple(VehicleAxis(form.axis, rng.choice([_DRAG, ("m_a", *_DRAG), _EITHER, _ALL])) for form in _axes(axes))
    return Layout(forms, tuple(curves), tuple(thrusters), mix, {"u", "v", "r"} <= set(axes) and rng.random() < 0.7)


def random_vehicle(rng: random.Random, layout: Layout | None = None) -> Rov:
    """Return a vehicle whose mass and drag both matter. One drag coefficient in six is zero."""
    layout = layout or random_layout(rng)
    numbers = {}
    for name, meta in layout.coefficients.items():
        if meta.tunable:
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
        assert meta.minimum <= numbers[name] <= meta.maximum, name
    return Rov(layout, numbers)


def random_inputs(rng: random.Random, rov: Rov) -> State:
    """Return commands of both signs, some beyond full thrust and some zero, loads, and a current."""
    found = {}
    for name in rov.layout.inputs:
        if name in rov.layout.commands:
            found[name] = rng.choice([rng.uniform(-1.1, 1.1), rng.uniform(-1.1, 1.1), 0.0])
        elif name in ("V_N", "V_E"):
            found[name] = rng.uniform(-0.5, 0.5)
        else:
            found[name] = rng.choice([0.0, rng.gauss(0.0, 0.3 if name == "N_ext" else 10.0)])
    return found


def random_state(rng: random.Random, rov: Rov) -> State:
    """Return velocities of a vehicle's usual size, some of them zero, a pose near the origin, and lagging forces."""
    sizes = {"x": 20.0, "y": 20.0, "z": 20.0, "psi": 3.0, "r": 1.5}
    found = {}
    for name in rov.layout.state:
        if name in ("x", "y", "z", "psi"):
            found[name] = rng.gauss(0.0, sizes[name])
        else:
            size = 10.0 if name in rov.layout.lagging else sizes.get(name, 0.8)
            found[name] = rng.choice([rng.gauss(0.0, size), rng.gauss(0.0, size), rng.gauss(0.0, size), 0.0])
    return found


def random_case(rng: random.Random, rov: Rov, shortest: float = -6.0, longest: float = 0.3) -> Case:
    """Return a step of 10^shortest to 10^longest seconds. One in six begins at rest."""
    state = at_rest(rov) if rng.random() < 1 / 6 else random_state(rng, rov)
    return rov, random_inputs(rng, rov), state, spread(rng, shortest, longest)


def at_rest(rov: Rov) -> State:
    """Return all states, each 0."""
    return dict.fromkeys(rov.layout.state, 0.0)


def still(rov: Rov) -> State:
    """Return all inputs, each 0."""
    return dict.fromkeys(rov.layout.inputs, 0.0)
