"""A seaway as a PythonFMU slave: linear waves with a JONSWAP spectrum, as vehicles feel them.

Each vehicle has a place in the water, where it gets the velocity and the acceleration of the water and the elevation of
the surface. It holds them over the next step, so they are those of the middle of that step, where the vehicle then is
if it moves on as in the last step. The waves add to the current that is connected. A tether gets velocity and
acceleration at each of its points, of the waves alone, for it has a current by its profile.

In a current U that is the same everywhere, omega - k U takes the place of omega in the water, and the acceleration is
that of the water which the current carries. U is a parameter; the velocity of the current comes as it always does.

A wave a cos(phase) of the surface has the phase omega t - k (x cos theta + y sin theta) + epsilon, and omega^2 =
g k tanh(k d) in water of the depth d (Airy's theory; DNV-RP-C205, 3.2.2). The frequencies are drawn within equal parts
of the range that has the energy of the spectrum, so that the sea does not repeat, and 4 sqrt(m_0) is H_s. Above the
mean level, the water moves as there.
"""

from math import cos, exp, inf, pi, sin, sqrt, tanh
from random import Random
from typing import ClassVar

from rov_fmu.bridges.system.companions._common import (
    ACCELERATION,
    DIRECTIONS,
    VELOCITY,
    Companion,
    Variables,
)

G = 9.80665
RANGE = (0.5, 4.0)  # of the frequencies over that of the peak: 99.7 % of the energy for gamma = 3.3
MOST = 1000  # components
PLACE, STEADY = ("x", "y", "z"), ("U_N", "U_E", "U_D")

# name: causality, start, unit, description
VARIABLES: Variables = {
    "H_s": ("parameter", 0.5, "m", "Significant wave height; of one component, the height from trough to crest"),
    "T_p": ("parameter", 6.0, "s", "Period of the peak of the spectrum"),
    "gamma": ("parameter", 3.3, "1", "Peak enhancement factor of JONSWAP; 1 is Pierson and Moskowitz"),
    "direction": ("parameter", 0.0, "rad", "Direction that the waves run to, from north to east"),
    "spreading": ("parameter", 0.0, "1", "Exponent n of the spreading cos^n around it; 0: all run alike"),
    "components": ("parameter", 100.0, "1", f"Number of components, 1 to {MOST}; 1 is a regular wave"),
    "seed": ("parameter", 1.0, "1", "Which sea of this spectrum: a whole number"),
    "seabed": ("parameter", 1000.0, "m", "Depth of the water"),
    "rise": ("parameter", 0.0, "s", "Time in which the waves grow from a calm sea"),
    "current_N": ("parameter", 0.0, "m/s", "Current northward in which the waves run, which changes their lengths"),
    "current_E": ("parameter", 0.0, "m/s", "Current eastward in which the waves run"),
    "step": ("parameter", 0.02, "s", "Step at the start, of whose middle the first values are"),
}


def point(suffix: str, *, steady: bool) -> Variables:
    """Return the variables of a point in the water; `steady`: with the current there."""
    groups = (
        (PLACE, "input", "m", "Position of the vehicle" if steady else "Position of the point"),
        *([(STEADY, "input", "m/s", "Current to which the waves add")] * steady),
        (VELOCITY, "output", "m/s", "Velocity of the water there"),
        (ACCELERATION, "output", "m/s2", "Acceleration of the water there"),
    )
    return {
        f"{name}{suffix}": (causality, 0.0, unit, f"{what}, {to}")
        for names, causality, unit, what in groups
        for name, to in zip(names, DIRECTIONS, strict=True)
    }


def place(suffix: str) -> Variables:
    """Return the variables of a vehicle's place in the water."""
    found = point(suffix, steady=True)
    return found | {f"elevation{suffix}": ("output", 0.0, "m", "Elevation of the surface there, positive upward")}


class Seaway(Companion):
    """The slave."""

    description = "A seaway: linear waves with a JONSWAP spectrum"
    places = (("pose", PLACE), ("current", VELOCITY), ("waves", (*ACCELERATION, "elevation")))
    behind = "steady"
    limits: ClassVar = {
        "H_s": (0.0, 100.0),
        "T_p": (0.01, 1e3),
        "gamma": (1.0, 20.0),
        "spreading": (0.0, 1e3),
        "components": (1.0, MOST),
        "seabed": (0.01, 1e6),
        "rise": (0.0, 1e6),
        "current_N": (-100.0, 100.0),
        "current_E": (-100.0, 100.0),
        "step": (0.0, 1e3),
    }

    H_s: float
    T_p: float
    gamma: float
    direction: float
    spreading: float
    components: float
    seed: float
    seabed: float
    rise: float
    current_N: float
    current_E: float
    step: float

    def __init__(self, **arguments: object) -> None:
        super().__init__(**arguments)
        self.before: dict[str, list[float]] = {}
        self.waves: list[tuple[float, ...]] = []
        self.lines = {
            name: [f"_{name}_{n}" for n in range(count)] for name, count in self.shape.get("lines", {}).items()
        }
        variables = place("") | VARIABLES | self.add_places(place)
        for suffix in self.suffixes:
            self.terminals.append((f"steady{suffix}", [f"{name}{suffix}" for name in STEADY], VELOCITY))
        for line, suffixes in self.lines.items():
            for port, some in (("pose", PLACE), ("waves", (*VELOCITY, *ACCELERATION))):
                own = [f"{name}{suffix}" for suffix in suffixes for name in some]
                members = tuple(f"{name}_p{n}" for n in range(len(suffixes)) for name in some)
                self.terminals.append((f"{port}_{line}", own, members))
            variables |= {name: one for suffix in suffixes for name, one in point(suffix, steady=False).items()}
        self.register(variables, "fixed")

    def exit_initialization_mode(self) -> None:
        """Draw the waves, and begin with the middle of the first step. Raises ValueError for a sea that cannot be."""
        self.check()
        self.waves = self._drawn()
        for suffix in self.suffixes:
            self._put(suffix, 0.5 * self.step, self._place(suffix))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the water in the middle of the next step."""
        for suffix in self.suffixes:
            now = self._place(suffix)
            before = self.before.get(suffix, now)
            ahead = [x + 1.5 * (x - was) for x, was in zip(now, before, strict=True)]
            self._put(suffix, current_time + 1.5 * step_size, ahead)
            self.before[suffix] = now
        for suffixes in self.lines.values():
            points = [self._place(suffix) for suffix in suffixes]
            if any(map(any, points)):  # a tether has told its points after its first step
                for suffix, now in zip(suffixes, points, strict=True):
                    self._put(suffix, current_time + 1.5 * step_size, now)
        return True

    def _place(self, suffix: str) -> list[float]:
        return [getattr(self, f"{x}{suffix}") for x in PLACE]

    def _drawn(self) -> list[tuple[float, ...]]:
        """Return amplitude, angular frequency, wave number, direction and phase of each component.

        One that cannot run against the current is left out.
        """
        count, peak = min(MOST, round(self.components)), 2.0 * pi / self.T_p
        if count == 1:
            found = [(0.5 * self.H_s, peak, self._wave_number(peak, self.direction), self.direction, 0.0)]
            return [wave for wave in found if wave[2] < inf]
        random, (low, high) = Random(round(self.seed)), RANGE
        width = (high - low) * peak / count
        drawn = []
        for n in range(count):
            omega = low * peak + (n + random.random()) * width
            drawn.append((self._density(omega / peak), omega, self._direction(random), 2.0 * pi * random.random()))
        energy = sum(density for density, *_ in drawn)
        return [
            (self.H_s * sqrt(density / (8.0 * energy)), omega, k, direction, phase)
            for density, omega, direction, phase in drawn
            if (k := self._wave_number(omega, direction)) < inf
        ]

    def _density(self, ratio: float) -> float:
        """Return the spectral density at omega/omega_p but for a factor (JONSWAP; DNV-RP-C205, 3.5.5)."""
        sigma = 0.07 if ratio <= 1.0 else 0.09
        enhanced = self.gamma ** exp(-0.5 * ((ratio - 1.0) / sigma) ** 2)
        return float(ratio**-5 * exp(-1.25 * ratio**-4) * enhanced)

    def _direction(self, random: Random) -> float:
        """Return a direction that is drawn from cos^n around the main one, by rejection."""
        while self.spreading > 0.0:
            off = pi * (random.random() - 0.5)
            if random.random() <= cos(off) ** self.spreading:
                return self.direction + off
        return self.direction

    def _wave_number(self, omega: float, direction: float) -> float:
        """Return k with (omega - k U)^2 = g k tanh(k d), the longest wave; infinity if none runs against the current U.

        By Newton's method: without a current from above, and then from the wave that would keep its speed in the water.
        """
        deep = omega**2 / G
        k = deep / sqrt(tanh(deep * self.seabed))
        for _ in range(20):
            t = tanh(k * self.seabed)
            k -= (k * t - deep) / (t + k * self.seabed * (1.0 - t * t))
        U = self.current_N * cos(direction) + self.current_E * sin(direction)
        if U == 0.0:
            return k
        if omega / k + U <= 0.0:
            return inf
        k = omega / (omega / k + U)
        for _ in range(50):
            t = tanh(k * self.seabed)
            sigma = sqrt(G * k * t)
            group = 0.5 * sigma / k * (1.0 + k * self.seabed * (1.0 - t * t) / t) + U
            if group <= 0.0:
                return inf
            k -= (sigma + k * U - omega) / group
        return k

    def _put(self, suffix: str, t: float, at: list[float]) -> None:
        """Set the outputs of a place or a point: sums over the components."""
        x, y, z = at
        V, A, elevation = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 0.0
        depth = min(max(z, 0.0), self.seabed)
        for a, omega, k, direction, phase in self.waves:
            north, east = cos(direction), sin(direction)
            sigma = omega - k * (self.current_N * north + self.current_E * east)  # as water sees it that is carried
            down, up = exp(-k * depth), exp(-k * (2.0 * self.seabed - depth))
            along, across = ((down + s * up) / (1.0 - exp(-2.0 * k * self.seabed)) for s in (1.0, -1.0))
            p = omega * t - k * (x * north + y * east) + phase
            c, s = a * cos(p), a * sin(p)
            for n, (share, value, rate) in enumerate(((north * along, c, -s), (east * along, c, -s), (across, s, c))):
                V[n] += sigma * share * value
                A[n] += sigma**2 * share * rate
            elevation += c
        share, growth = (t / self.rise, 1.0 / self.rise) if t < self.rise else (1.0, 0.0)
        for n, (velocity, acceleration, steady) in enumerate(zip(VELOCITY, ACCELERATION, STEADY, strict=True)):
            setattr(self, f"{velocity}{suffix}", getattr(self, f"{steady}{suffix}", 0.0) + share * V[n])
            setattr(self, f"{acceleration}{suffix}", share * A[n] + growth * V[n])
        setattr(self, f"elevation{suffix}", share * elevation)  # of a point of a tether it is no output
