"""Progress on a terminal: a line for each platform that is compiled, a bar of the work done, a bar of a study's runs.

The display disappears when the work ends or is interrupted. Where there is no terminal, nothing is shown.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Protocol

import click
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.report.console import console


@contextmanager
def compiling(platforms: Sequence[str]) -> Iterator[Callable[[str], None]]:
    """Show a line for each platform while it is compiled. Yields the function to call with a platform that is done."""
    with _shown(SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()) as progress:
        if progress is None:
            yield lambda _: None
        else:
            tasks = {name: progress.add_task(f"compiling {name}", total=1) for name in platforms}
            yield lambda name: progress.update(tasks[name], completed=1)


@contextmanager
def bar() -> Iterator[Callable[[str, float], None]]:
    """Show one bar, with the time taken and left.

    Yields the function to call with the name of the next step and the share of work done (0 to 1).
    """
    columns = (
        SpinnerColumn(),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TimeLeftColumn(),
        TextColumn("{task.description}"),
    )
    with _shown(*columns) as progress:
        if progress is None:
            yield lambda *_: None
        else:
            task = progress.add_task("reading", total=1.0)
            yield lambda step, share: progress.update(task, description=step, completed=share)


class TimeLeftColumn(ProgressColumn):
    """About the time left, for work whose share is known at a few moments only.

    It follows from the time and the share of the work at the last of these moments, and counts down from there.
    """

    def __init__(self) -> None:
        super().__init__()
        self._share = 0.0
        self._whole = 0.0
        """The time that all of the work takes, s."""

    def render(self, task: Task) -> Text:
        """Return the time left in minutes and seconds; nothing before any work is done."""
        if task.elapsed is None or task.completed <= 0.0:
            return Text("")
        if task.completed != self._share:
            self._share, self._whole = task.completed, task.elapsed / task.completed
        minutes, seconds = divmod(round(max(self._whole - task.elapsed, 0.0)), 60)
        return Text(f"about {minutes}:{seconds:02} left")


@contextmanager
def runs_bar() -> Iterator["RunsBar"]:
    """Show a bar of the runs of a study, with their rate and the time left."""
    columns = (
        SpinnerColumn(),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with _shown(*columns) as progress:
        yield RunsBar(progress)


class StudyProgress(Protocol):
    """The progress of a study, as rov_fmu/study/run/ reports it."""

    @property
    def done(self) -> int:
        """The number of runs that are done."""

    @property
    def total(self) -> int:
        """The number of all runs."""

    @property
    def failed(self) -> int:
        """The number of runs that failed."""

    @property
    def dashboard(self) -> str:
        """The address of Dask's page about its workers, or nothing."""


class RunsBar:
    """The bar of a study's runs, and the warnings above it."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._task = progress.add_task("starting the workers", total=None) if progress else None
        self._start: float | None = None
        self._done_before = 0

    def update(self, now: StudyProgress) -> None:
        """Show how many runs are done and failed. The first call prints the address of Dask's dashboard, too."""
        if self._progress is None or self._task is None:
            return
        if self._start is None:
            self._start, self._done_before = perf_counter(), now.done
            if now.dashboard:
                self._progress.console.print(f"what the workers do: {now.dashboard}", soft_wrap=True)
        rate = (now.done - self._done_before) / max(perf_counter() - self._start, 1e-3)
        words = f"{rate:,.0f} runs/s{f', {now.failed} failed' if now.failed else ''}"
        self._progress.update(self._task, total=now.total, completed=now.done, description=words)

    def warn(self, message: str) -> None:
        """Print a warning, above the bar if stderr is a terminal too."""
        line = f"rov-fmu: warning: {message}"
        if self._progress is not None and sys.stderr and sys.stderr.isatty():
            self._progress.console.print(line, soft_wrap=True)
        else:
            click.echo(line, err=True)


@contextmanager
def _shown(*columns: ProgressColumn) -> Iterator[Progress | None]:
    """Show progress until the block ends. Yields None if there is no terminal."""
    out = console()
    if not (out.is_terminal and out.file.isatty()):  # Rich calls a pipe a terminal if FORCE_COLOR is set, as in Jupyter
        yield None
        return
    progress = Progress(*columns, console=out, transient=True)
    progress.start()
    with cleaned_up(progress.stop):
        yield progress
