"""The runs of a study, in blocks. Each block is a Parquet file, whose name says what its rows depend on.

So a study that was interrupted goes on with the blocks that are missing, a plan with more runs keeps those that it has,
and several machines do a part of the blocks each, by Dask or alone, with files that fit together.
"""

import json
import logging
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from itertools import chain
from pathlib import Path
from threading import Lock, get_ident
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd  # noqa: F401 (PyArrow would import it at the first table, which takes a third of a second)
import pyarrow as pa
import pyarrow.parquet as pq

from rov_fmu.c.simulation import reasons, simulate, usable_cores
from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import LoadError, RunError
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import FileError, InputError, RovError, StudyError, brief, reason_of, shown
from rov_fmu.io.numbers import WORKERS
from rov_fmu.io.output import Output, WriteError, put_whole
from rov_fmu.io.program import program
from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.figures import Array, Figures
from rov_fmu.study.model import read_model, vehicle_model
from rov_fmu.study.plan import (
    DONE,
    FAILED,
    INCOMPLETE,
    REASON,
    RUN,
    RUNS,
    STATUS,
    STUDY,
    TIME,
    TRAJECTORY,
    PlanError,
    load_plan,
)
from rov_fmu.study.study import Study, prepare
from rov_fmu.study.system import SystemModel, SystemSimulator, half_step_words, read_system
from rov_fmu.vehicle.shipped import named_in
from rov_fmu.vehicle.vehicle import load_vehicle

if TYPE_CHECKING:
    from rov_fmu.study.results import Results

_OF_VEHICLE, _OF_FMU = 500, 50
"""The most runs of a block."""
_AT_ONCE = 4_000_000
"""The most recorded values of a block, which are in memory."""
_Row = dict[str, Any]


class Block(NamedTuple):
    """Consecutive runs, and the name of their file."""

    first: int
    values: Array
    name: str


class Done(NamedTuple):
    """What a call did."""

    runs: int
    failed: int
    warnings: Sequence[str]


def run_study(
    plan: Path | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    part: str | None = None,
    on_progress: Callable[[StudyProgress], None] = lambda _: None,
) -> "Results":
    """Do the missing runs of a study, and open its results.

    - `plan`, `folder`: the plan (TOML), and the folder of the results, which the same call continues.
    - `workers`: the number of processes of an FMU, or of threads of a vehicle; by default the number of cores.
    - `scheduler`: the address of a Dask scheduler whose workers do it instead; they share no folder.
    - `part`: "3/64" for the third of 64 parts, also beside others; the files of all fit together.
    - `on_progress`: called with the state of the runs.

        rov_fmu.run_study("plan.toml", "results", workers=2).runs  # a pandas data frame, a row for each run

    Raises FileError with a line for each reason, InputError about an argument, BuildError if a vehicle cannot be
    compiled, StudyError if the workers are lost, WriteError, and KeyboardInterrupt.
    """
    from rov_fmu.study.results import Results

    do_study(Path(plan), Path(folder), on_progress, workers=workers, scheduler=scheduler, part=part)
    return Results(folder)


def do_study(
    path: Path,
    folder: Path,
    on_progress: Callable[[StudyProgress], None] = lambda _: None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    part: str | None = None,
    force: bool = False,
) -> Done:
    """Do the missing runs of a study, or of a part of it. `force` removes the rows of another plan."""
    number, parts = _numbers_of(part)
    if workers is not None:
        WORKERS.checked("workers", workers)
        if scheduler is not None:
            raise InputError("study: leave --workers out, because the scheduler already has its workers")
    study = prepared(path)
    if (folder / STUDY).exists() and not force:
        from rov_fmu.study.results import Results

        Results(folder)  # raises FileError about what another version or program wrote
    blocks = [*_blocks(study)]
    others = _others(folder / RUNS, study, {block.name for block in blocks}, force=force)
    own = blocks[number - 1 :: parts]
    missing = [block for block in own if not (folder / RUNS / block.name).exists()]
    total, runs, failed = sum(len(block.values) for block in own), 0, 0
    before = total - sum(len(block.values) for block in missing)
    on_progress(StudyProgress(before, total, 0))
    try:
        done = _done(study, missing, workers, scheduler) if missing else iter(())
        first = next(done, None)  # before anything is written or removed, because an FMU may not run at all
        _begin(folder / RUNS, others)
        put_whole(Output(folder / STUDY, json.dumps(_told(study, blocks), indent=2, ensure_ascii=False).encode()))
        for block, content, lost in chain([first] if first else [], done):
            put_whole(Output(folder / RUNS / block.name, content))
            runs, failed = runs + len(block.values), failed + lost
            on_progress(StudyProgress(before + runs, total, failed))
    except LoadError as error:
        raise FileError(f"{study.model.name}: cannot be run: {error}") from error
    words = half_step_words(study, study.model) if runs and isinstance(study.model, SystemModel) else ""
    return Done(runs, failed, [*study.warnings, *filter(None, [words])])


def prepared(path: Path) -> Study:
    """Read a plan and what it names. Raises FileError."""
    plan = load_plan(path)
    if plan.fmu:
        return prepare(plan, path, read_model(path.parent / plan.fmu))
    if plan.system:
        return prepare(plan, path, read_system(path.parent / plan.system))
    assert plan.vehicle
    return prepare(plan, path, vehicle_model(load_vehicle(named_in(path, "vehicle", plan.vehicle, PlanError))))


def _others(folder: Path, study: Study, names: Collection[str], *, force: bool) -> list[Path]:
    """Return the files that are no block of the study, such as the last block of a plan that had fewer runs.

    Raises FileError about the rows of another plan.
    """
    others = [path for path in folder.glob("*.parquet") if path.name not in names]
    if (strange := [path for path in others if study.digest not in path.name]) and not force:
        raise FileError(f"{strange[0]}: has the rows of another plan or FMU: name another folder, or use --force")
    return others


def _begin(folder: Path, others: Iterable[Path]) -> None:
    """Make the folder of the blocks, and remove those files from it. Raises WriteError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(error.errno, error.strerror, str(error.filename or folder)) from error
    for path in others:
        path.unlink()


def _numbers_of(part: str | None) -> tuple[int, int]:
    """Return the number of a part, and that of all parts. Raises InputError."""
    match = re.fullmatch(r"(\d{1,5})/(\d{1,5})", part if isinstance(part, str) else "1/1" if part is None else "")
    number, count = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= count:
        raise InputError(f"part = {shown(part)}: must be a part and their number, such as 3/64")
    return number, count


def _blocks(study: Study) -> Iterator[Block]:
    """Divide the runs. The first blocks of an FMU are small, so that a few slow runs keep all processors busy."""
    most = max(1, min(_OF_VEHICLE, _AT_ONCE // (max(len(study.recorded), 1) * len(study.plan.times))))
    digest, first = study.digest, 0
    while first < len(study.rows):
        values = study.rows[first : first + (most if study.model.vehicle else min(_OF_FMU, first // 16 + 1))]
        yield Block(first, values, f"{first:09d}-{digest}-{sha256(values.tobytes()).hexdigest()[:12]}.parquet")
        first += len(values)


def _told(study: Study, blocks: Sequence[Block]) -> dict[str, Any]:
    """Return what the folder says of the study."""
    plan, has = study.plan, study.model.variables
    caution = study.model.vehicle.caution if study.model.vehicle else ""
    told = {name: has[name] for name in (*study.varied, *study.recorded)}
    return {
        "made_by": program(),
        "title": plan.title,
        "model": study.model.name,
        "plan": plan.model_dump(mode="json", by_alias=True, exclude_none=True),
        "columns": {"parameters": [*study.varied], "figures": [*plan.figures], "outputs": [*plan.kept]},
        "units": {name: variable.unit or "1" for name, variable in told.items()},
        "descriptions": {name: variable.description for name, variable in told.items()},
        "warnings": [*filter(None, [caution]), *study.warnings],
        "runs": len(study.rows),
        "files": [block.name for block in blocks],
    }


# ---- Rows ------------------------------------------------------------------------------------------------------------


class _Evaluation:
    """Makes the rows of runs from their outputs, for one thread at a time."""

    def __init__(self, study: Study) -> None:
        self._study, self._figures = study, Figures(study.plan.figures, study.plan.times)
        self._points = np.array(study.plan.kept_points, int)

    def row(self, run: int, values: Sequence[float], outputs: Mapping[str, Any]) -> _Row:
        study, plan = self._study, self._study.plan
        own = dict(zip(study.varied, values, strict=True))
        figures, reason = self._figures.of({**own, **outputs})
        kept = {TIME: plan.times, **{name: outputs[name] for name in plan.kept}}
        return {
            RUN: run,
            **own,
            **dict(zip(plan.figures, figures, strict=True)),
            STATUS: INCOMPLETE if reason else DONE,
            REASON: reason or None,
            TRAJECTORY: {name: values[self._points] for name, values in kept.items()} if plan.kept else None,
        }

    def lost(self, run: int, values: Sequence[float], reason: object) -> _Row:
        """Return the row of a run that did not end."""
        return {RUN: run, **dict(zip(self._study.varied, values, strict=True)), STATUS: FAILED, REASON: str(reason)}


def _parquet(study: Study, rows: Sequence[_Row]) -> bytes:
    """Return the file of some rows. A missing figure is null, which DuckDB and Polars skip in a median."""
    numbers = dict.fromkeys((*study.varied, *study.plan.figures), pa.float64())
    kinds = {RUN: pa.int64(), **numbers, STATUS: pa.string(), REASON: pa.string()}
    if study.plan.kept:
        lists = {TIME: "f8", **{name: study.model.variables[name].dtype for name in study.plan.kept}}
        kinds[TRAJECTORY] = pa.struct([(name, pa.list_(pa.from_numpy_dtype(kind))) for name, kind in lists.items()])
    sink = pa.BufferOutputStream()
    table = pa.Table.from_pylist([*rows], pa.schema(kinds))
    pq.write_table(table, sink, compression="zstd", use_dictionary=False, write_page_checksum=True)
    return sink.getvalue().to_pybytes()  # type: ignore[no-any-return]


# ---- Runs ------------------------------------------------------------------------------------------------------------


class _Runs:
    """The object in a child process: an FMU or a system, and the figures."""

    def __init__(self, folder: str, study: Study) -> None:
        self._evaluation, plan = _Evaluation(study), study.plan
        self._simulator: Simulation | SystemSimulator
        if isinstance(study.model, SystemModel):
            self._simulator = SystemSimulator(folder, study, study.model)
        else:
            given = (plan.set, study.inputs, study.recorded, study.varied, plan.tolerance)
            self._simulator = Simulation(folder, plan.times, plan.step, *given)

    def row(self, run: int, values: list[float]) -> _Row:
        try:
            return self._evaluation.row(run, values, self._simulator.run(values))
        except RunError as error:
            return self._evaluation.lost(run, values, error)


class _Machine:
    """Does runs on one machine: those of a vehicle in this process, and others in a child process for each thread."""

    def __init__(self, study: Study, parent: str | None = None, workers: int | None = None) -> None:
        """`parent` is the folder of temporary files. Raises FileError."""
        self._open, self._workers, self._lock = ExitStack(), workers, Lock()
        self._folder = self._open.enter_context(temporary_folder("study-", parent))
        if not study.model.vehicle:
            study.model.unpack(Path(self._folder))
        self._study = replace(study, model=replace(study.model, content=b""), rows=np.empty(0))
        self._evaluation = _Evaluation(self._study)
        self._children: dict[int, ChildProcess] | None = {}

    def block(self, block: Block) -> tuple[bytes, int]:
        """Do the runs of a block. Return its file, and the number of runs that failed. Raises LoadError, BuildError."""
        numbered = [*enumerate(block.values.tolist(), block.first)]
        rows = self._lanes(block) if self._study.model.vehicle else [self._row(*one) for one in numbered]
        return _parquet(self._study, rows), sum(row[STATUS] == FAILED for row in rows)

    def close(self) -> None:
        """End the processes, and remove the folder. Other threads that are doing runs get a LoadError."""
        with self._lock:
            children, self._children = self._children or {}, None
        for child in children.values():
            child.close()
        self._open.close()

    def _row(self, run: int, values: list[float]) -> _Row:
        """Return the row of a run. If it ends its process, or does not return, only that run fails."""
        limit, me = self._study.plan.time_limit, get_ident()
        try:
            if not (child := (self._children or {}).get(me)):
                child = ChildProcess(_Runs, self._folder, self._study, limits=budget(limit), temporary=self._folder)
                with self._lock:
                    if self._children is None:
                        child.close()
                        raise LoadError("the study has ended")
                    self._children[me] = child
            return child.call("row", run, values)  # type: ignore[no-any-return]
        except ChildError as error:
            if self._children is None:
                raise LoadError("the study has ended") from error
            self._children.pop(me, None)
            is_late = isinstance(error, LimitError) and error.limit == "time"
            late = f"did not return within time_limit = {limit:g} s"
            words = f"{self._study.model.running(self._folder)} {late if is_late else error}"
            return self._evaluation.lost(run, values, words)

    def _lanes(self, block: Block) -> list[_Row]:
        """Return the rows of a vehicle, whose runs are computed in the vectors of the processor."""
        study, times = self._study, self._study.plan.times
        vehicle, recorded = study.model.vehicle, study.recorded
        assert vehicle
        held = {name: np.append(signal, signal[-1]) for name, signal in study.inputs.items()}
        varied = {name: column[:, None] for name, column in zip(study.varied, block.values.T, strict=True)}
        given, count = {**study.plan.set, **held, **varied}, len(block.values)
        workers = self._workers
        found = simulate(vehicle, times, given, recorded, vehicles=count, workers=workers, lanes=True, ended=True)
        ended = (found.failed == len(times)) & np.isfinite(found.values).all(axis=(0, 2))
        why = f"the motion cannot be computed: {reasons(vehicle.layout, study.plan.step)}"
        return [
            self._evaluation.row(run, row, dict(zip(recorded, found.values[:, n], strict=True)))
            if ended[n]
            else self._evaluation.lost(run, row, why)
            for n, (run, row) in enumerate(enumerate(block.values.tolist(), block.first))
        ]


def _done(
    study: Study, blocks: Sequence[Block], workers: int | None, scheduler: str | None
) -> Iterator[tuple[Block, bytes, int]]:
    """Yield each block when its runs are done, with its file and the number of those that failed."""
    task: tuple[Any, ...]
    threads: Callable[[], int]
    with ExitStack() as at_end:
        if scheduler is None:
            count = 1 if study.model.vehicle else workers or usable_cores()
            pool: Any = at_end.enter_context(ThreadPoolExecutor(count))  # it ends after the machine
            machine = at_end.enter_context(closing(_Machine(study, None, workers)))
            task, threads = (machine.block,), lambda: count
        else:
            client = at_end.enter_context(_connected(scheduler))
            pool, sent = client.get_executor(pure=False), client.submit(replace, study, pure=False)
            task, threads = (_on_worker, client.id, sent), lambda: sum(client.nthreads().values()) or 1
        left, futures = iter(blocks), dict[Any, Block]()
        while True:
            while len(futures) < 2 * threads() and (block := next(left, None)):
                futures[pool.submit(*task, block)] = block
            if not futures:
                return
            for future in wait(futures, 2.0, FIRST_COMPLETED).done:
                yield futures.pop(future), *future.result()


# ---- On a cluster ----------------------------------------------------------------------------------------------------

_WAIT = 10.0
"""The seconds within which a scheduler must answer."""
_MACHINES: dict[str, _Machine] = {}
"""What this worker does, by the client that wants it."""
_LOCK = Lock()


@contextmanager
def _connected(scheduler: str) -> Iterator[Any]:
    """Connect to a scheduler of Dask. A task whose worker died is repeated elsewhere. Raises FileError, StudyError."""
    from distributed import Client
    from distributed.utils import silence_logging_cmgr

    with silence_logging_cmgr(logging.CRITICAL), ExitStack() as at_end:
        try:
            client = at_end.enter_context(Client(scheduler, timeout=_WAIT, set_as_default=False))
        except Exception as error:  # whatever another kind of server may answer
            raise FileError(f"--scheduler {scheduler}: no scheduler of Dask answers there") from error
        try:
            yield client
        except RovError:
            raise
        except Exception as error:  # a cluster raises various exceptions
            needs = "they need the same version of rov-fmu[study] as this machine"
            raise StudyError(
                f"the workers are lost: {brief(reason_of(error))}; {needs}. Finished runs are kept"
            ) from error
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.run(_forget, client.id)


def _on_worker(key: str, study: Study, block: Block) -> tuple[bytes, int]:
    """Do a block on a worker, which unpacks the FMU once."""
    from distributed import get_worker

    with _LOCK:
        if key not in _MACHINES:
            _MACHINES[key] = _Machine(study, get_worker().local_directory, workers=1)
    return _MACHINES[key].block(block)


def _forget(key: str) -> None:
    if machine := _MACHINES.pop(key, None):
        machine.close()
