"""The runs of a study that are missing, and what became of those that were done."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.plan.study import Study
from rov_fmu.study.results.store import Span, Store
from rov_fmu.study.run.run import Rows

_WATCH = 2.0
"""The progress is reported at least every so many seconds."""


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
        self._done_before = total - self.left

    @property
    def left(self) -> int:
        """The number of runs that nobody has begun."""
        return sum(end - first for first, end in self.missing)

    def take(self, most: int) -> Span:
        """Take consecutive runs from those that are missing."""
        first, end = self.missing.popleft()
        if end - first > most:
            self.missing.appendleft((first + most, end))
        return first, min(end, first + most)

    def write(self, span: Span, rows: Rows) -> None:
        """Keep the rows of runs. Raises WriteError."""
        self.store.write(span, rows.content)
        self.runs += span[1] - span[0]
        self.failed += rows.failed
        self.turned += rows.turned
        self.report()

    def report(self, *, has_workers: bool = True) -> None:
        """Tell the progress."""
        self._on_progress(
            StudyProgress(self._done_before + self.runs, self._total, self.failed, self.dashboard, has_workers)
        )

    @contextmanager
    def watched(self, workers: Callable[[], int] = lambda: 1) -> Iterator[None]:
        """Report again and again during the block, also when no run ends. `workers` returns how many there are."""
        ended = Event()

        def watch() -> None:
            with suppress(Exception):  # a client that is closed, or has lost its scheduler, raises
                while not ended.wait(_WATCH):
                    has_workers = workers() > 0
                    if not ended.is_set():
                        self.report(has_workers=has_workers)

        self.report()
        Thread(target=watch, daemon=True).start()
        try:
            yield
        finally:
            ended.set()
