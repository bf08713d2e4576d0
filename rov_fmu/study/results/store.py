"""The folder of a study's results: a description of the study, and Parquet files that are written whole.

The part 3/64 of a study is such a folder of its own in it, parts/3-of-64, until all parts are merged.
"""

import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rov_fmu import __version__
from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import FileError, first_of, listed
from rov_fmu.io.output import Output, WriteError, put_whole, write_whole
from rov_fmu.io.reading import read_text

PAGE, STUDY, RUNS, TRAJECTORIES, PARTS = "study.html", "study.json", "runs", "trajectories", "parts"
_FORMAT = 1
_LOCK = ".lock"
_FILE = re.compile(r"part-(\d{9,})-(\d{9,})\.parquet")
_PART = re.compile(r"([1-9]\d{0,7})-of-([1-9]\d{0,7})")
_SHOWN = 10
"""The number of parts that a message names."""


@dataclass(frozen=True)
class Part:
    """One of several parts of a study, which may run on different machines at different times."""

    number: int
    """From 1 to the count."""
    count: int

    def runs(self, total: int) -> tuple[int, int]:
        """Return the first run of this part, and the one after its last one. The sizes of parts differ by at most 1."""
        return (self.number - 1) * total // self.count, self.number * total // self.count

    @staticmethod
    def numbers(first: int, end: int, total: int, count: int) -> range:
        """Return the numbers of the parts that have runs from a first one to the one before the last one."""
        one, last = (-(-(run + 1) * count // total) for run in (first, end - 1))
        return range(one, last + 1)

    def store(self, whole: Path, *, force: bool = False) -> "Store":
        """Return the folder of this part in the folder of the whole study."""
        return Store(whole / PARTS / f"{self.number}-of-{self.count}", force=force)


def is_description(path: Path) -> bool:
    """Return True if a file is the description of a study, which the same study writes again."""
    try:
        return path.name == STUDY and bool(Store(path.parent).description())
    except FileError:
        return False


class Store:
    """A folder of results. A range of runs is done as soon as its file in runs/ exists."""

    def __init__(self, folder: Path, *, force: bool = False) -> None:
        """`force` allows replacing a file that is no description of a study, but has its name."""
        self.folder, self._force = folder, force

    @contextmanager
    def held(self) -> Iterator[None]:
        """Create and lock the folder. At the end, a new folder is removed if no run is done. Raises FileError,
        WriteError."""
        import locket

        is_new = not self.folder.exists()
        try:
            for each in (self.folder, self.folder / RUNS, self.folder / TRAJECTORIES):
                each.mkdir(parents=each.parent.name == PARTS, exist_ok=True)
            lock = locket.lock_file(str(self.folder / _LOCK), timeout=0)
            try:
                lock.acquire()
            except locket.LockError:
                raise FileError(f"{self.folder}: another study is writing there") from None
        except OSError as error:
            raise WriteError(error.errno, error.strerror, str(error.filename or self.folder)) from error

        def leave() -> None:
            if is_new and not self.done():
                shutil.rmtree(self.folder, ignore_errors=True)
            lock.release()

        with cleaned_up(leave, "the same command continues the study"):
            yield

    def check(self, study: Mapping[str, Any]) -> None:
        """Check that the runs in the folder, if there are any, belong to a study. Raises FileError."""
        if not (done := self.done()):
            return
        if not (self.folder / STUDY).exists():
            raise FileError(f"{self.folder}: has runs, but {STUDY}, which describes them, is missing")
        old, new = self.description(), study
        reason = ""
        if (engine := old.get("engine", "fmu")) != new["engine"]:
            reason = f"holds runs of --engine {engine}"
        elif old["fmu"] != new["fmu"]:
            why = (
                f", for the vehicle {name} has changed, or rov-fmu, which builds it" if (name := new["vehicle"]) else ""
            )
            reason = f"holds runs of another FMU{why}"
        elif changed := sorted(
            key for key in {*old["plan"], *new["plan"]} if old["plan"].get(key) != new["plan"].get(key)
        ):
            reason = f"holds runs of another plan ({', '.join(changed)} changed)"
        elif old["runs"] != new["runs"] and self.folder.parent.name == PARTS:
            reason = f"is a part of {old['runs']} runs, and not of {new['runs']}"
        if reason:
            raise FileError(f"{self.folder}: {reason}: choose another folder")
        if (end := done[-1][1]) > new["runs"]:
            raise FileError(f"{self.folder}: has runs up to number {end - 1}, but the plan has only {new['runs']} runs")

    def describe(self, study: Mapping[str, Any]) -> None:
        """Check that existing runs belong to a study, and write its description. Raises FileError, WriteError."""
        self.check(study)
        self._clean()
        text = json.dumps(
            {"format": _FORMAT, "made_by": f"rov-fmu {__version__}", **study}, indent=2, ensure_ascii=False
        )
        output = Output(self.folder / STUDY, f"{text}\n".encode())
        write_whole(output, force=self._force, is_ours=is_description)

    def merge(self, study: Mapping[str, Any]) -> None:
        """Move the runs of all parts into this folder. An interrupted call is continued by the next one.

        Raises FileError about parts that are missing, not complete, or of another study; WriteError.
        """
        names = [_PART.fullmatch(path.name) for path in (self.folder / PARTS).glob("*")]
        parts = sorted((int(name[2]), int(name[1])) for name in names if name)
        if not parts:
            raise FileError(f"{self.folder}: has no parts to merge: run each with --part, as in --part 1/8")
        (count, _), (other, _) = parts[0], parts[-1]
        if count != other:
            raise FileError(f"{self.folder / PARTS}: has parts of {count} and of {other}: remove those of one")
        runs = study["runs"]
        stores = [Part(number, count).store(self.folder) for _, number in parts]
        with ExitStack() as locks:
            for store in stores:
                locks.enter_context(store.held())
                store.check(study)
            own = self.done()
            files = [(store, span) for store in stores for span in store.done() if span not in own]
            gaps = _gaps([*own, *(span for _, span in files)], 0, runs)
            if lacking := sorted({n for gap in gaps for n in Part.numbers(*gap, runs, count)}):
                named = listed(first_of([str(number) for number in lacking], _SHOWN))
                raise FileError(
                    f"{self.folder}: of {count} parts, these are missing or not complete: {named}. "
                    f"Run them with --part, as in --part {lacking[0]}/{count}"
                )
            for store, (first, end) in files:
                if any(first < other_end and other < end for other, other_end in own):
                    raise FileError(f"{self.folder}: has runs that {store.folder} has, too: choose another folder")
            self.describe(study)
            for store, (first, end) in files:
                name = _name(first, end)
                trajectories = store.folder / TRAJECTORIES / name
                kept = trajectories.read_bytes() if trajectories.exists() else None
                self.write(first, end, (store.folder / RUNS / name).read_bytes(), kept)
        shutil.rmtree(self.folder / PARTS, ignore_errors=True)

    def description(self) -> dict[str, Any]:
        """Return the description of the study. Raises FileError."""
        path = self.folder / STUDY
        if not self.folder.is_dir():
            raise FileError(f"{self.folder}: there is no such folder")
        try:
            found = json.loads(read_text(path))
            known = isinstance(found, dict) and found.get("format") == _FORMAT
        except (ValueError, RecursionError):
            known = False
        if not known:
            raise FileError(
                f"{path}: is not the description of a study, or was written by another version of this tool"
            )
        return dict(found)

    def done(self) -> list[tuple[int, int]]:
        """Return the ranges of finished runs in order, each from the first to the one after the last."""
        names = (_FILE.fullmatch(path.name) for path in (self.folder / RUNS).iterdir())
        return sorted((int(name[1]), int(name[2]) + 1) for name in names if name)

    def missing(self, first: int, last: int) -> list[tuple[int, int]]:
        """Return the ranges of runs from a first one to the one before the last one that are not done."""
        return _gaps(self.done(), first, last)

    def write(self, first: int, end: int, runs: bytes, trajectories: bytes | None) -> None:
        """Write the rows of some runs, whole or not at all. Raises WriteError."""
        name = _name(first, end)
        outputs = [Output(self.folder / TRAJECTORIES / name, trajectories)] if trajectories is not None else []
        put_whole(*outputs, Output(self.folder / RUNS / name, runs))

    def _clean(self) -> None:
        """Remove unfinished files of a process that was killed."""
        there = {path.name for path in (self.folder / RUNS).iterdir()}
        for folder in (self.folder / RUNS, self.folder / TRAJECTORIES):
            for path in folder.iterdir():
                if path.name.startswith(".part-") or (_FILE.fullmatch(path.name) and path.name not in there):
                    path.unlink()


def _name(first: int, end: int) -> str:
    """Return the name of the files with the rows of some runs."""
    return f"part-{first:09d}-{end - 1:09d}.parquet"


def _gaps(done: Iterable[tuple[int, int]], first: int, last: int) -> list[tuple[int, int]]:
    """Return the ranges from a first number to the one before the last one that are not done."""
    found, begin = [], first
    for start, end in [*sorted(done), (last, last)]:
        if min(start, last) > begin:
            found.append((begin, min(start, last)))
        begin = max(begin, end)
    return found
