"""The live section of a page: the model as WebAssembly, the data of the vehicle, and the scripts that fly it."""

import base64
import json
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import floor, log10
from typing import Any

import numpy as np
from markupsafe import Markup

from rov_fmu.autopilot.allocation import thrust_rows
from rov_fmu.autopilot.ardusub import RATE, STICK_TIME, TURNING, Mixer, loops_of
from rov_fmu.autopilot.gains import STEP, autopilot_of
from rov_fmu.autopilot.law import AXES as LAW_AXES
from rov_fmu.autopilot.law import SENSORS
from rov_fmu.c.compile import MODULE_SOURCES
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Thruster
from rov_fmu.fmu.variables import variables
from rov_fmu.io.messages import InputError, listed
from rov_fmu.report.plots.geometry import size_of, thruster_place
from rov_fmu.report.plots.steps import held_commands
from rov_fmu.report.templates import inline_script, number, page, pretty_unit
from rov_fmu.tank.catalogue import as_json
from rov_fmu.tank.columns import FRACTION, INPUTS, THRUSTERS, LogColumn, columns_of_log
from rov_fmu.tank.readers.tables import rules_of_page
from rov_fmu.vehicle.steady import beyond_stated
from rov_fmu.vehicle.vehicle import Vehicle

_KEYS = {"surge": "WS", "sway": "EQ", "heave": "FR", "yaw": "DA"}
"""The letters of the keys for the positive and the negative direction of an axis."""
_SPARE_KEYS = ("LJ", "IK")
_VERTICAL = 0.9
"""The least vertical part of a thruster's direction for which its label says that it is vertical."""
_COARSE = 0.02
"""The relative error of a force in the tables of the page's autopilot, which are part of it."""
_HELD = {HEAVE: "depth", YAW: "heading", ROLL: "roll", PITCH: "pitch"}
"""What an autopilot of the page holds."""
_FARTHEST = 0.2
"""The farthest that a slider moves a centre of mass or buoyancy, m."""
_SCRIPTS = (
    "model.js",
    "helm.js",
    "flight.js",
    "recording.js",
    "canvas.js",
    "shape.js",
    "instruments.js",
    "picture.js",
    "charts.js",
    "controls.js",
)


Slider = tuple[str, str, float, float, float, str, str]
"""A tunable coefficient: name, label, both ends of the slider, value in the vehicle file, unit, description."""


@dataclass(frozen=True)
class FlyingVehicle:
    """A vehicle and its WebAssembly module."""

    vehicle: Vehicle
    module: bytes
    file: str = ""
    """The name of the vehicle file, which distinguishes vehicles of the same name and version."""


@dataclass(frozen=True)
class Live:
    """The content that the templates of a page need to fly a vehicle, with another one as a ghost."""

    data: Markup
    """The vehicles as JSON, as fmu_src/live/model.js declares it."""
    script: Markup
    """The scripts of fmu_src/live/, one after the other."""
    policy: str
    """The directive that allows this script in the page's content security policy."""
    tests: Sequence[str]
    """The labels of the step tests that a button starts."""
    keys: Sequence[tuple[Axis, str]]
    """The axes that commands drive, each with the letters of its keys: that of its positive direction, and that of its
    negative one."""
    tested: float
    """The largest command for which the model was identified."""
    places: Mapping[str, str]
    """Where the thruster is ("left rear"), by the command that drives only this thruster."""
    start: Mapping[str, float]
    """The start value of each variable."""
    loads: Sequence[tuple[str, float, str]]
    """The inputs that are not commands: name, end of the slider, unit."""
    tunable: Mapping[str, Sequence[Slider]]
    """The tunable coefficients by the title of their group."""
    laws: Sequence[Mapping[str, Any]]
    """The autopilots that can hold the vehicle."""
    title: str
    """The name of the vehicle, or the names of both."""
    other: str | None
    """The name of the ghost, if there is one."""
    recording: Markup | None
    """The recording that is flown at first as JSON, if there is one."""


def live(flown: Sequence[FlyingVehicle], recording: Mapping[str, Any] | None = None) -> Live:
    """Return the content that flies the first of these vehicles, with a recording if there is one. Raises
    DataFileError."""
    pilot = flown[0].vehicle
    data = [_data(one) for one in flown]
    script = inline_script(*_SCRIPTS, folder=MODULE_SOURCES)
    tests, start = data[0]["tests"], dict(data[0]["variables"])
    names = _names(flown)
    tunable = {
        "Ballast and payload": [*_ballast(pilot)],
        "Health of the thrusters": [*_health(pilot)],
        "Tuning α and β": [*_tuning(pilot)],
    }
    return Live(
        data=_json(data),
        script=script.text,
        policy=f"{script.policy} 'wasm-unsafe-eval'",
        tests=[f"{pilot.layout.axes[t['axis']].axis.name} {number(100.0 * t['command'], 3)} %" for t in tests],
        keys=[(axis, keys) for axis, keys in _keys(pilot.layout) if keys],
        tested=data[0]["tested"],
        places=_places(pilot),
        start=start,
        loads=list(_loads(pilot, start)),
        tunable={title: sliders for title, sliders in tunable.items() if sliders},
        laws=data[0]["laws"],
        title=" beside ".join(names),
        other=names[1] if len(flown) > 1 else None,
        recording=_json(recording) if recording else None,
    )


def _json(data: Any) -> Markup:
    """Return data as JSON that may stand in a script element."""
    return Markup(json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c"))


def _names(flown: Sequence[FlyingVehicle]) -> list[str]:
    """Return the names of the vehicles. Equal names also have the version or the file."""
    plain = [one.vehicle.name for one in flown]
    versions = [f"{one.vehicle.name} {one.vehicle.version}" for one in flown]
    files = [f"{one.vehicle.name} ({one.file})" if one.file else one.vehicle.name for one in flown]
    return next((names for names in (plain, versions, files) if len({*names}) == len(names)), plain)


def fly_page(
    flown: Sequence[FlyingVehicle], *, compact: bool = False, recording: Mapping[str, Any] | None = None
) -> str:
    """Return a page that has only the live section: the first vehicle and the second one as a ghost.

    A recording (`recording_of`) is flown at once.

    The compact form, for a frame in another page, shows the picture, the charts and the buttons only.
    Raises DataFileError.
    """
    vehicle = flown[0].vehicle
    given = recording["commands"] if recording else {}
    commands = [abs(value) for name, values in given.items() if name in vehicle.layout.commands for value in values]
    return page(
        "fly.html.j2",
        vehicle=vehicle,
        layout=vehicle.layout,
        live=live(flown, recording),
        beyond=[*_cautions(flown), *beyond_stated(vehicle)],
        compact=compact,
        recording=recording,
        strongest=max(commands, default=0.0),
    )


def _cautions(flown: Sequence[FlyingVehicle]) -> Iterator[str]:
    """Yield what the files of the vehicles say against their use, each in a line that names the vehicle."""
    for name, one in zip(_names(flown), flown, strict=True):
        if one.vehicle.caution:
            yield f"Caution, {name}: {one.vehicle.caution}."


def _data(flown: FlyingVehicle) -> dict[str, Any]:
    """Return the data of a vehicle for the scripts."""
    vehicle, layout, labels = flown.vehicle, flown.vehicle.layout, _labels(flown.vehicle)
    return {
        "identifier": vehicle.identifier,
        "name": vehicle.name,
        "module": base64.b64encode(zlib.compress(flown.module, 9)).decode(),
        "variables": [(v.name, 0.0 if v.name in layout.commands else v.start or 0.0) for v in variables(vehicle)],
        "pulse": layout.pulse,
        "tested": vehicle.command_range[1],
        "inputs": len(layout.inputs),
        "states": len(layout.state),
        "commands": list(layout.commands),
        "columns": list(_columns(layout)),
        "csv": rules_of_page(),
        "axes": [_axis(vehicle, axis, keys) for axis, keys in _keys(layout)],
        "thrusters": [_thruster(vehicle, thruster, labels[thruster.name]) for thruster in layout.thrusters],
        "fins": [{"at": fin.place, "along": fin.direction.value} for fin in layout.fins],
        **_autopilots(vehicle),
        "tests": list(_tests(vehicle)),
        "size": size_of(vehicle),
    }


def _columns(layout: Layout) -> Iterator[dict[str, Any]]:
    """Yield the columns of commands that a recording may have.

    `gains` are those of the vehicle's commands in the command of the column. `shares` are the commands that give this
    command best, while those of the other columns of its `kind` are 0.
    """
    columns = {name: one for name, one in columns_of_log(layout, None).items() if one.commands}
    fins = {name: LogColumn.of(FRACTION, name, INPUTS if layout.mix else THRUSTERS) for name in layout.commands}
    for kind in (INPUTS, THRUSTERS):
        own = {name: one for name, one in (fins | columns).items() if one.commands == kind}
        gains = [{name: 1.0} if name in layout.commands else layout.gains[column.name] for name, column in own.items()]
        matrix = np.array([[row.get(command, 0.0) for command in layout.commands] for row in gains])
        shares = np.linalg.pinv(matrix, rcond=1e-9).T if gains else ()
        for (name, column), row, share in zip(own.items(), gains, shares, strict=True):
            by_command = dict(zip(layout.commands, map(float, share), strict=True))
            yield {"name": name, "also": column.also, "kind": kind, "gains": row, "shares": by_command}


def _keys(layout: Layout) -> list[tuple[Axis, str]]:
    """Return each axis with the letters of its keys; none where no command acts. Axes without their own letters get the
    spare ones."""
    spare = iter(_SPARE_KEYS)
    keys = {form.axis: _KEYS.get(form.axis.name) or next(spare) for form in layout.axes}
    return [(axis, letters if layout.signs(axis) else "") for axis, letters in keys.items()]


def _axis(vehicle: Vehicle, axis: Axis, keys: str) -> dict[str, Any]:
    position = {"heave": "z", "roll": "phi", "pitch": "theta", "yaw": "psi"}.get(axis.name)
    return {
        "name": axis.name,
        "velocity": axis.velocity,
        "unit": axis.unit,
        "external": axis.external,
        "position": position,
        "positionUnit": axis.position_unit,
        "quantities": as_json(axis),
        "signs": vehicle.layout.signs(axis),
        "shares": _shares(vehicle, axis),
        "keys": keys,
    }


def _shares(vehicle: Vehicle, axis: Axis) -> dict[str, float]:
    """Return the commands by which a key drives an axis, the largest of them ±1.

    Those of a vehicle that rolls or pitches leave the other axes at rest, as far as thrust is linear in the commands.
    """
    layout = vehicle.layout
    if not layout.has_attitude:
        return layout.signs(axis)
    axes = layout.bare_axes
    gains = [*zip(*layout.gain_rows(t.name for t in layout.thrusters), strict=True)]
    effects = [
        [sum(vehicle.effect(t, other) * gain for t, gain in zip(layout.thrusters, own, strict=True)) for own in gains]
        for other in axes
    ]
    shares = np.linalg.pinv(np.array(effects), rcond=1e-9)[:, axes.index(axis)]
    most = np.abs(shares).max(initial=0.0)
    found = {name: round(float(x / (most or 1.0)), 4) for name, x in zip(layout.commands, shares, strict=True)}
    return {name: share for name, share in found.items() if share}


def _autopilots(vehicle: Vehicle) -> dict[str, Any]:
    """Return the autopilots of a vehicle, as fmu_src/live/model.js declares them, and the sentence why it has none.

    They hold depth, heading, roll and pitch, as far as the thrusters push along these axes; keys drive the others. That
    of ArduSub, with its default gains, needs one of its frames.
    """
    places = {variable.name: n for n, variable in enumerate(variables(vehicle))}
    names = {axis: name for axis, name in _HELD.items() if vehicle.layout.has(axis)}
    try:
        own = autopilot_of(vehicle)
    except InputError as error:
        return {"sensors": [], "laws": [], "unheld": f"It is not held: {str(error).partition(': ')[2]}."}
    tables = tuple(np.array(thrust_rows(vehicle, curve, None, _COARSE)) for curve in vehicle.layout.curves)
    # A jump to full thrust would tilt a Heavy by 47 degrees.
    steered = replace(own.sharing, tables=tables, stick_time=STICK_TIME)
    kinds = [("own", "Held by its own gains", round(1.0 / STEP), own.gain(YAW, "v_max"), own.loops, steered)]
    with suppress(InputError):
        sharing = Mixer(vehicle).sharing
        kinds.append(("ardusub", "Held as by ArduSub", RATE, TURNING, loops_of({}, 1), sharing))
    laws = []
    for name, title, rate, turn, loops, sharing in kinds:
        pushes = np.abs(sharing.of_axis).max(axis=0) > 0.0
        held = [axis for axis in names if pushes[LAW_AXES.index(axis)]]
        gains = "gains that are made for this vehicle" if name == "own" else "ArduSub's law and default gains"
        words = f"{listed(names[axis] for axis in held).capitalize()} {'are' if held[1:] else 'is'} held with {gains}."
        if lacking := [names[axis] for axis in names if axis not in held]:
            words += f" Its thrusters cannot hold {listed(lacking)}."
        numbers = [float(f"{x:.7g}") for x in (*loops.view("f8").ravel(), *sharing.numbers)]
        law = {"name": name, "title": title, "rate": rate, "turn": turn, "held": [axis.name for axis in held]}
        laws += [law | {"words": words, "numbers": numbers}] * bool(held)
    unheld = "" if laws else f"It is not held: its thrusters do not push along {listed(a.name for a in names)}."
    return {"sensors": [places.get(name, -1) for name in SENSORS], "laws": laws, "unheld": unheld}


def _thruster(vehicle: Vehicle, thruster: Thruster, label: str) -> dict[str, Any]:
    curve = vehicle.layout.curve_of[thruster.name]
    most = max(abs(vehicle.curve_force(curve, command)) for command in (1.0, -1.0))
    return {
        "force": f"F_{thruster.name}",
        "commands": list(vehicle.layout.gains[thruster.name]),
        "label": label,
        "at": thruster_place(vehicle, thruster),
        "along": thruster.direction.value,
        "most": most or 1.0,
    }


def _places(vehicle: Vehicle) -> dict[str, str]:
    """Return the label of the thruster for each command that drives only one."""
    if vehicle.layout.mix:
        return {}
    return {f"u_{name}": label for name, label in _labels(vehicle).items()}


def _labels(vehicle: Vehicle) -> dict[str, str]:
    """Return where each thruster is ("left rear"), by its name. Labels of thrusters at the same place have the name."""
    labels = {thruster.name: _label(vehicle, thruster) for thruster in vehicle.layout.thrusters}
    same = Counter(labels.values())
    return {name: label if same[label] == 1 else f"{name} {label}".rstrip() for name, label in labels.items()}


def _label(vehicle: Vehicle, thruster: Thruster) -> str:
    x, y, _ = thruster_place(vehicle, thruster)
    least = 0.2 * size_of(vehicle)
    words = [
        "left" if y < -least else "right" if y > least else "",
        "rear" if x < -least else "front" if x > least else "",
        "vertical" if abs(thruster.direction.value[2]) > _VERTICAL else "",
    ]
    return " ".join(word for word in words if word)


def _tests(vehicle: Vehicle) -> Iterator[dict[str, Any]]:
    """Yield, for each axis, steps of the commands that the page plots."""
    for n in range(len(vehicle.layout.axes)):
        for command in held_commands(vehicle):
            yield {"axis": n, "command": float(command) / 100.0}


def _loads(vehicle: Vehicle, start: Mapping[str, float]) -> Iterator[tuple[str, float, str]]:
    """Yield the sliders of the inputs that are not commands.

    Loads end at the strongest thrust, and others at 1, or at twice their start value if that is more.
    """
    most = {form.axis.external: _round(vehicle.strongest(form.axis)) for form in vehicle.layout.axes}
    along = [most[axis.external] for axis in vehicle.layout.bare_axes if not axis.is_rotation]
    most |= dict.fromkeys(vehicle.layout.forces_at_points, max(along, default=1.0))
    for name, declaration in vehicle.layout.inputs.items():
        if name not in vehicle.layout.commands:
            yield name, max(most.get(name, 1.0), 2.0 * abs(start[name])), pretty_unit(declaration.unit)


def _ballast(vehicle: Vehicle) -> Iterator[Slider]:
    """Yield the sliders of the mass, the weight, the buoyancy, their centres, and the scales of tables of thrust."""
    for name in vehicle.layout.ballast:
        declaration = vehicle.layout.coefficients[name]
        value, unit = vehicle[name], declaration.unit
        low, high = (0.8, 1.25) if unit == "N" else (0.5, 2.0)
        ends = (value - _FARTHEST, value + _FARTHEST) if unit == "m" else (low * value, high * value)
        yield name, name, *ends, value, "" if unit == "1" else pretty_unit(unit), declaration.description


def _health(vehicle: Vehicle) -> Iterator[Slider]:
    """Yield the sliders of the health of the thrusters, from dead to whole."""
    labels = _labels(vehicle)
    for thruster, name in vehicle.layout.health.items():
        description = vehicle.layout.coefficients[name].description
        yield name, labels[thruster] or thruster, 0.0, max(1.0, vehicle[name]), vehicle[name], "", description


def _tuning(vehicle: Vehicle) -> Iterator[Slider]:
    """Yield the sliders of the tuning factors."""
    for key, letter in (("alpha", "α"), ("beta", "β")):
        for axis in vehicle.layout.bare_axes:
            value = vehicle[name := axis.coefficient(key)]
            yield name, f"{letter} of {axis.name}", min(0.1, value), max(3.0, 2.0 * value), value, "", ""


def _round(x: float) -> float:
    """Round to one significant digit; 0 becomes 1."""
    return round(x, -floor(log10(x))) if x > 0.0 else 1.0
