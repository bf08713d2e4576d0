"""The files of `export --to autopilot` and `--to gains`: the FMUs of the autopilot, and its gains as YAML."""

from collections.abc import Iterator, Mapping
from dataclasses import astuple
from math import inf

from rov_fmu.autopilot.figures import STEPS, first_holds
from rov_fmu.autopilot.gains import Autopilot, autopilot_of
from rov_fmu.autopilot.law import AXES
from rov_fmu.bridges.autopilot.fmu import autopilot_fmu
from rov_fmu.equation.catalogue import UPWARD, Axis
from rov_fmu.io.messages import one_line
from rov_fmu.vehicle.vehicle import Vehicle

_UP = {axis for axis, sign in zip(AXES, UPWARD, strict=True) if sign > 0.0}
"""The axes whose sign is the same with y to port and z up."""
_NONE = 1e-9
"""What rounding errors leave where a thruster has no part."""


def autopilot_files(vehicle: Vehicle) -> dict[str, bytes]:
    """Return the FMUs of the autopilot of a vehicle by name. Raises InputError about its thrusters, and BuildError."""
    made = autopilot_of(vehicle)
    name = f"{vehicle.identifier}_autopilot"
    return {f"{name}{suffix}": autopilot_fmu(made, fmi=fmi) for fmi, suffix in ((2, ".fmu"), (3, ".fmi3.fmu"))}


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
    lines.append(
        "first_hold:  # of the whole vehicle from rest; others: 30 % more and less thrust and inertia, in a current"
    )
    for axis, (figures, worst) in first_holds(made).items():
        size, within = STEPS[axis]
        rise, over, settled, rest = ((f"{x[0]:.3g}" if x[0] < inf else ".inf") for x in astuple(figures))
        lines += [
            f"  {axis.name}: {{step: {size:.4g}, rise: {rise}, overshoot: {over}, overshoot_of_others: {worst:.3g},",
            f"    within: {within:.3g}, settled: {settled}, error_at_rest: {rest}}}",
        ]
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
