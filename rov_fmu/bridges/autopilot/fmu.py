"""The autopilot of a vehicle as an FMU: in C for all platforms, with the gains for this vehicle as start values.

Its inputs are the outputs of the vehicle (the terminals `pose`, `body_velocity` and `velocity`), and for each axis that
the thrusters can push a mode and what the axis aims at; its outputs are the commands (`thrusters`). The gains are
parameters, the tables of the thrusters constants of the code.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rov_fmu.autopilot.gains import Autopilot
from rov_fmu.autopilot.law import AXES, GAINS, LAW_FILE, OWN_GAINS, SENSORS, STATE, STEP_FILE, law_sources
from rov_fmu.autopilot.pilot import PLACES
from rov_fmu.build import model_fmu
from rov_fmu.c.source import sampled_sources
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import PITCH, ROLL, Axis, Declaration
from rov_fmu.equation.layout import Layout
from rov_fmu.fmu.archive import CARD
from rov_fmu.fmu.terminals import Terminal, terminals, terminals_document
from rov_fmu.fmu.variables import FmuModel, VariableList
from rov_fmu.io.templates import render

_PLUGS = ("pose", "body_velocity", "velocity")
"""The terminals of the vehicle that are the sensors."""
VALID = {
    "valid_position": "position",
    "valid_depth": "depth, with the velocity downward,",
    "valid_velocity": "velocity",
    "valid_attitude": "attitude, with its rates,",
}
"""The inputs that say which measurements are valid, with what they are of. So are they in fmu_src/autopilot/step.c."""
_MODES = "0: stick, 1: rate, 2: place or angle"


def _unit(axis: Axis, name: str) -> str:
    """Return the unit of a gain of an axis."""
    load, rate, place = axis.load, axis.unit, axis.position_unit or axis.unit.partition("/")[0]
    if name in ("most", "i_max", "bias"):
        return load
    turned = axis.is_rotation
    units: dict[str, str] = {
        **{"k_x": "1/s", "v_max": rate, "brake": f"{rate}2", "tracking": "s", "handover": "s"},
        **{"k_p": "N.m.s/rad" if turned else "N.s/m", "k_i": f"{load}/{place}"},
        **{"d_1": "N.m.s/rad" if turned else "N.s/m", "d_2": "N.m.s2/rad2" if turned else "N.s2/m2"},
        **{"inertia": "kg.m2" if turned else "kg", "k_d": "kg.m2" if turned else "kg"},
    }
    return units[name]


def autopilot_model(autopilot: Autopilot) -> FmuModel:
    """Return the model of the FMU of an autopilot."""
    vehicle, layout = autopilot.vehicle, autopilot.vehicle.layout
    sensors = [one for one in terminals(layout) if one.name in _PLUGS]
    measured = [name for one in sensors for name in one.variables]
    declared = {**layout.pose, **layout.velocities, **layout.over_ground}
    made = VariableList()
    add = made.add

    def put(name: str, text: str, unit: str, start: float, **rest: Any) -> int:
        return add(name, Declaration(unit, text), "input", "continuous", start=start, **rest)

    for name in measured:
        add(name, declared[name], "input", "continuous", start=float(name == QUATERNION[0]))
    aims = {axis: [-1] * 4 for axis in AXES}
    for axis in autopilot.axes:
        place, load = _place_of(axis), "torque" if axis.is_rotation else "force"
        aims[axis] = [
            put(f"mode_{axis.velocity}", f"Mode of {axis.name}. {_MODES}", "1", 2.0 * (axis in (ROLL, PITCH)),
                display_unit=None, minimum=0.0, maximum=2.0),
            put(f"stick_{axis.velocity}", f"Share of the largest {load} in {axis.name}", "1", 0.0,
                minimum=-1.0, maximum=1.0),
            put(f"ref_{axis.velocity}", f"Rate to hold in {axis.name}", axis.unit, 0.0),
            put(f"ref_{place}", _held(axis), _length(axis), 0.0),
        ]  # fmt: skip
    most = {"minimum": 0.0, "maximum": 1.0}
    sag = put("sag", "Part of the largest command that is lost, as by a battery", "1", 0.0, **most)
    valid = len(made)
    for flag, words in VALID.items():
        put(flag, f"1: the {words} is measured; 0: it is old", "1", 1.0, display_unit=None, **most)
    inputs = len(made)
    made.add_clock()
    for name, declaration in layout.commands.items():
        add(name, declaration, "output", "discrete", initial="calculated", dependencies={})
    states = dict.fromkeys(AXES, -1)
    for axis in autopilot.axes:
        memory = Declaration("1", f"What the loop of {axis.name} keeps between steps")
        first, *_ = [
            add(f"kept_{n}_{axis.velocity}", memory, "local", "discrete", initial="calculated", display_unit=None)
            for n in range(STATE)
        ]
        states[axis] = first
    held = dict.fromkeys(AXES, -1)
    for axis in autopilot.axes:
        words = f"1: {axis.name} does what its mode asks for; 0: it lacks a valid measurement, and a lower mode acts"
        rest: dict[str, Any] = {"initial": "calculated", "dependencies": {}, "display_unit": None}
        held[axis] = add(f"is_held_{axis.velocity}", Declaration("1", words), "output", "discrete", **rest)
    gains = {axis: [-1] * len(GAINS) for axis in AXES}
    for axis in autopilot.axes:
        for n, name in enumerate(OWN_GAINS):
            text = f"{axis.name.capitalize()}: {GAINS[name]}"
            own = Declaration(_unit(axis, name), text)
            start = autopilot.gain(axis, name)
            gains[axis][n] = add(
                f"{name}_{axis.velocity}", own, "parameter", "tunable", initial="exact", start=start, display_unit=None
            )
    places = {variable.name: variable.value_reference for variable in made[:inputs]}
    given = {
        "inputs": inputs,
        "commands": len(layout.commands),
        "sag": sag,
        "valid": valid,
        "held": [*held.values()],
        "quaternion": places.get(QUATERNION[0], -1),
        "variables": len(made),
        "sensors": [places.get(name, -1) for name in SENSORS],
        "aims": [*aims.values()],
        "states": [*states.values()],
        "gains": [*gains.values()],
        "sharing": [*map(repr, autopilot.sharing.numbers.tolist())],
    }
    files = law_sources(LAW_FILE, STEP_FILE) | sampled_sources() | {"model.h": render("autopilot.h.j2", **given)}
    names = {axis.name: autopilot.lags[axis.name] for axis in autopilot.axes}
    told = ", ".join(f"{name} {lag:.3g} s" for name, lag in names.items())
    summary = f"Autopilot of {vehicle.name}: holds {', '.join(names)} by its thrusters"
    summary += f". Caution: {vehicle.caution}" if vehicle.caution else ""
    card = (
        f"What it is\n- {summary}.\n- For each axis: {_MODES}. It samples once per step.\n"
        f"Where it holds\n- The gains are for a step of {autopilot.step:g} s, {autopilot.delay:g} s from sensor to "
        f"thrust, and the lags {told}.\n"
    )
    return FmuModel(
        *(f"{vehicle.identifier}_autopilot", vehicle.version, vehicle.source, summary, card),
        tuple(made),
        terminals_document(_terminals(layout, sensors)),
        files,
        has_derivatives=False,
        experiment=(10.0, autopilot.step),
    )


def _held(axis: Axis) -> str:
    """Return what is held of an axis in mode 2. North and east need surge and sway alike, because the vehicle turns."""
    name = next(name for name, one in PLACES.items() if one is axis)
    both = "; needs mode 2 of surge and of sway" if name in ("north", "east") else ""
    return f"{name.capitalize()} to hold{both}"


def _place_of(axis: Axis) -> str:
    """Return the name of the place or the angle of an axis."""
    return SENSORS[AXES.index(axis)]


def _length(axis: Axis) -> str:
    return "rad" if axis.is_rotation else "m"


def _terminals(layout: Layout, sensors: Sequence[Terminal]) -> list[Terminal]:
    commands = next(one for one in terminals(layout) if one.name == "thrusters")
    valid = Terminal("valid", "input", "bus", "Which measurements are valid", tuple(VALID))
    return [*(replace(one, causality="input") for one in sensors), valid, replace(commands, causality="output")]


def autopilot_fmu(autopilot: Autopilot, platforms: Sequence[str] | None = None, fmi: int = 2) -> bytes:
    """Return the FMU of an autopilot for Co-Simulation.

    - `platforms`: those of PLATFORMS, or `host`; by default those with 64 bits.

    Raises BuildError.
    """
    model = autopilot_model(autopilot)
    return model_fmu(model, platforms, {CARD: model.card.encode()}, fmi)
