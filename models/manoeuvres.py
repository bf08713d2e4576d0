"""How one command drives one axis: which thrusters, which coefficients, which names and units.

A test of surge, heave or yaw is one number held over time, a fraction -1 ... 1 of full thrust; positive moves the
vehicle forward, down, or its bow to starboard. Everything in the tank tests is told by this number.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from .dynamics import Axis, Coefficients, Inputs, axes, thrust


@dataclass(frozen=True)
class Manoeuvre:
    """One axis and the command that drives it alone."""

    axis: str
    velocity: str
    """Symbol: u, w or r. The coefficients of the axis are a_d_<velocity> ... beta_<velocity>."""
    unit: str
    """Of the velocity."""
    signs: Mapping[str, float]
    """Of the thruster commands that the test holds."""
    thruster: str
    """rear or top: its thrust is a_t_<thruster>, b_t_<thruster>."""
    inertia: str
    """The coefficient that resists acceleration: m_rov or I_r."""
    position: str
    """What a sensor measures along the axis; its rate is the velocity."""
    position_unit: str
    load: str
    """Unit of force or torque."""

    def coefficient(self, kind: str) -> str:
        """Name of a coefficient of the axis: kind is a_d, b_d, alpha or beta."""
        return f"{kind}_{self.velocity}"

    @property
    def thrust_names(self) -> tuple[str, str]:
        """The coefficients of its thrust curve."""
        return f"a_t_{self.thruster}", f"b_t_{self.thruster}"

    def inputs(self, command: float) -> Inputs:
        """The inputs that hold a command (fraction of full thrust)."""
        return Inputs(**{name: sign * command for name, sign in self.signs.items()})

    def motion(self, coefficients: Coefficients, command: float) -> Axis:
        """The axis under a held command, (18)."""
        return axes(coefficients, self.inputs(command))["uwr".index(self.velocity)]

    def response(self, coefficients: Coefficients, command: float) -> tuple[float, float]:
        """Signed V_ss, and Tau (17) in s from rest, in closed form."""
        motion = self.motion(coefficients, command)
        return motion.steady_velocity(), motion.time_constant()

    def force(self, coefficients: Coefficients, command: float) -> float:
        """Thrust (N) or torque (N.m) before the tuning α, by (9), (10) and (4)."""
        F = thrust(coefficients, self.inputs(command))
        return {"u": F.F_l + F.F_r, "w": F.F_t, "r": F.tau_rear}[self.velocity]


SURGE = Manoeuvre("surge", "u", "m/s", {"u_l": 1.0, "u_r": 1.0}, "rear", "m_rov", "distance", "m", "N")
HEAVE = Manoeuvre("heave", "w", "m/s", {"u_t": 1.0}, "top", "m_rov", "depth", "m", "N")
YAW = Manoeuvre("yaw", "r", "rad/s", {"u_l": 1.0, "u_r": -1.0}, "rear", "I_r", "heading", "rad", "N.m")
MANOEUVRES = {m.axis: m for m in (SURGE, HEAVE, YAW)}
