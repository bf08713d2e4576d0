"""Reads and computes random expressions, and prints what the process did meanwhile, as JSON.

This is a process of its own, because an audit hook stays until its process ends. The argument is the number of
expressions.
"""

import builtins
import json
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import numpy.ma  # NumPy loads this part of itself at its first median of NaN
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rov_fmu.study.plan.expression import CONSTANTS, FUNCTIONS, ExpressionError
from rov_fmu.study.plan.figures import Figures, Responses, read_expression

POINTS = 50
T = np.linspace(0.0, 5.0, POINTS)
VALUES: dict[str, Any] = {
    "y": np.sin(T),
    "z": np.where(T > 4.0, np.nan, T * 1e300),
    "n": np.arange(POINTS, dtype=np.int32) - 9,
    "b": T > 2.0,
    "small": np.arange(POINTS, dtype=np.uint8),
    "m": 6.5,
    "der(y)": np.cos(T),
}
"""Outputs of every kind that an FMU has, and a parameter."""
FIGURES = {**FUNCTIONS, **Responses(T).functions}
ALLOWED = st.sampled_from([*VALUES.keys() - {"der(y)"}, "t", *CONSTANTS, "out['der(y)']", "where(y > 0)[0]"])
NUMBERS = st.one_of(st.integers(-60, 60), st.integers(), st.floats(), st.just(10**400)).map(repr)
ANY_NAME = st.sampled_from(sorted({*dir(np), *dir(np.ndarray), *dir(builtins), *dir(str), *FIGURES, *VALUES, "np"}))
TEXTS = st.one_of(st.text("abc/._%{}O8", max_size=9), st.binary(max_size=9)).map(repr)
OPERATORS = st.sampled_from([*"+-*/%@&|^<>", "//", "**", "<<", ">>", "<=", ">=", "==", "!=", "is", "in", "and", "or"])


def _called(parts: Any, names: Any) -> Any:
    keywords = st.lists(st.tuples(st.sampled_from(["start", "end", "band", "out", "dtype", "axis", "y"]), parts))
    arguments = st.tuples(st.lists(parts, max_size=4), keywords.filter(lambda given: len(given) < 3))
    return st.tuples(names, arguments).map(
        lambda call: f"{call[0]}({', '.join([*call[1][0], *(f'{name}={part}' for name, part in call[1][1])])})"
    )


def _proper_call(parts: Any) -> Any:
    """With as many values as the function takes."""
    return st.sampled_from(sorted(FIGURES)).flatmap(
        lambda name: st.lists(parts, min_size=FIGURES[name].least, max_size=min(4, FIGURES[name].most)).map(
            lambda given: f"{name}({', '.join(given)})"
        )
    )


def _proper(parts: Any) -> Any:
    """What an expression may have."""
    three = st.tuples(parts, parts, parts)
    return st.one_of(
        _proper_call(parts),
        st.tuples(parts, OPERATORS, parts).map(lambda of: f"({' '.join(of)})"),
        st.tuples(parts, parts).map(lambda of: f"{of[0]}[{of[1]}]"),
        three.map(lambda of: f"{of[0]}[{of[1]}:{of[2]}]"),
        three.map(lambda of: f"({of[0]} if {of[1]} else {of[2]})"),
        three.map(lambda of: f"({of[0]} < {of[1]} >= {of[2]})"),
        parts.map(lambda of: f"where({of})[0]"),
        st.tuples(st.sampled_from(["-", "~", "not "]), parts).map(lambda of: f"({of[0]}{of[1]})"),
    )


def _improper(parts: Any) -> Any:
    """What it may not have, and nearly so."""
    return st.one_of(
        _proper(parts),
        _called(parts, ANY_NAME),
        _called(parts, parts),
        st.tuples(parts, ANY_NAME).map(".".join),
        st.lists(parts, max_size=3).map(lambda of: f"[{', '.join(of)}]"),
        st.lists(parts, max_size=3).map(lambda of: f"({', '.join(of)},)"),
        parts.map(lambda of: f"[x for x in {of}]"),
        parts.map(lambda of: f"(lambda: {of})"),
        parts.map(lambda of: f"(x := {of})"),
        parts.map(lambda of: f"f'{{{of}}}'" if "'" not in of else f"*{of}"),
    )


EXPRESSIONS = st.one_of(
    st.recursive(st.one_of(ALLOWED, ALLOWED, NUMBERS), _proper, max_leaves=12),
    st.recursive(st.one_of(ALLOWED, NUMBERS, ANY_NAME, TEXTS), _improper, max_leaves=8),
)

events: Counter[str] = Counter()
found: Counter[str] = Counter()
is_watched = False


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if is_watched:
        events[f"{event} {arguments[0]}" if event in ("open", "import") else event] += 1


def see(expression: str) -> None:
    """Read and compute an expression; the value must be a number or an array of one dimension, and nothing else."""
    global is_watched  # noqa: PLW0603 (a hook has no other way to be told)
    before = {name: np.copy(value) for name, value in VALUES.items()}
    value: Any = None
    is_watched = True
    try:
        read = read_expression(expression)
        with np.errstate(all="ignore"):
            value = read.value({**CONSTANTS, "t": T, **VALUES})
        (figure,), _ = Figures({"f": expression}, T).of(VALUES)
    except ExpressionError:
        found["refused"] += 1
        return
    except Exception:
        found["failed"] += 1
        return
    finally:
        is_watched = False
    found["computed"] += 1
    assert isinstance(figure, float), expression
    assert isinstance(value, float | np.number | np.bool_ | np.ndarray), (expression, type(value))
    assert np.asarray(value).dtype.kind in "biuf", expression
    assert np.ndim(value) <= 1, expression
    assert np.size(value) <= POINTS, expression
    assert all(np.array_equal(before[name], VALUES[name], equal_nan=True) for name in VALUES), expression


def main(count: int) -> None:
    """Print the events of the audit hook, and how many expressions were refused, failed and were computed."""
    global is_watched  # noqa: PLW0603
    warnings.simplefilter("ignore")
    sys.addaudithook(_watch)
    is_watched = True
    Path(__file__).read_bytes()
    is_watched = False
    assert events[f"open {__file__}"] == 1, "the hook sees that a file is opened"
    events.clear()
    quick = settings(
        max_examples=count, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
    )
    quick(given(EXPRESSIONS)(see))()
    print(json.dumps({"events": events, **found}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
