"""Motion by Taylor series, exact up to rounding (standard library only).

For what has no closed form: lag and coupling, and the track of a turn.

Between the reversals of its axes all terms of the motion are polynomials of the state. With v = sum of v_n t^n

    v_(n+1) = (C_n - B v_n - A (v^2)_n) / (n + 1),      (v^2)_n = sum of v_j v_(n-j),  A of the direction's sign

and likewise the force of a lag, C_n = D (-1/T)^n / n!, the coupling's products, the direction E = e^(i turn),
E' = i r E, and the track P' = (u + i v) E. The coefficients tell how far they reach, as in Jorba and Zou, A software
package for the numerical integration of ODEs by means of high-order Taylor methods (2005). A reversal is a root of the
polynomial: the piece is cut there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, exp, expm1, hypot, inf, isfinite, nan, remainder, sin
from math import tau as full_turn

from .riccati import Riccati

ORDER = 20
"""Of the polynomials: more costs more than the longer pieces save."""
MOST_PIECES = 10_000
"""In a step: 1,000 s at rates of 5/s that never settle, or 20,000 rad. Beyond, the motion is not computed."""

_EPS = 2.0**-53
_HALVINGS = 20  # down to a millionth of a piece: there a velocity that just touches zero has no drag worth a sign
_LEAST = 2.0**-_HALVINGS


@dataclass(frozen=True)
class Coupling:
    """u' += c_u v r, v' -= c_v u r, r' -= c_r u v, with c_u = M_v/M_u, c_v = M_u/M_v, c_r = (M_v - M_u)/M_r."""

    c_u: float
    c_v: float
    c_r: float


@dataclass(frozen=True)
class Fade:
    """A part of the force of each axis, as acceleration: what it is at the start fades into what it becomes."""

    rate: float
    now: tuple[float, ...]
    then: tuple[float, ...]

    def late(self, t: float) -> list[float]:
        """What differs after t seconds from what it becomes."""
        fall = exp(-self.rate * t)
        return [(a - b) * fall for a, b in zip(self.now, self.then, strict=True)]

    def value(self, t: float) -> list[float]:
        """What it is after t seconds, from the nearer end: next to nothing is left of two large ones otherwise."""
        if (x := self.rate * t) > 0.7:
            return [b + d for b, d in zip(self.then, self.late(t), strict=True)]
        return [a + (a - b) * expm1(-x) for a, b in zip(self.now, self.then, strict=True)]


@dataclass(frozen=True)
class Flow:
    """What moves: its axes, what fades of their forces, how they are coupled; and which of the axes are u, v and r."""

    axes: tuple[Riccati, ...]
    fades: tuple[Fade, ...] = ()
    coupling: Coupling | None = None
    u: int | None = None
    v: int | None = None
    r: int | None = None

    @property
    def is_free(self) -> bool:
        """Whether each axis has a closed form."""
        return not self.fades and not self.coupling


@dataclass(frozen=True)
class Moved:
    """Where a step leads: velocities, distances (angles) along the axes, and the track in the frame of its start."""

    velocities: tuple[float, ...]
    distances: tuple[float, ...]
    track: complex
    """Ahead + i to starboard."""


def advance(flow: Flow, velocities: Sequence[float], h: float) -> Moved:
    """The motion after h > 0 seconds; not finite where it cannot be computed."""
    v, gone = list(velocities), [0.0] * len(velocities)
    track, turn, way_so_far = 0j, 0.0, 0.0
    done, tau = 0.0, h
    for _ in range(MOST_PIECES):
        rest = h - done
        push = [axis.C for axis in flow.axes]
        for fade in flow.fades:
            push = [a + b for a, b in zip(push, fade.value(done), strict=True)]
        fades = [(fade.rate, fade.late(done)) for fade in flow.fades]
        if all(settled := _settled(flow, push, fades, v)):
            angle = v[flow.r] * rest if flow.r is not None else 0.0
            if not isfinite(turn + angle):
                break
            arc = sin(0.5 * angle) / (0.5 * angle) if angle else 1.0  # chord by arc
            track += _planar(flow, v) * rest * arc * _direction(turn + 0.5 * angle)
            return Moved(tuple(v), tuple(s + x * rest for s, x in zip(gone, v, strict=True)), track)
        if flow.is_free and flow.r is not None and not isfinite(flow.axes[flow.r].distance(v[flow.r], rest)):
            break
        if flow.is_free and (left := _straight_rest(flow, v, rest, way_so_far)) is not None:
            return Moved(tuple(v), tuple(gone), track + left * _direction(turn))
        piece = _Piece(flow, push, fades, v, settled, min(rest, tau))
        if piece.reach == 0.0:
            tau = 1e-3 * piece.tau
            if tau == 0.0:
                break
            continue
        length = piece.cut()
        end = piece.tau * length
        v = piece.velocities(length)
        chord = piece.track(length)
        track += chord * _direction(turn)
        way_so_far += hypot(chord.real, chord.imag)
        way = piece.distances(length)
        gone = [s + x for s, x in zip(gone, way, strict=True)]
        if not all(map(isfinite, (*gone, *v))):
            break
        if flow.r is not None:
            turn = remainder(turn + way[flow.r], full_turn)  # rounded as a small angle
        if end >= rest:
            return Moved(tuple(v), tuple(gone), track)
        done += end
        tau = 2.0 * piece.tau * piece.reach
    return Moved((nan,) * len(v), (nan,) * len(v), complex(nan, nan))


def _straight_rest(flow: Flow, v: Sequence[float], rest: float, way: float) -> complex | None:
    """What is left of the track of a free motion, where it is straight or nothing; None elsewhere.

    A motion that fades away never settles, but no longer matters at some time. Ways there and back are no such end.
    """
    if any(flow.axes[n].reversal_time(v[n]) < rest for n in (flow.u, flow.v, flow.r) if n is not None):
        return None
    left, angle = [flow.axes[n].distance(v[n], rest) if n is not None else 0.0 for n in (flow.u, flow.v)], 0.0
    if flow.r is not None:
        angle = flow.axes[flow.r].distance(v[flow.r], rest)
    if not abs(angle) < 0.5 * _EPS and max(map(abs, left)) > _EPS / 8.0 * way:
        return None
    return complex(*left)


def _direction(angle: float) -> complex:
    return complex(cos(angle), sin(angle))


def _planar(flow: Flow, v: Sequence[float]) -> complex:
    return complex(v[flow.u] if flow.u is not None else 0.0, v[flow.v] if flow.v is not None else 0.0)


def _settled(
    flow: Flow, push: Sequence[float], fades: Sequence[tuple[float, Sequence[float]]], v: Sequence[float]
) -> list[bool]:
    """Of each axis, whether what is left of its acceleration is rounding of its terms; of coupled ones all or none."""
    rates, sizes, settled = [], [], []
    for n, (axis, x) in enumerate(zip(flow.axes, v, strict=True)):
        A, B = axis.drag(x)
        terms = [push[n], -B * x, -A * abs(x) * x]
        rates.append(sum(terms))
        sizes.append(sum(map(abs, terms)))
    coupled: tuple[int, ...] = ()
    if flow.coupling and flow.u is not None and flow.v is not None and flow.r is not None:
        coupled = flow.u, flow.v, flow.r
        k, (u, w, r) = flow.coupling, (v[n] for n in coupled)
        for n, term in zip(coupled, (k.c_u * w * r, -k.c_v * u * r, -k.c_r * u * w), strict=True):
            rates[n] += term
            sizes[n] += abs(term)
    for n, (rate, size) in enumerate(zip(rates, sizes, strict=True)):
        settled.append(all(abs(x) <= 16.0 * _EPS * size for x in (rate, *(d[n] for _, d in fades))))
    are_coupled_settled = all(settled[n] for n in coupled)
    return [is_one and (are_coupled_settled or n not in coupled) for n, is_one in enumerate(settled)]


class _Piece:
    """The polynomials of a piece that begins at the velocities v, in time by tau; they hold for 0 ... reach."""

    def __init__(
        self,
        flow: Flow,
        push: Sequence[float],
        fades: Sequence[tuple[float, Sequence[float]]],
        v: Sequence[float],
        settled: Sequence[bool],
        tau: float,
    ) -> None:
        self.flow, self.tau = flow, tau
        self.c = [[x] for x in v]
        self.E, self.P = [1 + 0j], [0j]
        signs = [0.0] * len(v)
        falls = [1.0 for _ in fades]
        for n in range(ORDER):
            changes = []
            for a, (axis, c) in enumerate(zip(flow.axes, self.c, strict=True)):
                signs[a] = signs[a] or (c[n] > 0.0) - (c[n] < 0.0)
                A, B = axis.drag(signs[a])
                force = push[a] if n == 0 else sum(d[a] * fall for (_, d), fall in zip(fades, falls, strict=True))
                changes.append(force - B * c[n] - signs[a] * A * _product(c, c, n))
            falls = [fall * -rate * tau / (n + 1) for (rate, _), fall in zip(fades, falls, strict=True)]
            W = self._planar_product(n)
            E = 0j
            if flow.r is not None:
                r = self.c[flow.r]
                E = 1j * sum(r[j] * self.E[n - j] for j in range(n + 1))
                if flow.coupling and flow.u is not None and flow.v is not None:
                    u, w, k = self.c[flow.u], self.c[flow.v], flow.coupling
                    changes[flow.u] += k.c_u * _product(w, r, n)
                    changes[flow.v] -= k.c_v * _product(u, r, n)
                    changes[flow.r] -= k.c_r * _product(u, w, n)
            for c, change, is_settled in zip(self.c, changes, settled, strict=True):
                c.append(0.0 if is_settled else tau * change / (n + 1))
            self.E.append(tau * E / (n + 1))
            self.P.append(tau * W / (n + 1))
        ends = [x for c in self.c for x in c[-2:]]
        ends += [x for p in (self.E, self.P) for z in p[-2:] for x in (z.real, z.imag)]
        self.reach = 0.0  # where it overflows
        if all(map(isfinite, ends)):
            self.reach = min(1.0, *(_reach(c) for c in self.c), _reach([hypot(z.real, z.imag) for z in self.E]))

    def _planar_product(self, n: int) -> complex:
        flow, total = self.flow, 0j
        for index, unit in ((flow.u, 1.0), (flow.v, 1j)):
            if index is not None:
                c = self.c[index]
                total += unit * sum(c[j] * self.E[n - j] for j in range(n + 1))
        return total

    def cut(self) -> float:
        """The length over which it is taken: up to the first reversal, where that velocity becomes 0 exactly."""
        self.at_rest: int | None = None
        length = self.reach
        for a, c in enumerate(self.c):
            end, reverses = _first_root(c, length)
            if reverses or end < length:
                length, self.at_rest = end, a if reverses else self.at_rest if end == length else None
        return length

    def velocities(self, t: float) -> list[float]:
        found = [_value(c, t) for c in self.c]
        if self.at_rest is not None:
            found[self.at_rest] = 0.0
        return found

    def distances(self, t: float) -> list[float]:
        return [self.tau * t * _value([x / (n + 1) for n, x in enumerate(c)], t) for c in self.c]

    def track(self, t: float) -> complex:
        total = 0j
        for p in reversed(self.P):
            total = total * t + p
        return total


def _product(a: Sequence[float], b: Sequence[float], n: int) -> float:
    """Coefficient n of a product."""
    return sum(a[j] * b[n - j] for j in range(n + 1))


def _value(c: Sequence[float], t: float) -> float:
    """c[0] and what is added to it."""
    change = 0.0
    for x in c[:0:-1]:
        change = (change + x) * t
    return c[0] + change


def _reach(c: Sequence[float]) -> float:
    """How far the last two terms stay below rounding of one of the first three that are not zero."""
    first = next((n for n, x in enumerate(c) if x != 0.0), 0)

    def within(n: int) -> float:
        if c[n] == 0.0:
            return inf
        return max(((_EPS * abs(c[k] / c[n])) ** (1.0 / (n - k)) for k in range(first, min(first + 3, n))), default=0.0)

    return min(within(len(c) - 2), within(len(c) - 1))


def _first_root(c: Sequence[float], length: float) -> tuple[float, bool]:
    """How far a polynomial goes before its sign changes, at most the length; and whether it is zero there."""
    k = next((n for n, x in enumerate(c) if x != 0.0), None)
    if k is None:
        return length, False
    shortest = length * _LEAST
    while True:
        sizes = [abs(x) * length**n for n, x in enumerate(c)]
        if sizes[k] > sum(sizes[k + 1 :]) or length <= shortest:
            return length, False
        if k == 0 and sizes[1] > sum(n * size for n, size in enumerate(sizes[2:], 2)):
            value = _value(c, length)
            if value != 0.0 and (value > 0.0) == (c[0] > 0.0):  # a product would underflow
                return length, False
            return _root(c, length), True
        length *= 0.5


def _root(c: Sequence[float], length: float) -> float:
    """The one root of a polynomial that only rises or only falls, by Newton's method within the bounds known."""
    low, high, t = 0.0, length, 0.5 * length
    for _ in range(60):
        value = _value(c, t)
        if value == 0.0:
            return t
        low, high = (t, high) if (value > 0.0) == (c[0] > 0.0) else (low, t)
        slope = 0.0
        for n in range(len(c) - 1, 0, -1):
            slope = slope * t + n * c[n]
        new = t - value / slope if slope != 0.0 else low  # it may underflow
        if not low < new < high:
            new = 0.5 * (low + high)
        if new == t or high - low <= 2.0**-52 * high:
            return new
        t = new
    return t
