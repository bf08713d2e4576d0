"""A step of a vehicle by Taylor series, exact up to rounding for any length (standard library only).

Between reversals the motion is y_i' = k_i + sum of L_ij y_j + sum of Q_ijk y_j y_k (equation.py). In the series
y(t) = sum of c_n t^n, a product of two states is a Cauchy product. So each coefficient follows from those before it:

    (n + 1) c_i,n+1 = k_i (for n = 0) + sum of L_ij c_j,n + sum of Q_ijk (c_j,0 c_k,n + ... + c_j,n c_k,0)

A step consists of pieces, and each piece has its own series. A piece is as long as its last coefficients allow (Jorba
and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, 2005), and it
ends at the first reversal of a monitored velocity. States that have settled are constant in the series. Once all of
them have settled, the rest of the step is straight or circular motion.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import atan2, copysign, hypot, inf, isfinite, nan, prod, sin, tau
from operator import mul

from .attitude import BESIDE_NOSE, QUATERNION, beside_nose, turned_heading, unwrapped
from .equation import Equation
from .expression import Expression, compiled

ORDER = 20
"""The order of the series. A higher order costs more than its longer pieces save. The C code has its own order."""
MOST_PIECES = 100_000
"""The largest number of pieces of a step. A vehicle that swings without linear drag never settles, and each swing takes
a few pieces. A step that needs more is not computed. The C code, which is much faster, has its own number."""

_EPSILON = 2.0**-53  # half a unit in the last place of 1
_FADED = 1e-40  # a state below this share of its largest size has no effect any more, whatever the drag is
_RATIO = 2.0 ** (-57 / (ORDER + 1))  # its powers beyond ORDER are below rounding
_SMALLEST = 1e-322  # rounding keeps smaller numbers from fading any further
_MOST_PARTS = 4096  # of a piece, between which the attitude is computed
_SHORTEST = 2.0**-20  # within this share of a piece, the drag of a velocity that just touches 0 is negligible

Series = Sequence[Sequence[float]]
"""The coefficients of each state."""


class Table:
    """An equation in the form that a step needs: states and coefficients have places instead of names."""

    def __init__(self, equation: Equation) -> None:
        self.equation, self.states = equation, equation.states
        self.place = place = {name: n for n, name in enumerate(self.states)}
        self.monitored = [place[name] for name in equation.monitored]
        self.rows: list[list[tuple[int, tuple[int, ...]]]] = []
        """For each state, the terms of its rate: the place of the coefficient, and the places of the factors."""
        self.velocities: list[int | None] = []
        """For each coefficient, the place of the velocity on whose direction it depends, or None."""
        formulas: dict[str, Expression] = {}
        for terms in equation.rows.values():
            self.rows.append([])
            for term in terms:
                self.rows[-1].append((len(formulas), tuple(place[name] for name in term.factors)))
                directed = [equation.directed[name] for name in term.coefficient.names if name in equation.directed]
                self.velocities.append(place[directed[0].velocity] if directed else None)
                formulas[f"coefficient_{len(formulas)}"] = term.coefficient
        self.coefficients = list(formulas)
        self.coefficient_formulas = formulas
        self.held_formulas = compiled({**equation.program, **equation.forces, **formulas}, equation.measured)
        self.lag_formulas = compiled({force: after for force, (_, after) in equation.lagging.items()})
        self.products = sorted({factors for row in self.rows for _, factors in row if len(factors) == 2})
        self.used = {place[name] for name in equation.used}
        """The states that a term contains. The others are integrals of them."""
        self.orientation = {place[name] for name in equation.orientation if name in place}
        self.end_formulas = compiled(equation.ends)
        self.dynamic: list[tuple[set[int], set[int]]] = []
        """The components that may settle, in their order: the states of each, and the other states it depends on."""
        for component in equation.dynamic:
            group = {place[name] for name in component}
            inputs = {place[name] for state in component for name in equation.states_in_rate[state]}
            self.dynamic.append((group, inputs - group))


def step(table: Table, values: Mapping[str, float], h: float) -> dict[str, float]:
    """Return the states after h > 0 seconds with the inputs held.

    `values` are the coefficients, inputs and states by their names. The result is not finite when the motion overflows
    or would take more than MOST_PIECES pieces.
    """
    motion = Motion(table, values)
    return motion.end() if motion.advance(h) else dict.fromkeys(motion.end(), nan)


class Motion:
    """The states of a table during a step, and the coefficients of the current piece."""

    def __init__(self, table: Table, values: Mapping[str, float]) -> None:
        self.table, self.values = table, dict(values)
        found = table.held_formulas(values)
        self.steady = {name: found[name] for forces in table.equation.lags.values() for name in forces.values()}
        starts = {**found, **values}
        self.y = [float(starts[name]) if name in table.equation.starts else 0.0 for name in table.states]
        self.lost = [0.0] * len(self.y)  # the rounding error of each state, which would add up over many pieces
        self.scale = [0.0] * len(self.y)  # the largest size of each state so far
        self.start = dict(self.values)
        self.settled: set[int] = set()
        self.unit = 0.0  # the unit of time of the current series, s
        self.heading = 0.0
        """The heading of a vehicle with an attitude, with its turns, for the direction beside the nose."""
        if table.equation.ends:
            self.heading = turned_heading(found, values.get("psi", 0.0))
        self.hold()

    def advance(self, h: float) -> bool:
        """Move for h seconds. Return False when the motion overflows or would take more than MOST_PIECES pieces."""
        done, lost, unit = 0.0, 0.0, h  # elapsed seconds, their rounding error, and the unit of time of the series
        for _ in range(MOST_PIECES):
            self.settle()
            if self.has_settled():
                self.coast(h - done)
                return True
            unit = min(unit, h - done)
            series = self.series(unit)
            self.unit = unit
            reach = self.reach(series)
            if reach == 0.0:
                unit *= 1e-3
                if unit == 0.0:
                    break
                continue
            length = self.move(series, reach)
            if length * unit >= h - done:
                return True
            before, elapsed = done, length * unit + lost
            done += elapsed
            lost = elapsed - (done - before)
            unit *= 2.0 * reach
        return False

    def hold(self) -> None:
        """Compute the coefficients for both directions of the velocities.

        First, end the lags whose forces have all arrived: each of these forces becomes exactly the steady thrust.
        """
        table, values = self.table, self.values
        for progress, forces in table.equation.lags.items():
            gaps = {force: abs(self.steady[steady] - values[force]) for force, steady in forces.items()}
            sizes = {force: abs(self.steady[steady]) + abs(self.start[force]) for force, steady in forces.items()}
            has_arrived = all(gaps[force] <= _EPSILON * sizes[force] for force in forces)
            if has_arrived:
                values.update({force: self.steady[steady] for force, steady in forces.items()})
            self.put(table.place[progress], 1.0 if has_arrived else 0.0)
        forward = table.held_formulas({**values, **dict.fromkeys(table.equation.monitored, 1.0)})
        reverse = table.held_formulas({**values, **dict.fromkeys(table.equation.monitored, -1.0)})
        self.forward = [forward[name] for name in table.coefficients]
        self.reverse = [reverse[name] for name in table.coefficients]
        self.direct(self.y)

    def put(self, state: int, value: float) -> None:
        """Set a state to an exact value."""
        self.y[state], self.lost[state] = value, 0.0

    def direct(self, signs: Sequence[float]) -> None:
        """Choose the coefficients for the signs of the velocities."""
        both = zip(self.table.velocities, self.forward, self.reverse, strict=True)
        self.k = [reverse if v is not None and signs[v] < 0.0 else forward for v, forward, reverse in both]

    def rates(self, y: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return the rate of each state, and the sum of the sizes of its terms."""
        rows = [[self.k[n] * prod(y[i] for i in factors) for n, factors in row] for row in self.table.rows]
        return [_sum(row) for row in rows], [_sum(map(abs, row)) for row in rows]

    # ---- Attitude ----

    def follow(self, y_at: Callable[[float], Sequence[float]], end: float, turn: float, swing: float) -> None:
        """Follow the turns of the heading, and the sign of the quaternion, from time 0 to the end of a motion.

        Per unit of time, the vehicle turns by at most `turn`, and the direction beside the nose by at most `swing`. In
        each part of this time, the direction moves by less than its distance from the vertical, so that its heading is
        that of the same turn; and the vehicle turns by less than half a turn, so that its quaternion has the sign that
        is nearer to the one before.
        """
        t, horizontal = 0.0, beside_nose(self.rotation(y_at(0.0)))
        for n in range(1, _MOST_PARTS + 1):
            if not t < end:
                break
            part = min(0.9 * hypot(*horizontal) / (swing or _SMALLEST), 2.0 / (turn or _SMALLEST))
            t = min(t + max(part, end / _MOST_PARTS), end) if n < _MOST_PARTS else end
            values = self.rotation(y_at(t))
            found = self.table.end_formulas({**self.start, **values})
            self.start |= {name: found[f"next_{name}"] for name in QUATERNION}
            horizontal, self.heading = beside_nose(values), turned_heading(values, self.heading)

    def rotation(self, y: Sequence[float]) -> dict[str, float]:
        """Return the entries of the rotation matrix by name."""
        return {name: y[self.table.place[name]] for name in self.table.equation.orientation if name in self.table.place}

    # ---- Settled states ----

    def settle(self) -> None:
        """Find the components that have settled.

        A component has settled when those that it depends on have settled and its rates are rounding errors. A
        component that has faded to nothing, and that nothing drives, is put to rest.
        """
        y = self.y
        self.direct(y)
        self.scale = [max(size, abs(x)) for size, x in zip(self.scale, y, strict=True)]
        rates, sizes = self.rates(y)
        self.settled = set()
        for group, inputs in self.table.dynamic:
            if inputs <= self.settled:
                if all(abs(rates[i]) <= 8.0 * _EPSILON * sizes[i] for i in group):
                    self.settled |= group
                elif all(abs(y[i]) <= _FADED * self.scale[i] + _SMALLEST for i in group):
                    at_rest, _ = self.rates([0.0 if i in group else x for i, x in enumerate(y)])
                    if not any(at_rest[i] for i in group):
                        self.settled |= group
                        for i in group:
                            self.put(i, 0.0)

    def has_settled(self) -> bool:
        """Return True when all states are constant, except for the heading and the integrals."""
        return self.table.used - self.table.orientation <= self.settled

    def coast(self, h: float) -> None:
        """Move for h seconds of straight or circular motion, once all has settled.

        Only the heading still changes, by a rotation y' = L y with L^3 = -w^2 L. The integrals rise by h times their
        rates at the mean of y, which is y + (1 - cos wh)/(w^2 h) L y + (1 - sin(wh)/(wh))/w^2 L^2 y.
        """
        table, mean, end = self.table, list(self.y), list(self.y)
        turning = table.orientation - self.settled
        first = self.rates(mean)[0]
        second = self.rates([first[i] if i in turning else x for i, x in enumerate(mean)])[0]
        slope, bend = (hypot(*(rates[i] for i in turning)) for rates in (first, second))
        w = bend / slope if slope else 0.0
        angle = w * h
        if angle:
            half, whole = (sin(0.5 * angle), sin(angle)) if isfinite(angle) else (nan, nan)
            for i in turning:
                along, across = first[i] / w, second[i] / w / w
                mean[i] += 2.0 * half * half / angle * along + (1.0 - whole / angle) * across
                end[i] += whole * along + 2.0 * half * half * across
            if table.equation.ends:
                sines = [x / w if i in turning else 0.0 for i, x in enumerate(first)]
                self.follow_circle(sines, [x / w / w if i in turning else 0.0 for i, x in enumerate(second)], angle)
        rates, _ = self.rates(mean)
        self.y = [x if i in table.used else x + h * rates[i] for i, x in enumerate(end)]

    def follow_circle(self, along: Sequence[float], across: Sequence[float], angle: float) -> None:
        """Follow the attitude through a rotation with constant velocities.

        At the angle a, the table has the states y + sin(a) along + (1 - cos(a)) across. Every whole turn changes the
        heading by the same angle, and the sign of the quaternion.
        """

        def y_at(t: float) -> list[float]:
            whole, half = sin(t), sin(0.5 * t)
            return [x + whole * a + 2.0 * half * half * b for x, a, b in zip(self.y, along, across, strict=True)]

        swing, turns = hypot(*beside_nose(self.rotation(along), (1, 2, 3))), angle // tau
        before, start = self.heading, dict(self.start)
        self.follow(y_at, tau, 1.0, swing)
        self.heading = before + (self.heading - before) * turns
        if turns % 2.0 == 0.0:
            self.start = start
        self.follow(y_at, angle % tau, 1.0, swing)

    # ---- A piece ----

    def series(self, unit: float) -> Series:
        """Return the series of all states, with time in units of `unit` seconds.

        The direction of a velocity that is 0 is that of its first nonzero coefficient. Until then its terms are 0.
        """
        table, c = self.table, [[x] for x in self.y]
        signs = [0.0] * len(c)
        for n in range(ORDER):
            begins = [v for v in table.monitored if signs[v] == 0.0 and c[v][n] != 0.0]
            if begins:
                for v in begins:
                    signs[v] = copysign(1.0, c[v][n])
                self.direct(signs)
            factor: dict[tuple[int, ...], float] = {
                (a, b): _sum(map(mul, c[a], reversed(c[b]))) for a, b in table.products
            }
            factor.update({(i,): x[n] for i, x in enumerate(c)})
            factor[()] = 1.0 if n == 0 else 0.0
            for i, row in enumerate(table.rows):
                rate = 0.0
                if i not in self.settled:
                    for place, factors in row:
                        rate += self.k[place] * factor[factors]
                c[i].append(unit * rate / (n + 1))
        return c

    def reach(self, series: Series) -> float:
        """Return the time up to which the series may be used, at most 1; 0 when they overflow."""
        if not all(isfinite(x) for c in series for x in c[-3:]):
            return 0.0
        return min(1.0, *(usable_time(series[i]) for i in self.table.used))

    def end_of_piece(self, series: Series, length: float) -> tuple[float, int | None]:
        """Return the end of a piece, and the place of the velocity that reverses there, or None."""
        reversed_velocity = None
        for v in self.table.monitored:
            end, is_reversal = _sign_kept(series[v], length)
            if is_reversal or end < length:
                length, reversed_velocity = end, v if is_reversal else None
        return length, reversed_velocity

    def move(self, series: Series, length: float) -> float:
        """Move to the end of a piece, which is at `length` or at the first reversal, and return that time."""
        length, reversed_velocity = self.end_of_piece(series, length)
        if self.table.equation.ends:
            self.follow_series(series, length)
        changes = [_change(c, length) + lost for c, lost in zip(series, self.lost, strict=True)]
        before, self.y = self.y, [x + change for x, change in zip(self.y, changes, strict=True)]
        self.lost = [change - (x - y) for change, x, y in zip(changes, self.y, before, strict=True)]
        if reversed_velocity is not None:
            self.put(reversed_velocity, 0.0)  # so that the next piece has the other direction
        if self.steady:
            self.arrive()
        return length

    def arrive(self) -> None:
        """Update the forces that lag, and the coefficients that follow from them, at the end of a piece."""
        progress = {name: self.y[self.table.place[name]] for name in self.table.equation.lags}
        found = self.table.lag_formulas({**self.values, **self.steady, **progress})
        self.values.update({force: found[force] for force in self.table.equation.lagging})
        self.hold()

    def follow_series(self, series: Series, length: float) -> None:
        """Follow the attitude through a piece."""
        place, entries = self.table.place, [self.table.place[name] for name in self.rotation(self.y)]
        bounds = {v: sum(abs(x) * length**k for k, x in enumerate(series[place[v]])) for v in "pqr" if v in place}
        about = {"p": 2.0 * BESIDE_NOSE[1], "q": 1.0, "r": 1.0}
        turn = self.unit * hypot(*bounds.values())
        swing = self.unit * hypot(*(about[v] * bound for v, bound in bounds.items()))

        def y_at(t: float) -> list[float]:
            y = list(self.y)
            for i in entries:
                y[i] += _change(series[i], t)
            return y

        self.follow(y_at, length, turn, swing)

    def end(self) -> dict[str, float]:
        """Return the vehicle's states by their names."""
        equation, found = self.table.equation, {force: self.values[force] for force in self.table.equation.lagging}
        for name, x in zip(self.table.states, self.y, strict=True):
            if name in self.start:  # an integral has only counted the change
                found[name] = x if name in equation.starts else self.start[name] + x
        if equation.ends:
            after = self.table.end_formulas({**self.start, **dict(zip(self.table.states, self.y, strict=True))})
            rotation = self.rotation(self.y)
            psi = unwrapped(atan2(rotation["R_21"], rotation["R_11"]), self.heading)
            found |= {name: after[f"next_{name}"] for name in QUATERNION} | {"psi": psi}
        return found


# ---- Numbers ---------------------------------------------------------------------------------------------------------


def _sum(terms: Iterable[float]) -> float:
    """Return a sum that is the same in all versions of Python, unlike sum()."""
    total = 0.0
    for x in terms:
        total += x
    return total


def _change(c: Sequence[float], t: float) -> float:
    """Return the change of a state from 0 to t."""
    change = 0.0
    for x in c[:0:-1]:
        change = (change + x) * t
    return change


def usable_time(c: Sequence[float]) -> float:
    """Return the time at which the terms decrease like the powers of _RATIO from the first three to the last three.

    Of three neighbouring coefficients the largest counts, because every second or third coefficient may be 0.
    """
    first = next((n for n, x in enumerate(c) if x != 0.0), len(c))
    reach = inf
    for n in range(max(first + 1, len(c) - 3), len(c)):
        if c[n] != 0.0:
            terms = range(first, min(first + 3, n))
            reach = min(reach, _RATIO * max(abs(c[k] / c[n]) ** (1.0 / (n - k)) for k in terms))
    return reach


def _sign_kept(c: Sequence[float], length: float) -> tuple[float, bool]:
    """Return a time up to which a velocity certainly keeps its sign, and whether the velocity is 0 at that time.

    The time is at most `length`.
    """
    first = next((n for n, x in enumerate(c) if x != 0.0), None)
    shortest = _SHORTEST * length
    while first is not None and length > shortest:
        sizes = [abs(x) * length**n for n, x in enumerate(c)]
        if sizes[first] >= sum(sizes[first + 1 :]):
            break
        if first == 0 and sizes[1] > 4.0 * sum(n * size for n, size in enumerate(sizes[2:], 2)):  # monotonic
            end = c[0] + _change(c, length)
            is_reversal = end == 0.0 or (end > 0.0) != (c[0] > 0.0)  # the product of both values could underflow
            return (min(length, _root(c)), True) if is_reversal else (length, False)
        length *= 0.5
    return length, False


def _root(c: Sequence[float]) -> float:
    """Return the root of a series by Newton's method. The slope must stay within a quarter of the first slope."""
    t, following = 0.0, -c[0] / c[1]
    for _ in range(60):
        if abs(following - t) <= 2.0 * _EPSILON * following:
            break
        t, slope = following, 0.0
        for n in range(len(c) - 1, 0, -1):
            slope = slope * t + n * c[n]
        following = t - (c[0] + _change(c, t)) / slope
    return following
