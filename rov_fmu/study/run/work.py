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
        self.study, self._design, self.store = study, design, store
        self._missing, self._total, self._on_progress = deque(missing), total, on_progress
        self._done_before, self._made = total - self._left, perf_counter()

    @property
    def _left(self) -> int:
        """The number of runs that nobody has begun."""
        return sum(end - first for first, end in self._missing)

    def do_tasks(
        self, submit: Callable[[int, Array], "Future[Rows]"], threads: Callable[[], int], most: int | None = None
    ) -> None:
        """Do the missing runs in tasks of about a second, and write the rows of each task as it ends.

        `submit` gives the runs from a first one on to one of the threads, whose present number `threads` returns. The
        first tasks have `most` runs, and no other one has more; without it, they have one run each.
        Raises LoadError, StudyError, WriteError, and what a connection to threads elsewhere raises.
        """
        seconds = _TASK / (most or 1)  # of a run, by the last task
        spans = dict["Future[Rows]", Span]()
        self.started = perf_counter() - self._made
        self._report()
        try:
            while self._missing or spans:
                count = threads()
                while self._missing and len(spans) < _AHEAD * (count or 1):
                    size = max(min(ceil(_TASK / seconds), ceil(self._left / (count or 1))), ceil(_LEAST / seconds))
                    first, end = self._take(min(size, most or size))
                    spans[submit(first, self._design.rows(first, end))] = first, end
                done, _ = wait(spans, _WATCH, FIRST_COMPLETED)
                for future in done:
                    rows, span = _result(future), spans.pop(future)
                    self._write(span, rows)
                    seconds = max(rows.seconds / (span[1] - span[0]), 1e-6)
                if not done:
                    self._report(has_workers=count > 0)
        finally:
            for future in spans:
                future.cancel()

    def _take(self, most: int) -> Span:
        """Take consecutive runs from those that are missing."""
        first, end = self._missing.popleft()
        if end - first > most:
            self._missing.appendleft((first + most, end))
        return first, min(end, first + most)

    def _write(self, span: Span, rows: Rows) -> None:
        self.store.write(span, rows.content)
        self.runs += span[1] - span[0]
        self.failed += rows.failed
        self.turned += rows.turned
        self.elapsed = perf_counter() - self._made - self.started
        self._report()

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
