"""A step of a vehicle by an explicit Runge-Kutta method of order 8, and the dead time (standard library only).

The method is DOP853, whose coefficients are in dop853.py.
It is a second, independent way to the step that fmu_src/c computes by Taylor series. It moves a `model`: a module that
printed.py prints for each vehicle. What lags follows its exponential, which makes nothing stiff. A substep ends where a
velocity or a rotor reverses, because drag or thrust then has other coefficients.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from math import atan2, copysign, hypot, inf, isfinite, nan, sqrt, tau
from typing import Any, NamedTuple

from .dop853 import FIFTH, THIRD, A, B, C

MOST_SUBSTEPS = 100_000
"""The largest number of substeps that a step may try. Hours of a fast turn or of a fast decay need more."""
MOST_AT_ONCE = 500
"""Of these, a step may try so many at once, and the others as time passes, as in fmu_src/c/step.c."""
MOST_WAITING = 1024
"""The largest number of changes of commands that may wait for the dead time, as in fmu_src/c/delay.c."""
TOO_MANY_WAIT = f"more than {MOST_WAITING} changes of commands wait for the dead time; change them less often"
BESIDE_NOSE = (1.0, 1e-6, 0.618e-6)
"""A direction of the body just beside the nose, for which turns are counted, as in fmu_src/c/heading.c.

The heading of the nose jumps by half a turn where the nose passes the vertical, and rounding would choose the side."""

_EPSILON = 2.0**-52
_TOLERANCE = 64.0 * _EPSILON  # of the estimated error, which is far above the true one; rounding gives up to 40
_SHARE = 1e-3  # a velocity below this share of the largest needs no smaller errors than one of this share
_SHORTEST = 1e-30  # a substep in s; a motion that needs shorter ones overflows


def _used(weights: Sequence[float]) -> dict[int, float]:
    """Return the weights that are not 0, by the number of the rate."""
    return {n: weight for n, weight in enumerate(weights) if weight}


_STAGES = [(node, _used(weights)) for node, weights in zip(C, A, strict=True)]
_END, _FIFTH, _THIRD = map(_used, (B, FIFTH, THIRD))

State = list[float]


def step(model: Any, values: Mapping[str, float], h: float) -> dict[str, float]:
    """Return the states of a vehicle after h > 0 seconds with the inputs held, by their names.

    `values` are the coefficients, inputs and states by their names. The result is not finite when the motion overflows
    or would need too many substeps.
    """
    motion = Motion(model, values)
    return motion.end() if motion.move(h) else dict.fromkeys(motion.end(), nan)


class Motion:
    """The states of a model during a step, as offsets from the start where no rate depends on them."""

    def __init__(self, model: Any, values: Mapping[str, float]) -> None:
        self.model, self.values, self.tried = model, dict(values), 0
        self.time = 0.0
        """The time since the start of the step, or since a rotor reversed."""
        self.direction = dict.fromkeys(model.MONITORED, 1.0)
        self.find_numbers()
        starts = {**model.numbers(self.values), **values, **dict.fromkeys(model.OFFSETS, 0.0)}
        self.y: State = [starts.get(f"start_{name}", starts[name]) for name in model.STATES]
        self.size = [0.0] * len(self.y)
        """The largest size of each state so far."""
        self.heading = self.turned(self.y, values.get("psi", 0.0))
        self.begin()

    def find_numbers(self) -> None:
        """Compute all numbers that are constant until the next reversal."""
        self.numbers = self.model.numbers({**self.values, **self.direction})
        self.of_model = self.model.motion(self.numbers)
        self.until: float = self.model.until_reversal(self.numbers)

    def reverse_rotor(self) -> None:
        """Let the time begin anew where a rotor reverses."""
        self.values |= self.model.lagging(self.numbers, self.time)
        self.time = 0.0
        self.find_numbers()

    def rates(self, after: float, y: State) -> State:
        """Return the rates of the states some seconds after the start of the substep."""
        rates: State = self.of_model(self.time + after, y)
        return rates

    def begin(self) -> None:
        """Begin a substep: find the directions, the rates, and the sizes of the terms in the rates.

        A velocity of exactly 0 will move with the sign of its rate, and needs the drag coefficients of that side,
        unless the rate is a rounding error.
        """
        self.size = [max(size, abs(x)) for size, x in zip(self.size, self.y, strict=True)]
        self.terms: State = self.model.sizes(self.numbers, self.time, self.y)
        self.rate = self.rates(0.0, self.y)
        before = dict(self.direction)
        for name, i in self.model.MONITORED.items():
            leads = self.y[i] or (0.0 if self.is_rounding(i, self.rate[i]) else self.rate[i])
            self.direction[name] = copysign(1.0, leads) if leads else before[name]
        if self.direction != before:
            self.find_numbers()
            self.begin()  # the rates of other velocities may have changed

    def is_rounding(self, i: int, rate: float) -> bool:
        """Return True if the rate of a state is a rounding error of its terms."""
        return abs(rate) <= 16.0 * _EPSILON * self.terms[i]

    def move(self, rest: float) -> bool:
        """Move for a time. Return False if the motion overflows or needs too many substeps."""
        h, shortest, total = rest, min(_SHORTEST, _SHORTEST * rest), rest
        per_second = MOST_SUBSTEPS / max(rest, 1.0)
        while rest > 0.0 and h > shortest and self.tried < MOST_AT_ONCE + per_second * (total - rest):
            left = self.until - self.time
            h = min(h, rest, left)
            y, error = self.trial(h)
            if error > 1.0:
                h *= max(0.1, 0.9 * error**-0.125)
                continue
            length, reversing = self.reversal(h, y)
            if reversing is None and length < h:
                h = length
                continue
            if reversing is not None:
                y, _ = self.trial(length)
                y[reversing] = 0.0
            self.y, self.time, rest = y, self.time + length, rest - length
            self.heading = self.turned(y, self.heading)
            if length == left:
                self.reverse_rotor()
            self.begin()
            h *= min(6.0, 0.9 * (error or 1e-9) ** -0.125)
        return rest == 0.0

    def trial(self, h: float) -> tuple[State, float]:
        """Return the states after a substep, and the largest error relative to the tolerance."""
        self.tried += 1
        slopes = [self.rate]
        for node, weights in _STAGES:
            change = self.combined(weights, slopes)
            slopes.append(self.rates(node * h, [x + h * d for x, d in zip(self.y, change, strict=True)]))
        y = [x + h * d for x, d in zip(self.y, self.combined(_END, slopes), strict=True)]
        if not all(isfinite(x) for x in y):
            return y, inf
        return y, self.error(h, y, self.combined(_FIFTH, slopes), self.combined(_THIRD, slopes))

    def error(self, h: float, y: State, fifth: State, third: State) -> float:
        """Return the largest error of a substep relative to the tolerance. `fifth` and `third` estimate its rate."""
        error = self.swing(y)
        own = zip(self.size, y, self.terms, strict=True)
        sizes = [max(size, abs(x)) + h * terms for size, x, terms in own]
        for group in self.model.GROUPS:
            least = _SHARE * max(sizes[i] for i in group)
            for i in group:
                sizes[i] = max(sizes[i], least)
        for size, e, e_3 in zip(sizes, fifth, third, strict=True):
            a, b = (h * x / size / _TOLERANCE if size else 0.0 for x in (e, e_3))
            if a * a > 0.0:
                error = max(error, a * a / sqrt(a * a + 0.01 * b * b))
        return error

    def combined(self, weights: Mapping[int, float], slopes: Sequence[State]) -> State:
        """Return a weighted sum of slopes."""
        total = [0.0] * len(self.y)
        for n, weight in weights.items():
            total = [x + weight * slope for x, slope in zip(total, slopes[n], strict=True)]
        return total

    def reversal(self, h: float, y: State) -> tuple[float, int | None]:
        """Return the time and the place of the first velocity that reverses in a substep with the states y at its end.

        Without a reversal, this is h and None. A shorter time and None ask for another trial, because the direction of
        a velocity that begins at 0 was the wrong one.
        """
        found: tuple[float, int | None] = h, None
        rates = self.rates(h, y)
        for name, i in self.model.MONITORED.items():
            sign, length = self.direction[name], found[0]

            def velocity(t: float, i: int = i, sign: float = sign) -> float:
                return sign * self.trial(t)[0][i]

            def slope(t: float, i: int = i, sign: float = sign) -> float:
                return sign * self.rates(t, self.trial(t)[0])[i]

            if self.y[i] and self.rate[i] * sign < 0.0 < rates[i] * sign and y[i] * sign > 0.0:
                length = _root(slope, length, self.rate[i] * sign, rates[i] * sign)  # where it is slowest
            reached = y[i] * sign if length == h else velocity(length)
            if reached < -_EPSILON * max(self.size[i], abs(y[i])):
                if self.y[i]:
                    found = _root(velocity, length, self.y[i] * sign, reached), i
                    continue
                if self.is_rounding(i, self.rate[i]):
                    if self.is_rounding(i, reached / h):  # forces that cancel each other leave no direction
                        continue
                    self.direction[name] = -sign
                    self.find_numbers()
                    self.rate = self.rates(0.0, self.y)
                return 0.5 * h, None
        return found

    # ---- Attitude ----

    def named(self, y: State) -> dict[str, float]:
        """Return the states of the model by their names."""
        return dict(zip(self.model.STATES, y, strict=True))

    def turned(self, y: State, heading: float) -> float:
        """Return the heading of the direction beside the nose, by at most half a turn from a heading before."""
        return turned_heading(self.named(y), heading) if self.model.QUATERNION else heading

    def swing(self, y: State) -> float:
        """Return an error above 1 if the direction beside the nose could have passed the vertical on either side."""
        if not self.model.QUATERNION:
            return 0.0
        (a, b), (c, d) = beside_nose(self.named(self.y)), beside_nose(self.named(y))
        swung = hypot(c - a, d - b) / max(0.9 * hypot(a, b), 1e-9)
        return min(swung, 1e9) ** 8

    def end(self) -> dict[str, float]:
        """Return the states of the vehicle by their names."""
        y = self.named(self.y)
        found = {name: x for name, x in y.items() if name in self.values}
        found |= {name: self.values[name] + y[name] for name in self.model.OFFSETS if name in self.values}
        found |= self.model.lagging(self.numbers, self.time)
        if self.model.QUATERNION:
            e, a, b, c = (y[name] for name in self.model.QUATERNION)
            length = (e * e + a * a + b * b + c * c) ** 0.5
            found |= {name: y[name] / length for name in self.model.QUATERNION}
            found["psi"] = heading(y, self.heading)
        return found


# ---- Dead time -------------------------------------------------------------------------------------------------------


class Change(NamedTuple):
    """A change of the commands that waits for the dead time.

    It has the time that it still takes. The time at which it arrives would have fewer digits late in a run.
    """

    remaining: float
    """The time until it arrives, s."""
    commands: dict[str, float]
    lost: float = 0.0
    """The rounding error of the remaining time, which would add up over many small steps."""

    def after(self, h: float) -> "Change":
        """Return the same change h seconds later."""
        passed = self.lost - h
        remaining = self.remaining + passed
        return Change(remaining, self.commands, passed - (remaining - self.remaining))


class Memory:
    """What a vehicle keeps from step to step beside its states, in the Python step: commands and the current.

    These are the commands that act, the changes that wait for the dead time, and the current during the step before.
    Before its first command, every thruster is still. For a vehicle without a dead time, nothing waits.
    """

    def __init__(
        self, starts: Mapping[str, float], acting: Mapping[str, str], before: Mapping[str, str] | None = None
    ) -> None:
        """Begin with the commands at the start. `acting` are the names of the commands that act after the dead time.

        There are none without a dead time. `before` are the names of the components of the current during the step
        before, if a current that changes passes the vehicle.
        """
        self.names = acting
        self.names_before = before or {}
        self.current: dict[str, float] = {}
        """The current during the step before, by those names; empty before the first step."""
        self.acting = {name: starts[name] for name in acting}
        """The commands that act."""
        self.waiting: list[Change] = []
        """The changes that have not arrived yet. Their remaining times never fall."""

    def step(
        self, vehicle: Any, inputs: Mapping[str, float], state: Mapping[str, float], t: float, h: float
    ) -> dict[str, float]:
        """Return the states of a vehicle after h > 0 seconds from time t with the inputs held.

        Raises ValueError when more than MOST_WAITING changes wait. After that, and after a motion that overflows,
        `waiting` is the same as before the step.
        """
        current = {before: inputs[name] for name, before in self.names_before.items()}
        before, passed, after = self.current or current, 0.0, dict(state)
        line = copy(self)
        if self.names:
            line._send({name: inputs[name] for name in self.names}, vehicle["T_d"])
        while passed < h:
            line._receive(t, passed)
            until = min(h, line.waiting[0].remaining) if line.waiting else h
            after = vehicle.step({**inputs, **before, **line.delayed}, after, until - passed)
            before, passed = current, until
        line.waiting = [change.after(h) for change in line.waiting]
        line._receive(t + h)
        if all(map(isfinite, after.values())):
            self.acting, self.waiting, self.current = line.acting, line.waiting, current
        return after

    @property
    def delayed(self) -> dict[str, float]:
        """The commands that act, by the names of the variables for them."""
        return {self.names[name]: value for name, value in self.acting.items()}

    def _send(self, commands: dict[str, float], dead_time: float) -> None:
        if commands == (self.waiting[-1].commands if self.waiting else self.acting):
            return
        kept = [change for change in self.waiting if change.remaining < dead_time]
        if len(kept) == MOST_WAITING:
            raise ValueError(TOO_MANY_WAIT)
        self.waiting = [*kept, Change(dead_time, commands)]

    def _receive(self, t: float, passed: float = 0.0) -> None:
        while self.waiting and self.waiting[0].remaining - passed <= 4.0 * _EPSILON * (1.0 + abs(t)):
            self.acting, self.waiting = self.waiting[0].commands, self.waiting[1:]


# ---- Numbers ---------------------------------------------------------------------------------------------------------


def formula_name(variable: str) -> str:
    """Return the name that a variable has in the equation: der_x for der(x). Others have their own."""
    return variable.replace("(", "_").removesuffix(")")


def _root(f: Callable[[float], float], b: float, f_0: float, f_b: float) -> float:
    """Return where a function changes its sign between 0 and b, by the Illinois method."""
    a, f_a = 0.0, f_0
    for _ in range(100):
        x = b - f_b * (b - a) / (f_b - f_a) if f_b else b
        if not min(a, b) < x < max(a, b):
            break
        f_x = f(x)
        if (f_x < 0.0) == (f_b < 0.0):
            f_a *= 0.5
        else:
            a, f_a = b, f_b
        b, f_b = x, f_x
    return b if abs(f_b) <= abs(f_a) else a


def beside_nose(entries: Mapping[str, float]) -> list[float]:
    """Return the parts north and east of the direction beside the nose, for the entries of the rotation matrix."""
    (a, b, c) = BESIDE_NOSE
    return [a * entries[f"R_{n}1"] + (b * entries[f"R_{n}2"] + c * entries[f"R_{n}3"]) for n in (1, 2)]


def turned_heading(entries: Mapping[str, float], near: float) -> float:
    """Return the heading of the direction beside the nose that differs from another heading by at most half a turn."""
    north, east = beside_nose(entries)
    return unwrapped(atan2(east, north), near)


def heading(entries: Mapping[str, float], near: float) -> float:
    """Return the heading of the nose for a rotation matrix, in the turn that follows from a heading before."""
    return unwrapped(atan2(entries["R_21"], entries["R_11"]), turned_heading(entries, near))


def unwrapped(angle: float, near: float) -> float:
    """Return the angle that differs from an angle by whole turns and is the nearest to another one."""
    turns = (near - angle) / tau
    return angle + tau * round(turns) if isfinite(turns) else nan


def cubic(f: Any, g: Any, a: Any, b: Any, t: Any) -> Any:
    """Return the cubic between 0 and 1 at t. Its values at the ends are f and g, and its slopes there are a and b."""
    return f + t * (a + t * (3.0 * (g - f) - 2.0 * a - b + t * (a + b - 2.0 * (g - f))))


def interpolated(x: Any, table: Sequence[Sequence[float]]) -> Any:
    """Return the value at x of cubics between points. The table has the places, values and slopes of the points."""
    places, values, slopes = table
    n = min(max(bisect_right(places, x) - 1, 0), len(places) - 2)
    h = places[n + 1] - places[n]
    return cubic(values[n], values[n + 1], h * slopes[n], h * slopes[n + 1], (x - places[n]) / h)
