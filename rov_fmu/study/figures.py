"""The figures of a run: expressions over its outputs, and the functions of time that they may call."""

import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from math import isfinite, isnan, nan
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.equation.alone import RISE
from rov_fmu.io.messages import RovError, brief, reason_of
from rov_fmu.study.expression import (
    CONSTANTS,
    FUNCTIONS,
    TIME,
    FigureExpression,
    elements,
)

Array = npt.NDArray[np.float64]
_ANY_TIMES = np.zeros(1)
_STEADY = 0.1
"""The share of a window, at its end, over which the steady value is the mean."""
_BAND = 0.05
"""The share of the whole change within which a response has settled."""


class TimeError(RovError, ValueError):
    """A call names a time that a run does not have."""


class Responses:
    """The functions of an output over the times of a run (s) that an expression may call."""

    def __init__(self, times: Array) -> None:
        self._times = times
        self._slack = 1e-9 * max(1.0, abs(times[0]), abs(times[-1]))
        self.functions: dict[str, Callable[..., Any]] = {
            "V_ss": self.steady,
            "Tau": self.time_constant,
            "overshoot": self.overshoot,
            "settling_time": self.settling_time,
            "at": self.at,
            "final": self.final,
        }
        """The functions by their names in an expression."""

    def at(self, y: Array, /, time: float) -> float:
        """Return y at a time, interpolated linearly."""
        self._check_times(time)
        return float(np.interp(time, self._times, y))

    def final(self, y: Array, /) -> float:
        """Return the last y."""
        return float(elements(y)[-1])

    def steady(self, y: Array, /, start: float | None = None, end: float | None = None) -> float:
        """Return the steady y: its mean over the last tenth of the time from `start` to `end`."""
        return self._window(y, start, end)[2]

    def time_constant(self, y: Array, /, start: float | None = None, end: float | None = None) -> float:
        """Return the time from `start` until 1 - 1/e of the change to the steady value; NaN without a change."""
        t, change = self._change(y, start, end)
        n = int((change >= RISE).argmax())
        if not change[n] >= RISE:
            return nan
        share = (RISE - change[n - 1]) / (change[n] - change[n - 1])  # n is not 0, because the first change is 0
        return float(t[n - 1] + share * (t[n] - t[n - 1]) - t[0])

    def overshoot(self, y: Array, /, start: float | None = None, end: float | None = None) -> float:
        """Return the largest excess of y over its steady value, divided by its change; NaN without a change."""
        return float(np.maximum(self._change(y, start, end)[1].max() - 1.0, 0.0))

    def settling_time(
        self, y: Array, /, start: float | None = None, end: float | None = None, band: float = _BAND
    ) -> float:
        """Return the time from `start` until y stays within a band around its steady value; NaN if it never does.

        A band of 0.05 is 5 % of the change to the steady value.
        """
        t, change = self._change(y, start, end)
        outside = np.flatnonzero(~(np.abs(change - 1.0) <= band))
        n = int(outside[-1]) + 1 if outside.size else 0
        return float(t[n] - t[0]) if n < len(change) else nan

    def _window(self, y: Array, start: float | None, end: float | None) -> tuple[Array, Array, float]:
        """Return the times from one to another, within rounding, y at these, and the mean of its last tenth."""
        t, slack = self._times, self._slack
        begin, finish = t[0] if start is None else start, t[-1] if end is None else end
        self._check_times(begin, finish)
        first, last = np.searchsorted(t, (begin - slack, finish + slack)).tolist()
        if first >= last:
            raise TimeError(f"there is no communication point from {begin:g} to {finish:g}")
        t, y = t[first:last], elements(y)[first:last]
        return t, y, float(y[t >= t[-1] - _STEADY * (t[-1] - t[0]) - slack].mean())

    def _change(self, y: Array, start: float | None, end: float | None) -> tuple[Array, Array]:
        """Return the times, and y scaled to 0 at the start and 1 when steady, or NaN if these are the same."""
        t, y, steady = self._window(y, start, end)
        return t, (y - y[0]) / (steady - y[0] or nan)

    def _check_times(self, *times: float) -> None:
        """Raise TimeError if a time is not in the run, or else ValueError if it is NaN."""
        first, last = self._times[0], self._times[-1]
        for time in times:
            if time < first - self._slack or time > last + self._slack:
                raise TimeError(f"there is no time {time:g} s in a run from {first:g} to {last:g} s")
        if isnan(sum(times)):
            raise ValueError("a time is NaN")


def read_expression(text: str, times: Array = _ANY_TIMES) -> FigureExpression:
    """Read an expression over the times of a run. Raises ExpressionError with the reason."""
    return FigureExpression(text, {**FUNCTIONS, **Responses(times).functions})


class Figures:
    """The figures of a plan, for one thread at a time. Raises ExpressionError."""

    def __init__(self, expressions: Mapping[str, str], times: Array) -> None:
        self._expressions = {name: read_expression(text, times) for name, text in expressions.items()}
        self._constants = {**CONSTANTS, TIME: times}

    def of(self, run: Mapping[str, Any]) -> tuple[list[float | None], str]:
        """Compute the figures from the outputs and parameters of a run.

        A figure without a value is None, and the text has the reason.
        """
        values = {**self._constants, **run}
        found, reasons = list[float | None](), []
        with np.errstate(all="ignore"):
            for name, expression in self._expressions.items():
                try:
                    found.append(_number(expression, values))
                except Exception as error:  # NumPy raises many kinds
                    found.append(None)
                    reasons.append(f"{name}: {_words(error)}")
        return found, "; ".join(reasons)


def _number(expression: FigureExpression, values: Mapping[str, Any]) -> float:
    """Return the value of an expression. Raises TypeError or ValueError if it is no finite number, and any other."""
    value = expression.value(values)
    if isinstance(value, np.ndarray):
        raise TypeError("must be one number, and not an array")
    if not isfinite(value):
        raise ValueError(f"is {'NaN' if isnan(value) else 'infinite'}")
    return float(value)


def _words(error: Exception) -> str:
    """Return why an expression has no value. Python's message about a division differs between versions."""
    return "division by zero" if isinstance(error, ZeroDivisionError) else brief(reason_of(error))


def unusable(text: str, variables: Iterable[str], varied: Collection[str], times: Array) -> str:
    """Return why an expression cannot be a figure of any run at these times, or an empty text if that depends on the
    run.

    All values of the run are NaN here, so that a wrong type or a wrong time is found if it does not depend on them.
    """
    expression = read_expression(text, times)
    none = np.full(len(times), nan)
    values = {**CONSTANTS, TIME: times, **dict.fromkeys(variables, none), **dict.fromkeys(varied, nan)}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # from NumPy, about values that do not come from the FMU
        try:
            _number(expression, values)
        except Exception as error:
            numbers = expression.names.intersection(varied)
            if numbers and isinstance(error, TypeError):
                return f"{_words(error)}; {min(numbers)} varies, and what varies is a number"
            # No operation gives an array that is longer than a run; NumPy names the size.
            beyond = isinstance(error, IndexError) and str(error).endswith(f" with size {len(times)}")
            if beyond or isinstance(error, TypeError | TimeError) or expression.names <= CONSTANTS.keys():
                return _words(error)
    return ""
