"""How good a hold is: the figures of a step of its aim, and the flights by which an autopilot tells its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, pi, radians

import numpy as np

from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.gains import Autopilot
from rov_fmu.autopilot.law import AXES, PLACE, SENSORS, STICK
from rov_fmu.autopilot.pilot import PLACES, Pilot
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, YAW, Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

STEPS = {HEAVE: (1.0, 0.02), YAW: (0.5 * pi, radians(2.0))}
"""The first hold: its distance in depth (m) and heading (rad), and the error within which the vehicle is settled."""
_CURRENT = {"V_N": 0.2, "V_E": -0.1, "u": -0.2, "v": 0.1}
"""The current of one of the flights, m/s, and the velocities through the water of a vehicle at rest over ground."""
_SECONDS = 15.0
_REST = 2.0
"""The time at the end of a step in which the vehicle is at rest, s."""
_PART = 0.3
"""The part by which thrust and inertia of other vehicles differ."""


@dataclass(frozen=True, eq=False)
class StepFigures:
    """What a step of an aim shows: a number for each vehicle, in s, and in the unit of the errors."""

    rise: Array
    """The time to 90 % of the step; infinite if it is not reached."""
    overshoot: Array
    """The largest error beyond the aim."""
    settled: Array
    """The time from which the error stays within what is allowed; infinite if it does not."""
    rest: Array
    """The error at rest: that of the last 2 s, RMS."""


def step_figures(errors: Array, size: float, h: float, within: float = inf) -> StepFigures:
    """Return the figures of a step.

    - `errors`: what the vehicles are beyond their aim, every h seconds from the step on (times x vehicles).
    - `size`: the step, with its sign; with 0, every error is one beyond the aim.
    - `within`: the error within which a vehicle is settled.
    """
    beyond = errors * np.sign(size) if size else np.abs(errors)
    risen, off = beyond >= -0.1 * abs(size), ~(np.abs(errors) <= within)
    return StepFigures(
        rise=np.where(risen.any(axis=0), h * risen.argmax(axis=0), inf),
        overshoot=beyond.max(axis=0).clip(0.0),
        settled=np.where(off[-1], inf, h * (len(off) - off[::-1].argmax(axis=0)) * off.any(axis=0)),
        rest=np.sqrt((errors[-round(_REST / h) :] ** 2).mean(axis=0)),
    )


@dataclass(frozen=True)
class Aim:
    """What an autopilot held during a simulation, and how it was reached from what there was at the start."""

    variable: str
    """The variable that is held."""
    value: float
    """m, rad, m/s or rad/s."""
    rise: float
    """The time to 90 % of the way, s; infinite if it was not reached."""
    overshoot: float
    """The largest error beyond the aim; all errors count where the vehicle began there."""

    def told(self, factor: float, unit: str) -> str:
        """Return the aim in words, in a unit of so many per SI unit."""
        reached = f"90 % after {self.rise:.2g} s" if self.rise < inf else "not reached"
        return f"aim {factor * self.value:.4g} {unit}: {reached}, overshoot {factor * self.overshoot:.2g} {unit}"


def aims_of(pilot: Pilot, seen: Mapping[str, Array], h: float) -> dict[str, Aim]:
    """Return the aims of a pilot by name, from what there was every h seconds, by variable."""
    aims: dict[str, Aim] = {}
    for axis, name in pilot.held.items():
        n = AXES.index(axis)
        over_ground = axis is HEAVE and name not in PLACES
        variable = "vg_D" if over_ground else SENSORS[n + (0 if name in PLACES else len(AXES))]
        errors, turns = seen[variable] - pilot.aims[n], axis.is_rotation and name in PLACES
        errors = (errors + pi) % (2.0 * pi) - pi if turns else errors
        figures = step_figures(errors[:, np.newaxis], -errors[0], h)
        aims[name] = Aim(variable, float(pilot.aims[n]), float(figures.rise[0]), float(figures.overshoot[0]))
    return aims


def scaled_axis(vehicle: Vehicle, axis: Axis, thrust: float, inertia: float) -> dict[str, float]:
    """Return the coefficients of a vehicle whose thrust and inertia along an axis are multiplied by factors."""
    by = (("alpha", thrust), ("beta", 1.0 / inertia))
    return {name: factor * vehicle[name] for key, factor in by for name in [axis.coefficient(key)]}


def first_holds(autopilot: Autopilot) -> dict[Axis, tuple[StepFigures, float]]:
    """Return the figures of a first hold of depth and heading, and the largest overshoot of vehicles that differ.

    From rest, with no thrust, the autopilot is to hold a depth 1 m below and a heading 90 deg to starboard. The
    figures are those of the vehicle in still water, whose commands act at once, as `VehicleModel.hold` flies it. The
    others fly in a current, with commands that act a step later, or with 30 % more and less thrust and inertia as well.

        first_holds(autopilot_of(vehicle))[HEAVE][0].overshoot[0]  # m

    Raises BuildError without an engine.
    """
    vehicle, h = autopilot.vehicle, autopilot.step
    own = {*vehicle.layout.state, *vehicle.layout.inputs}
    start, current = ({k: x for k, x in some.items() if k in own} for some in ({"z": 10.0}, _CURRENT))
    parts = (1.0 + _PART, 1.0 - _PART)
    others = [start, start | current, start]
    for by in ((thrust, inertia) for thrust in parts for inertia in parts):
        others.append(
            start | {k: x for axis in vehicle.layout.bare_axes for k, x in scaled_axis(vehicle, axis, *by).items()}
        )
    held = [axis for axis in autopilot.axes if axis in (*STEPS, ROLL, PITCH)]
    aims = {axis: size for axis, (size, _) in STEPS.items() if axis in held}
    mode = [PLACE if axis in held else STICK for axis in AXES]
    aim = [aims.get(axis, 0.0) + start.get("z", 0.0) * (axis is HEAVE) for axis in AXES]
    flights = Flights(vehicle, autopilot.sharing, others, [0, 0, *[1] * (len(others) - 2)])
    steps = round(_SECONDS / h)
    seen = flights.fly(autopilot.loops, np.tile(mode, (steps, 1)), np.tile(aim, (steps, 1)), h).sensors
    found: dict[Axis, tuple[StepFigures, float]] = {}
    for axis, size in aims.items():
        a = AXES.index(axis)
        errors = seen[..., SENSORS.index("z" if axis is HEAVE else "psi")].T - aim[a]
        figures = step_figures(errors, size, h, STEPS[axis][1])
        found[axis] = figures, float(figures.overshoot.max())
    return found
