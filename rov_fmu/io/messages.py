"""Messages to the user: errors, hints, progress, and values on one printable line."""

import os
import reprlib
import shutil
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from textwrap import wrap

from rov_fmu.io.groups import grouped

MOST = 10
"""The largest number of mistakes in a file that are printed. The others are only counted."""

_MOST_NAMES = 20
"""The largest number of names in a message that lists those that exist."""
NO_FILE = "there is no such file"
"""The reason if a file is missing."""

Progress = Callable[[str, float], None]
"""A function that is called with the name of the next step and the share of the work that is done, from 0 to 1, or NaN
where nothing tells it."""


def silent(_step: str, _share: float) -> None:
    """Show no progress."""


def part(on_progress: Progress, low: float, high: float) -> Progress:
    """Return the progress of a part of the work, from the share `low` to the share `high` of all of it."""
    return lambda step, share: on_progress(step, low + (high - low) * share)


class RovError(Exception):
    """Everything that rov-fmu raises of its own. The message is a line for each reason.

    `except rov_fmu.RovError` catches them all:

        RovError
            BuildError
                OptionError
            ChildError *
                LimitError *
            DivergedError *
            ExpressionError *
            FileError
                DataFileError
                    UnreadableFileError
                NoResultsError
                PlanError
                SystemPlanError *
                VehicleFileError
            InputError
                UnknownNameError
            LoadError *
            MismatchError *
            ProofError
            RunError *
                CallError *
            StudyError
            TimeError *
            TuningError
            WriteError

    FileError, InputError, MismatchError, OptionError and TuningError are also a ValueError, UnknownNameError is a
    KeyError, and WriteError an OSError. Those with a star are internal: they become one of the others before they reach
    a caller.
    """


class _LinesError(RovError):
    """An exception whose message has a line for each reason."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("\n".join(map(one_line, reasons)))

    def __reduce__(self) -> tuple[type["_LinesError"], tuple[str, ...]]:
        """Return what pickle needs: the lines."""
        return type(self), tuple(str(self).split("\n"))


class FileError(_LinesError, ValueError):
    """A file that cannot be used. Each reason is a line with the file, the place, the value and what is allowed."""


class InputError(_LinesError, ValueError):
    """An argument that cannot be used. The message is a line with its name, its value and what is allowed."""


class UnknownNameError(InputError, KeyError):
    """A name that does not exist in a result."""

    __str__ = ValueError.__str__


class ProofError(_LinesError):
    """An FMU that does not keep what it claims, such as the results that it contains. Each reason is a line."""


class StudyError(_LinesError):
    """A study that cannot continue. Its finished runs are kept."""


def lines_on(path: Path, mistakes: Iterable[str]) -> list[str]:
    """Return a line for each of the first ten different mistakes in a file, and one with the number of the others.

    An empty string stands for a mistake that is only counted.
    """
    all_mistakes = [*mistakes]
    different = [*dict.fromkeys(filter(None, all_mistakes))]
    lines = [f"{path}: {line}" for line in different[:MOST]]
    if more := len(different[MOST:]) + all_mistakes.count(""):
        lines.append(f"{path}: {more} more mistake{'s' if more > 1 else ''}")
    return lines


def first_of(lines: Sequence[str], most: int = 100) -> list[str]:
    """Return the first of many lines, and a line with the number of the others."""
    more = len(lines) - most
    return [*lines[:most], *([f"{more} more"] if more > 0 else [])]


def one_line(text: str) -> str:
    """Return the text with line breaks, control characters and undecodable bytes escaped, as Python writes them."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def print_message(text: str) -> None:
    """Print a line to stderr: on a terminal in lines that end between words, in a pipe as it is.

    All messages are printed here, and all other text by `rov_fmu.report.console`. Both escape control characters,
    because a name or value of a stranger's file could otherwise change what the terminal shows.
    """
    if not sys.stderr:
        return
    line = one_line(text)
    if sys.stderr.isatty():
        try:
            columns = os.get_terminal_size(sys.stderr.fileno()).columns
        except (OSError, ValueError):
            columns = 0
        line = wrapped(line, columns or shutil.get_terminal_size().columns, "  ")
    print(line, file=sys.stderr)


def wrapped(text: str, width: int, indent: str = "") -> str:
    """Return the text in lines of a width that end between words; those after the first are indented."""
    return "\n".join(wrap(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False))


def brief(text: str, most: int = 80) -> str:
    """Return the text on one line, cut to a largest number of characters."""
    clean = one_line(text[: most + 20])
    return clean if len(clean) <= most else f"{clean[: most - 3]}..."


def reason_of(error: BaseException) -> str:
    """Return the text of an exception that a library raised.

    If it has no text, these are words for its kind, because the name of a class tells a user nothing.
    """
    text = str(error).strip()
    if isinstance(error, KeyError) and text:
        return f"{text} is missing"
    known = (words for kind, words in _WITHOUT_TEXT.items() if isinstance(error, kind))
    return text or next(known, "no reason is known")


_WITHOUT_TEXT: dict[type[BaseException], str] = {
    MemoryError: "the memory is not enough",
    EOFError: "it ends too early",
    TimeoutError: "it takes too long",
    NotImplementedError: "it has a part of an unknown kind",
}


def capitalized(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def listed(words: Iterable[str], before_last: str = "and") -> str:
    """Return words as in a sentence: a, b and c."""
    *some, last = [*words] or [""]
    return f"{', '.join(some)} {before_last} {last}" if some else last


def similar(name: str, names: Iterable[str], most: int = 1) -> list[str]:
    """Return the names that are most similar to an unknown one, without regard to case; the most similar is first.

    Of equally similar names, one with which the unknown name begins is first: for u_left, this is u_l, and not u_t.
    """
    by_folded = grouped((known.casefold(), known) for known in names)
    unknown = name.casefold()

    def closeness(known: str) -> tuple[float, bool]:
        return SequenceMatcher(None, known, unknown).ratio(), unknown.startswith(known)

    close = sorted(get_close_matches(unknown, by_folded, len(by_folded) or 1), key=closeness, reverse=True)
    return [known for folded in close for known in by_folded[folded]][:most]


def only(name: str, names: Collection[str], in_words: str = "") -> str:
    """Return the end of a message about an unknown name: the first names that exist, and the most similar one.

    `in_words` replaces the list of the names with commas. If there is only one name, it is not suggested again.
    """
    hint = did_you_mean(name, names) if len(names) > 1 else ""
    return f", only {in_words or ', '.join(first_of([*names], _MOST_NAMES))}{hint}"


def did_you_mean(name: str, names: Iterable[str], most: int = 1, also: Mapping[str, str] | None = None) -> str:
    """Return the end of a message about an unknown name: `; did you mean ...?`, or nothing if no name is similar.

    `also` has other words that people use, each with the text to suggest for it.
    """
    words = {**{known: known for known in names}, **(also or {})}
    suggestions = dict.fromkeys(words[word] for word in similar(name, words, most))
    return f"; did you mean {' or '.join(suggestions)}?" if suggestions else ""


class _Repr(reprlib.Repr):
    """A repr of limited length, which shows only a few levels and entries of a value."""

    def repr_int(self, x: int, level: int) -> str:
        """Write very long numbers in hexadecimal, because Python refuses to write them in decimals."""
        return super().repr_int(x, level) if x.bit_length() < 1000 else hex(x)


_REPR = _Repr()
_REPR.maxstring = _REPR.maxother = 80


def shown(value: object) -> str:
    """Return any value as a message shows it."""
    return brief(_REPR.repr(value))
