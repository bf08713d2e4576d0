"""Messages to the user: whatever they tell of, one line that can be printed anywhere."""

import reprlib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

MOST = 10
"""Mistakes in a file that are told; the others are counted."""


class FileError(ValueError):
    """A file that cannot be used: a line for each reason, with file, place in it, value and what is allowed."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("\n".join(map(one_line, reasons)))


class InputError(ValueError):
    """An argument of a function that cannot be used: one line with its name, its value and what is allowed."""

    def __init__(self, reason: str) -> None:
        super().__init__(one_line(reason))


class UnknownNameError(InputError, KeyError):
    """A name that a result does not have."""

    __str__ = ValueError.__str__


class ProofError(Exception):
    """An FMU that does not come to the results that it carries."""


class StudyError(Exception):
    """A study that cannot go on; what is done is kept."""


def lines_on(path: Path, mistakes: Iterable[str]) -> list[str]:
    """A line for each of the first ten different mistakes in a file, and one that counts the others.

    An empty mistake is only counted.
    """
    every = [*mistakes]
    different = [*dict.fromkeys(filter(None, every))]
    more = len(different[MOST:]) + every.count("")
    counted = [f"{more} more mistake{'s' if more > 1 else ''}"] if more else []
    return [f"{path}: {line}" for line in (*different[:MOST], *counted)]


def one_line(text: str) -> str:
    """Line breaks, other control characters and undecodable bytes of a file's name as Python writes them."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def brief(text: str, most: int = 80) -> str:
    """On one line, and not endless."""
    clean = one_line(text[: most + 20])
    return clean if len(clean) <= most else f"{clean[: most - 3]}..."


def similar(name: str, names: Iterable[str], most: int = 1) -> list[str]:
    """The names that are most like an unknown one, whatever their case; the most similar comes first."""
    by_folded: dict[str, list[str]] = {}
    for known in names:
        by_folded.setdefault(known.casefold(), []).append(known)
    close = get_close_matches(name.casefold(), by_folded, most)
    return [known for folded in close for known in by_folded[folded]][:most]


def did_you_mean(name: str, names: Iterable[str], most: int = 1, also: Mapping[str, str] | None = None) -> str:
    """The end of a message about an unknown name: `; did you mean ...?`, or nothing where no name is similar.

    `also` has other words that people use, and the name or names that each of them stands for.
    """
    words = {**{known: known for known in names}, **(also or {})}
    found = dict.fromkeys(words[word] for word in similar(name, words, most))
    return f"; did you mean {' or '.join(found)}?" if found else ""


class _Repr(reprlib.Repr):
    """A few levels and entries of a value; the defaults would cut what fits into a message."""

    def repr_int(self, x: int, level: int) -> str:
        """Python refuses to write very long numbers in decimals."""
        return super().repr_int(x, level) if x.bit_length() < 1000 else hex(x)


_REPR = _Repr()
_REPR.maxstring = _REPR.maxother = 80


def shown(value: object) -> str:
    """Any value as a message shows it."""
    return brief(_REPR.repr(value))
