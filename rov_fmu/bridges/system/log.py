"""The log of a dive as sensors in a system tell it: a table that `identify` reads."""

from collections.abc import Iterator
from math import isnan

import numpy as np
from scipy.spatial.transform import Rotation

from rov_fmu.bridges.system.connections import SystemStructure
from rov_fmu.bridges.system.master import Name
from rov_fmu.bridges.system.sensors import TRUE
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmus.instance import Array
from rov_fmu.io.numbers import csv_of

_HEADERS = {
    "depth": {"z": "depth [m]"},
    "velocity": {"vg_N": "north velocity [m/s]", "vg_E": "east velocity [m/s]"},
    "attitude": {
        **{"phi": "roll angle [rad]", "theta": "pitch angle [rad]", "psi": "heading [rad]"},
        **{"p": "roll velocity [rad/s]", "q": "pitch velocity [rad/s]", "r": "yaw velocity [rad/s]"},
    },
}
"""The headers of `identify` by the variables of each instrument. The velocity is over ground."""


def sensor_log(structure: SystemStructure, component: str, values: dict[Name, Array], step: float) -> bytes:
    """Return the log of the sensors of a component as CSV: the commands at each step, and samples when they were taken.

    - `values`: the outputs of the system by name, at the start and after each step.

    What is not valid, and what is between two samples, is empty.
    """
    count = len(next(iter(values.values())))
    columns = {"time [s]": step * np.arange(count), **dict(_commands(structure, component, values, count))}
    told = {name: series for (of, name), series in values.items() if of == component}
    if QUATERNION[0] in told:
        turns = Rotation.from_quat(np.array([told[name] for name in (*QUATERNION[1:], QUATERNION[0])]).T)
        told |= dict(zip(("psi", "theta", "phi"), turns.as_euler("ZYX").T, strict=True))
    for instrument, headers in _HEADERS.items():
        taken = told[f"time_of_{instrument}"]
        is_new = np.diff(taken, prepend=-1.0) > 0.0
        some = np.flatnonzero(is_new & (told[f"valid_{instrument}"] > 0.0))
        rows = np.rint(taken[some] / step).astype(int)
        for name, header in headers.items():
            if name in told:
                columns[header] = np.full(count, np.nan)
                columns[header][rows] = told[name][some]
    return csv_of(columns, zip(*columns.values(), strict=True), lambda x: "" if isnan(x) else repr(float(x))).encode()


def _commands(
    structure: SystemStructure, component: str, values: dict[Name, Array], count: int
) -> Iterator[tuple[str, Array]]:
    """Yield the commands of the vehicle that a component measures, by their headers."""
    ends = {one.end: one for one in structure.connections}
    measured = {ends[end].start[0] for end in ends if end[0] == component and end[1].startswith(TRUE)}
    for rov in sorted(measured):
        part = structure.parts[rov]
        for name in part.terminals.get("thrusters", {}).values():
            start = float(structure.values[rov].get(name, part.variables[name].start))
            one = ends.get((rov, name))
            series = one.factor * values[one.start] + one.offset if one else np.full(count, start)
            yield f"{name} [{part.variables[name].unit}]", series
