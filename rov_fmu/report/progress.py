"""Progress on stderr: the parts of a command's work, one after another, or several at once.

A terminal shows a line for each part: ✓ and its duration, or its progress and the remaining time. The lines disappear
when the work ends or is interrupted. A pipe or a file gets one line as each part ends, except for the last part, whose
end the result shows, and one at least every ten seconds. First answers stand above these lines on a terminal, where
each replaces the last one, and get a line each in a pipe.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from math import exp
from threading import Event, Lock, Thread
from time import perf_counter
from typing import Any

from rich.console import RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column
from rich.text import Text

from rov_fmu.io.interrupts import cleaned_up
from rov_fmu.io.messages import Progress as OnProgress
from rov_fmu.io.messages import one_line, print_message
from rov_fmu.report.console import console, paragraph

_EVERY = 10.0
"""The time between two lines about running work in a pipe, s."""


_TELLING = 0.05
"""The share of the work from which the time that is left is told."""


class _Running:
    """A part that is running."""

    def __init__(self, name: str) -> None:
        self.words, self.began = name, perf_counter()
        self.task: TaskID | None = None
        """Its line on a terminal."""
        self._share, self._at, self._goes_on = 0.0, self.began, True

    def reach(self, words: str, share: float, *, goes_on: bool) -> None:
        """Take the step that the part is at, the share that is done, and whether more is being done."""
        self._goes_on = goes_on
        if share > self._share:
            self._share, self._at = share, perf_counter()
        self.words = words

    @property
    def so_far(self) -> float:
        """For how long it has been running, s."""
        return perf_counter() - self.began

    @property
    def left(self) -> float | None:
        """For how long it will be running, s; None as long as too little is done, and while nothing is done.

        It follows from the time in which the share was done, and becomes smaller until the next share is done. Even
        where this takes longer than all that was left, something is left.
        """
        is_known = self._goes_on and self._share > _TELLING
        left = (self._at - self.began) * (1.0 / self._share - 1.0) if is_known else 0.0
        return left * exp((self._at - perf_counter()) / left) if left else None


class Parts:
    """The parts of a command's work, on a terminal or in a pipe."""

    def __init__(self, display: "Display | None") -> None:
        self._display = display
        self._running: dict[str, _Running] = {}
        self._lock = Lock()

    def begin(self, *names: str) -> OnProgress:
        """End the running parts and begin new ones. Returns the progress of the last of these."""
        for name in [*self._running]:
            self.end(name)
        for name in names:
            running = _Running(name)
            if self._display:
                running.task = self._display.add_task(one_line(name), total=1.0, count="", running=running)
            with self._lock:
                self._running[name] = running
        return partial(self.show, names[-1])

    def end(self, name: str) -> None:
        """Say that a part is done."""
        with self._lock:
            running = self._running.pop(name)
        if self._display and running.task is not None:
            self._display.update(running.task, completed=1.0, description=one_line(name), count="")
        else:
            self.print(f"{name}: done in {running.so_far:.1f} s")

    def show(self, name: str, step: str, share: float, count: str = "", *, goes_on: bool = True) -> None:
        """Show the step of a running part, and the share that is done or, if given, a count.

        `goes_on` is False while nothing is done, so that nobody knows how long it will take.
        """
        running, words = self._running[name], count or f"{share:.0%}"
        with self._lock:
            running.reach(f"{step}, {words}", share, goes_on=goes_on)
        if self._display and running.task is not None:
            self._display.update(running.task, completed=min(share, 0.999), description=one_line(step), count=words)

    def tell(self, subject: str, answer: str) -> None:
        """Show the answer about a subject that is known so far. On a terminal, it replaces the one before."""
        line = f"so far: {answer}"
        if self._display:
            self._display.answers[subject] = line
        else:
            self.print(line)

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
            lines = [(running.words, running.so_far, running.left) for running in self._running.values()]
        for words, so_far, left in lines:
            self.print(f"{words} ({so_far:.0f} s so far{'' if left is None else f', about {left:.0f} s left'})")


class _Left(ProgressColumn):
    """The time that is left, as a pipe gets it."""

    def render(self, task: Task) -> Text:
        left = None if task.finished else task.fields["running"].left
        return Text("" if left is None else str(timedelta(seconds=round(left))), style="progress.remaining")


class Display(Progress):
    """The parts on a terminal, below the answers so far."""

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        self.answers: dict[str, str] = {}
        super().__init__(*columns, **options)

    def get_renderables(self) -> Iterator[RenderableType]:
        """Yield the answers, and the parts."""
        yield from (Text(line, no_wrap=True, overflow="ellipsis") for line in [*self.answers.values()])
        yield from super().get_renderables()


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
        _Left(),
    )
    display = Display(*columns, console=out, transient=True, expand=True)
    display.start()
    with cleaned_up(display.stop):
        yield Parts(display)


@contextmanager
def compiling() -> Iterator[tuple[Callable[[Sequence[str]], None], Callable[[str], None]]]:
    """Show a part for the content of an FMU, and then one for each platform; these are compiled in parallel.

    Yields the function to call with the platforms when the compilers begin, and the one to call with each that is done.
    A pipe gets a line for each of several platforms.
    """
    with parts() as shown:
        if shown.is_shown:
            shown.begin("making the content")

        chosen: list[str] = []

        def begin(platforms: Sequence[str]) -> None:
            chosen.extend(platforms)
            if platforms:
                shown.begin(*(f"compiling {name}" for name in platforms))

        def done(name: str) -> None:
            if shown.is_shown or len(chosen) > 1:
                shown.end(f"compiling {name}")

        yield begin, done


@dataclass(frozen=True)
class StudyProgress:
    """The progress of a study, or of a part of it."""

    done: int
    """The number of runs that are done, including those of earlier calls."""
    total: int
    failed: int
    """The number of runs that failed in this call."""


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
        """Show how many runs are done and failed."""
        time, reports = perf_counter(), self._reports
        if not reports:
            self._parts.begin("runs")
            self._done_before, self._result = now.done, time
        elif now.done > reports[-1][1]:
            self._result = time
        reports.append((time, now.done))
        if len(reports) == 1:
            return
        while reports[1][0] <= time - _EVERY:
            reports.popleft()
        began, before = reports[0]
        goes_on = now.done > before
        if goes_on:
            speed = per_second((now.done - before) / max(time - began, 1e-3))
        else:
            speed = f"{time - self._result:.0f} s without a result"
        words = f"{speed}{f', {now.failed:,} failed' if now.failed else ''}"
        share = (now.done - self._done_before) / max(now.total - self._done_before, 1)
        self._parts.show("runs", words, share, f"{now.done:,}/{now.total:,} runs", goes_on=goes_on)


def per_second(rate: float) -> str:
    """Return a rate of runs in words: 1,120 runs/s."""
    return f"{rate:,.0f} runs/s" if rate >= 10.0 else f"{rate:.2g} runs/s"
