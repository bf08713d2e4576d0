"""The figures of a run: expressions over its outputs, and the functions of time that they may call."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from math import isfinite, isnan, nan
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.io.messages import brief, shown
from rov_fmu.model.riccati import RISE
from rov_fmu.study.plan.expression import BY_NAME, CONSTANTS, FUNCTIONS, TIME, Expression, Function

Array = npt.NDArray[np.float64]
_STEADY = 0.1
"""The last part of a window, over which the mean is what is steady."""
_NEVER = ("must be one number", "TypeError")
"""How the reasons begin that hold for every run."""
_MOST_WINDOWS = 1000
_BAND = 0.05
"""Of the way from the beginning: within it a response is settled."""


class Responses:
    """What an expression may call: functions of an output over the times of a run (s)."""

    def __init__(self, times: Array) -> None:
        self._times = times
        self._slack = 1e-9 * max(1.0, abs(times[0]), abs(times[-1]))
        self._windows: dict[tuple[float | None, float | None], tuple[slice, slice]] = {}
        own: dict[str, Callable[..., float]] = {
            "V_ss": self.steady,
            "Tau": self.time_constant,
            "overshoot": self.overshoot,
            "settling_time": self.settling_time,
            "at": self.at,
            "final": self.final,
        }
        self.functions = {name: Function.by_name(method) for name, method in own.items()}
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
            begin, finish = t[0] if start is None else start, t[-1] if end is None else end
            first, last = int(np.searchsorted(t, begin - slack)), int(np.searchsorted(t, finish + slack))
            if first >= last:
                raise ValueError(f"there is no communication point from {begin:g} to {finish:g}")
            if len(self._windows) == _MOST_WINDOWS:  # times that vary from run to run would fill the memory
                self._windows.clear()
            steady = t[last - 1] - _STEADY * (t[last - 1] - t[first]) - slack
            self._windows[start, end] = slice(first, last), slice(int(np.searchsorted(t, steady)), last)
        return self._windows[start, end]

    def _see(self, *times: float) -> None:
        """That they are times of the run."""
        first, last = self._times[0], self._times[-1]
        for time in times:
            if not first - self._slack <= time <= last + self._slack:
                raise ValueError(f"there is no time {time:g} s in a run from {first:g} to {last:g} s")

    def wrong_times(self, given: Mapping[str, Any]) -> str:
        """What is wrong with the times among the constant values of a call, by parameter; an empty text if nothing."""
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


def read_expression(text: str) -> Expression:
    """Read an expression apart from any run. Raises ExpressionError with the reason if it is not allowed."""
    return Expression(text, {**FUNCTIONS, **Responses(np.zeros(1)).functions})


def meaning(name: str) -> str:
    """What a name is that is not a variable of the FMU, if an expression cannot use it as a value."""
    if name in {**FUNCTIONS, **Responses(np.zeros(1)).functions}:
        return f"{name} is a function: write {name}(...)"
    if name == BY_NAME:
        return f'{BY_NAME} gives a variable by its name: write {BY_NAME}["der(u)"]'
    return ""


class Figures:
    """The figures of a plan, for one thread at a time. Raises ExpressionError."""

    def __init__(self, expressions: Mapping[str, str], times: Array) -> None:
        functions = {**FUNCTIONS, **Responses(times).functions}
        self._expressions = {name: Expression(text, functions) for name, text in expressions.items()}
        self._constants = {**CONSTANTS, TIME: times}

    def of(self, run: Mapping[str, Any]) -> tuple[list[float], str]:
        """The figures in order, for a run's outputs and parameters; NaN, and the reason, for one that has no value."""
        values = {**self._constants, **run}
        found, reasons = [], []
        with np.errstate(all="ignore"):
            for name, expression in self._expressions.items():
                value, reason = _number(expression, values)
                found.append(nan if reason else value)
                reasons += [f"{name}: {reason}"] if reason else []
        return found, "; ".join(reasons)


def _number(expression: Expression, values: Mapping[str, Any]) -> tuple[float, str]:
    """The value of an expression, or NaN with the reason why it is not one finite number."""
    try:
        value = expression.value(values)
    except ZeroDivisionError:  # Python's words for it differ between versions
        return nan, "ZeroDivisionError: division by zero"
    except Exception as error:  # NumPy raises many kinds
        return nan, brief(f"{type(error).__name__}: {error}")
    if isinstance(value, np.ndarray):
        return nan, f"must be one number, and not {shown(value)}"
    number = float(value)
    return number, "" if isfinite(number) else f"is {'NaN' if isnan(number) else 'infinite'}"


def unusable(text: str, variables: Iterable[str], varied: Iterable[str], run_times: Array) -> str:
    """Why an expression cannot be a figure of any run; an empty text if that depends on the run.

    `run_times` may be empty if the plan does not say them properly.
    """
    expression = read_expression(text)
    if run_times.size:
        responses = Responses(run_times)
        for given in expression.constant_values:
            if reason := responses.wrong_times(given):
                return reason
    times = np.linspace(0.0, 1.0, 11)
    run = {**dict.fromkeys(variables, times), **dict.fromkeys(varied, 1.0)}
    with warnings.catch_warnings():  # of NumPy, on numbers that do not come from the FMU
        warnings.simplefilter("ignore", RuntimeWarning)
        reason = Figures({"": text}, times).of(run)[1].removeprefix(": ")
    is_constant = expression.names <= CONSTANTS.keys()
    return reason if is_constant or reason.startswith(_NEVER) else ""
