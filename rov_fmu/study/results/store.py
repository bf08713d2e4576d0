"""The folder of a study's results: a description of the study, and Parquet files with the rows of its runs.

A file is written whole, and says in its footer which study it belongs to and which runs it has. It counts only if that
is true: if its rows are those of its name, with their trajectories, if no other file has them, and if the checksums of
its pages are right. So parts of a study are files of one folder, wherever they were made: to merge is to copy.
"""

import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd  # noqa: F401 (PyArrow would import it at the first table, which takes a third of a second)
import pyarrow as pa
import pyarrow.parquet as pq

from rov_fmu import __version__
from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import FileError, brief, first_of, listed, reason_of
from rov_fmu.io.output import Output, WriteError, put_whole, write_whole
from rov_fmu.io.reading import read_text
from rov_fmu.study.plan.plan import RUN, TIME, TRAJECTORY

PAGE, STUDY, RUNS = "study.html", "study.json", "runs"
_FORMAT = 2
_LOCK = ".lock"
_ABOUT = b"rov-fmu"
"""The key of what a file says of itself in its footer."""
_DRAFT = re.compile(r"\.part-(\d+)-\d+\.parquet")
_SHOWN = 10
"""The number of files, or of ranges of runs, that a message names."""

Span = tuple[int, int]
"""The first of consecutive runs, and the one after the last."""


def parquet(table: pa.Table, study: Mapping[str, Any], first: int) -> bytes:
    """Return the file with the rows of runs from a first one on, which belong to a study."""
    about = {"first": first, "end": first + len(table), "study": {key: study[key] for key in ("plan", "fmu", "engine")}}
    sink = pa.BufferOutputStream()
    told = table.replace_schema_metadata({_ABOUT: json.dumps(about)})
    pq.write_table(told, sink, compression="zstd", write_page_checksum=True)
    return sink.getvalue().to_pybytes()  # type: ignore[no-any-return]


def old_rows(folder: Path, outputs: Sequence[str]) -> pa.Table:
    """Return the rows of a study of format 1, whose trajectories are in a folder of their own, a row for each time."""
    table = pq.read_table(folder / RUNS).sort_by(RUN)
    if not outputs:
        return table
    long = pq.read_table(folder / "trajectories").to_pandas().sort_values([RUN, TIME])
    by_run = {run: own[[TIME, *outputs]].to_dict("list") for run, own in long.groupby(RUN)}
    return table.append_column(TRAJECTORY, pa.array([by_run.get(run) for run in table[RUN].to_pylist()]))


def not_done(done: Iterable[Span], within: Span) -> list[Span]:
    """Return the ranges of a range of runs that are not done."""
    found, (begin, last) = [], within
    for start, end in [*sorted(done), (last, last)]:
        if min(start, last) > begin:
            found.append((begin, min(start, last)))
        begin = max(begin, end)
    return found


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
    def held(self, part: str = "") -> Iterator[None]:
        """Create the folder and lock it, or a part of it. At the end, a new folder is removed if no run is done.

        Raises FileError, WriteError.
        """
        import locket

        is_new = not self.folder.exists()
        try:
            for each in (self.folder, self.folder / RUNS):
                each.mkdir(exist_ok=True)
            lock = locket.lock_file(str(self.folder / f"{_LOCK}{part}"), timeout=0)
            lock.acquire()
        except locket.LockError:
            raise FileError(f"{self.folder}: another study is writing there") from None
        except OSError as error:
            raise WriteError(error.errno, error.strerror, str(error.filename or self.folder)) from error

        def leave() -> None:
            if is_new and not self._files() and len([*self.folder.glob(f"{_LOCK}*")]) == 1:
                shutil.rmtree(self.folder, ignore_errors=True)
            lock.release()

        with cleaned_up(leave, "the same command continues the study"):
            yield

    def checked(self, study: Mapping[str, Any], *, whole: bool = False) -> dict[Path, Span]:
        """Return the files in the order of their runs, once they are found to be those of a study.

        Each file is opened; `whole`: every page is read. Raises FileError with a line for each file that cannot count.
        """
        found, wrong = dict[Path, Span](), list[str]()
        for path in self._files():
            try:
                found[path] = _span(path, study, whole=whole)
            except FileError as error:
                wrong.append(str(error))
        for (path, (_, end)), (other, (first, _)) in pairwise(found.items()):
            if first < end:
                wrong.append(f"{other}: has runs that {path} has, too: remove one of them")
        if wrong:
            raise FileError(*first_of([*dict.fromkeys(wrong)], _SHOWN))
        return found

    def describe(self, study: Mapping[str, Any], runs: Span) -> list[Span]:
        """Check that existing runs belong to a study, and write its description. Return the missing ones of `runs`.

        Unfinished files of these runs are removed, which a process that was killed has left. Raises FileError,
        WriteError.
        """
        path = self.folder / STUDY
        if is_description(path) and self.description()["format"] != _FORMAT:
            raise FileError(f"{self.folder}: was written by an earlier version of this tool: choose another folder")
        done = [*self.checked(study).values()]
        if done and done[-1][1] > study["runs"]:
            last = done[-1][1] - 1
            raise FileError(f"{self.folder}: has runs up to number {last}, but the plan has only {study['runs']} runs")
        for draft in (self.folder / RUNS).glob(".part-*"):
            if (name := _DRAFT.match(draft.name)) and runs[0] <= int(name[1]) < runs[1]:
                draft.unlink()
        text = json.dumps(
            {"format": _FORMAT, "made_by": f"rov-fmu {__version__}", **study}, indent=2, ensure_ascii=False
        )
        write_whole(Output(path, f"{text}\n".encode()), force=self._force, is_ours=is_description)
        return not_done(done, runs)

    def check_complete(self, study: Mapping[str, Any]) -> None:
        """Check every page of every file, and that no run of a study is missing. Raises FileError."""
        if missing := not_done(self.checked(study, whole=True).values(), (0, study["runs"])):
            named = listed(first_of([f"{first} to {end - 1}" for first, end in missing], _SHOWN))
            advice = f"do them with --part, or copy their files into {RUNS}"
            raise FileError(f"{self.folder}: of {study['runs']} runs, these are missing: {named}: {advice}")

    def description(self) -> dict[str, Any]:
        """Return the description of the study. Raises FileError."""
        path, found = self.folder / STUDY, None
        if not self.folder.is_dir():
            raise FileError(f"{self.folder}: there is no such folder")
        with suppress(ValueError, RecursionError):
            found = json.loads(read_text(path))
        if not isinstance(found, dict) or found.get("format") not in (1, _FORMAT):
            words = "is not the description of a study, or was written by another version of this tool"
            raise FileError(f"{path}: {words}")
        return found

    def write(self, span: Span, rows: bytes) -> None:
        """Write the file with the rows of some runs, whole or not at all. Raises WriteError."""
        put_whole(Output(self.folder / RUNS / _name(span), rows))

    def _files(self) -> list[Path]:
        return sorted((self.folder / RUNS).glob("part-*.parquet"))


# ---- One file --------------------------------------------------------------------------------------------------------


def _name(span: Span) -> str:
    return f"part-{span[0]:09d}-{span[1] - 1:09d}.parquet"


def _parts(study: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the rows depend on, by the words with which a message tells that it has changed."""
    return {**study["plan"], "--engine": study["engine"], "the vehicle, the FMU or rov-fmu": study["fmu"]}


def _span(path: Path, study: Mapping[str, Any], *, whole: bool) -> Span:
    """Return the runs of a file. Raises FileError if it cannot count."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            schema, rows = file.schema_arrow, file.read(None if whole else [RUN])[RUN].to_pylist()
        about, has = json.loads(schema.metadata[_ABOUT]), schema.empty_table().flatten().column_names
        span = about["first"], about["end"]
        old, new = _parts(about["study"]), _parts(study)
        in_order = rows == [*range(span[0], span[0] + len(rows))] and len(rows) == span[1] - span[0]
    except (pa.ArrowException, OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        told = brief(reason_of(error).partition("\n")[0].partition(". ")[0])
        raise FileError(f"{path}: cannot be read: {told}. Remove it, and its runs are done again") from error
    if old != new:
        changed = brief(", ".join(sorted(key for key in {*old, *new} if old.get(key) != new.get(key))))
        raise FileError(f"{path.parents[1]}: holds runs of another study ({changed} changed): choose another folder")
    if not in_order or path.name != _name(span):
        raise FileError(f"{path}: has the runs {span[0]} to {span[1] - 1}, and not those of its name")
    columns = study["columns"]
    outputs = [TIME, *columns["outputs"]] if columns["outputs"] else []
    wanted = {*columns["parameters"], *columns["figures"], *(f"{TRAJECTORY}.{name}" for name in outputs)}
    if lacking := sorted(wanted.difference(has)):
        raise FileError(f"{path}: lacks {listed(lacking)}")
    return span
