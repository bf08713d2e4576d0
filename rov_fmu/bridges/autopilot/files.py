"""The files of `export --to autopilot` and `--to gains`: the FMUs of the autopilot, and its gains as YAML."""

from collections.abc import Iterator, Mapping
from math import inf, pi, radians

import numpy as np

from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.gains import Autopilot, autopilot_of
from rov_fmu.autopilot.law import AXES, PLACE, SENSORS, STICK
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.bridges.sdf import Array
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, UPWARD, YAW, Axis
from rov_fmu.io.messages import one_line
from rov_fmu.vehicle.vehicle import Vehicle

_UP = {axis for axis, sign in zip(AXES, UPWARD, strict=True) if sign > 0.0}
"""The axes whose sign is the same with y to port and z up."""
_SECONDS = 15.0
_STEPS = {HEAVE: (1.0, 0.02), YAW: (0.5 * pi, radians(2.0))}
"""A step of the depth (m) and of the heading (rad), and the error within which the vehicle is settled."""
_START = {"z": 10.0}
_NONE = 1e-9
"""What rounding errors leave where a thruster has no part."""


def autopilot_files(vehicle: Vehicle) -> dict[str, bytes]:
    """Return the FMUs of the autopilot of a vehicle by name. Raises InputError about its thrusters, and BuildError."""
    made = autopilot_of(vehicle)
    name = f"{vehicle.identifier}_autopilot"
    return {f"{name}{suffix}": autopilot_fmu(made, fmi=fmi) for fmi, suffix in ((2, ".fmu"), (3, ".fmi3.fmu"))}


def flown(autopilot: Autopilot) -> Iterator[tuple[Axis, Array]]:
    """Yield the axes of _STEPS that are held, with depths (m) or headings (rad) less the target after its step."""
    vehicle, steps = autopilot.vehicle, round(_SECONDS / autopilot.step)
    held = [axis for axis in autopilot.axes if axis in (*_STEPS, ROLL, PITCH)]
    modes = np.tile([PLACE if axis in held else STICK for axis in AXES], (steps, 1))
    for axis in (axis for axis in _STEPS if axis in held):
        start = {name: value for name, value in _START.items() if name in vehicle.layout.state}
        flights, aim = Flights(vehicle, autopilot.sharing, [start]), np.zeros(len(AXES))
        aim[AXES.index(HEAVE)] = start.get("z", 0.0)
        flights.fly(autopilot.loops, modes, np.tile(aim, (steps, 1)), autopilot.step)
        aim[AXES.index(axis)] += _STEPS[axis][0]
        seen = flights.fly(autopilot.loops, modes, np.tile(aim, (steps, 1)), autopilot.step).sensors[0]
        yield axis, seen[:, SENSORS.index("z" if axis is HEAVE else "psi")] - aim[AXES.index(axis)]


def gains_yaml(vehicle: Vehicle) -> Mapping[str, str]:
    """Return the gains of a cascade in SI units as a YAML file. Raises InputError and BuildError."""
    made = autopilot_of(vehicle)
    share = made.sharing
    lines = [
        f"# The gains of a cascade for {vehicle.identifier}: {one_line(vehicle.name)}. SI units.",
        "# v* = sat(k_x (x* - x), v_max), braked so that the aim is reached with the deceleration brake;",
        "# tau = k_p (v* - v) + k_i int(v* - v) dt + linear v* + quadratic |v*| v* + inertia dv*/dt + bias.",
        *([f"# Caution: {one_line(vehicle.caution)}."] if vehicle.caution else []),
        f"step: {made.step:g}  # s, of the controller",
        f"delay: {made.delay:g}  # s, from the sensors to the thrust",
        "axes:",
    ]
    for axis in made.axes:
        gain = {name: f"{made.gain(axis, name):.6g}" for name in made.loops.dtype.names or ()}
        lines += [
            f"  {axis.name}:",
            f"    {{k_x: {gain['k_x']}, k_p: {gain['k_p']}, k_i: {gain['k_i']}, lag: {made.lags[axis.name]:g},",
            f"     v_max: {gain['v_max']}, brake: {gain['brake']}, tau_max: {gain['most']},",
            f"     linear: {gain['d_1']}, quadratic: {gain['d_2']}, inertia: {gain['inertia']}}}",
        ]
    lines.append("in_closed_loop:  # flown with the whole vehicle, from rest")
    for axis, errors in flown(made):
        size, within = _STEPS[axis]
        late = np.flatnonzero(np.abs(errors) > within)
        settled = (late[-1] + 1) * made.step if len(late) and late[-1] + 1 < len(errors) else inf if len(late) else 0.0
        over, rest = max(0.0, float(errors.max())), abs(float(errors[-1]))
        lines.append(
            f"  {axis.name}: {{step: {size:.4g}, overshoot: {over:.3g}, within: {within:.3g}, settled: "
            f"{settled if settled < inf else '.inf'}, error_at_the_end: {rest:.3g}}}"
        )
    for frame, flipped in (("forward_starboard_down", set[Axis]()), ("forward_port_up", {*AXES} - _UP)):
        lines += [f"{frame}:", "  bias: {" + ", ".join(_signed(made, flipped)) + "}"]
        lines.append("  allocation:  # force of each thruster (N) per force or moment along the axes")
        for thruster, row in zip(vehicle.layout.thrusters, share.of_axis, strict=True):
            signed = ((-1.0 if axis in flipped else 1.0) * row[AXES.index(axis)] for axis in made.axes)
            numbers = ", ".join(f"{x if abs(x) > _NONE else 0.0:.6g}" for x in signed)
            lines.append(f'    "{thruster.name}": [{numbers}]')
    lines.append("force_to_command:  # N, and the fraction of the full command; linear in between")
    for curve, rows in zip(vehicle.layout.curves, share.tables, strict=True):
        lines.append(f"  {curve.name}: [{', '.join(f'[{force:.6g}, {command:.6g}]' for force, command in rows)}]")
    used = (f'"{one.name}": {vehicle.layout.curve_of[one.name].name}' for one in vehicle.layout.thrusters)
    lines.append("curves: {" + ", ".join(used) + "}")
    return {"gains.yaml": "\n".join([*lines, ""])}


def _signed(made: Autopilot, flipped: set[Axis]) -> Iterator[str]:
    """Yield the demands at rest, with the signs of a frame."""
    for axis in made.axes:
        yield f"{axis.name}: {(-1.0 if axis in flipped else 1.0) * made.gain(axis, 'bias') + 0.0:.6g}"
