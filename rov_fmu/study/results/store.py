"""The folder of a study's results: a description of the study, and Parquet files that are written whole."""

import json
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rov_fmu import __version__
from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output, WriteError, write_whole
from rov_fmu.io.reading import read_text

STUDY, RUNS, TRAJECTORIES = "study.json", "runs", "trajectories"
_FORMAT = 1
_LOCK = ".lock"
_PART = re.compile(r"part-(\d{9,})-(\d{9,})\.parquet")


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
                each.mkdir(exist_ok=True)
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

    def belongs_to(self, plan: Mapping[str, Any], fmu: str, vehicle: str | None, runs: int, **description: Any) -> None:
        """Check that existing results belong to this plan and FMU (a digest), and write the description of the study.

        `vehicle` is the vehicle that the FMU was built from, if any. Raises FileError, WriteError.
        """
        path = self.folder / STUDY
        if self.done() and path.exists():
            old = self.description()
            if old["fmu"] != fmu:
                why = f", for the vehicle {vehicle} has changed, or rov-fmu, which builds it" if vehicle else ""
                raise FileError(f"{self.folder}: holds runs of another FMU{why}: choose another folder")
            keys = {*old["plan"], *plan}
            if changed := sorted(key for key in keys if old["plan"].get(key) != plan.get(key)):
                raise FileError(
                    f"{self.folder}: holds runs of another plan ({', '.join(changed)} changed): choose another folder"
                )
        elif self.done():
            raise FileError(f"{self.folder}: has runs, but {STUDY}, which describes them, is missing")
        if (end := max((end for _, end in self.done()), default=0)) > runs:
            raise FileError(f"{self.folder}: has runs up to number {end - 1}, but the plan has only {runs} runs")
        self._clean()
        head = {"format": _FORMAT, "made_by": f"rov-fmu {__version__}", "runs": runs, "plan": dict(plan), "fmu": fmu}
        text = json.dumps({**head, **description}, indent=2, ensure_ascii=False)
        write_whole(Output(path, f"{text}\n".encode()), force=self._force, is_ours=is_description)

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
        names = (_PART.fullmatch(path.name) for path in (self.folder / RUNS).iterdir())
        return sorted((int(name[1]), int(name[2]) + 1) for name in names if name)

    def missing(self, runs: int) -> list[tuple[int, int]]:
        """Return the ranges of runs that are not done."""
        found, begin = [], 0
        for first, end in [*self.done(), (runs, runs)]:
            if first > begin:
                found.append((begin, first))
            begin = max(begin, end)
        return found

    def write(self, first: int, end: int, runs: bytes, trajectories: bytes | None) -> None:
        """Write the rows of some runs, whole or not at all. Raises WriteError."""
        name = f"part-{first:09d}-{end - 1:09d}.parquet"
        outputs = [Output(self.folder / TRAJECTORIES / name, trajectories)] if trajectories is not None else []
        write_whole(*outputs, Output(self.folder / RUNS / name, runs), force=True)

    def _clean(self) -> None:
        """Remove unfinished files of a process that was killed."""
        there = {path.name for path in (self.folder / RUNS).iterdir()}
        for folder in (self.folder / RUNS, self.folder / TRAJECTORIES):
            for path in folder.iterdir():
                if path.name.startswith(".part-") or (_PART.fullmatch(path.name) and path.name not in there):
                    path.unlink()
