"""A folder of tank tests to try `rov-fmu identify` on, made by a simulated pool: no such vehicle was ever in the water.

The vehicle, "Otter", is shaped like the paper's: two rear thrusters and one on top. Its thrusters push less in reverse
and not at all at small commands; it is a little heavy; and its commands arrive late. The pool has an integrator of its
own, SciPy's DOP853, and none of the mathematics that identifies the vehicle from the files.
"""

from collections.abc import Mapping, Sequence
from io import StringIO
from math import radians
from pathlib import Path

import click
import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, SourcedVector, Thruster, VehicleAxis
from rov_fmu.io.output import Output, write_whole
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.pool import Array, swim

_CURVE = ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0")
_AHEAD, _DOWN = (SourcedVector(along, "drawing") for along in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
_LAYOUT = Layout(
    (VehicleAxis(SURGE), VehicleAxis(HEAVE, ("a_d", "b_d", "F_0")), VehicleAxis(YAW)),
    (Curve("rear", _CURVE, n_thrusters=2), Curve("top", _CURVE)),
    (
        Thruster(name="l", curve="rear", direction=_AHEAD, arm="port"),
        Thruster(name="r", curve="rear", direction=_AHEAD, arm="starboard"),
        Thruster(name="t", curve="top", direction=_DOWN),
    ),
)
OTTER = Vehicle(
    _LAYOUT,
    {
        "m_rov": 8.2,
        "I_r": 0.16,
        "R": 0.24,
        "gamma": 0.45,
        "a_t_rear": 38.0,
        "b_t_rear": 4.5,
        "a_t_rear_reverse": 24.0,
        "b_t_rear_reverse": 3.0,
        "c_0_rear": 0.05,
        "a_t_top": 9.5,
        "b_t_top": 0.6,
        "a_t_top_reverse": 7.0,
        "b_t_top_reverse": 0.5,
        "c_0_top": 0.06,
        "a_d_u": 6.5,
        "b_d_u": 6.0,
        "a_d_w": 24.0,
        "b_d_w": 2.2,
        "a_d_r": 0.21,
        "b_d_r": 0.09,
        "F_0_w": 0.15,
        "alpha_u": 1.0,
        "alpha_w": 1.0,
        "alpha_r": 1.0,
        "beta_u": 0.72,
        "beta_w": 0.55,
        "beta_r": 0.45,
        **dict.fromkeys(_LAYOUT.health.values(), 1.0),
    },
)
"""The true coefficients, which an identification should find."""
DELAY = 0.12
"""The delay from a command to the thrust (s)."""

# Of each axis: the thrusters that drive it, what is measured, its header, its noise, and from SI units to the header's.
_SENSORS: Mapping[str, tuple[Axis, Mapping[str, float], str, str, float, float]] = {
    "surge": (SURGE, {"l": 1.0, "r": 1.0}, "x", "distance [m]", 0.01, 1.0),
    "heave": (HEAVE, {"t": 1.0}, "z", "depth [m]", 0.005, 1.0),
    "yaw": (YAW, {"l": 1.0, "r": -1.0}, "psi", "heading [deg]", radians(0.4), np.degrees(1.0)),
}
_PLANS: Mapping[str, Sequence[Sequence[tuple[int, float]]]] = {  # %, s
    "surge": (
        ((0, 4), (30, 12), (-30, 12), (0, 8), (60, 8), (0, 10)),
        ((0, 4), (45, 10), (-45, 10), (20, 12), (0, 10), (-60, 8)),
        ((0, 4), (70, 6), (0, 8), (-70, 6), (35, 8), (0, 4), (-20, 14)),
    ),
    "heave": (
        ((0, 4), (35, 14), (-35, 14), (50, 10), (-50, 10)),
        ((0, 4), (25, 16), (-45, 12), (60, 8), (-60, 10)),
        ((0, 4), (70, 8), (-70, 8), (40, 10), (-55, 10), (0, 12)),
    ),
    "yaw": (
        ((0, 4), (30, 10), (-30, 10), (50, 10), (-50, 10), (0, 8)),
        ((0, 4), (20, 12), (-40, 10), (60, 8), (-20, 12), (0, 8)),
        ((0, 4), (70, 8), (0, 8), (-60, 8), (35, 8), (-70, 8)),
    ),
}
_PULLS = (-100, -80, -60, -50, -40, -30, -20, -10, -5, 5, 10, 20, 30, 40, 50, 60, 80, 100)
_RATE = 20.0
_ROV = """# What no test in this folder tells of the vehicle.

[vehicle]
name = "Otter"
identifier = "otter"
version = "1.0"
description = "A small ROV with two rear thrusters and one on top"
source = "Tank tests in a simulated pool"

[known]
m_rov = { value = 8.2, unit = "kg", source = "Weighed" }
I_r = { value = 0.16, unit = "kg.m2", source = "From the drawing" }
R = { value = 0.24, unit = "m", source = "From the drawing" }
gamma = { value = 0.45, unit = "rad", source = "From the drawing" }
"""


def write_tests(folder: Path, seed: int = 0, *, force: bool = False) -> None:
    """Write rov.toml, force tests of both curves and three logs of each axis."""
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    outputs = [Output(folder / "rov.toml", _ROV.encode())]
    for curve, spread in (("rear", 0.25), ("top", 0.08)):
        pulls = [(c, bollard_pull(curve, c / 100.0) + spread * random.standard_normal()) for c in _PULLS * 2]
        header = "command [%],force [N]"
        outputs.append(_table(folder / f"thrust_{curve}.csv", header, np.array(sorted(pulls)), "%d,%.2f"))
    for name, plans in _PLANS.items():
        for number, plan in enumerate(plans, 1):
            header = f"time [s],command [%],{_SENSORS[name][3]}"
            log = _log(name, plan, random)
            outputs.append(_table(folder / f"log_{name}_{number}.csv", header, log, "%.2f,%d,%.4f"))
    write_whole(*outputs, force=force)


def bollard_pull(curve: str, command: float) -> float:
    """Return the force (N) of all thrusters of a curve at a command, while the vehicle is held."""
    end = "_reverse" if command < 0.0 else ""
    beyond = max(abs(command) - OTTER[f"c_0_{curve}"], 0.0)
    return float(np.sign(command) * (OTTER[f"a_t_{curve}{end}"] * beyond**2 + OTTER[f"b_t_{curve}{end}"] * beyond))


def _log(name: str, plan: Sequence[tuple[int, float]], random: np.random.Generator) -> Array:
    """Return the time (s), the command (%) and the sensor's value of an axis, n x 3."""
    axis, pattern, symbol, _, noise, unit = _SENSORS[name]
    percent = np.concatenate([np.full(round(_RATE * hold), command) for command, hold in plan])
    time = np.arange(len(percent)) / _RATE
    motion = swim(OTTER, time, {thruster: sign * percent / 100.0 for thruster, sign in pattern.items()}, DELAY)
    measured = unit * (motion[symbol] + noise * random.standard_normal(len(time)))
    return np.column_stack([time, percent, measured % 360.0 if axis is YAW else measured])


def _table(path: Path, header: str, rows: Array, digits: str) -> Output:
    text = StringIO()
    np.savetxt(text, rows, digits, header=header, comments="")
    return Output(path, text.getvalue().encode())


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--force", is_flag=True, help="Replace files that this example did not write, or that have changed since."
)
def main(folder: Path, *, force: bool) -> None:
    """Write the folder."""
    write_tests(folder, force=force)


if __name__ == "__main__":
    main()
