"""Progress on stderr: the parts of a command's work, one after another, or several at once.

A terminal shows a line for each part: ✓ and its duration, or its progress and the remaining time. The lines disappear
when the work ends or is interrupted. A pipe or a file gets one line as each part ends, except for the last part, whose
end the result shows, and one at least every ten seconds.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from threading import Event, Lock, Thread
from time import perf_counter
from typing import Protocol

from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Column

from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import Progress as OnProgress
from rov_fmu.io.messages import one_line, print_message
from rov_fmu.report.console import console, paragraph

_EVERY = 10.0
"""The time between two lines about running work in a pipe, s."""


_TELLING = 0.05
"""The share of the work from which the time that is left is told."""


class Parts:
    """The parts of a command's work, on a terminal or in a pipe."""

    def __init__(self, display: Progress | None) -> None:
        self._display = display
        self._running: dict[str, tuple[float, TaskID | None]] = {}
        """When each running part began, s, and its line on a terminal."""
        self._steps: dict[str, tuple[str, float]] = {}
        """The step that each running part is at, in a pipe, and the share that is done."""
        self._lock = Lock()

    def begin(self, *names: str) -> OnProgress:
        """End the running parts and begin new ones. Returns the progress of the last of these."""
        for name in [*self._running]:
            self.end(name)
        for name in names:
            task = self._display.add_task(one_line(name), total=1.0, count="") if self._display else None
            with self._lock:
                self._running[name] = perf_counter(), task
        return partial(self.show, names[-1])

    def end(self, name: str) -> None:
        """Say that a part is done."""
        with self._lock:
            began, task = self._running.pop(name)
        if self._display and task is not None:
            self._display.update(task, completed=1.0, description=one_line(name), count="")
        else:
            self.print(f"{name}: done in {perf_counter() - began:.1f} s")

    def show(self, name: str, step: str, share: float, count: str = "", *, goes_on: bool = True) -> None:
        """Show the step of a running part, and the share that is done or, if given, a count.

        `goes_on` is False while nothing is done, so that nobody knows how long it will take.
        """
        _, task = self._running[name]
        words = count or f"{share:.0%}"
        if self._display and task is not None:
            self._display.update(task, completed=min(share, 0.999), description=one_line(step), count=words)
        with self._lock:
            self._steps[name] = f"{step}, {words}", share if goes_on else 0.0

    @property
    def is_shown(self) -> bool:
        """True on a terminal, which shows each step."""
        return self._display is not None

    def print(self, message: str) -> None:
        """Print a line, on a terminal above the parts."""
        if self._display:
            paragraph(self._display.console, f"rov-fmu: {message}", "  ")
        else:
            print_message(f"rov-fmu: {message}")

    def print_running(self) -> None:
        """Print a line about each running part: its step, for how long it has been running, and how long it will."""
        with self._lock:
            lines = [(*self._steps.get(name, (name, 0.0)), began) for name, (began, _) in self._running.items()]
        for words, share, began in lines:
            so_far = perf_counter() - began
            left = f", about {so_far * (1.0 / share - 1.0):.0f} s left" if share > _TELLING else ""
            self.print(f"{words} ({so_far:.0f} s so far{left})")


@contextmanager
def parts() -> Iterator[Parts]:
    """Show the parts of the work of the block."""
    out = console(stderr=True)
    if not (out.is_terminal and out.file.isatty()):  # Rich calls a pipe a terminal if FORCE_COLOR is set, as in Jupyter
        shown, ended = Parts(None), Event()

        def repeat() -> None:
            while not ended.wait(_EVERY):
                shown.print_running()

        Thread(target=repeat, daemon=True).start()
        with cleaned_up(ended.set):
            yield shown
        return
    words = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    columns = (
        SpinnerColumn(finished_text="✓"),
        TextColumn("{task.description}", markup=False, table_column=words),
        BarColumn(bar_width=12),
        TextColumn("{task.fields[count]}", markup=False),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    display = Progress(*columns, console=out, transient=True, expand=True)
    display.start()
    with cleaned_up(display.stop):
        yield Parts(display)


@contextmanager
def compiling(platforms: Sequence[str]) -> Iterator[tuple[Callable[[], None], Callable[[str], None]]]:
    """Show a part for the content of an FMU, and then one for each platform; these are compiled in parallel.

    Yields the function to call when the compilers begin, and the one to call with each platform that is done. A pipe
    gets a line for each of several platforms.
    """
    with parts() as shown:
        if shown.is_shown:
            shown.begin("making the content")

        def begin() -> None:
            if platforms:
                shown.begin(*(f"compiling {name}" for name in platforms))

        def done(name: str) -> None:
            if shown.is_shown or len(platforms) > 1:
                shown.end(f"compiling {name}")

        yield begin, done


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

    @property
    def has_workers(self) -> bool:
        """False while no worker is there."""


class StudyParts:
    """The parts of a study: its start, and the runs."""

    def __init__(self, shown: Parts) -> None:
        self._parts = shown
        shown.begin("starting the study")
        self._reports = deque[tuple[float, int]]()
        """The time of each report of the last ten seconds, and of the one before, with the number of runs done."""
        self._done_before = 0
        self._result = 0.0
        """The time of the latest result, or of the first report."""

    def update(self, now: StudyProgress) -> None:
        """Show how many runs are done and failed. The first call prints the address of Dask's dashboard, too."""
        time, reports = perf_counter(), self._reports
        if not reports:
            self._parts.begin("runs")
            self._done_before, self._result = now.done, time
            if now.dashboard and self._parts.is_shown:
                self._parts.print(f"what the workers do: {now.dashboard}")
        elif now.done > reports[-1][1]:
            self._result = time
        reports.append((time, now.done))
        if len(reports) == 1:
            return
        while reports[1][0] <= time - _EVERY:
            reports.popleft()
        began, before = reports[0]
        goes_on = now.has_workers and now.done > before
        if goes_on:
            speed = per_second((now.done - before) / max(time - began, 1e-3))
        else:
            speed = f"{'' if now.has_workers else 'no worker is there, '}{time - self._result:.0f} s without a result"
        words = f"{speed}{f', {now.failed:,} failed' if now.failed else ''}"
        share = (now.done - self._done_before) / max(now.total - self._done_before, 1)
        self._parts.show("runs", words, share, f"{now.done:,}/{now.total:,} runs", goes_on=goes_on)


def per_second(rate: float) -> str:
    """Return a rate of runs in words: 1,120 runs/s."""
    return f"{rate:,.0f} runs/s" if rate >= 10.0 else f"{rate:.2g} runs/s"
