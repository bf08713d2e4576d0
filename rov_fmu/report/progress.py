"""Progress on stderr: the parts of a command's work, one after another, or several at once.

A terminal shows a line for each part: ✓ and its duration, or its progress and the approximate remaining time. The lines
disappear when the work ends or is interrupted. A pipe or a file gets one line as each part ends, except for the last
part, whose end the result shows.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from time import perf_counter
from typing import Protocol

from rich.console import RenderableType
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TaskID, TimeElapsedColumn
from rich.progress_bar import ProgressBar
from rich.table import Column, Table
from rich.text import Text

from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import Progress as OnProgress
from rov_fmu.io.messages import print_message
from rov_fmu.report.console import console, paragraph

_BAR = 12
"""The width of a bar, which leaves room for the words on a terminal of 80 columns."""


class Parts:
    """The parts of a command's work, on a terminal or in a pipe."""

    def __init__(self, display: Progress | None) -> None:
        self._display = display
        self._running: dict[str, tuple[float, TaskID | None]] = {}
        """When each running part began, s, and its line."""

    def begin(self, *names: str) -> OnProgress:
        """End the running parts and begin new ones. Returns the progress of the last of these."""
        while self._running:
            self.end(next(iter(self._running)))
        for name in names:
            task = self._display.add_task(name, total=1.0, count="") if self._display else None
            self._running[name] = perf_counter(), task
        return partial(self.show, names[-1])

    def end(self, name: str) -> None:
        """Say that a part is done."""
        began, task = self._running.pop(name)
        if self._display and task is not None:
            self._display.update(task, completed=1.0, description=name, count="")
        else:
            self.print(f"{name}: done in {perf_counter() - began:.1f} s")

    def show(self, name: str, step: str, share: float, count: str = "") -> None:
        """Show the step of a running part, and the share that is done or, if given, a count."""
        _, task = self._running[name]
        if self._display and task is not None:
            self._display.update(task, completed=min(share, 0.999), description=step, count=count or f"{share:.0%}")

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


@contextmanager
def parts() -> Iterator[Parts]:
    """Show the parts of the work of the block."""
    out = console(stderr=True)
    if not (out.is_terminal and out.file.isatty()):  # Rich calls a pipe a terminal if FORCE_COLOR is set, as in Jupyter
        yield Parts(None)
        return
    fixed = Column(no_wrap=True, min_width=1)  # Rich cuts the others where a column is empty
    columns = (
        SpinnerColumn(finished_text="✓"),
        _Words(Column(ratio=1, no_wrap=True, overflow="ellipsis")),
        _Share(fixed),
        TimeElapsedColumn(fixed),
        TimeLeftColumn(fixed),
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


class StudyParts:
    """The parts of a study: the start of the workers, and the runs. A pipe gets a line for each tenth of the runs."""

    def __init__(self, shown: Parts) -> None:
        self._parts = shown
        shown.begin("starting the workers")
        self._began: float | None = None
        self._done_before = self._tenth = 0

    def update(self, now: StudyProgress) -> None:
        """Show how many runs are done and failed. The first call prints the address of Dask's dashboard, too."""
        if self._began is None:
            self._parts.begin("runs")
            self._began, self._done_before = perf_counter(), now.done
            self._tenth = 10 * now.done // max(now.total, 1)
            if now.dashboard and self._parts.is_shown:
                self._parts.print(f"what the workers do: {now.dashboard}")
        if now.done == self._done_before:
            return
        rate = (now.done - self._done_before) / max(perf_counter() - self._began, 1e-3)
        words = f"{per_second(rate)}{f', {now.failed:,} failed' if now.failed else ''}"
        count = f"{now.done:,}/{now.total:,}"
        share = (now.done - self._done_before) / (now.total - self._done_before)
        self._parts.show("runs", words, share, count)
        before, self._tenth = self._tenth, 10 * now.done // now.total
        if before < self._tenth < 10 and not self._parts.is_shown:
            self._parts.print(f"{count} runs, {words}")


def per_second(rate: float) -> str:
    """Return a rate of runs in words: 1,120 runs/s."""
    return f"{rate:,.0f} runs/s" if rate >= 10.0 else f"{rate:.2g} runs/s"


# ---- The columns on a terminal ---------------------------------------------------------------------------------------


class _Words(ProgressColumn):
    """The name of a part, or the step that it is at, in the room that the other columns leave."""

    def render(self, task: Task) -> RenderableType:
        """Return the words."""
        return task.description


class _Share(ProgressColumn):
    """A bar and a count, if the part is running and its share is known."""

    def render(self, task: Task) -> RenderableType:
        """Return the bar with the count behind it."""
        if task.finished or task.completed <= 0.0:
            return Text("")
        row = Table.grid(padding=(0, 1))
        row.add_row(ProgressBar(1.0, task.completed, width=_BAR), Text(task.fields["count"]))
        return row


class TimeLeftColumn(ProgressColumn):
    """The approximate remaining time of work whose share is known only at a few moments.

    It follows from the time and the share of the work at the last of these moments, and counts down from there.
    """

    def __init__(self, table_column: Column | None = None) -> None:
        super().__init__(table_column)
        self._whole: dict[TaskID, tuple[float, float]] = {}
        """The last known share of each part, and the time that all of it takes, s."""

    def render(self, task: Task) -> Text:
        """Return the time left in minutes and seconds; nothing before any work is done, and at the end."""
        if task.elapsed is None or task.completed <= 0.0 or task.finished:
            return Text("")
        if task.completed != self._whole.get(task.id, (0.0, 0.0))[0]:
            self._whole[task.id] = task.completed, task.elapsed / task.completed
        minutes, seconds = divmod(round(max(self._whole[task.id][1] - task.elapsed, 0.0)), 60)
        return Text(f"about {minutes}:{seconds:02} left")
