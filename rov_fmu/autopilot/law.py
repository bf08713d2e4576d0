"""The law of the autopilot (fmu_src/autopilot/autopilot.c): its numbers as arrays, and its library.

For each axis, a place or an angle becomes a rate, and a rate a demand; the thrusters share the demands. ArduSub's loops
are one set of numbers (`rov_fmu.autopilot.ardusub`), and those in SI units another.
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rov_fmu.c.library import load_sources
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.equation.layout import Layout
from rov_fmu.io.paths import FMU_SRC
from rov_fmu.tank.arrays import Array

AXES = (SURGE, SWAY, HEAVE, ROLL, PITCH, YAW)
"""The axes in the order of the law."""
STICK, RATE, PLACE = 0.0, 1.0, 2.0
"""The modes of an axis: its aim is the share of the largest demand, a rate, or a place or an angle."""
GAINS: Mapping[str, str] = {
    "k_x": "from the error of the place or angle to the rate, 1/s",
    "v_max": "largest rate that an error asks for",
    "brake": "deceleration with which the aim is reached, also the largest acceleration of the feed-forward",
    "k_p": "from the error of the rate to the demand",
    "k_i": "from its integral to the demand",
    "k_d": "from its slope to the demand",
    "i_max": "largest demand of the integrator",
    "tracking": "time in which the integrator gives back what the thrusters cannot give",
    "d_1": "feed-forward: linear drag",
    "d_2": "feed-forward: quadratic drag",
    "inertia": "feed-forward: inertia with added mass",
    "bias": "demand at rest, against the weight",
    "most": "largest demand",
    "handover": "time in which the demand before a hold fades away",
    "k_a": "from the error of the rate to the acceleration, 1/s: the controller is then one of acceleration",
    "k_ff": "from the target to the demand",
    "k_aim": "from the rate of a moving aim to the rate",
    **dict.fromkeys(("f_a", "f_target", "f_error", "f_sensor", "f_demand"), "frequency of a filter, Hz"),
}
"""The numbers of an axis, `loop_gains` of the C, with their meaning. 0 is none."""
OWN_GAINS = tuple(GAINS)[: tuple(GAINS).index("k_a")]
"""The numbers of an autopilot in SI units, which its owner may change. The others are those of ArduSub's loops."""
LOOP = np.dtype([(name, np.float64) for name in GAINS])
THRUSTER = np.dtype([("of_axis", "f8", 6), ("to_axis", "f8", 6), ("row", "f8"), ("rows", "f8")])
_HEAD = ("thrusters", "rows", "commands", "scales", "steps", "attitude", "stick_time", "neutral", "ahead", "astern")
SHARING = np.dtype([*((name, "f8") for name in _HEAD), ("priority", "f8", 6)])
"""The struct `sharing` of the C, which thrusters, tables and the matrix of commands follow."""
STATE, SENSED = 14, 15
"""The numbers of doubles in `loop_state` and `sensor_values`."""
SENSORS: tuple[str, ...] = (*"xyz", "phi", "theta", "psi", *"uvwpqr", "vg_N", "vg_E", "vg_D")
"""The variables of a vehicle that are the sensors. One that neither rolls nor pitches has psi alone."""
LAW_FILE, FLIGHTS_FILE, STEP_FILE = "autopilot.c", "flights.c", "step.c"
FILES = (LAW_FILE, FLIGHTS_FILE)
_SOURCES = FMU_SRC / "autopilot"


@dataclass(frozen=True, eq=False)
class Sharing:
    """How thrusters make the demands along AXES."""

    of_axis: Array
    """The output of each thruster per demand (thrusters x AXES): forces (N), or fractions without tables."""
    to_axis: Array
    """What each thruster gives along the axes per output (thrusters x AXES)."""
    commands: Array
    """The fractions of the commands by those of the thrusters (commands x thrusters)."""
    priority: tuple[int, ...]
    """The group of each axis; those of group 0 come first."""
    tables: tuple[Array, ...] = ()
    """Rows of force (N) and fraction of the full command, both rising."""
    table_of: tuple[int, ...] = ()
    """The table of each thruster."""
    scales: bool = True
    """True if a group of axes is scaled as a whole; False if outputs are only clipped."""
    steps: float = 0.0
    """Outputs are rounded down to 1/steps; 0 for none."""
    attitude: bool = False
    """True if errors of the attitude are those of its quaternion, and demands turn with it."""
    stick_time: float = 0.0
    """The time constant with which a stick moves, s."""
    pulse: tuple[float, float, float] = (0.0, 1.0, 1.0)
    """The command without thrust, and what is added for the full command ahead and astern."""

    @property
    def numbers(self) -> Array:
        """The numbers as they lie in the memory of the C."""
        count, rows = len(self.of_axis), sum(map(len, self.tables))
        head, thrusters = np.zeros(1, SHARING), np.zeros(count, THRUSTER)
        flags = float(self.scales), self.steps, float(self.attitude), self.stick_time, *self.pulse
        head[0] = (count, rows, len(self.commands), *flags, self.priority)
        thrusters["of_axis"], thrusters["to_axis"] = self.of_axis, self.to_axis
        if self.tables:
            sizes = np.array([*map(len, self.tables)])
            thrusters["row"] = (np.cumsum(sizes) - sizes)[[*self.table_of]]
            thrusters["rows"] = sizes[[*self.table_of]]
        parts = head.view("f8"), thrusters.view("f8"), *map(np.ravel, self.tables), self.commands.ravel()
        return np.concatenate([np.asarray(part, np.float64).ravel() for part in parts])


def pulse_of(layout: Layout) -> tuple[float, float, float]:
    """Return the command without thrust, and what a full one ahead and astern adds: fractions or pulse widths."""
    neutral = layout.command_of(0.0)
    return neutral, layout.command_of(1.0) - neutral, neutral - layout.command_of(-1.0)


def law_sources(*files: str) -> dict[str, str]:
    """Return C files of the law by name, after the header with `loop_gains`, which GAINS declares."""
    header = f"/* The numbers of the loop of an axis. */\ntypedef struct {{ double {', '.join(GAINS)}; }} loop_gains;\n"
    return {"gains.h": header} | {name: (_SOURCES / name).read_text(encoding="utf-8") for name in files}


def load_law() -> ctypes.CDLL:
    """Return the library of the law, which is the same for all vehicles. Raises BuildError."""
    return load_sources("autopilot", lambda: law_sources(*FILES))
