"""The motion under held inputs by extrapolation of the midpoint rule (Gragg, Bulirsch, Stoer), for reference results.

It shares the equations with rov_fmu/motion/ and no solution of them: no closed form, no series. Where a velocity
reverses, the drag has a kink, and the step is cut there. Arithmetic alone, so the numbers are the same everywhere.
"""

from collections.abc import Callable, Mapping, Sequence
from math import cos, isfinite, nan, sin

from rov_fmu.motion.rov import Rov

State = dict[str, float]
_Numbers = list[float]
_Rates = Callable[[Sequence[float]], _Numbers]

_DIVISIONS = (2, 4, 6, 8, 10, 12, 14, 16)
_TOLERANCE = 1e-11
"""Of what the last column of the extrapolation changes; the error is far below."""
_ENOUGH = 1e-10
"""The same, where the shortest step does no better; errors of many steps add up."""
_FLOOR = 1e-4
"""m, rad, N, and per second: sizes that are not resolved further."""
_STILL = 1e-12
"""A velocity that counts as none where it changes its sign."""
_MOST_HALVINGS = 8
"""Of the time to the next state that is asked for."""
_SHORTEST = 1e-6
"""What is left of them where that is not enough."""


class TooFastError(Exception):
    """A motion that the shortest step does not resolve."""


def states(rov: Rov, inputs: Mapping[str, float], state: Mapping[str, float], times: Sequence[float]) -> list[State]:
    """The states after so many seconds each, rising, with the inputs held. Raises TooFastError."""
    y, axes = [*(state[name] for name in rov.layout.state), 0.0], len(rov.layout.axes)
    equations = _equations(rov, inputs)
    found, t, step = [], 0.0, times[0] / 4.0
    still = equations([0] * axes)
    for end in times:
        least = (end - t) / 2.0**_MOST_HALVINGS
        while t < end:
            h = min(step, end - t)
            pushed = still(y)
            signs = _signs(y, pushed, axes)
            rates = equations(signs)
            after, error = _leap(rates, y, h)
            turned = _turned(signs, after)
            if any(y[n] == 0.0 == pushed[n] for n in turned):  # not pushed yet: it may go the other way
                signs = [-s if n in turned and y[n] == 0.0 == pushed[n] else s for n, s in enumerate(signs)]
                rates = equations(signs)
                after, error = _leap(rates, y, h)
                turned = _turned(signs, after)
            both = any(y[n] == 0.0 for n in turned)  # a start and a reversal: two steps
            if h > (_SHORTEST if both else 1.0) * least and (both or not error <= _TOLERANCE):
                step = h / 2.0  # the error of a far too long step is no number
                continue
            if not error <= _ENOUGH:
                raise TooFastError
            while turned:
                h = _reversal(rates, y, turned[0], h, after[turned[0]])
                after, _ = _leap(rates, y, h)
                after[turned[0]] = 0.0
                turned = _turned(signs, after)
            y, t = after, end if h == end - t else t + h
            step *= 2.0 if error < 1e-3 * _TOLERANCE else 1.0
        found.append(dict(zip(rov.layout.state, y, strict=False)))
    return found


def _equations(rov: Rov, inputs: Mapping[str, float]) -> Callable[[Sequence[int]], _Rates]:
    """Time derivatives of the state and of a zero behind it, by the signs of the velocities that the drag goes by."""
    layout, F, coupling = rov.layout, rov.commanded(inputs), rov.coupling
    place = {name: n for n, name in enumerate(layout.state)}
    late = [t for t in layout.thrusters if f"F_{t.name}" in place]
    motions = rov.axes(inputs, {t.name: F[t.name] for t in layout.thrusters if t not in late})
    late_forces = []
    for n, form in enumerate(layout.axes):
        push = rov[form.axis.coefficient("alpha")] * rov.gain(form)
        late_forces += [(n, place[f"F_{t.name}"], push * rov.effect(t, form.axis)) for t in late]
    late_forces = [effect for effect in late_forces if effect[-1]]
    lags = [(place[f"F_{t.name}"], F[t.name], 1.0 / rov[layout.curve_of[t.name].coefficient("T")]) for t in late]
    at_u, at_v, at_w, at_r, at_psi = (place.get(name, len(place)) for name in ("u", "v", "w", "r", "psi"))
    V_N, V_E = (inputs.get(name, 0.0) for name in ("V_N", "V_E"))
    planar, deep, turns = ("x" in place), ("z" in place), ("psi" in place)

    def with_signs(signs: Sequence[int]) -> _Rates:
        drags = [motion.drag(sign) for motion, sign in zip(motions, signs, strict=True)]
        axes = [(m.C, sign * A, B) for m, sign, (A, B) in zip(motions, signs, drags, strict=True)]

        def rates(y: Sequence[float]) -> _Numbers:
            found = [C - (B + A * v) * v for (C, A, B), v in zip(axes, y, strict=False)]
            for n, m, effect in late_forces:
                found[n] += effect * y[m]
            u, v, r = y[at_u], y[at_v], y[at_r]
            if coupling:
                found[at_u] += coupling.c_u * v * r
                found[at_v] -= coupling.c_v * u * r
                found[at_r] -= coupling.c_r * u * v
            if planar:
                psi = y[at_psi]
                c, s = (cos(psi), sin(psi)) if isfinite(psi) else (nan, nan)
                found += [u * c - v * s + V_N, u * s + v * c + V_E]
            if deep:
                found.append(y[at_w])
            if turns:
                found.append(r)
            found += [(target - y[n]) * rate for n, target, rate in lags]
            found.append(0.0)
            return found

        return rates

    return with_signs


def _signs(y: Sequence[float], rates: Sequence[float], axes: int) -> list[int]:
    """Of the velocities; of one at rest, the way it will go."""
    return [(v > 0.0) - (v < 0.0) or (-1 if rate < 0.0 else 1) for v, rate in zip(y[:axes], rates, strict=False)]


def _turned(signs: Sequence[int], y: Sequence[float]) -> list[int]:
    """The velocities that have another sign."""
    return [n for n, sign in enumerate(signs) if sign * y[n] < -_STILL]


def _leap(rates: _Rates, y: Sequence[float], h: float) -> tuple[_Numbers, float]:
    """The state after h, and what the last column changed against its size."""
    start = rates(y)
    before: list[_Numbers] = []
    for n, divisions in enumerate(_DIVISIONS):
        step = h / divisions
        old, new = y, [a + step * b for a, b in zip(y, start, strict=True)]
        for _ in range(divisions - 1):
            old, new = new, [a + 2.0 * step * b for a, b in zip(old, rates(new), strict=True)]
        row = [new]
        for k, coarser in enumerate(reversed(_DIVISIONS[:n])):
            weight = 1.0 / ((divisions / coarser) * (divisions / coarser) - 1.0)
            row.append([a + (a - b) * weight for a, b in zip(row[-1], before[k], strict=True)])
        before = row
    best, second = before[-2:][::-1]
    error = max(abs(a - b) / max(abs(a), abs(c), _FLOOR) for a, b, c in zip(best, second, y, strict=True))
    return best, error if all(map(isfinite, best)) else nan  # max() passes over a nan


def _reversal(rates: _Rates, y: Sequence[float], n: int, h: float, after: float) -> float:
    """When the velocity at n, which changes its sign within h, is zero: by regula falsi (Illinois)."""
    low, at_low, high, at_high = 0.0, y[n], h, after
    if at_low == 0.0:
        return h
    while True:
        middle = high - at_high * (high - low) / (at_high - at_low)
        value = _leap(rates, y, middle)[0][n]
        if abs(value) < _STILL or abs(high - low) < 1e-13 * h:
            return middle
        if value * at_high < 0.0:
            low, at_low = high, at_high
        else:
            at_low /= 2.0
        high, at_high = middle, value
