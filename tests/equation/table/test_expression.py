"""Expressions: how they are written in C and Python, evaluated, differentiated and named (equation/expression.py).

Values and derivatives are compared with those that mpmath computes with 50 digits from the same operations.
"""

import random
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest

from rov_fmu.equation.expression import (
    ARRAYS,
    PYTHON,
    Expression,
    Name,
    Names,
    Operation,
    beyond_dead_band,
    call,
    collected,
    compiled,
    directed,
    of,
    saturated,
    tangent,
    to_c,
    where,
    written,
)

a, b, c, d = map(Name, "abcd")


@pytest.mark.parametrize(
    ("expression", "in_c"),
    [
        (a / (b * c), "a / (b * c)"),
        ((a + b) * c, "(a + b) * c"),
        (call("abs", a) + call("pow", b, 2.0), "fabs(a) + pow(b, 2.0)"),
        (call("table", where(b < 0.0, a, c)), "table(b < 0.0 ? a : c)"),
        (saturated(a), "a > 1.0 ? 1.0 : a < -1.0 ? -1.0 : a"),
        (directed(b, a, -a) * c, "(b < 0.0 ? -a : a) * c"),
        (beyond_dead_band(a, b, c), "a < 0.0 || (a == 0.0 && b > 0.0) ? 0.0 : c"),
        (where(where(b < c, a, b) < 1.0, 1.0, 2.0), "(b < c ? a : b) < 1.0 ? 1.0 : 2.0"),
        (where(b >= c, where(a < b, 1.0, 2.0), 3.0), "b >= c ? (a < b ? 1.0 : 2.0) : 3.0"),
    ],
)
def test_c_has_the_brackets_that_it_needs(expression: Expression, in_c: str) -> None:
    assert to_c(expression) == in_c


def test_two_quantities_never_have_the_same_identifier() -> None:
    names = Names(["angle_max_rudder", "F_1"])
    rudder = names("angle", "max_rudder")
    assert (rudder.identifier, rudder.kind, rudder.owners) == ("angle_max_rudder_2", "angle", ("max_rudder",))
    assert names("angle", "max_rudder") is rudder
    assert names("angle_max", "rudder").identifier == "angle_max_rudder_3"
    assert names("angle", "max_rudder_2").identifier == "angle_max_rudder_2_2"
    assert [name.owners for name in names.of_kind("angle")] == [("max_rudder",), ("max_rudder_2",)]


# ---- Values and derivatives ------------------------------------------------------------------------------------------

EXACT: dict[str, Callable[..., object]] = {
    "neg": lambda x: -x,
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "<": lambda x, y: x < y,
    "sin": mp.sin,
    "cos": mp.cos,
    "abs": abs,
    "sqrt": mp.sqrt,
    "pow": mp.power,
    "log": mp.log,
    "atan2": mp.atan2,
    "if": lambda test, x, y: x if test else y,
    "saturated": lambda x: max(-1, min(1, x)),
    "directed": lambda subject, x, y: y if subject < 0 else x,
    "square": lambda x: x * x,
}
"""The operations in mpmath; "square" stands for a thrust table."""
SQUARE = {"square": lambda x: x * x, "slope_of_square": lambda x: 2.0 * x}


class Pair:
    """An expression beside the same operations in mpmath."""

    def __init__(self, ours: Expression, exact: Callable[[dict[str, mp.mpf]], mp.mpf]) -> None:
        self.ours, self.exact = ours, exact


def applied(op: str, *parts: Pair) -> Pair:
    ours = Operation(op, tuple(part.ours for part in parts))
    return Pair(ours, lambda at: EXACT[op](*(part.exact(at) for part in parts)))


def random_pair(rng: random.Random, depth: int) -> Pair:
    """Return a random expression, which is smooth near most points."""

    def inner() -> Pair:
        return random_pair(rng, depth - 1)

    def positive() -> Pair:
        return applied("+", Pair(of(0.5), lambda _: mp.mpf(0.5)), applied("abs", inner()))

    if depth == 0:
        name = rng.choice("abcd")
        return Pair(Name(name), lambda at: at[name])
    op = rng.choice([*(op for op in EXACT if op != "<"), "number"])
    value = rng.uniform(0.1, 3.0)
    parts: dict[str, Callable[[], tuple[Pair, ...]]] = {
        "if": lambda: (applied("<", inner(), inner()), inner(), inner()),
        "directed": lambda: (inner(), inner(), inner()),
        "pow": lambda: (positive(), applied("sin", inner())),
        **dict.fromkeys(("/", "atan2"), lambda: (inner(), positive())),
        **dict.fromkeys(("sqrt", "log"), lambda: (positive(),)),
        **dict.fromkeys(("+", "-", "*"), lambda: (inner(), inner())),
    }
    if op == "number":
        return Pair(of(value), lambda _: mp.mpf(value))
    return applied(op, *parts.get(op, lambda: (inner(),))())


def line(pair: Pair, at: dict[str, float], change: dict[str, float]) -> Callable[[mp.mpf], mp.mpf]:
    """Return the exact value along a straight line through a point."""
    return lambda t: pair.exact({name: x + t * change[name] for name, x in at.items()})


def test_values_and_derivatives_are_those_that_mpmath_computes() -> None:
    rng = random.Random(1)
    compared = 0
    with mp.workdps(50):
        for _ in range(400):
            pair = random_pair(rng, 4)
            at, change = ({name: rng.uniform(-2.0, 2.0) for name in "abcd"} for _ in range(2))
            moved = line(pair, at, change)
            slope = tangent(pair.ours, lambda name: Name(f"d_{name}")) or of(0.0)
            values = {**at, **{f"d_{name}": x for name, x in change.items()}}
            alike = compiled({"value": collected(pair.ours)}, {**SQUARE, "cube": lambda x: x * x * x})(values)
            found = compiled({"value": pair.ours, "slope": slope}, SQUARE)(values)
            value = moved(mp.mpf(0))
            assert found["value"] == pytest.approx(float(value), rel=1e-11, abs=1e-12), to_c(pair.ours)
            assert alike["value"] == pytest.approx(float(value), rel=1e-9, abs=1e-10), written(pair.ours, PYTHON)
            step = mp.mpf(10) ** -20
            sides = [(moved(step) - value) / step, (value - moved(-step)) / step]
            if abs(sides[0] - sides[1]) < 1e-9 * (1 + abs(sides[0])):  # no kink at this point
                size = float(abs(sides[0]))
                assert found["slope"] == pytest.approx(float(sides[0]), rel=1e-9, abs=1e-9 * (1.0 + size)), to_c(
                    pair.ours
                )
                compared += 1
    assert compared > 350


def test_arrays_get_the_values_of_numbers() -> None:
    rng = random.Random(2)
    functions = {
        **{name: getattr(np, name) for name in ("sin", "cos", "abs", "sqrt", "log", "where")},
        "pow": np.power,
        "atan2": np.arctan2,
        "both": np.logical_and,
        "either": np.logical_or,
        **SQUARE,
    }
    for _ in range(100):
        formulas = {"value": random_pair(rng, 4).ours, "beyond": beyond_dead_band(a, b, c)}
        points = [{name: rng.choice([0.0, rng.uniform(-2.0, 2.0)]) for name in "abcd"} for _ in range(8)]
        arrays = {name: np.array([point[name] for point in points]) for name in "abcd"}
        found = compiled(formulas, functions, ARRAYS)(arrays)
        for name in formulas:
            expected = [compiled(formulas, SQUARE)(point)[name] for point in points]
            assert np.broadcast_to(found[name], 8) == pytest.approx(np.array(expected), rel=1e-14, abs=1e-15)
