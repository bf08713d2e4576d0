"""ArduSub in ALT_HOLD as numbers of the autopilot's law, 400 times a second.

A depth error becomes a speed (PSC_POSZ), a speed error an acceleration (PSC_VELZ), and its error the throttle
(PSC_ACCZ). An angle error becomes a rate (ATC_ANG), and its error a turn (ATC_RAT). The factors of the frame make the
outputs of the motors from them.

The numbers are from ArduPilot's documentation and from what its sources do: `AC_PosControl`, `AC_AttitudeControl_Sub`,
`AC_PID`, `AP_Motors6DOF`. The filters of the sensors are among them because loops that are too fast chatter by their
delay. A new heading is a target that moves to it, as the real one's does. Left out are the estimator, sensor noise,
the shaping of other targets, and what stops an integrator at full thrust.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan, pi, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.autopilot.flights import Flights
from rov_fmu.autopilot.law import AXES, LOOP, PLACE, SENSORS, STICK, Sharing, pulse_of
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, YAW, Axis
from rov_fmu.io.messages import InputError, listed
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.readers.ardusub_frames import DEMANDS, FRAMES, fitting_frames, servos_of
from rov_fmu.vehicle.vehicle import Vehicle

RATE = 400
"""The steps of ArduSub in a second."""
ROWS = {ROLL: "RLL", PITCH: "PIT", YAW: "YAW", HEAVE: "PSC"}
"""The axes that ArduSub holds, the first of DEMANDS, with what the names of their gains contain."""
FIRMWARE = {
    **dict.fromkeys(("ATC_RAT_RLL_P", "ATC_RAT_PIT_P"), 0.135),
    **dict.fromkeys(("ATC_RAT_RLL_I", "ATC_RAT_PIT_I"), 0.09),
    **dict.fromkeys(("ATC_RAT_RLL_D", "ATC_RAT_PIT_D"), 0.0036),
    **{"ATC_RAT_YAW_P": 0.18, "ATC_RAT_YAW_I": 0.018, "ATC_RAT_YAW_D": 0.0},
    **dict.fromkeys(("ATC_ANG_RLL_P", "ATC_ANG_PIT_P", "ATC_ANG_YAW_P"), 6.0),
    **{"PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 0.1, "PSC_ACCZ_D": 0.0, "PSC_ACCZ_FF": 0.0},
    **{"PSC_POSZ_P": 3.0, "PSC_VELZ_P": 8.0},
}
"""ArduSub's default gains, by the names before 4.7."""
_TURN = {
    ROLL: {"brake": radians(550.0), "i_max": 0.444, "f_target": 30.0},
    PITCH: {"brake": radians(550.0), "i_max": 0.444, "f_target": 30.0},
    YAW: {"brake": radians(120.0), "i_max": 0.222, "f_target": 5.0},
}
"""The acceleration that the first controller respects, rad/s2: half of ATC_ACCEL_R_MAX and ATC_ACCEL_P_MAX, and the
most that AC_AttitudeControl allows in yaw; the limit of the integrator (IMAX), a demand; the filter of the targets."""
_DIVE = {"brake": 1.0, "f_a": 5.0, "f_error": 20.0, "f_demand": 2.0, "most": 1.0, "i_max": 1.0}
"""The same of the depth: PILOT_ACCEL_Z, and the filters of the speed's error (PSC_VELZ_FLTE), of the last error, and
of the throttle. `AC_PosControl` lets the integrator reach the hover throttle, which is half of the throttle and so a
full demand, whatever PSC_ACCZ_IMAX is."""
_SENSORS = 20.0
"""The filters of gyroscope and accelerometer (INS_GYRO_FILTER, INS_ACCEL_FILTER), Hz."""
_SLEW, _INPUT_TIME, _TURN_UP = radians(60.0), 0.15, radians(1100.0)
"""How a target of the heading moves: its largest rate (ATC_SLEW_YAW), the time constant with which it arrives
(ATC_INPUT_TC), and its largest acceleration (ATC_ACCEL_Y_MAX)."""
STICK_TIME = 0.8
"""The time constant with which a stick moves, s."""
TURNING = 3.375 * pi / 4.0
"""The rate of yaw by a full stick, rad/s."""
_PRIORITY = (1, 1, 0, 0, 0, 1)
"""The groups of motors, by AXES: those that lift, roll and pitch come before the others."""


@dataclass(frozen=True)
class Leg:
    """A part of a flight: a step of the target, or the forward stick, which is held as long as the leg."""

    axis: Axis
    size: float
    """The change of the depth (m) or of the heading (rad), or the stick, from -1 to 1."""
    seconds: float = 7.0


@dataclass(frozen=True, eq=False)
class FlownLeg:
    """A leg as the vehicles flew it. Where the motion of a vehicle cannot be computed, its errors are NaN."""

    leg: Leg
    errors: Array
    """What roll, pitch, heading (rad) and depth (m) are beyond their targets (times x 4 x vehicles)."""
    demands: Array
    """The demands along DEMANDS from -1 to 1, up for the throttle (times x 6 x vehicles)."""
    fractions: Array
    """The commands from -1 to 1 (times x commands x vehicles)."""

    def of(self, *vehicles: int) -> "FlownLeg":
        """Return the leg of some vehicles by their numbers."""
        return FlownLeg(self.leg, *(part[..., [*vehicles]] for part in (self.errors, self.demands, self.fractions)))


class Mixer:
    """How the demands of ArduSub along its axes become the commands of a vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Find the frame. Raises InputError if no frame has these thrusters, or leaves open where a motor is."""
        layout = vehicle.layout
        self.frame = next(iter(fitting_frames(layout)), "")
        if not self.frame:
            inputs = listed(layout.commands)
            raise InputError(
                f"{vehicle.identifier}: no frame of ArduSub has a motor for each of {inputs}, and no other"
            )
        try:
            servos = servos_of(layout, self.frame, {})
        except InputError as error:
            reason = f"which motors of {self.frame} drive which thrusters is open: write the positions of the thrusters"
            raise InputError(f"{vehicle.identifier}: {reason}") from error
        motors = [(FRAMES[self.frame][number - 1], sign) for number, sign in map(servos.__getitem__, layout.commands)]
        self._matrix = np.array([[sign * ("-.+".index(factor) - 1.0) for factor in motor] for motor, sign in motors])
        neutral, *_ = pulse_of(layout)
        self._pulse = (neutral, 400.0, 400.0) if layout.pulse else (neutral, 1.0, 1.0)

    @property
    def sharing(self) -> Sharing:
        """The motors for the law, whose heave is down. Pulse widths make the outputs steps of 1/400."""
        of_axis = self._matrix[:, [DEMANDS.index(axis) for axis in AXES]] * [-1.0 if a is HEAVE else 1.0 for a in AXES]
        count, scales = len(of_axis), self.frame == "vectored_6dof"
        return Sharing(
            *(of_axis, np.zeros((count, len(AXES))), np.eye(count), _PRIORITY),
            scales=scales,
            steps=400.0,
            stick_time=STICK_TIME,
            pulse=self._pulse,
        )

    def push(self, vehicle: Vehicle, axis: Axis, demand: float) -> float:
        """Return the force (N) or moment (N.m) along an axis that a demand gives there, with the tuning α."""
        neutral, scale, _ = self._pulse
        commands = (neutral + scale * demand * self._matrix[:, DEMANDS.index(axis)]).tolist()
        inputs = vehicle.layout.usual_inputs | dict(zip(vehicle.layout.commands, commands, strict=True))
        return vehicle[axis.coefficient("alpha")] * vehicle.along(axis, vehicle.commanded(inputs))


def loops_of(gains: Mapping[str, Any], count: int) -> NDArray[np.void]:
    """Return the numbers of the law (vehicles x AXES, of the type LOOP) for gains by ArduSub's names before 4.7.

    A gain is a number, or an array for the vehicles; others are the firmware's. A throttle of 1 is 1000 in ArduSub, and
    an acceleration is in cm/s2, hence the factor 0.2.
    """
    loops = np.zeros((count, len(AXES)), LOOP)

    def put(axis: Axis, key: str, name: str, scale: float = 1.0) -> None:
        loops[key][:, AXES.index(axis)] = scale * np.asarray(gains.get(name, FIRMWARE.get(name, 0.0)))

    for axis, numbers in {**_TURN, HEAVE: _DIVE}.items():
        for key, value in {"f_sensor": _SENSORS, **numbers}.items():
            loops[key][:, AXES.index(axis)] = value
        put(axis, "k_x", "PSC_POSZ_P" if axis is HEAVE else f"ATC_ANG_{ROWS[axis]}_P")
        for key in ("P", "I", "D"):
            name = f"PSC_ACCZ_{key}" if axis is HEAVE else f"ATC_RAT_{ROWS[axis]}_{key}"
            put(axis, f"k_{key.lower()}", name, 0.2 if axis is HEAVE else 1.0)
    put(HEAVE, "k_a", "PSC_VELZ_P")
    put(HEAVE, "k_ff", "PSC_ACCZ_FF", 0.2)
    return loops


def _moving(begin: float, end: float, steps: int) -> Array:
    """Return the target of the heading in each step on its way to a new one."""
    targets, at, rate = np.empty(steps), begin, 0.0
    for n in range(steps):
        wanted = min(max((end - at) / _INPUT_TIME, -_SLEW), _SLEW)
        rate += min(max(wanted - rate, -_TURN_UP / RATE), _TURN_UP / RATE)
        at += rate / RATE
        targets[n] = at
    return targets


def fly(
    vehicle: Vehicle,
    gains: Mapping[str, Any],
    legs: Sequence[Leg],
    others: Sequence[Mapping[str, float]] = ({},),
    loads: Any = 0.0,
    delays: Sequence[float] | None = None,
) -> Iterator[FlownLeg]:
    """Yield the legs of a flight of vehicles that differ in some numbers only, one leg after the other.

    - `gains`: a number, or an array for the vehicles, by ArduSub's names; others have the firmware's.
    - `others`: for each vehicle, the coefficients that are not those of `vehicle`, and what is held or at the start.
    - `loads`: the load along heave on each vehicle while the stick is forward, N.
    - `delays`: the time of each vehicle from its sensors to its commands, s.

    They begin at rest, 10 m deep, and head north. Raises what `Mixer` raises, and BuildError without an engine.
    """
    layout, count = vehicle.layout, len(others)
    start = {"z": 10.0} if "z" in layout.state else {}
    flights = Flights(
        vehicle,
        Mixer(vehicle).sharing,
        [{**start, **one} for one in others],
        [round(RATE * delay) for delay in delays or [0.0] * count],
    )
    loops, held = loops_of(gains, count), [AXES.index(axis) for axis in ROWS]
    loops["k_aim"][:, AXES.index(YAW)] = 1.0
    aim = np.array([start.get("z", 0.0) if axis is HEAVE else 0.0 for axis in AXES])
    mode = np.array([PLACE if axis in ROWS else STICK for axis in AXES])
    signs = np.array([-1.0 if axis is HEAVE else 1.0 for axis in DEMANDS])
    for leg in legs:
        n = AXES.index(leg.axis)
        aim[n] = leg.size if leg.axis is SURGE else aim[n] + leg.size
        aim[AXES.index(SURGE)] *= leg.axis is SURGE
        steps, ahead = round(leg.seconds * RATE), leg.axis is SURGE and leg.size > 0.0
        inputs = {HEAVE.external: np.reshape(loads, (-1, 1)) * ahead} if layout.has(HEAVE) else {}
        aims = np.tile(aim, (steps, 1))
        if leg.axis is YAW:
            aims[:, n] = _moving(aim[n] - leg.size, aim[n], steps)
        flown = flights.fly(loops, np.tile(mode, (steps, 1)), aims, 1.0 / RATE, inputs)
        errors = flown.sensors[..., [SENSORS.index(name) for name in ("phi", "theta", "psi", "z")]] - aim[held]
        errors[..., 2] -= 2.0 * pi * np.floor(errors[..., 2] / (2.0 * pi) + 0.5)
        errors[flights.failed] = nan
        demands = flown.demands[..., [AXES.index(axis) for axis in DEMANDS]] * signs
        yield FlownLeg(leg, *(np.moveaxis(part, 0, -1) for part in (errors, demands, flown.outputs)))
