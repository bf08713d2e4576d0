"""The motion with lag and coupling to some 30 digits, by extrapolation of the midpoint rule (Gragg, Bulirsch, Stoer).

It shares neither code nor method with rov_fmu/equation/: it uses no series and no closed form. The equations of
verification/references/equations.py are integrated while the signs of the velocities are held. A step ends where a
velocity reverses, and Newton's method finds that time.
"""

from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import gmpy2
from gmpy2 import mpfr
from mpmath import mp

from rov_fmu.vehicle.vehicle import Vehicle

from .equations import Equations, equations

Number = Any  # a gmpy2 number
Rates = Callable[[Sequence[Number]], list[Number]]
BITS = 260
_DIVISIONS = tuple(range(2, 34, 2))
_TOLERANCE = 1e-33  # of a step
_SETTLED = 1e-42


Ended = tuple[dict[str, Number], dict[str, Number], dict[str, Number]]
"""The end of a motion: the states, with the pose relative to the start, the largest velocity of each axis, and the
length of the path of each coordinate, back and forth."""


class _System:
    """The equations in numbers of gmpy2. The heading of a state is relative to the start."""

    def __init__(self, equations: Equations, psi: float) -> None:
        self.held, self.psi = equations, mpfr(psi)
        self.axes, self.lags = [*self.held.axes.values()], [*self.held.lags.values()]
        self.names, self.lagging = [*equations.axes], [f"F_{name}" for name in equations.lags]
        self.first_force = len(self.names) + 4

    def rates(self, signs: Sequence[int]) -> Rates:
        """Return the function that gives the time derivatives, with the drag for velocities of these signs."""
        return lambda y: self.held.derivatives(y, lambda turned: gmpy2.sin_cos(self.psi + turned), signs)

    def first_step(self, y: Sequence[Number]) -> Number:
        """Return a time (s) in which little changes, because shortening a long first step is expensive."""
        rates = [1 / lag.T for lag in self.lags] + [abs(V) for V in self.held.level(y)]
        largest = [abs(F) + abs(lag.target) for F, lag in zip(y[self.first_force :], self.lags, strict=True)]
        for axis, V in zip(self.axes, y, strict=False):
            force = abs(axis.constant) + sum(abs(gain) * F for gain, F in zip(axis.lagging, largest, strict=True))
            drags = (axis.ahead, axis.astern)
            rates += [B + 2 * A * abs(V) + gmpy2.sqrt(A * force) for A, B in drags] + [gmpy2.sqrt(force)]
        if self.held.coupled:
            u, v, r = (self.held.axes[name].inertia for name in ("u", "v", "r"))
            speed = sum(abs(V) for V in y[: len(self.names)])
            rates += [abs(factor) * speed for factor in (v / u, u / v, (v - u) / r)]
        return mpfr(0.1) / (sum(rates) or mpfr("1e-9"))

    def is_settled(self, rates: Sequence[Number], y: Sequence[Number]) -> bool:
        """Return True when every remaining change is far below the required precision."""
        sizes = [
            abs(axis.constant) + abs(V) * axis.ahead[1] + V**2 * axis.ahead[0]
            for axis, V in zip(self.axes, y, strict=False)
        ]
        return all(abs(rate) <= _SETTLED * size for rate, size in zip(rates, sizes, strict=False)) and all(
            abs(lag.target - F) <= _SETTLED * abs(lag.target)
            for lag, F in zip(self.lags, y[self.first_force :], strict=True)
        )


def real(number: Any) -> Number:
    """Convert a number, which may be one of mpmath, to gmpy2."""
    return mpfr(mp.nstr(mp.mpf(number), 90))


_NUMBERS = SimpleNamespace(mpf=real, zero=mpfr(0), one=mpfr(1), inf=gmpy2.inf(), fsum=sum, sin=gmpy2.sin, cos=gmpy2.cos)
"""The numbers of gmpy2, behind the names that mpmath uses."""


def leap(rates: Rates, y: Sequence[Number], start: Sequence[Number], h: Number) -> tuple[list[Number], Number]:
    """Return the state after h and its relative error; `start` are the rates at y."""
    rows: list[list[list[Number]]] = []
    for divisions in _DIVISIONS:
        step = h / divisions
        before, now = list(y), [a + step * b for a, b in zip(y, start, strict=True)]
        twice = 2 * step
        for _ in range(divisions - 1):
            before, now = now, [a + twice * b for a, b in zip(before, rates(now), strict=True)]
        row = [now]
        for k, coarser in enumerate(reversed(_DIVISIONS[: len(rows)]), 1):
            weight = mpfr(1) / ((mpfr(divisions) / coarser) ** 2 - 1)
            row.append([a + (a - b) * weight for a, b in zip(row[-1], rows[-1][k - 1], strict=True)])
        rows.append(row)
    best, second = rows[-1][-1], rows[-1][-2]
    sizes = [abs(a) + abs(b) + abs(h * c) for a, b, c in zip(y, best, start, strict=True)]
    errors = [abs(a - b) / size for a, b, size in zip(best, second, sizes, strict=True) if size]
    return best, max(errors, default=mpfr(0))


def growth(error: Number, tolerance: float) -> Number:
    """Return the factor of the length of the next step after a step with this error."""
    if not gmpy2.is_finite(error):
        return mpfr(0.1)
    ideal = mpfr(0.9) * (mpfr(tolerance) / error) ** (mpfr(1) / 31) if error else mpfr(4)
    return min(mpfr(4), max(mpfr(0.1), ideal))


def _signs(
    rates_with: Callable[[Sequence[int]], Rates], y: Sequence[Number], places: Sequence[int], h: Number
) -> tuple[list[int], Number]:
    """Return the signs of some states in the step, and a time after which one that is zero has its sign.

    The sign of one may choose that of another: of a rotor that begins to turn, and of the vehicle that it pushes.
    """
    signs, before = [-1 if y[a] < 0 else 1 for a in places], list[int]()
    soon = h / 2**24
    while any(y[a] == 0 for a in places) and signs != before:
        before, rates = signs, rates_with(signs)
        later = leap(rates, y, rates(y), soon)[0]
        signs = [sign if y[a] != 0 else -1 if later[a] < 0 else 1 for a, sign in zip(places, signs, strict=True)]
    return signs, soon


def until_reversal(
    rates_with: Callable[[Sequence[int]], Rates], y: list[Number], places: Sequence[int], h: Number, tolerance: float
) -> tuple[list[Number], Number, Number]:
    """Return the state after h or at the first reversal of the states at these places, the time, and the next h.

    The time is 0 where h was too long. `rates_with` gives the rates while these states have some signs.
    """
    signs, soon = _signs(rates_with, y, places, h)
    rates = rates_with(signs)
    end, error = leap(rates, y, rates(y), h)
    taken, size = h, h * growth(error, tolerance)
    if not error <= tolerance:
        return y, mpfr(0), size
    for a, sign in zip(places, signs, strict=True):
        low = soon if y[a] == 0 else mpfr(0)
        high = taken if sign * end[a] < 0 else _dip(rates, y, end, a, sign, taken)
        if high is not None and high > low:
            taken, end = _reversal(rates, y, a, low, high)
    return end, taken, size


def _reversal(rates: Rates, y: Sequence[Number], a: int, low: Number, high: Number) -> tuple[Number, list[Number]]:
    """Return the time between `low` and `high` at which the velocity of axis `a` is zero, and the state then."""
    start = rates(y)
    t, sign = (low + high) / 2, leap(rates, y, start, high)[0][a] > 0
    for _ in range(400):
        end = leap(rates, y, start, t)[0]
        low, high = (low, t) if (end[a] > 0) == sign else (t, high)
        slope = rates(end)[a]
        new = t - end[a] / slope if slope else (low + high) / 2
        if abs(new - t) <= abs(t) * mpfr(2) ** (80 - BITS):
            break
        t = new if low < new < high else (low + high) / 2
    end[a] = mpfr(0)
    return t, end


def _dip(rates: Rates, y: Sequence[Number], end: Sequence[Number], a: int, sign: int, h: Number) -> Number | None:
    """Return a time at which a velocity with the same sign at both ends has the other sign; None if there is none."""
    start, last = rates(y), rates(end)
    if not (sign * start[a] < 0 < sign * last[a]) or min(abs(y[a]), abs(end[a])) > h * max(abs(start[a]), abs(last[a])):
        return None
    low, high = mpfr(0), h
    for _ in range(60):
        t = (low + high) / 2
        middle = leap(rates, y, start, t)[0]
        if sign * middle[a] < 0:
            return t
        low, high = (t, high) if sign * rates(middle)[a] < 0 else (low, t)
    return None


def integrate(rov: Vehicle, inputs: Mapping[str, float], state: Mapping[str, float], h: float) -> Ended:
    """Return the end of the motion after h seconds with the inputs held, without the current."""
    with gmpy2.context(gmpy2.get_context(), precision=BITS):
        system = _System(equations(rov, inputs, _NUMBERS), state.get("psi", 0.0))
        n = len(system.names)
        y = [mpfr(state[name]) for name in system.names] + [mpfr(0)] * 4
        y += [mpfr(state[name]) for name in system.lagging]
        fastest, paths = [abs(x) for x in y[:n]], [mpfr(0)] * 3
        remaining = mpfr(h)
        size = system.first_step(y)
        while remaining > 0:
            size = min(size, remaining)
            start = system.rates([-1 if V < 0 else 1 for V in y[:n]])(y)
            if system.is_settled(start, y):
                y = _steady_end(system, y, start, remaining)
                paths = [path + abs(remaining * rate) for path, rate in zip(paths, _pace(start, n), strict=True)]
                break
            end, taken, size = until_reversal(system.rates, y, range(n), size, _TOLERANCE)
            moved = [b - a for a, b in zip(y[n : n + 4], end[n : n + 4], strict=True)]
            steps = (gmpy2.hypot(moved[0], moved[1]), abs(moved[2]), abs(moved[3]))
            paths = [path + step for path, step in zip(paths, steps, strict=True)]
            y, remaining = end, remaining - taken
            fastest = [max(a, abs(b)) for a, b in zip(fastest, y, strict=False)]
        names = [*system.names, "x", "y", "z", "psi", *system.lagging]
        planar, depth, turn = map(plain, paths)
        return (
            {name: plain(x) for name, x in zip(names, y, strict=True)},
            {name: plain(x) for name, x in zip(system.names, fastest, strict=True)},
            {"x": planar, "y": planar, "z": depth, "psi": turn},
        )


def _pace(rates: Sequence[Number], n: int) -> tuple[Number, Number, Number]:
    """Return the horizontal speed, the rate of the depth and the rate of the heading."""
    return gmpy2.hypot(rates[n], rates[n + 1]), rates[n + 2], rates[n + 3]


def _steady_end(system: _System, y: Sequence[Number], rates: Sequence[Number], h: Number) -> list[Number]:
    """Return the state after h seconds of steady motion, straight or on a circle."""
    n = len(system.names)
    r, end = rates[n + 3], list(y)
    north, east = rates[n], rates[n + 1]
    if r == 0:
        end[n], end[n + 1] = y[n] + north * h, y[n + 1] + east * h
    else:  # the velocity (x', y') turns by r h
        s, c = gmpy2.sin_cos(r * h)
        end[n] += (north * s - east * (1 - c)) / r
        end[n + 1] += (east * s + north * (1 - c)) / r
    end[n + 2] += rates[n + 2] * h
    end[n + 3] += r * h
    end[system.first_force :] = [lag.target for lag in system.lags]
    return end


def plain(number: Number) -> Any:
    """Convert a number of gmpy2 to mpmath."""
    return mp.mpf(f"{number:.70e}")
