"""Tank tests with disturbances, simulated by the integrator in verification/references/pool.py."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

import numpy as np
from scipy.signal import lfilter

from rov_fmu.equation.catalogue import AXIS, CURVE, Axis, coefficient_name
from rov_fmu.vehicle.vehicle import Vehicle
from tests.recordings import Measured
from verification.references.pool import Array, swim

Plan = Sequence[tuple[float, float]]
"""Commands with their durations, s."""

PATTERNS: dict[str, dict[str, float]] = {
    "surge": {"l": 1.0, "r": 1.0},
    "heave": {"t": 1.0},
    "yaw": {"l": 1.0, "r": -1.0},
}
"""The thrusters of the VideoRay that drive each axis, with their signs."""
NOISE = {"depth": 0.005, "heading": radians(0.5), "distance": 0.02, "velocity": 0.02}
"""The standard deviations of the sensors: m, rad, m, m/s."""


def with_more(k: Vehicle, **values: float) -> Vehicle:
    """Return the vehicle with other coefficients, including new ones such as F_0_w, T_top or a_t_rear_reverse."""
    axes, curves = [], []
    for form in k.layout.axes:
        more = [key for key in AXIS if coefficient_name(key, form.axis.velocity) in values and key not in form.keys]
        axes.append(replace(form, keys=(*form.keys, *more)))
    for curve in k.layout.curves:
        more = [key for key in CURVE if coefficient_name(key, curve.name) in values and key not in curve.keys]
        curves.append(replace(curve, keys=(*curve.keys, *more)))
    layout = replace(k.layout, axes=tuple(axes), curves=tuple(curves))
    assert values.keys() <= layout.coefficients.keys()
    return Vehicle(layout, {**k.coefficients, **values})


@dataclass(frozen=True, eq=False)
class Run:
    """n samples of the motion along one axis without noise, in SI units."""

    axis: Axis
    time: Array
    command: Array
    velocity: Array
    position: Array

    def recorded(
        self,
        random: np.random.Generator,
        quantity: str,
        file: str = "log.csv",
        *,
        colour: float = 0.0,
        jitter: float = 0.0,
    ) -> Measured:
        """Return the recording of a sensor.

        `colour` is the correlation of the noise of successive samples, `jitter` the error of time stamps (s).
        """
        values = self.velocity if quantity == "velocity" else self.position
        taken = self.time + jitter * random.standard_normal(len(self.time))
        white = random.standard_normal(len(self.time))
        errors = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white) if colour else white
        values = np.interp(taken, self.time, values) + NOISE[quantity] * errors
        return Measured(file, self.axis, quantity, self.time, self.command, values)


def run(
    k: Vehicle,
    axis: Axis,
    plan: Plan,
    rate: float,
    *,
    delay: float = 0.0,
) -> Run:
    """Run a plan from rest along one axis, with a delay of the commands (s)."""
    command = np.concatenate([np.full(round(hold * rate), c) for c, hold in plan])
    time = np.arange(len(command)) / rate
    thrusters = {name: sign * command for name, sign in PATTERNS[axis.name].items()}
    motion = swim(k, time, thrusters, delay)
    place = {"surge": "x", "sway": "y", "heave": "z", "yaw": "psi"}[axis.name]
    return Run(axis, time, command, motion[axis.velocity], motion[place])
