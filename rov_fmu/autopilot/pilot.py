"""The autopilot in the loop of a program: it takes what is measured, and returns the commands."""

import ctypes
from collections.abc import Mapping
from math import isfinite

import numpy as np

from rov_fmu.autopilot.gains import Autopilot
from rov_fmu.autopilot.law import AXES, PLACE, RATE, SENSORS, STATE, STICK, load_law
from rov_fmu.c.simulation import pointer
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.io.messages import InputError, listed, only, shown

PLACES: Mapping[str, Axis] = {
    **{"north": SURGE, "east": SWAY, "depth": HEAVE},
    **{"roll": ROLL, "pitch": PITCH, "heading": YAW},
}
"""The axes by the places and angles that they hold, m and rad."""
RATES: Mapping[str, Axis] = {f"{axis.name}_rate" if axis in (ROLL, PITCH) else axis.name: axis for axis in AXES}
"""The axes by the velocities that they hold, m/s and rad/s."""


class Pilot:
    """An autopilot of a vehicle, with what its loops contain. It begins level, with no thrust along other axes."""

    def __init__(self, autopilot: Autopilot) -> None:
        """Raises BuildError when the law cannot be compiled."""
        self.autopilot = autopilot
        self.modes = np.array([PLACE if a in (ROLL, PITCH) and a in autopilot.axes else STICK for a in AXES])
        """The mode of each of AXES."""
        self.aims = np.zeros(len(AXES))
        """What each of AXES aims at."""
        self.held: dict[Axis, str] = {}
        """The axes that `hold` was asked to hold, by the names of their aims."""
        self._states, self._numbers = np.zeros((len(AXES), STATE)), autopilot.sharing.numbers
        self._law = load_law()

    def hold(self, **aims: float) -> "Pilot":
        """Hold places and angles (PLACES, m and rad) or velocities (RATES, m/s and rad/s). The other axes go on.

            pilot.hold(depth=2.0, heading=0.5, surge=0.3)

        Raises InputError about a name, a number, or an axis that the thrusters cannot push.
        """
        if len({"north", "east"} & aims.keys()) == 1:
            raise InputError("north and east are held together")
        held: dict[Axis, str] = {}
        for name, value in aims.items():
            axis = PLACES.get(name) or RATES.get(name)
            if axis is None:
                raise InputError(f"hold: there is no {name}{only(name, [*PLACES, *RATES])}")
            if (other := held.setdefault(axis, name)) != name:
                raise InputError(f"hold: {other} and {name} are aims of one axis, {axis.name}: leave one out")
            if axis not in self.autopilot.axes:
                own = listed(one.name for one in self.autopilot.axes)
                vehicle = self.autopilot.vehicle.identifier
                raise InputError(f"{name}: the thrusters of {vehicle} cannot hold {axis.name}, only {own}")
            if not (isinstance(value, (int, float, np.number)) and isfinite(value)):
                raise InputError(f"{name} = {shown(value)}: must be a finite number")
            n, self.held[axis] = AXES.index(axis), name
            self.modes[n], self.aims[n] = PLACE if name in PLACES else RATE, value
        return self

    def step(self, now: Mapping[str, float], h: float, most: float = 1.0) -> dict[str, float]:
        """Return the commands for the next h seconds.

        - `now`: the variables of the vehicle by name, such as `stepper.now`: position, Euler angles, velocities,
          turn rates, and the velocity over ground (SENSORS). Those that it does not have are 0.
        - `most`: the largest command, as a fraction of the full one.

            commands = pilot.step(stepper.now, 0.02)
        """
        sensors = np.array([now.get(name, 0.0) for name in SENSORS])
        commands = np.empty(len(self.autopilot.vehicle.layout.commands))
        given = (self.autopilot.loops, self._numbers, self._states, sensors, self.modes, self.aims)
        times = ctypes.c_double(most), ctypes.c_double(h)
        self._law.autopilot_command(*map(pointer, given), *times, pointer(commands))
        return dict(zip(self.autopilot.vehicle.layout.commands, commands.tolist(), strict=True))
