"""The law by which ArduSub holds depth, heading and attitude, with its default gains, filters and limits.

It follows ArduPilot's sources: `AP_Motors6DOF.cpp` (the factors of the frame `vectored_6dof`, and the mixing),
`AC_AttitudeControl_Sub.h`, `AC_PosControl.cpp` and `AC_PID.cpp` (the cascades). It leaves out the filter that estimates
the state, and the shaping of targets; `flights.py` flies it with noisy estimates, and writes logs. `Hold.by` has other
gains, the filters of the sensors, and a heading that moves to its target (`AC_AttitudeControl.cpp`). It shares no code
with `rov_fmu/bridges/ardusub/`, which makes such gains. `fmu_src/autopilot/` has these loops in C, and the tests
compare the two.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import copysign, cos, pi, radians, sin, sqrt
from typing import Any

from typing_extensions import Self

VECTORED_6DOF = (
    (0, 0, 1, 0, -1, 1),
    (0, 0, -1, 0, -1, -1),
    (0, 0, -1, 0, 1, 1),
    (0, 0, 1, 0, 1, -1),
    (1, -1, 0, -1, 0, 0),
    (-1, -1, 0, -1, 0, 0),
    (1, 1, 0, -1, 0, 0),
    (-1, 1, 0, -1, 0, 0),
)
"""Roll, pitch, yaw, throttle, forward and lateral factor of each motor."""
VECTORED = (*VECTORED_6DOF[:4], (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0))
"""The same of the frame of six motors."""
STICK = 0.8
"""The time constant with which a stick moves, s. After a jump to full thrust ahead, the vehicle would turn over before
the integrators of the law hold its bow down."""

Vector = tuple[float, float, float]


def part_of(frequency: float, dt: float) -> float:
    """The part of a change that passes ArduPilot's low-pass filter of first order in a step."""
    return dt / (dt + 0.5 / pi / frequency) if frequency else 1.0


def sqrt_controller(error: float, p: float, most: float) -> float:
    """The rate that removes an error: proportional at first, then such that the deceleration is at most `most`."""
    linear = most / p**2
    return p * error if abs(error) <= linear else copysign(sqrt(2.0 * most * (abs(error) - 0.5 * linear)), error)


@dataclass
class Pid:
    """AC_PID: the filters of target, error and derivative (Hz, 0 for none), and the limit of the integrator."""

    p: float
    i: float
    d: float
    most: float
    target_filter: float = 0.0
    error_filter: float = 0.0
    slope_filter: float = 0.0
    forward: float = 0.0
    """The gain of the target."""
    integral: float = 0.0
    slope: float = 0.0
    _last: tuple[float, float] | None = None
    """The filtered target and error of the last step."""

    def __call__(self, target: float, measured: float, dt: float) -> float:
        """Return the output after a step of dt seconds."""
        if self._last is None:
            self._last = target, target - measured
        wanted, before = self._last
        wanted += part_of(self.target_filter, dt) * (target - wanted)
        error = before + part_of(self.error_filter, dt) * (wanted - measured - before)
        self.slope += part_of(self.slope_filter, dt) * ((error - before) / dt - self.slope)
        self.integral = max(-self.most, min(self.most, self.integral + self.i * error * dt))
        self._last = wanted, error
        return self.p * error + self.integral + self.d * self.slope + self.forward * wanted


@dataclass
class Biquad:
    """The low-pass filter of second order of a sensor, by the bilinear transform (Bristow-Johnson's cookbook)."""

    frequency: float
    """Hz, 0 for none."""
    _past: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """The last two inputs and outputs."""

    def __call__(self, value: float, dt: float) -> float:
        """Return the output after a step of dt seconds."""
        if not self.frequency:
            return value
        turn = 2.0 * pi * self.frequency * dt
        damping, b = sin(turn) / sqrt(2.0), 0.5 * (1.0 - cos(turn))
        x1, x2, y1, y2 = self._past
        y = (b * (value + 2.0 * x1 + x2) + 2.0 * cos(turn) * y1 - (1.0 - damping) * y2) / (1.0 + damping)
        self._past = value, x1, y, y1
        return y


@dataclass(frozen=True)
class Motion:
    """What the sensors of a vehicle tell, in SI units."""

    attitude: Vector
    """Roll, pitch and heading."""
    rates: Vector
    """The rates of roll, pitch and yaw."""
    depth: float
    sinking: float
    """The velocity down."""
    acceleration: float
    """The acceleration down."""


@dataclass
class Hold:
    """The law, with what its integrators and filters contain."""

    depth: float = 1.0
    """The depth to hold, m."""
    heading: float = 0.0
    """The heading to hold, rad."""
    throttle: float = 0.0
    frame: tuple[tuple[int, ...], ...] = VECTORED_6DOF
    roll: Pid = field(default_factory=lambda: Pid(0.135, 0.09, 0.0036, 0.444, 30.0, 0.0, 30.0))
    pitch: Pid = field(default_factory=lambda: Pid(0.135, 0.09, 0.0036, 0.444, 30.0, 0.0, 30.0))
    yaw: Pid = field(default_factory=lambda: Pid(0.18, 0.018, 0.0, 0.222, 5.0, 0.0, 5.0))
    climb: Pid = field(default_factory=lambda: Pid(8.0, 0.0, 0.0, 1000.0, error_filter=5.0))
    """From cm/s to cm/s2."""
    rise: Pid = field(default_factory=lambda: Pid(0.5, 0.1, 0.0, 100.0, error_filter=20.0))
    """From cm/s2 to throttle; 1000 is full throttle."""
    angles: Vector = (6.0, 6.0, 6.0)
    """The gains of the angles, ATC_ANG_*_P."""
    depth_gain: float = 3.0
    """PSC_POSZ_P."""
    sensors: list[Biquad] = field(default_factory=lambda: [Biquad(0.0) for _ in range(4)])
    """The filters of the rates and of the acceleration."""
    slew: float = 0.0
    """The largest rate of the target of the heading (ATC_SLEW_YAW), rad/s; with 0, a new heading is one at once."""
    _target: tuple[float, float] | None = None
    """The target of the heading, and its rate."""

    @classmethod
    def by(cls, gains: Mapping[str, float], **others: Any) -> Self:
        """Return the law with some gains by ArduSub's names, and sensors that have filters of 20 Hz."""
        hold = cls(**others)
        turns = {"RLL": hold.roll, "PIT": hold.pitch, "YAW": hold.yaw}
        for pid, name in [*((pid, f"ATC_RAT_{turn}") for turn, pid in turns.items()), (hold.rise, "PSC_ACCZ")]:
            pid.p, pid.i, pid.d = (gains.get(f"{name}_{key}", getattr(pid, key.lower())) for key in "PID")
        hold.rise.forward = gains.get("PSC_ACCZ_FF", 0.0)
        hold.climb.p, hold.depth_gain = gains.get("PSC_VELZ_P", 8.0), gains.get("PSC_POSZ_P", 3.0)
        roll, pitch, yaw = (gains.get(f"ATC_ANG_{turn}_P", 6.0) for turn in turns)
        hold.angles, hold.sensors = (roll, pitch, yaw), [Biquad(20.0) for _ in range(4)]
        hold.slew = radians(60.0)
        return hold

    def _heading(self, dt: float) -> tuple[float, float]:
        """Return the target of the heading and its rate, as input_shaping_angle moves it to a new heading: with
        ATC_INPUT_TC, 0.15 s, and at most ATC_ACCEL_Y_MAX, 1100 deg/s2."""
        if not self.slew:
            return self.heading, 0.0
        (at, rate), most = self._target or (self.heading, 0.0), radians(1100.0)
        wanted = max(-self.slew, min(self.slew, sqrt_controller(self.heading - at, 1.0 / 0.15, most)))
        rate = max(rate - most * dt, min(rate + most * dt, wanted))
        self._target = at + rate * dt, rate
        return self._target

    def outputs(self, motion: Motion, forward: float, lateral: float, dt: float) -> list[float]:
        """Return the outputs of the motors from -1 to 1, for sticks from -1 to 1 and a step of dt seconds."""
        phi, theta, psi = motion.attitude
        target, target_rate = self._heading(dt)
        error = (target - psi + pi) % (2 * pi) - pi
        most = radians(120.0)  # AC_ATTITUDE_ACCEL_Y_CONTROLLER_MAX_RADSS, which also limits the error
        of_roll, of_pitch, of_yaw = self.angles
        yaw_rate = sqrt_controller(max(-most / of_yaw, min(most / of_yaw, error)), of_yaw, most) + target_rate
        wanted = (-of_roll * phi, -of_pitch * theta, yaw_rate)
        rates = [sensor(rate, dt) for sensor, rate in zip(self.sensors, motion.rates, strict=False)]
        roll, pitch, yaw = (
            pid(target, rate, dt)
            for pid, target, rate in zip((self.roll, self.pitch, self.yaw), wanted, rates, strict=True)
        )
        throttle = self._throttle(motion, dt)
        turns = [roll * f[0] + pitch * f[1] + throttle * f[3] for f in self.frame]
        moves = [yaw * f[2] + forward * f[4] + lateral * f[5] for f in self.frame]
        most_turn, most_move = max(1.0, *map(abs, turns)), max(1.0, *map(abs, moves))
        return [
            max(-1.0, min(1.0, turn / most_turn + move / most_move)) for turn, move in zip(turns, moves, strict=True)
        ]

    def _throttle(self, motion: Motion, dt: float) -> float:
        """Return the throttle from -1 to 1: PILOT_ACCEL_Z = 100 cm/s2, and a filter of 2 Hz."""
        target = sqrt_controller(100.0 * (motion.depth - self.depth), self.depth_gain, 100.0)
        acceleration = self.climb(target, -100.0 * motion.sinking, dt)
        measured = self.sensors[3](motion.acceleration, dt)
        asked = max(-1.0, min(1.0, 2e-3 * self.rise(acceleration, -100.0 * measured, dt)))
        self.throttle += part_of(2.0, dt) * (asked - self.throttle)
        return self.throttle
