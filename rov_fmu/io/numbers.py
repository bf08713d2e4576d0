"""Numbers as text, with the digits that their intervals or their readers need, and the numbers that arguments take."""

from collections.abc import Callable, Iterable
from decimal import Decimal
from math import floor, inf, isfinite, log10, nextafter
from numbers import Real
from typing import Any, NamedTuple

from rov_fmu.io.messages import InputError, shown

_EXACT = 1e-9
"""The width of an interval relative to its value up to which the value is exact, and the width is rounding."""
_WIDTH_IN_UNITS = 3.0
"""The least width of a written interval in units of the last digit. The width is then known to a third."""
_NEAR_ZERO = 0.01
"""The value relative to the width of an interval around 0 below which it is written as 0."""


def with_interval(value: float, interval: tuple[float, float] | None, digits: int = 4) -> tuple[str, str, str]:
    """Return a value and the ends of its interval as text, with digits that suit the width of the interval.

    36.98 from 36.974 to 37.004 becomes 36.98, 36.97, 37.00: all three have the same decimals, and the interval is at
    least three units of the last one wide. Where this would leave less than two digits of the value, each number has
    two significant digits of its own, and a value that is small beside an interval around 0 becomes 0. Rounding keeps
    the order of numbers, so an interval that contains its value is never written as one that does not. Where there is
    no interval, or one that is as narrow as rounding, the value has the given number of significant digits. The ends
    are empty where there is no interval.
    """
    if interval is None:
        return significant(value, digits), "", ""
    low, high = interval
    width = high - low
    if low <= 0.0 <= high and abs(value) < _NEAR_ZERO * width:
        value = 0.0
    if width > _EXACT * abs(value) and all(map(isfinite, (value, low, high))):
        exponent, digits = floor(log10(width / _WIDTH_IN_UNITS)), 2
        if abs(value) >= 10.0 ** (exponent + 1):
            return _rounded(value, exponent), _rounded(low, exponent), _rounded(high, exponent)
    return significant(value, digits), significant(low, digits), significant(high, digits)


def _rounded(number: float, exponent: int) -> str:
    """Return a number rounded to a multiple of a power of ten: 36.98 for 36.982 and -2."""
    return _plain(+Decimal(number).quantize(Decimal(1).scaleb(exponent)))  # the sign makes 0 of -0


class NumberRange(NamedTuple):
    """The finite numbers that an argument takes: an option of a command, and the keyword of the same name in Python."""

    allowed: str
    """What they are, in messages."""
    least: float = -inf
    most: float = inf
    kind: type[float] = float

    def checked(self, key: str, given: Any) -> Any:
        """Return a number of the kind. Raises InputError with the name of the argument about anything else."""
        is_number = isinstance(given, Real)
        if is_number and self.least <= given <= self.most and isfinite(given) and (of := self.kind(given)) == given:
            return of
        raise InputError(f"{key} = {shown(given)}: must be {self.allowed}")


ABOVE_0 = nextafter(0.0, 1.0)
LENGTHS = NumberRange("a time above 0, s", ABOVE_0)
"""The length of a step or of a motion."""
MOTIONS = NumberRange("a time above 0 and at most 1e+06, s", ABOVE_0, 1e6)
"""The length of a motion in steps, and of each."""
WORKERS = NumberRange("a whole number from 1 to 1024", 1, 1024, int)
"""The number of processes or of threads."""
TIME_LIMITS = NumberRange("a number of seconds above 0, at most 1e6", ABOVE_0, 1e6)
"""The time that the program of a stranger may take."""
TOLERANCES = NumberRange("a number above 0", ABOVE_0)
"""A relative tolerance."""
NUMBERS = NumberRange("a finite number")
GAIN_VALUES = NumberRange("a number that is at least 0", 0.0)
"""A gain, or the limit of one."""


def significant(number: float, digits: int) -> str:
    """Return a number as text with `digits` significant digits: 0.30, 420."""
    return _plain(Decimal(f"{number:.{digits - 1}e}")) if number and isfinite(number) else f"{number:g}"


def csv_of(names: Iterable[str], rows: Iterable[Iterable[float]], number: Callable[[float], str] = repr) -> str:
    """Return rows of numbers as a CSV file with the names above. By default each number has all its digits."""
    return "".join(",".join(line) + "\n" for line in (names, *(map(number, row) for row in rows)))


def percent(share: float) -> str:
    """Return a share in percent: `17%`; how far it is above 100 % tells nobody more: `more than 100%`."""
    return f"{share:.0%}" if share <= 1.0 else "more than 100%"


def _plain(number: Decimal) -> str:
    """Return a decimal number with its digits, and with an exponent only where it is very small or very large."""
    return f"{number:f}" if not number or -5 <= number.adjusted() < 6 else f"{number:e}"
