"""The law by which ArduSub holds depth, heading and attitude, with its default gains, filters and limits.

It follows ArduPilot's sources: `AP_Motors6DOF.cpp` (the factors of the frame `vectored_6dof`, and the mixing),
`AC_AttitudeControl_Sub.h`, `AC_PosControl.cpp` and `AC_PID.cpp` (the cascades). It leaves out the filter that estimates
the state, and the shaping of targets; `flights.py` flies it with noisy estimates, and writes logs.
`fmu_src/live/hold.js`, of the page that flies, is the same law in JavaScript, and the tests compare the two.
"""

from dataclasses import dataclass, field
from math import copysign, pi, radians, sqrt

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
        return self.p * error + self.integral + self.d * self.slope


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

    def outputs(self, motion: Motion, forward: float, lateral: float, dt: float) -> list[float]:
        """Return the outputs of the motors from -1 to 1, for sticks from -1 to 1 and a step of dt seconds."""
        phi, theta, psi = motion.attitude
        error = (self.heading - psi + pi) % (2 * pi) - pi
        most = radians(120.0)  # AC_ATTITUDE_ACCEL_Y_CONTROLLER_MAX_RADSS, which also limits the error
        yaw_rate = sqrt_controller(max(-most / 6.0, min(most / 6.0, error)), 6.0, most)
        wanted = (-6.0 * phi, -6.0 * theta, yaw_rate)  # the rates by ATC_ANG_*_P
        roll, pitch, yaw = (
            pid(target, rate, dt)
            for pid, target, rate in zip((self.roll, self.pitch, self.yaw), wanted, motion.rates, strict=True)
        )
        throttle = self._throttle(motion, dt)
        turns = [roll * f[0] + pitch * f[1] + throttle * f[3] for f in self.frame]
        moves = [yaw * f[2] + forward * f[4] + lateral * f[5] for f in self.frame]
        most_turn, most_move = max(1.0, *map(abs, turns)), max(1.0, *map(abs, moves))
        return [
            max(-1.0, min(1.0, turn / most_turn + move / most_move)) for turn, move in zip(turns, moves, strict=True)
        ]

    def _throttle(self, motion: Motion, dt: float) -> float:
        """Return the throttle from -1 to 1: PSC_POSZ_P = 3, PILOT_ACCEL_Z = 100 cm/s2, and a filter of 2 Hz."""
        target = sqrt_controller(100.0 * (motion.depth - self.depth), 3.0, 100.0)
        acceleration = self.climb(target, -100.0 * motion.sinking, dt)
        asked = max(-1.0, min(1.0, 2e-3 * self.rise(acceleration, -100.0 * motion.acceleration, dt)))
        self.throttle += part_of(2.0, dt) * (asked - self.throttle)
        return self.throttle
