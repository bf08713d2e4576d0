"""The figures of a run: expressions over its outputs, and the functions that they may use."""

import ast
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import reduce
from inspect import signature
from math import isfinite, isnan, nan
from types import CodeType
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.files.messages import brief, shown
from rov_fmu.motion.riccati import RISE

Array = npt.NDArray[np.float64]
_STEADY = 0.1
"""The last part of a window, over which the mean is what is steady."""
_ARGUMENTS = re.compile(r"Error running function .* and kwargs \{.*?\}: ", re.S)
"""What asteval tells of a call before it tells what is wrong."""
_METHOD = re.compile(r"Responses\.\w+")
_NEVER = ("must be one number", "NotImplementedError", "AttributeError", "TypeError", "NameError")
"""How reasons begin that no run can change."""
_PLAIN = (
    ast.Expression, ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.UnaryOp, ast.UAdd, ast.USub, ast.Subscript,
    ast.Slice, ast.keyword, ast.Name, ast.Load,
)  # fmt: skip
"""What arithmetic of outputs is made of, besides numbers and calls."""
_NUMBERS_OF = ("abs", "max", "mean", "min", "sum")
"""Functions of NumPy whose values are numbers."""
_NOT_FOR_FIGURES = ("open", "print", "dir", "type", "loadtxt", "genfromtxt", "fromfile", "fromregex")
_BAND = 0.05
"""Of the way from the beginning: within it a response is settled."""


class Responses:
    """What an expression may call: functions of an output over the times of a run (s)."""

    def __init__(self, times: Array) -> None:
        self._times = times
        self._slack = 1e-9 * max(1.0, abs(times[0]), abs(times[-1]))
        self._windows: dict[tuple[float | None, float | None], tuple[slice, slice]] = {}
        self.functions: dict[str, Callable[..., float]] = {
            "V_ss": self.steady, "Tau": self.time_constant, "overshoot": self.overshoot,
            "settling_time": self.settling_time, "at": self.at, "final": self.final,
        }  # fmt: skip
        """By the name in an expression."""

    def at(self, y: Array, time: float) -> float:
        """y at a time, straight between two points."""
        self._see(time)
        return float(np.interp(time, self._times, y))

    def final(self, y: Array) -> float:
        """The last y."""
        return float(y[-1])

    def steady(self, y: Array, start: float | None = None, end: float | None = None) -> float:
        """Steady y: its mean over the last tenth of the time from `start` to `end`."""
        return float(y[self._window(start, end)[1]].mean())

    def time_constant(self, y: Array, start: float | None = None, end: float | None = None) -> float:
        """Time from `start` until y has gone 1 - 1/e of its way to the steady value; NaN where it goes nowhere."""
        way, t = self._way(y, start, end)
        n = int((way >= RISE).argmax())
        if not way[n] >= RISE:
            return nan
        share = (RISE - way[n - 1]) / (way[n] - way[n - 1])  # n is not 0, where the way is 0
        return float(t[n - 1] + share * (t[n] - t[n - 1]) - t[0])

    def overshoot(self, y: Array, start: float | None = None, end: float | None = None) -> float:
        """How far y goes beyond its steady value, by its way there: 0.1 is 10 %. NaN where it goes nowhere."""
        way, _ = self._way(y, start, end)
        return float(np.maximum(way.max() - 1.0, 0.0))

    def settling_time(
        self, y: Array, start: float | None = None, end: float | None = None, band: float = _BAND
    ) -> float:
        """Time from `start` until y stays within a band of its steady value; NaN where it never does.

        A band of 0.05 is 5 % of its way there.
        """
        way, t = self._way(y, start, end)
        outside = np.flatnonzero(~(np.abs(way - 1.0) <= band))
        n = int(outside[-1]) + 1 if outside.size else 0
        return float(t[n] - t[0]) if n < len(way) else nan

    def _window(self, start: float | None, end: float | None) -> tuple[slice, slice]:
        """The points between two times, both included but for rounding, and those of their last tenth."""
        if (start, end) not in self._windows:
            t, slack = self._times, self._slack
            self._see(*(time for time in (start, end) if time is not None))
            first = int(np.searchsorted(t, (t[0] if start is None else start) - slack))
            last = int(np.searchsorted(t, (t[-1] if end is None else end) + slack))
            if first >= last:
                raise ValueError(f"there is no communication point from {start} to {end}")
            steady = t[last - 1] - _STEADY * (t[last - 1] - t[first]) - slack
            self._windows[start, end] = slice(first, last), slice(int(np.searchsorted(t, steady)), last)
        return self._windows[start, end]

    def _see(self, *times: float) -> None:
        """That they are times of the run."""
        first, last = self._times[0], self._times[-1]
        for time in times:
            if not first - self._slack <= time <= last + self._slack:
                raise ValueError(f"there is no time {time:g} s in a run from {first:g} to {last:g} s")

    def wrong_times(self, call: ast.Call) -> str:
        """What is wrong with the times that are given in numbers where one of the functions is called; or nothing."""
        function = self.functions.get(call.func.id) if isinstance(call.func, ast.Name) else None
        if function is None:
            return ""
        try:
            written = signature(function).bind(*call.args, **{k.arg or "": k.value for k in call.keywords})
        except TypeError:  # told as that
            return ""
        given = {key: _constant(node) for key, node in written.arguments.items()}
        try:
            self._window(given.get("time"), None)
            self._window(given.get("start"), given.get("end"))
        except ValueError as error:
            return str(error)
        return ""

    def _way(self, y: Array, start: float | None, end: float | None) -> tuple[Array, Array]:
        """How far y has come, 0 where it is first and 1 where it is steady; NaN where that is the same. The times."""
        window, steady = self._window(start, end)
        part = y[window]
        whole = y[steady].mean() - part[0]
        return (part - part[0]) / (whole or nan), self._times[window]


TIME = "t"
"""The times of the communication points, in an expression."""
BY_NAME = "out"
"""Variables whose name is none in Python, in an expression: out["der(u)"]."""


def _interpreter() -> Any:
    """Of expressions: NumPy's functions, no statements."""
    from asteval import Interpreter

    interpreter = Interpreter(minimal=True, with_ifexp=True, with_listcomp=True, use_numpy=True)
    for name in _NOT_FOR_FIGURES:
        interpreter.symtable.pop(name, None)
    # Python's own skip NaN, or not, as it comes
    numpys = {"max": _of_all("max", np.max, np.maximum), "min": _of_all("min", np.min, np.minimum), "sorted": np.sort}
    interpreter.symtable.update(numpys)
    return interpreter


def _of_all(name: str, of_one: Callable[[Any], Any], of_two: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """NumPy's function of an array, and of several values as Python has it."""

    def function(y: Any, *others: Any) -> Any:
        return reduce(of_two, others, y) if others else of_one(y)

    function.__qualname__ = name  # as errors tell it
    return function


def known_names() -> set[str]:
    """What an expression may name besides variables."""
    return {*_interpreter().symtable, *Responses(np.zeros(1)).functions, TIME, BY_NAME}


def names_in(expression: str) -> set[str]:
    """What an expression names, but for what it binds itself. Raises ValueError with the reason where it is none."""
    try:
        tree = ast.fix_missing_locations(ast.parse(expression.strip(), mode="eval"))  # as asteval does
    except (SyntaxError, RecursionError, MemoryError) as error:
        reason = getattr(error, "msg", "too long")
        raise ValueError(f"is no expression: {reason}") from error
    names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
    bound = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    quoted = {
        n.slice.value
        for n in ast.walk(tree)
        if isinstance(n, ast.Subscript) and isinstance(n.value, ast.Name) and n.value.id == BY_NAME
        and isinstance(n.slice, ast.Constant) and isinstance(n.slice.value, str)
    }  # fmt: skip
    return (names - bound) | quoted


def _constant(node: ast.expr) -> float | None:
    """The number that is written there; None of what a run must tell."""
    code = None if any(isinstance(n, ast.Name) for n in ast.walk(node)) else compiled(ast.unparse(node))
    with suppress(Exception):
        if code and isinstance(value := eval(code, {"__builtins__": {}}), int | float):
            return value
    return None


def taken_of(module: str, expression: str) -> str:
    """The first name that is taken of a module, as max in np.max(y); or nothing."""
    taken = (
        n.attr
        for n in ast.walk(ast.parse(expression.strip(), mode="eval"))
        if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id == module
    )
    return next(taken, "")


def compiled(expression: str) -> CodeType | None:
    """Arithmetic with the functions above and numbers alone, as code, which is many times faster; of others None.

    Nothing in it can reach further than asteval lets it, or grow: it has no attributes, texts, lists and powers.
    """
    functions = {*Responses(np.zeros(1)).functions, *_NUMBERS_OF}
    with suppress(RecursionError, MemoryError):  # too long
        tree = ast.parse(expression.strip(), mode="eval")
        if all(_is_plain(node, functions) for node in ast.walk(tree)):
            return compile(tree, "figure", "eval")
    return None


def _is_plain(node: ast.AST, functions: set[str]) -> bool:
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id in functions
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float)
    return isinstance(node, _PLAIN)


class Figures:
    """The figures of a plan, for one thread at a time."""

    def __init__(self, expressions: Mapping[str, str], times: Array) -> None:
        self.names = tuple(expressions)
        self._interpreter = _interpreter()
        self._symbols = self._interpreter.symtable
        functions = Responses(times).functions
        self._symbols |= {TIME: times} | functions
        self._called = {function.__qualname__: name for name, function in functions.items()}
        self._parsed = {
            name: (compiled(text), self._interpreter.parse(text.strip())) for name, text in expressions.items()
        }

    def of(self, run: Mapping[str, Any]) -> tuple[list[float], str]:
        """In the order of their names, for a run's outputs and parameters; NaN with its reason where there is none."""
        self._symbols.update(run)
        self._symbols[BY_NAME] = run
        found, reasons = [], []
        with np.errstate(all="ignore"):
            for name, (code, parsed) in self._parsed.items():
                value, reason = self._soon(code) or self._value(parsed)
                if not (reason or isfinite(value)):
                    reason = f"is {'NaN' if isnan(value) else 'infinite'}"
                found.append(nan if reason else value)
                reasons += [f"{name}: {reason}"] if reason else []
        return found, "; ".join(reasons)

    def _soon(self, code: CodeType | None) -> tuple[float, str] | None:
        """The number by code; None where there is none, and asteval shall say why."""
        with suppress(Exception):
            if code and isinstance(value := eval(code, {"__builtins__": {}}, self._symbols), float):
                return float(value), ""
        return None

    def _value(self, parsed: Any) -> tuple[float, str]:
        interpreter = self._interpreter
        interpreter.error = []
        try:
            value = interpreter.run(parsed, with_raise=False)
        except Exception as error:  # whatever an expression can do
            return nan, brief(f"{type(error).__name__}: {error}")
        if interpreter.error:
            _, words = interpreter.error[0].get_error()
            told = _ARGUMENTS.sub("", words.strip()).splitlines()[-1].strip()
            return nan, brief(_METHOD.sub(lambda method: self._called[method[0]], told))
        if np.ndim(value) != 0 or not isinstance(value, int | float | np.number | np.bool_):
            return nan, f"must be one number, and not {shown(value)}"
        return float(value), ""


def unusable(expression: str, variables: Iterable[str], varied: Iterable[str], run_times: Array) -> str:
    """Why an expression is no figure, whatever the run; nothing where a run must tell. There may be no times yet."""
    for n in ast.walk(ast.parse(expression.strip(), mode="eval")):
        if run_times.size and isinstance(n, ast.Call) and (reason := Responses(run_times).wrong_times(n)):
            return reason
    times = np.linspace(0.0, 1.0, 11)
    run = {**dict.fromkeys(variables, times), **dict.fromkeys(varied, 1.0)}
    with warnings.catch_warnings():  # of NumPy, on numbers that are none of the FMU's
        warnings.simplefilter("ignore", RuntimeWarning)
        reason = Figures({"": expression}, times).of(run)[1].removeprefix(": ")
    return reason if reason.startswith(_NEVER) else ""
