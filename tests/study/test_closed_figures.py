"""A plan may come from anyone: the expressions of its figures compute, and can do nothing else."""

import builtins
import gc
import json
import re
import shutil
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from threading import get_ident
from typing import Any

import numpy as np
import numpy.ma  # NumPy loads this part of itself at its first median of NaN
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rov_fmu.cli import main
from rov_fmu.study.expression import CONSTANTS, FUNCTIONS, ExpressionError
from rov_fmu.study.figures import Figures, Responses, read_expression

IMPORTS = "a_module_that_only_a_hostile_plan_imports"

HOSTILE = [
    # what the evaluator of earlier versions did: files written, a module imported, the process crashed
    "array([b'0123'])[0].tofile('written')",
    "matrix.tofile(array([1.0]), 'written')",
    "u.tofile('written')",
    f"info('x', 80, None, '{IMPORTS}')",
    'ndarray(3, "O", b"a"*24)',
    # the ways out of a sandbox of Python
    f"__import__('{IMPORTS}')",
    "getattr(u, 'tofile')('written')",
    "().__class__.__base__.__subclasses__()",
    "max.__globals__",
    "V_ss.__self__",
    "(lambda: u[0])()",
    "[c for c in ().__class__.__mro__]",
    "max(x for x in u)",
    "{1: u}[1]",
    "(u[0],)[0]",
    "[u[0]][0]",
    "f'{u.tofile}'",
    "'%s' % u",
    "'a' * 10**9",
    "(x := u)[0]",
    "(yield u)",
    "await u",
    "u[0]; u[1]",
    "import os",
    "locals()['u']",
    "out",
    "out.clear()",
    "out[u]",
    "out['a']['b']",
    "max",
    "abs(at)",
    # functions of Python and NumPy that are not listed
    *(
        f"{name}(u, 10**9)"
        for name in (
            *("open", "eval", "exec", "compile", "globals", "vars", "breakpoint", "input", "memoryview"),
            *("loadtxt", "fromfile", "genfromtxt", "memmap", "save", "savetxt", "frompyfunc", "vectorize"),
            *("apply_along_axis", "set_printoptions", "seterrcall", "repeat", "tile", "outer", "ones", "linspace"),
        )
    ),
    # arguments that write, or call back
    "sqrt(u, u)[0]",
    "clip(u, 0, 1, u)[0]",
    "sum(u, 0, None, u)",
    "mean(u, dtype='O')",
    "max(*u)",
    "max(**u)",
    "V_ss(u, **{'start': 1})",
    "final(u, self=u)",
    # sizes and times without end
    "9**9**9**9",
    "max(9**9**9**9, 1)",
    "1 << 10**12",
    "9" * 1900,
    "u[:, None][0][0]",
    "u[..., 0]",
    "u[0, 0]",
    "where(where(u > 0) > 0)[0]",
    "u @ u",
    "1j * u[0]",
    "round(1, 10**9)",
    "-" * 1900 + "1",
    "u[0]" + "+1" * 900,
]


def test_comparisons_within_comparisons_take_no_time() -> None:
    text = "u"
    for _ in range(60):
        text = f"(0 < {text} < 2)"
    assert read_expression(text).value({"u": 1.0})


def test_hostile_expressions_are_refused_in_one_line_each_and_do_nothing(
    tmp_path: Path, videoray_fmu: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ten at a time, because a command prints at most ten lines; some are refused before the FMU is read."""
    (tmp_path / f"{IMPORTS}.py").write_text("")
    shutil.copy(videoray_fmu, tmp_path / "videoray.fmu")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    remaining = {f"f{n}": expression for n, expression in enumerate(HOSTILE)}
    while remaining:
        figures = "".join(f"{name} = {json.dumps(remaining[name])}\n" for name in [*remaining][:10])
        head = 'fmu = "videoray.fmu"\nstop_time = 1.0\nstep = 0.1\nsampler = "grid"\n'
        (tmp_path / "plan.toml").write_text(f"{head}[figures]\n{figures}")
        assert main(["study", "plan.toml", "-o", "results"]) == 2
        out, err = capsys.readouterr()
        refused = re.findall(r"^rov-fmu: plan\.toml: figures\.(f\d+) = .*\n", err, re.MULTILINE)
        assert refused, f"these are not refused:\n{figures}"
        assert (out, err.count("\n")) == ("", len(refused))
        for name in refused:
            del remaining[name]
    assert {path.name for path in tmp_path.iterdir()} == {f"{IMPORTS}.py", "videoray.fmu", "plan.toml"}
    assert IMPORTS not in sys.modules


# ---- Random expressions ----------------------------------------------------------------------------------------------

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


def _written(form: str, *parts: Any) -> Any:
    """Texts of a form, with drawn parts in the places of its braces."""
    return st.tuples(*parts).map(lambda drawn: form.format(*drawn))


def _called(names: Any, parts: Any) -> Any:
    """Calls of a name with some values, of which the last one may have a name."""
    named = _written("{}={}", st.sampled_from(["start", "end", "band", "out", "dtype", "axis", "y"]), parts)
    values = st.tuples(st.lists(parts, max_size=4), st.lists(named, max_size=1))
    return _written("{}({})", names, values.map(lambda some: ", ".join([*some[0], *some[1]])))


def _proper_call(parts: Any) -> Any:
    """A call with as many values as the function takes."""

    def calls(name: str) -> Any:
        parameters = signature(FIGURES[name]).parameters.values()
        least = sum(one.default is one.empty and one.kind is not one.VAR_POSITIONAL for one in parameters)
        values = st.lists(parts, min_size=least, max_size=4 if name in ("max", "min") else len(parameters))
        return values.map(lambda given: f"{name}({', '.join(given)})")

    return st.sampled_from(sorted(FIGURES)).flatmap(calls)


def _proper(parts: Any) -> Any:
    """Parts of an expression that are allowed."""
    return st.one_of(
        _proper_call(parts),
        _written("({} {} {})", parts, OPERATORS, parts),
        _written("{}[{}]", parts, parts),
        *(_written(form, parts, parts, parts) for form in ("{}[{}:{}]", "({} if {} else {})", "({} < {} >= {})")),
        _written("where({})[0]", parts),
        _written("({}{})", st.sampled_from(["-", "~", "not "]), parts),
    )


def _improper(parts: Any) -> Any:
    """Parts that are allowed, and others that are not."""
    others = ("[{0}, {0}]", "({0},)", "[x for x in {0}]", "(lambda: {0})", "(x := {0})", "f'{{{0}}}'", "{0}.{0}")
    return st.one_of(
        _proper(parts),
        _called(ANY_NAME, parts),
        _called(parts, parts),
        _written("{}.{}", parts, ANY_NAME),
        *(_written(form, parts) for form in others),
    )


EXPRESSIONS = st.one_of(
    st.recursive(st.one_of(ALLOWED, ALLOWED, NUMBERS), _proper, max_leaves=12),
    st.recursive(st.one_of(ALLOWED, NUMBERS, ANY_NAME, TEXTS), _improper, max_leaves=8),
)

HARMLESS = {"compile", "exec <figure>", "builtins.id", "object.__getattr__", "sys._getframe"}
"""Audit events of reading a text with `ast`, and of computing what is left of it."""


class Audit:
    """Counts the audit events of one thread; its hook stays until the process ends."""

    def __init__(self) -> None:
        self.events: Counter[str] = Counter()
        self._thread = 0
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[object, ...]) -> None:
        if self._thread == get_ident():
            what = getattr(arguments[0], "co_filename", arguments[0]) if event in ("open", "import", "exec") else ""
            self.events[f"{event} {what}".strip()] += 1

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count the events of this thread within this context, without those of the collector of garbage."""
        gc.disable()
        self._thread = get_ident()
        try:
            yield
        finally:
            self._thread = 0
            gc.enable()


@pytest.fixture(scope="module")
def audit() -> Audit:
    found = Audit()
    with found.counting():
        Path(__file__).read_bytes()
    assert found.events.pop(f"open {__file__}") == 1, "the hook sees that a file is opened"
    return found


@pytest.mark.parametrize(
    "count",
    [40, pytest.param(300, marks=pytest.mark.long), pytest.param(10_000, marks=pytest.mark.weekly)],
)
def test_random_expressions_give_numbers_and_arrays_and_open_no_file(count: int, audit: Audit) -> None:
    found: Counter[str] = Counter()

    @settings(max_examples=count, suppress_health_check=[*HealthCheck])
    @given(EXPRESSIONS)
    def check(expression: str) -> None:
        before = {name: np.copy(value) for name, value in VALUES.items()}
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"), audit.counting():
                warnings.simplefilter("ignore")
                value = read_expression(expression).value({**CONSTANTS, "t": T, **VALUES})
                (figure,), _ = Figures({"f": expression}, T).of(VALUES)
        except ExpressionError:
            found["refused"] += 1
            return
        except Exception:
            found["failed"] += 1
            return
        found["computed"] += 1
        assert isinstance(figure, float | None)
        assert isinstance(value, float | np.number | np.bool_ | np.ndarray)
        assert np.asarray(value).dtype.kind in "biuf"
        assert np.ndim(value) <= 1
        assert np.size(value) <= POINTS
        assert all(np.array_equal(before[name], VALUES[name], equal_nan=True) for name in VALUES)

    check()
    assert audit.events.keys() <= HARMLESS
    assert found["computed"] > 0
    assert found["refused"] > 0
