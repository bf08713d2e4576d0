"""The runs of a study that are missing, and what became of those that were done."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from math import ceil
from time import perf_counter

from rov_fmu.fmus.instance import Array
from rov_fmu.io.messages import RovError, StudyError, brief, reason_of
from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.plan.study import Study
from rov_fmu.study.results.store import Span, Store
from rov_fmu.study.run.run import Rows

_WATCH = 2.0
"""The progress is reported at least every so many seconds while tasks are done."""
_TASK = 1.0
"""The seconds that a task should take."""
_LEAST = 0.2
"""The least seconds of a task, also when few runs remain."""
_AHEAD = 3
"""The number of tasks submitted for each thread, so that no thread waits for the next one."""


class Work:
    """The missing runs of a study or of a part of it, and what became of those that this call did."""

    dashboard = ""
    """The address of Dask's page about its workers, or an empty text."""
    runs = failed = turned = 0
    """The number of runs, of those that failed, and of those in which the vehicle turned over."""
    started = 0.0
    """The seconds until the first run could begin."""
    elapsed = 0.0
    """The seconds from then until the last run was done."""

    def __init__(
        self,
        study: Study,
        design: Design,
        store: Store,
        missing: Iterable[Span],
        total: int,
        on_progress: Callable[[StudyProgress], None],
    ) -> None:
        """`total` is the number of runs with those that are done."""
        self.study, self.design, self.store = study, design, store
        self.missing, self._total, self._on_progress = deque(missing), total, on_progress
        self._done_before, self._made = total - self.left, perf_counter()

    @property
    def left(self) -> int:
        """The number of runs that nobody has begun."""
        return sum(end - first for first, end in self.missing)

    def begin(self) -> None:
        """Say that the first run can begin."""
        self.started = perf_counter() - self._made
        self._report()

    def take(self, most: int) -> tuple[Span, Array]:
        """Take consecutive runs from those that are missing, with their rows of values."""
        first, end = self.missing.popleft()
        if end - first > most:
            self.missing.appendleft((first + most, end))
            end = first + most
        return (first, end), self.design.rows(first, end)

    def write(self, span: Span, rows: Rows) -> None:
        """Keep the rows of runs. Raises WriteError."""
        self.store.write(span, rows.content)
        self.runs += span[1] - span[0]
        self.failed += rows.failed
        self.turned += rows.turned
        self.elapsed = perf_counter() - self._made - self.started
        self._report()

    def do_tasks(self, submit: Callable[[int, Array], "Future[Rows]"], threads: Callable[[], int]) -> None:
        """Do the missing runs in tasks of about a second, and write the rows of each task as it ends.

        `submit` gives the runs from a first one on to one of the threads, whose present number `threads` returns.
        Raises LoadError, StudyError, WriteError, and what a connection to threads elsewhere raises.
        """
        seconds = _TASK  # of a run, by the last task; the first tasks have one run each
        spans = dict["Future[Rows]", Span]()
        self.begin()
        try:
            while self.missing or spans:
                count = threads()
                while self.missing and len(spans) < _AHEAD * (count or 1):
                    size = min(ceil(_TASK / seconds), ceil(self.left / (count or 1)))
                    span, values = self.take(max(size, ceil(_LEAST / seconds)))
                    spans[submit(span[0], values)] = span
                done, _ = wait(spans, _WATCH, FIRST_COMPLETED)
                for future in done:
                    rows, span = _result(future), spans.pop(future)
                    self.write(span, rows)
                    seconds = max(rows.seconds / (span[1] - span[0]), 1e-6)
                if not done:
                    self._report(has_workers=count > 0)
        finally:
            for future in spans:
                future.cancel()

    def _report(self, *, has_workers: bool = True) -> None:
        """Tell the progress."""
        self._on_progress(
            StudyProgress(self._done_before + self.runs, self._total, self.failed, self.dashboard, has_workers)
        )


def _result(future: "Future[Rows]") -> Rows:
    try:
        return future.result()
    except (RovError, CancelledError, OSError):  # an OSError is of the connection
        raise
    except Exception as error:  # a cluster raises various exceptions
        raise StudyError(f"the workers are lost: {brief(reason_of(error))}") from error
