"""Progress on stderr: the parts of a command's work, one after another, or several at once.

A terminal shows a line for each part: ✓ and its duration, or its progress and the remaining time. The lines disappear
when the work ends or is interrupted. A pipe or a file gets one line as each part ends, except for the last part, whose
end the result shows, and one at least every ten seconds. First answers stand above these lines on a terminal, where
each replaces the last one, and get a line each in a pipe.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from threading import Event, Lock, Thread
from time import perf_counter
from typing import Any

from rich.console import RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
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


@dataclass
class _Running:
    """A part that is running."""

    words: str
    task: TaskID | None
    """Its line on a terminal."""
    began: float
    share: float = 0.0

    @property
    def so_far(self) -> float:
        """For how long it has been running, s."""
        return perf_counter() - self.began

    @property
    def left(self) -> float | None:
        """For how long it will be running, as fast as so far, s; None as long as too little is done."""
        return self.so_far * (1.0 / self.share - 1.0) if self.share > _TELLING else None


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
            task = self._display.add_task(one_line(name), total=1.0, count="") if self._display else None
            with self._lock:
                self._running[name] = _Running(name, task, perf_counter())
        return partial(self.show, names[-1])

    def end(self, name: str) -> None:
        """Say that a part is done."""
        with self._lock:
            running = self._running.pop(name)
        if self._display and running.task is not None:
            self._display.update(running.task, completed=1.0, description=one_line(name), count="")
        else:
            self.print(f"{name}: done in {running.so_far:.1f} s")

    def show(self, name: str, step: str, share: float, count: str = "") -> None:
        """Show the step of a running part, and the share that is done, if it is known, or a count, if it is given."""
        running, count = self._running[name], count or (f"{share:.0%}" if share >= 0.0 else "")
        with self._lock:
            running.words, running.share = f"{step}{count and f', {count}'}", share
        if self._display and running.task is not None:
            done = min(share, 0.999) if share >= 0.0 else 0.0
            self._display.update(running.task, completed=done, description=one_line(step), count=count)

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
        TimeRemainingColumn(),
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
        self._began, self._before = 0.0, -1
        """The time of the first report, and the runs that were done then."""

    def update(self, now: StudyProgress) -> None:
        """Show how many runs are done and failed."""
        if self._before < 0:
            self._parts.begin("runs")
            self._began, self._before = perf_counter(), now.done
            return
        done, time = now.done - self._before, perf_counter() - self._began
        words = per_second(done / max(time, 1e-3))
        words += f", {now.failed:,} failed" if now.failed else ""
        share = done / max(now.total - self._before, 1)
        self._parts.show("runs", words, share, f"{now.done:,}/{now.total:,} runs")


def per_second(rate: float) -> str:
    """Return a rate of runs in words: 1,120 runs/s."""
    return f"{rate:,.0f} runs/s" if rate >= 10.0 else f"{rate:.2g} runs/s"
