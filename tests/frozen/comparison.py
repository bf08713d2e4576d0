"""How a known result is compared with that of today: the same words, and numbers that are as close as they repeat.

What is computed repeats but for rounding. A fit ends a little apart on another processor, which adds in another order:

- J is minimised to ENOUGH, so an evidence, which is a difference of two J, may differ by as much.
- An estimate and the ends of its interval may move by a share of the width of the interval, and a correlation by this
  share of its range.
- Any other number follows from these, and may change by a share of itself.

Such a number may also be rounded to the next one with the same digits. A digit alone is a count, and stays, except in a
percentage.
"""

import re
from collections.abc import Iterator, Sequence
from difflib import unified_diff
from itertools import accumulate
from math import isclose

from rov_fmu.identify.likelihood.solve import ENOUGH
from rov_fmu.report.templates import RAISED

_OF_INTERVAL = 0.02
"""The share of the width of an interval: 0.09 standard errors, with which J rises by 0.008."""
_OF_NUMBER = 0.005
"""The share of another number of a fit."""
_POWER = re.compile("(·|\\b)10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_PLAIN = {raised: digit for digit, raised in RAISED.items()}
_N = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_NUMBER = re.compile(_N)
_INTERVAL = re.compile(rf'({_N})(?:, unit = "[^"]*", interval = \[|[^|\d(]*\()({_N})(?:, | to )({_N})[])]')
"""A value with the ends of its interval, in a vehicle file and in a sentence."""
_CORRELATIONS = re.compile(r"correlation = \{.*?\}")


def differences(kept: str, made: str, *, is_fit: bool) -> list[str]:
    """Return the lines in which a result of today differs from the one that is kept, marked by - and +."""
    old, new = kept.splitlines(), made.splitlines()
    plain = [_plain(line) for line in old]
    reaches = _of_fit(plain) if is_fit else map(_exact, plain)
    is_same = map(_same, plain, map(_plain, new), reaches)
    as_kept = [a if same else b for a, b, same in zip(old, new, is_same, strict=False)] + new[len(old) :]
    return [*unified_diff(old, as_kept, "kept", "now", n=1, lineterm="")]


def _plain(line: str) -> str:
    """Return a line with its numbers as Python reads them: -1.2e-5 for −1.2·10⁻⁵, and 1e6 for 10⁶."""
    line = line.replace("−", "-")
    return _POWER.sub(lambda found: f"{'' if found[1] else 1}e{found[2].translate(_PLAIN)}", line)


def _same(old: str, new: str, reaches: Sequence[float]) -> bool:
    """Return True if two lines have the same words, and numbers that are within reach of each other."""
    if _NUMBER.sub("0", old) != _NUMBER.sub("0", new):
        return False
    numbers = zip(_NUMBER.findall(old), _NUMBER.findall(new), reaches, strict=True)
    return all(isclose(float(a), float(b), rel_tol=1e-12, abs_tol=reach) for a, b, reach in numbers)


def _exact(line: str) -> list[float]:
    """Return how far the numbers of a line may move that repeat but for rounding."""
    return [1e-12 + 1e-9 * abs(float(number)) for number in _NUMBER.findall(line)]


def _of_fit(lines: Sequence[str]) -> Iterator[list[float]]:
    """Yield how far the numbers of each line of a fit may move."""
    heads: list[str] = []
    for line in lines:
        cells = line.split("|")
        if "| 95 % from |" in line or "| Evidence |" in line:
            heads = [cell.strip() for cell in cells]
        elif len(cells) == 1:
            heads = []  # the table has ended
        known = [*_known(line, cells, heads if len(heads) == len(cells) else [])]
        yield [_reach(line, number, known) for number in _NUMBER.finditer(line)]


def _known(line: str, cells: Sequence[str], heads: Sequence[str]) -> Iterator[tuple[int, int, float]]:
    """Yield the parts of a line, from a character to another, whose numbers are known to a size, with this size."""
    for found in _CORRELATIONS.finditer(line):
        yield *found.span(), 2.0 * _OF_INTERVAL
    for found in _INTERVAL.finditer(line):
        value, low, high = map(float, found.groups())
        if low <= value <= high:
            yield *found.span(), _OF_INTERVAL * (high - low)
    ends = [*accumulate(len(cell) + 1 for cell in cells)]
    for n, head in enumerate(heads):
        if head == "Evidence":
            yield ends[n - 1], ends[n], ENOUGH
        elif head == "95 % from" and all(_NUMBER.fullmatch(cell.strip()) for cell in cells[n - 1 : n + 2]):
            low, high = map(float, cells[n : n + 2])
            yield ends[n - 2], ends[n + 1], _OF_INTERVAL * (high - low)


def _reach(line: str, number: re.Match[str], known: Sequence[tuple[int, int, float]]) -> float:
    """Return how far a number of a fit may move: as far as it is known, and to the next one with the same digits."""
    mantissa, _, exponent = number[0].lstrip("-").partition("e")
    is_count = len(mantissa) == 1 and not line[number.end() :].lstrip().startswith("%")
    digit = 0.0 if is_count else 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    other = 0.0 if is_count else _OF_NUMBER * abs(float(number[0]))
    return digit + next((size for first, end, size in known if first <= number.start() < end), other)
