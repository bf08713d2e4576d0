"""The autopilot's loop of one axis, written from its equations as a reference for the C.

It shares no code with `rov_fmu/autopilot/` or `fmu_src/autopilot/`. It leaves out the thrusters and their limits.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import copysign, pi, sqrt


def limited(x: float, most: float) -> float:
    """Return x within its limit; a limit of 0 is none."""
    return max(-most, min(most, x)) if most > 0.0 else x


@dataclass
class Cascade:
    """The loop of an axis: from a place or a rate to a force or moment, with what it remembers between two steps.

    n steps after a hold has begun, v* = v + (1 - f_n) (v_aim - v) with f_n = (1 + 2 h/T)^-n, so the rate that is asked
    for begins at the measured one. The demand has what was demanded before the hold, less what the loop asks for then,
    times (1 + h/T)^-n. T is the number `handover`.
    """

    gains: Mapping[str, float]
    turns: bool
    """True for an angle, whose errors are within half a turn."""
    demand: float = 0.0
    integral: float = 0.0
    steps: int = -1
    """The steps since the hold began; -1 for none."""
    excess: float = 0.0
    """What was demanded before the hold, less what the loop asked for in its first step."""
    last_wanted: float = 0.0

    def stick(self, share: float) -> float:
        """Return the demand of a stick, as a share of the largest demand."""
        self.steps, self.demand = -1, share * self.gains["most"]
        return self.demand

    def place(self, aim: float, place: float, rate: float, h: float) -> float:
        """Return the demand that holds a place (m) or an angle (rad)."""
        error = (aim - place + pi) % (2.0 * pi) - pi if self.turns else aim - place
        k_x, brake = self.gains["k_x"], self.gains["brake"]
        size = min(abs(error), brake / k_x) if self.turns else abs(error)
        wanted = k_x * size if k_x**2 * size <= brake else sqrt(2.0 * brake * size - (brake / k_x) ** 2)
        return self.rate(copysign(limited(wanted, self.gains["v_max"]), error), rate, h)

    def rate(self, aim: float, rate: float, h: float) -> float:
        """Return the demand that holds a rate, m/s or rad/s."""
        k, self.steps = self.gains, self.steps + 1
        fade = (1.0 + 2.0 * h / k["handover"]) ** -self.steps
        wanted = rate + (1.0 - fade) * (aim - rate)
        error = wanted - rate
        self.integral = limited(self.integral + k["k_i"] * error * h, k["i_max"])
        slope = limited((wanted - self.last_wanted) / h, k["brake"]) if self.steps else 0.0
        self.last_wanted = wanted
        asked = k["k_p"] * error + self.integral + k["bias"] + (k["d_1"] + k["d_2"] * abs(wanted)) * wanted
        asked += k["inertia"] * (1.0 - fade) * slope
        if not self.steps:
            self.excess = self.demand - asked
        self.demand = limited(asked + self.excess * (1.0 + h / k["handover"]) ** -self.steps, k["most"])
        return self.demand
