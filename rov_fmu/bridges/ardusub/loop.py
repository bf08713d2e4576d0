"""ArduSub in ALT_HOLD around many vehicles at once: the loops that hold depth and attitude, 400 times a second.

A depth error becomes a speed (PSC_POSZ), a speed error an acceleration (PSC_VELZ), and its error the throttle
(PSC_ACCZ). An angle error becomes a rate (ATC_ANG), and its error a turn (ATC_RAT). The factors of the frame make the
outputs of the motors from them, and the C of the FMU moves the vehicles, with all their axes, dead band and lag.

This is written from ArduPilot's documentation and from what its sources do: `AC_PosControl`, `AC_AttitudeControl_Sub`,
`AC_PID`, `AP_Motors6DOF`. The filters of the sensors are in it because loops that are too fast chatter by their delay.
Left out are the estimator, sensor noise, the shaping of targets, and what stops an integrator at full thrust.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan, pi, radians, sqrt, tan
from typing import Any

import numpy as np

from rov_fmu.c.stepper import Stepper
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
_BRAKES = np.array([[radians(550.0)], [radians(550.0)], [radians(120.0)], [1.0]])
"""The accelerations that the first controllers respect, rad/s2 and m/s2: half of ATC_ACCEL_R_MAX and ATC_ACCEL_P_MAX,
the most that AC_AttitudeControl allows in yaw, and PILOT_ACCEL_Z."""
_MOST = np.array([[0.444], [0.444], [0.222], [0.2]])
"""The limits of the integrators (IMAX), as demands."""
_SENSORS = 20.0
"""The filters of gyroscope and accelerometer (INS_GYRO_FILTER, INS_ACCEL_FILTER), Hz."""
_STICK = 0.8
"""The time constant with which a stick moves, s."""
_RECORDED = ("phi", "theta", "psi", "z", "p", "q", "r", "der(z)")


@dataclass(frozen=True)
class Leg:
    """A part of a flight: a step of the target, or the forward stick, which is held as long as the leg."""

    axis: Axis
    size: float
    """The change of the depth (m) or of the heading (rad), or the stick, from -1 to 1."""
    seconds: float = 7.0


@dataclass(frozen=True, eq=False)
class Flown:
    """A leg as the vehicles flew it. Where the motion of a vehicle cannot be computed, its errors are NaN."""

    leg: Leg
    errors: Array
    """What roll, pitch, heading (rad) and depth (m) are beyond their targets (times x 4 x vehicles)."""
    demands: Array
    """The demands along DEMANDS from -1 to 1, up for the throttle (times x 6 x vehicles)."""
    fractions: Array
    """The commands from -1 to 1 (times x commands x vehicles)."""


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
        self._scale, self._neutral = (400.0, 1500.0) if layout.pulse else (1.0, 0.0)

    def fractions(self, demands: Array) -> Array:
        """Return the outputs from -1 to 1 (commands x vehicles) as pulse widths make them: in steps of 1/400."""
        outputs = self._matrix @ demands
        if self.frame == "vectored_6dof":  # each group of thrusters is scaled down as a whole
            vertical = self._matrix[:, [3]] != 0.0
            for group in (vertical, ~vertical):
                outputs /= np.where(group, np.abs(outputs * group).max(axis=0).clip(1.0), 1.0)
        return np.floor(400.0 * _within(outputs, 1.0)) / 400.0

    def commands(self, fractions: Array) -> Array:
        """Return the commands of the vehicle: fractions of the full command, or pulse widths."""
        return self._neutral + self._scale * fractions

    def push(self, vehicle: Vehicle, axis: Axis, demand: float) -> float:
        """Return the force (N) or moment (N.m) along an axis that a demand gives there, with the tuning α."""
        commands = self.commands(demand * self._matrix[:, DEMANDS.index(axis)]).tolist()
        inputs = vehicle.layout.usual_inputs | dict(zip(vehicle.layout.commands, commands, strict=True))
        return vehicle[axis.coefficient("alpha")] * vehicle.along(axis, vehicle.commanded(inputs))


def _within(values: Array, most: Any) -> Array:
    within: Array = np.minimum(np.maximum(values, -most), most)
    return within


def _passed(*frequencies: float) -> Array:
    """Return the part of a change that passes low-pass filters of first order in a step; inf Hz is no filter."""
    return 1.0 / (1.0 + 0.5 * RATE / pi / np.array(frequencies)[:, np.newaxis])


class _Law:
    """The loops, with what their filters and integrators contain. Rows are roll, pitch, heading, and depth."""

    def __init__(self, gains: Mapping[str, Any], count: int) -> None:
        def rows(form: str, depth: str, scale: float = 1.0) -> Array:
            own = [form.format(turn) for turn in ("RLL", "PIT", "YAW")]
            values = [gains.get(name, FIRMWARE.get(name, 0.0)) for name in (*own, depth)]
            return np.array([np.broadcast_to(value, count) for value in values]) * [[1.0], [1.0], [1.0], [scale]]

        self._first = rows("ATC_ANG_{}_P", "PSC_POSZ_P")
        self._pid = [rows(f"ATC_RAT_{{}}_{key}", f"PSC_ACCZ_{key}", 0.2) for key in ("P", "I", "D", "FF")]
        self._climb = gains.get("PSC_VELZ_P", FIRMWARE["PSC_VELZ_P"])
        self._reach = _BRAKES / self._first
        self._reach[3] = inf
        self._target, self._error, self._slope, self._integral, self._last, self._before = np.zeros((6, 4, count))
        self._slow, self._sinking, self._throttle, self._stick = np.zeros((4, count))

    def __call__(self, off: Array, rates: Array, stick: float) -> Array:
        """Return the demands along DEMANDS after a step.

        `off` are the targets less what is measured, and `rates` those of roll, pitch, yaw and depth.
        """
        size, linear = np.minimum(np.abs(off), self._reach), _BRAKES / self._first**2
        brake = np.sqrt(2.0 * _BRAKES * np.maximum(size - 0.5 * linear, 0.0))
        wanted = np.copysign(np.where(size <= linear, self._first * size, brake), off)
        self._slow = self._slow + _CLIMB * (wanted[3] - rates[3] - self._slow)
        wanted[3] = self._climb * self._slow
        measured = self._filtered(np.array([*rates[:3], RATE * (rates[3] - self._sinking)]))
        self._sinking = rates[3]
        p, i, d, forward = self._pid
        self._target = self._target + _TARGETS * (wanted - self._target)
        change = _ERRORS * (self._target - measured - self._error)
        self._error = self._error + change
        self._slope = self._slope + _TARGETS * (RATE * change - self._slope)
        self._integral = _within(self._integral + i * self._error / RATE, _MOST)
        asked = p * self._error + self._integral + d * self._slope + forward * self._target
        self._throttle = self._throttle + _THROTTLE * (_within(-asked[3], 1.0) - self._throttle)
        self._stick = self._stick + (stick - self._stick) / (1.0 + RATE * _STICK)
        return np.array([*asked[:3], self._throttle, self._stick, np.zeros_like(self._stick)])

    def _filtered(self, measured: Array) -> Array:
        """Return what the sensors tell: a low-pass filter of second order, by Butterworth, as `LowPassFilter2p`."""
        w = tan(pi * _SENSORS / RATE)
        scale = 1.0 + sqrt(2.0) * w + w * w
        kept = 2.0 * (w * w - 1.0) * self._last + (1.0 - sqrt(2.0) * w + w * w) * self._before
        now = measured - kept / scale
        output = w * w / scale * (now + 2.0 * self._last + self._before)
        self._last, self._before = now, self._last
        return output


_TARGETS, _ERRORS = _passed(30.0, 30.0, 5.0, inf), _passed(inf, inf, inf, 20.0)
"""The filters of the targets and of the errors of the last controllers. Those of the slopes are like the targets'."""
_CLIMB, _THROTTLE = _passed(5.0, 2.0)
"""The filters of the speed's error (PSC_VELZ_FLTE) and of the throttle."""


def fly(
    vehicle: Vehicle,
    gains: Mapping[str, Any],
    legs: Sequence[Leg],
    others: Sequence[Mapping[str, float]] = ({},),
    load: float = 0.0,
) -> Iterator[Flown]:
    """Yield the legs of a flight of vehicles that differ in some numbers only, one leg after the other.

    - `gains`: a number, or an array for the vehicles, by ArduSub's names; others have the firmware's.
    - `others`: for each vehicle, the coefficients that are not those of `vehicle`, and what is held or at the start.
    - `load`: the load along heave on vehicles after the second while the stick is forward, N.

    They begin at rest, 10 m deep, and head north. Raises what `Mixer` raises, and BuildError without an engine.
    """
    mixer, layout, count = Mixer(vehicle), vehicle.layout, len(others)
    names = [name for name in _RECORDED if name in layout.places]
    places = [_RECORDED.index(name) for name in names]
    start = {"z": 10.0} if "z" in layout.state else {}
    steppers = [Stepper(vehicle, {**start, **one}, names) for one in others]
    law, failed, now = _Law(gains, count), np.zeros(count, bool), np.zeros((len(_RECORDED), count))
    now[places] = np.transpose([stepper.recorded() for stepper in steppers])
    targets = now[:4]
    for leg in legs:
        targets = targets + np.array([[leg.size * (leg.axis is axis)] for axis in ROWS])
        stick, steps = leg.size * (leg.axis is SURGE), round(leg.seconds * RATE)
        if layout.has(HEAVE):
            for stepper in steppers[2:]:
                stepper.inputs[0, [*layout.inputs].index(HEAVE.external)] = load * (stick > 0.0)
        sizes = len(ROWS), len(DEMANDS), len(layout.commands)
        errors, demands, fractions = (np.empty((steps, rows, count)) for rows in sizes)
        for n in range(steps):
            off = targets - now[:4]
            off[2] = (off[2] + pi) % (2.0 * pi) - pi
            errors[n], demands[n] = -off, law(off, now[4:], stick)
            fractions[n] = mixer.fractions(demands[n])
            now = now.copy()
            for k, commands in enumerate(mixer.commands(fractions[n]).T.tolist()):
                try:
                    now[places, k] = steppers[k].step(commands, 1.0 / RATE)
                except OverflowError:
                    failed[k] = True
        errors[:, :, failed] = nan
        yield Flown(leg, errors, demands, fractions)
