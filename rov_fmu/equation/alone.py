"""One axis alone: V_ss and Tau in closed form, from the forces of forces.py.

While the other axes are at rest, the vehicle is level and the thrust is steady, (18) is a scalar Riccati equation,

    v' = C - B v - A |v| v,

with A in 1/m (1/rad for a rotation), B in 1/s and C in m/s2 (rad/s2). At the steady velocity V_ss, v' is 0. Tau (17) is
the time from rest until p V_ss is reached, p = 1 - 1/e:

    D^2 = B^2 + 4 A |C|,    V_ss = 2 C / (B + D),    Tau = (2 / D) artanh(p / (1 + (1 - p) B / D)).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import e, inf

from .attitude import entry
from .catalogue import REVERSE
from .expression import (
    Expression,
    Name,
    call,
    compiled,
    directed,
    equal,
    replaced,
    total,
    where,
)
from .forces import Force, forces_of
from .layout import Layout
from .terms import equation_of

POWERS = {2: "A", 1: "B"}
"""The coefficient of drag by the power of the velocity: a drag of power n is |v|^(n - 1) v times it."""
RISE = 1.0 - 1.0 / e
"""The fraction of V_ss that is reached after Tau, (17)."""


def closed_form() -> dict[str, Expression]:
    """Return the formulas of D, V_ss and Tau. Without drag, and where A drives the axis, V_ss and Tau are infinite."""
    A, B, C, D = map(Name, "ABCD")
    without_drag = where(equal(C, 0.0), 0.0, directed(C, inf, -inf))
    return {
        "D": where(A < 0.0, 0.0, call("hypot", B, 2.0 * call("sqrt", A) * call("sqrt", abs(C)))),
        "V_ss": where(D > 0.0, 2.0 * C / (B + D), without_drag),
        "Tau": where(D > 0.0, 2.0 * call("atanh", RISE / (1.0 + (1.0 / e) * (B / D))) / D, inf),
    }


def stopping_formula() -> Expression:
    """Return the distance from v until `share` of it without any force: the integral of 1 / (A |v| + B)."""
    A, B, share, speed = Name("A"), Name("B"), Name("share"), abs(Name("v"))
    quadratic = call("log", (A * speed + B) / (A * share * speed + B)) / A
    linear = where(B > 0.0, (1.0 - share) * speed / B, inf)
    return where(A > 0.0, where(speed > 0.0, where(speed < inf, quadratic, inf), 0.0), linear)


@lru_cache(maxsize=100)
def _forces_of(layout: Layout) -> tuple[Force, ...]:
    return tuple(forces_of(layout, equation_of(layout).names))


def alone_formulas(layout: Layout, velocity: str) -> dict[str, Expression]:
    """Return the formulas of the motion of an axis alone: A, B and C, and A_reverse and B_reverse for v < 0.

    They contain coefficients, inputs, `Equation.parameters` and `Equation.thrust`.
    """
    equation = equation_of(layout)
    gain = equation.names("gain", velocity)
    forces = [force for force in _forces_of(layout) if force.axis == velocity]
    constant: list[tuple[str, ...]] = [()]
    """The factors of forces that are constant: none, and for a vehicle that moves without turning, how level it is."""
    if not layout.by_velocity[velocity].axis.is_rotation:
        constant.append((entry(3, 3),))
    loads = [force.along() for force in forces if force.factors in constant]
    formulas = _drag((force for force in forces if {*force.factors} == {velocity}), gain) | {"C": gain * total(loads)}
    steady = {force: Name(name) for lag in equation.lags for force, name in lag.steady.items()}
    return {key: replaced(formula, {**steady, **equation.forces}) for key, formula in formulas.items()}


def _drag(forces: Iterable[Force], gain: Expression) -> dict[str, Expression]:
    """Return the formulas of the drag by the keys of POWERS, ahead and in reverse."""
    parts: dict[str, list[Expression]] = {key + end: [] for end in ("", REVERSE) for key in POWERS.values()}
    for force in forces:
        power = len(force.factors)
        ahead, astern = (force.along(gain, reverse=reverse) for reverse in (False, True))
        parts[POWERS[power]].append(-ahead)
        parts[POWERS[power] + REVERSE].append(astern if power % 2 == 0 else -astern)
    return {key: total(own) for key, own in parts.items()}


def response_formulas(layout: Layout, velocity: str) -> dict[str, Expression]:
    """Return the formulas of V_ss and Tau of an axis alone, after those that they contain."""
    formulas = alone_formulas(layout, velocity)
    drag = {key: directed(Name("C"), formulas[key], formulas[key + REVERSE]) for key in POWERS.values()}
    return {"C": formulas["C"], **drag, **closed_form()}


_closed_form, _stopping = compiled(closed_form()), compiled({"distance": stopping_formula()})


def steady_velocity(A: float, B: float, C: float) -> float:
    """Return the velocity V_ss at which drag balances the force, A |V| V + B V = C; infinite without drag.

    - `A`, `B`, `C`: quadratic drag, 1/m (1/rad), linear drag, 1/s, and force, m/s2 (rad/s2), each over the inertia.

        steady_velocity(0.48, 1.43, 0.77)  # m/s
    """
    return AxisAlone(A, B, C).steady_velocity()


def time_constant(A: float, B: float, C: float) -> float:
    """Return Tau of (17), the time from rest until the velocity is (1 - 1/e) V_ss; infinite without drag.

    - `A`, `B`, `C`: those of `steady_velocity`.

        time_constant(0.48, 1.43, 0.77)  # s
    """
    return AxisAlone(A, B, C).time_constant()


@dataclass(frozen=True)
class AxisAlone:
    """The motion of one axis alone under held inputs: v' = C - B v - A |v| v."""

    A: float
    B: float
    C: float
    reverse: tuple[float, float] | None = None
    """A and B for v < 0, if they differ."""

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "AxisAlone":
        """Return the motion with the values of `alone_formulas`."""
        drag, reverse = (values["A"], values["B"]), (values["A_reverse"], values["B_reverse"])
        return cls(*drag, values["C"], reverse if reverse != drag else None)

    def drag(self, sign: float) -> tuple[float, float]:
        """Return A and B for velocities of this sign."""
        return self.reverse if self.reverse and sign < 0.0 else (self.A, self.B)

    def acceleration(self, v: float) -> float:
        """Return v', (18)."""
        A, B = self.drag(v)
        return self.C - (B + A * abs(v)) * v

    def steady_velocity(self) -> float:
        """Return V_ss."""
        return self._response("V_ss")

    def time_constant(self) -> float:
        """Return Tau of (17), from rest."""
        return self._response("Tau")

    def _response(self, name: str) -> float:
        """Return one of the numbers of `closed_form`."""
        A, B = self.drag(self.C)
        return float(_closed_form({"A": A, "B": B, "C": self.C})[name])

    def stopping_distance(self, v: float, share: float) -> float:
        """Return the distance from v until `share` of it without any force, m or rad."""
        A, B = self.drag(v)
        return float(_stopping({"A": A, "B": B, "v": v, "share": share})["distance"])
