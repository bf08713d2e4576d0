"""The runs of a study that are missing, and what became of them."""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from threading import Event, Thread

from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.plan.sampling import Design
from rov_fmu.study.results.store import Store
from rov_fmu.study.run.run import Rows

_WATCH = 2.0
"""The progress is reported at least every so many seconds."""


@dataclass(frozen=True)
class Progress:
    """The progress of a study, or of a part of it."""

    done: int
    """The number of runs that are done, including those of earlier calls."""
    total: int
    failed: int
    """The number of runs that failed in this call."""
    dashboard: str = ""
    """The address of Dask's page about its workers, or an empty text."""
    has_workers: bool = True
    """False while no worker is there, so that nothing is done."""


@dataclass
class Spent:
    """The runs that one call did, and the time that it took."""

    runs: int = 0
    failed: int = 0
    turned: int = 0
    """The number of these runs in which the vehicle turned over."""
    started: float = 0.0
    """The seconds until the first run could begin."""
    elapsed: float = 0.0
    """The seconds from then until the last run was done."""


@dataclass
class Work:
    """The missing runs from a first one to the one before the last one, and what became of those that were done."""

    job: Job
    design: Design
    store: Store
    first: int
    last: int
    on_progress: Callable[[Progress], None] = lambda _: None
    dashboard: str = ""
    spent: Spent = field(default_factory=Spent)

    def __post_init__(self) -> None:
        self.missing = deque(self.store.missing(self.first, self.last))
        self._done_before = self.last - self.first - self.left

    @property
    def left(self) -> int:
        """The number of runs that nobody has begun."""
        return sum(end - first for first, end in self.missing)

    def take(self, most: int) -> tuple[int, int]:
        """Take consecutive runs from those that are missing: the first one, and the one after the last one."""
        first, end = self.missing.popleft()
        if end - first > most:
            self.missing.appendleft((first + most, end))
        return first, min(end, first + most)

    def write(self, first: int, end: int, rows: Rows) -> None:
        """Keep the rows of runs. Raises WriteError."""
        self.store.write(first, end, rows.content)
        self.spent.runs += end - first
        self.spent.failed += rows.failed
        self.spent.turned += rows.turned
        self.report()

    def report(self, *, has_workers: bool = True) -> None:
        """Tell the progress."""
        done = self._done_before + self.spent.runs
        self.on_progress(Progress(done, self.last - self.first, self.spent.failed, self.dashboard, has_workers))

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
