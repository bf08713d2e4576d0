"""Warnings that differ only in the recording or the axis they speak of become one."""

import re
from collections.abc import Iterable, Sequence

from rov_fmu.model.layout import AXES

_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_AXIS = re.compile(rf"({'|'.join(AXES)}): ")


def grouped(warnings: Iterable[str], files: Iterable[str]) -> tuple[str, ...]:
    """The warnings, alike ones as one in the place of the first.

    Of those that name a file the numbers may differ: the one names all files, and numbers from the lowest to the
    highest. Others must agree in every word but the axis that they begin with.
    """
    names = re.compile("|".join(re.escape(name) for name in sorted(files, key=len, reverse=True)) or r"(?!)")
    alike: dict[tuple[str, ...], list[str]] = {}
    for warning in dict.fromkeys(warnings):
        alike.setdefault(_key(warning, names), []).append(warning)
    return tuple(_as_one(group, names) for group in alike.values())


def _key(warning: str, names: re.Pattern[str]) -> tuple[str, ...]:
    """What warnings that become one have in common; a warning of several files stands alone."""
    said = _AXIS.sub("", warning, count=1) if _AXIS.match(warning) else warning
    if len({*names.findall(said)}) != 1:
        return said, "" if _AXIS.match(warning) and not names.search(said) else warning
    return (_NUMBER.sub("0", names.sub("\0", said)),)


def _as_one(group: Sequence[str], names: re.Pattern[str]) -> str:
    first = group[0]
    if len(group) == 1:
        return first
    axes = dict.fromkeys(found[1] for warning in group if (found := _AXIS.match(warning)))
    said = [_AXIS.sub("", warning, count=1) if _AXIS.match(warning) else warning for warning in group]
    if files := dict.fromkeys(found[0] for words in said if (found := names.search(words))):
        plain = [names.sub("\0", words) for words in said]
        numbers = iter(zip(*map(_NUMBER.findall, plain), strict=True))
        said = [_NUMBER.sub(lambda _: _span(next(numbers)), plain[0]).replace("\0", _listed(list(files)))]
    return f"{_listed(list(axes))}: {said[0]}" if axes else said[0]


def _span(numbers: Sequence[str]) -> str:
    low, high = min(numbers, key=float), max(numbers, key=float)
    return low if float(low) == float(high) else f"{low} ... {high}"


def _listed(words: Sequence[str]) -> str:
    """A, b and c."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
