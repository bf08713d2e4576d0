"""Complete studies: the rows are those of the closed form, also after workers, FMUs or the study itself have died."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from rov_fmu import Results, run_study
from rov_fmu.cli import main
from rov_fmu.fmus.instance import LoadError
from rov_fmu.io.messages import FileError, StudyError
from rov_fmu.io.output import WriteError
from rov_fmu.report.progress import StudyProgress
from rov_fmu.study.plan.model import read_model
from rov_fmu.study.plan.plan import load_plan
from rov_fmu.study.plan.study import prepare
from rov_fmu.study.results.store import Store, not_done, parquet
from rov_fmu.study.run.child import Child
from rov_fmu.study.run.run_study import do_study
from tests.commands import start, without_progress
from tests.folders import beside
from tests.study.conftest import same

Foreign = Callable[..., Path]
posix = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")


def _plan(folder: Path, fmu: Path, runs: int = 40, more: str = "", vary: str = "", limit: float = 60.0) -> Path:
    path = folder / "plan.toml"
    path.write_text(f"""fmu = "{beside(fmu, folder)}"
time_limit = {limit}
stop_time = 2.0
step = 0.1
runs = {runs}
seed = 5
[inputs]
u.steps = [[1.0, 0.5]]
[vary]
a.uniform = [0.0, 1.0]
b.uniform = [0.0, 1.0]
c.uniform = [0.0, 1.0]
{vary}
[keep]
outputs = ["y"]
every = 0.5
[figures]
end = "y[-1]"
sooner = "at(y, 1)"
{more}
""")
    return path


def _expected(runs: pd.DataFrame, t: Any) -> Any:
    """Return y of the foreign FMU, whose input is 0 before 1 s and 0.5 after."""
    to = runs.a + 2.0 * runs.b + 3.0 * runs.c
    return to * (1.0 - np.exp(-t / 0.5)) + 0.5 * (1.0 - np.exp(-max(t - 1.0, 0.0) / 0.5))


@pytest.fixture
def do(foreign: Foreign, tmp_path: Path, scheduler: str) -> Callable[..., Results]:
    """A function that does the study of a foreign FMU (`_plan`) on the shared worker, in the folder `results`."""

    def done(reset: int = 0, on_progress: Any = lambda _: None, **plan: Any) -> Results:
        path = _plan(tmp_path, foreign(reset), **plan)
        return run_study(path, tmp_path / "results", scheduler=scheduler, on_progress=on_progress)

    return done


def _processes(word: str) -> set[int]:
    """The processes that this one has started, directly or not, whose command line has a word."""
    found = set()
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            if any(word in part for part in process.cmdline()):
                found.add(process.pid)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, foreign: Foreign, scheduler: str) -> Results:
    """The results of an undisturbed study."""
    folder = tmp_path_factory.mktemp("whole")
    return run_study(_plan(folder, foreign()), folder / "results", scheduler=scheduler)


def test_the_rows_are_those_of_the_closed_form(whole: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = whole.runs
    assert runs.index.tolist() == [*range(40)]
    assert {*runs.status} == {"done"}
    assert runs.reason.isna().all()
    assert runs.end.to_numpy() == pytest.approx(_expected(runs, 2.0).to_numpy(), rel=1e-12)
    assert runs.sooner.to_numpy() == pytest.approx(_expected(runs, 1.0).to_numpy(), rel=1e-12)
    long, bands = whole.trajectories(), whole.bands("y", (0.0, 0.5, 1.0))
    assert long.t.tolist() == [*bands.index] * 40 == [0.0, 0.5, 1.0, 1.5, 2.0] * 40
    for t, part in long.groupby("t"):
        y: Any = _expected(runs, t)
        assert part.y.to_numpy() == pytest.approx(y.to_numpy(), rel=1e-12)
        assert [bands[q][t] for q in bands] == pytest.approx([y.min(), y.median(), y.max()], rel=1e-12, abs=1e-15)
    monkeypatch.setattr("rov_fmu.study.results.results._AT_ONCE", 100)
    pd.testing.assert_frame_equal(whole.bands("y", (0.0, 0.5, 1.0)), bands)
    assert whole.trajectories([3, 5]).run.tolist() == [3] * 5 + [5] * 5


def test_an_fmu_whose_reset_does_nothing_gives_the_rows_of_one_that_resets(
    do: Callable[..., Results], whole: Results
) -> None:
    """Such a reset leaves y as it was, so each run has an instance of its own."""
    others = _processes("_serve")
    same(do(1), whole)
    assert _processes("_serve") <= others, "the processes of the FMU have ended"


def test_a_run_that_fails_is_a_row_with_its_reason_and_the_rest_goes_on(
    do: Callable[..., Results],
) -> None:
    progress: list[StudyProgress] = []
    modes = "mode.values = [0, 1, 6, 7, 8, 9]"
    results = do(runs=30, vary=modes, more='bad = "1/(mode - mode)"', on_progress=progress.append)
    warns = results.runs["mode"].isin([0, 9])
    failed, others = results.runs[~warns], results.runs[warns]
    assert {*others["mode"]} == {0, 9}, "an FMU that warns goes on"
    assert 0 < len(failed) < 30
    assert {*failed.status} == {"failed"}
    assert {*zip(failed["mode"], failed.reason, strict=True)} == {
        (1, "the step at 1 s: error; the FMU: the pump is blocked"),
        (6, "setting the inputs at 1 s: discard"),
        (7, "reading at 0.1 s: discard"),
        (8, "initialization: error"),
    }
    assert failed[["end", "sooner"]].isna().all(axis=None)
    table = pq.read_table(results.folder / "runs")
    assert [table[name].null_count for name in ("end", "bad")] == [len(failed), 30]
    assert {*others.status} == {"incomplete"}
    assert {*others.reason} == {"bad: division by zero"}
    assert others.end.to_numpy() == pytest.approx(_expected(others, 2.0).to_numpy(), rel=1e-12)
    assert {*results.trajectories().run} == {*others.index}
    assert [progress[0].failed, progress[-1].failed] == [0, len(failed)]
    assert [*results.failed.index, *results.incomplete.index] == [*failed.index, *others.index]


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        pytest.param(2, "ended its process: SIGABRT", marks=pytest.mark.long),
        pytest.param(3, "ended its process: SIGSEGV", marks=[pytest.mark.weekly, posix]),
        pytest.param(4, "did not return within time_limit = 2 s", marks=[pytest.mark.long, posix]),
    ],
)
def test_a_run_that_ends_its_process_or_does_not_return_fails_alone_and_others_tell_if_the_vehicle_turned_over(
    mode: float, reason: str, foreign: Foreign, tmp_path: Path
) -> None:
    """With a = 2 the roll passes 90 degrees. A run takes thousandths of a second."""
    plan, folder = _plan(tmp_path, foreign(), vary="mode.values = [0]", limit=2.0), tmp_path / "unpacked"
    study, _ = prepare(load_plan(plan), plan, read_model(foreign()))
    child = Child(folder, study.unpacked(folder))
    runs = child.runs(np.array([[2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, mode], [1.0, 0.0, 0.0, 0.0]]))
    child.close()
    assert [(run.columns["status"], run.columns["reason"], run.turned) for run in runs] == [
        ("done", None, True),
        ("failed", f"the FMU {reason}", False),
        ("done", None, False),
    ]
    with pytest.raises(LoadError, match="the study has ended"):
        child.runs(np.zeros((1, 4)))


@pytest.mark.long
def test_more_runs_of_the_same_plan_go_on_and_fewer_are_refused(
    foreign: Foreign, tmp_path: Path, whole: Results, do: Callable[..., Results], capsys: pytest.CaptureFixture[str]
) -> None:
    results = do(runs=24).folder
    progress: list[StudyProgress] = []
    before = {path.name: path.stat().st_mtime_ns for path in (results / "runs").iterdir()}
    draft = results / "runs" / ".part-000000030-000000039.parquet.abc.part"
    draft.write_bytes(b"of a process that was killed")
    same(do(runs=40, limit=99.0, on_progress=progress.append), whole)
    assert [progress[0].done, progress[-1].done] == [24, 40]
    assert do_study(tmp_path / "plan.toml", results, progress.append, scheduler="tcp://nowhere").runs == 0
    assert not draft.exists()
    assert before.items() <= {path.name: path.stat().st_mtime_ns for path in (results / "runs").iterdir()}.items()
    capsys.readouterr()
    assert main(["study", str(_plan(tmp_path, foreign(), runs=12)), "-o", str(results)]) == 2
    line = f"rov-fmu: {results}: has runs up to number 39, but the plan has only 12 runs\n"
    assert capsys.readouterr().err == line
    same(Results(results), whole)


COLUMNS = {"parameters": ["a"], "figures": ["end"], "outputs": ["y"]}
STUDY: dict[str, Any] = {"plan": {"seed": 1}, "fmu": "1", "vehicle": "rov", "engine": "lanes", "runs": 9}
STUDY |= {"columns": COLUMNS}


def _rows(first: int, end: int, study: Mapping[str, Any] = STUDY, without: str = "") -> bytes:
    """Return the file of some runs with a trajectory each."""
    numbers = pa.array(np.linspace(0.0, 1.0, end - first))
    lists = pa.array([{"t": [0.0, 1.0], "y": [0.0, float(n)]} for n in range(first, end)])
    columns = {"run": np.arange(first, end), "a": numbers, "end": numbers, "trajectory": lists}
    return parquet(pa.table({name: column for name, column in columns.items() if name != without}), study, first)


def _filled(folder: Path, *spans: tuple[int, int], **change: Any) -> Store:
    store = Store(folder)
    with store.held():
        for first, end in spans:
            store.write((first, end), _rows(first, end, {**STUDY, **change}))
    return store


def test_runs_of_another_study_are_refused_and_those_that_are_missing_are_told(tmp_path: Path) -> None:
    store = _filled(tmp_path / "results", (2, 4))
    with store.held():
        assert (store.describe(STUDY, (0, 9)), not_done([(2, 4)], (0, 4))) == ([(0, 2), (4, 9)], [(0, 2)])
        assert [not_done([(2, 4)], within) for within in ((1, 3), (2, 4), (3, 6))] == [[(1, 2)], [], [(4, 6)]]
        for change, reason in (
            ({"fmu": "2"}, r"runs of another study \(the vehicle, the FMU or rov-fmu changed\): choose another folder"),
            ({"engine": "fmu"}, r"results: holds runs of another study \(--engine changed\): choose another folder"),
            ({"plan": {"seed": 2}}, r"results: holds runs of another study \(seed changed\): choose another folder"),
        ):
            with pytest.raises(FileError, match=reason):
                store.describe({**STUDY, **change}, (0, 9))
        (store.folder / "study.json").unlink()
        store.describe(STUDY, (0, 9))
    for text in ("{", "[1]", '{"format": 0}', '{"format": 3}'):
        (store.folder / "study.json").write_text(text)
        with pytest.raises(FileError, match="or was written by another version of this tool"):
            store.description()
    (store.folder / "study.json").write_text('{"format": 2}')
    assert store.description() == {"format": 2}


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "rows of another part": (
        lambda path: path.write_bytes(_rows(0, 4)),
        "has the runs 0 to 3, and not those of its name",
    ),
    "overlap": (
        lambda path: path.with_name("part-000000003-000000005.parquet").write_bytes(_rows(3, 6)),
        "has runs that .*, too",
    ),
    "gone": (Path.unlink, "of 9 runs, these are missing: 4 to 8: do them with --part"),
    "no trajectories": (
        lambda path: path.write_bytes(_rows(4, 9, without="trajectory")),
        "lacks trajectory.t and trajectory.y",
    ),
    "no figure": (lambda path: path.write_bytes(_rows(4, 9, without="end")), "lacks end"),
    "other numbers": (lambda path: path.write_bytes(_rows(5, 9)), "has the runs 5 to 8, and not those of its name"),
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:300]), "cannot be read: Parquet magic bytes not found"),
    "empty": (lambda path: path.write_bytes(b""), "cannot be read: "),
    "without a footer of ours": (
        lambda path: pd.DataFrame({"run": range(4, 9)}).to_parquet(path),
        "cannot be read: ",
    ),
    "another study": (
        lambda path: path.write_bytes(_rows(4, 9, {**STUDY, "plan": {"seed": 3}})),
        r"holds runs of another study \(seed changed\)",
    ),
}
"""What may have become of the file of the second part, and what is told."""


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_file_that_does_not_count_is_refused_by_its_name(kind: str, tmp_path: Path) -> None:
    store = _filled(tmp_path, (0, 4), (4, 9))
    store.check_complete(STUDY)
    damage, reason = DAMAGE[kind]
    path = tmp_path / "runs" / "part-000000004-000000008.parquet"
    damage(path)
    with pytest.raises(FileError, match=reason):
        store.check_complete(STUDY)


def test_a_flipped_bit_is_noticed_or_changes_nothing(tmp_path: Path) -> None:
    store = _filled(tmp_path, (4, 9))
    ((path, _),) = store.checked(STUDY, whole=True).items()
    content, rows = path.read_bytes(), pq.read_table(path)
    refused = 0
    for place in range(0, len(content), 17):
        path.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
        try:
            store.checked(STUDY, whole=True)
        except FileError:
            refused += 1
        else:
            assert pq.read_table(path).equals(rows)
    assert refused > 60


def test_results_that_are_not_there_are_a_line(foreign: Foreign, tmp_path: Path, scheduler: str) -> None:
    with pytest.raises(FileError, match="nowhere: there is no such folder"):
        Results(tmp_path / "nowhere")
    plan = _plan(tmp_path, foreign(), runs=2, more="[set]\nfast = true\ngain = 2")
    plan.write_text(plan.read_text().replace('[keep]\noutputs = ["y"]\nevery = 0.5\n', ""))
    results = run_study(plan, tmp_path / "results", scheduler=scheduler)
    runs = results.runs
    assert runs.end.to_numpy() == pytest.approx((runs.a + 2.0 * runs.b + 3.0 * runs.c + 1.0).to_numpy(), rel=1e-12)
    with pytest.raises(FileError, match=r"no trajectory of 'y' is kept, nor any other: the plan has no \[keep\]"):
        results.bands("y")
    with pytest.raises(FileError, match="there is no figure 'y', only end, sooner"):
        results.sensitivity("y")
    with pytest.raises(FileError, match='Sobol indices need sampler = "saltelli" in the plan'):
        results.sensitivity("end")
    with pytest.raises(WriteError, match="Not a directory"):
        run_study(plan, plan / "results", scheduler=scheduler)


# ---- Interrupted and killed ------------------------------------------------------------------------------------------


SLOW: dict[str, Any] = {"runs": 600, "more": "[set]\nmode = 5"}
"""Two workers wait seven seconds for the FMU: most runs are left when the first two parts are there."""


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory, foreign: Foreign, scheduler: str) -> Results:
    """The results of an undisturbed study, whose FMU need not wait."""
    folder = tmp_path_factory.mktemp("slow")
    return run_study(_plan(folder, foreign(), runs=SLOW["runs"]), folder / "results", scheduler=scheduler)


def _parts(results: Path) -> list[Path]:
    return [*(results / "runs").glob("part-*.parquet")] if results.is_dir() else []


def _begun(plan: Path, results: Path) -> "subprocess.Popen[str]":
    """Start a study and return its process when some runs are done."""
    process = start(
        ["study", str(plan), "-o", str(results), "--workers", "2"],
        stdout=subprocess.DEVNULL,
        start_new_session=True,
        # a shell starts what it runs in the background with interrupts ignored, and that is inherited
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 300.0
    while len(_parts(results)) < 2:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.01)
    return process


@posix
@pytest.mark.long
@pytest.mark.parametrize("number", [pytest.param("SIGINT", marks=pytest.mark.weekly), "SIGKILL"])
def test_an_interrupted_or_killed_study_goes_on_where_it_was(
    number: str, foreign: Foreign, tmp_path: Path, slow: Results, scheduler: str
) -> None:
    plan, results = _plan(tmp_path, foreign(), **SLOW), tmp_path / "results"
    process = _begun(plan, results)
    os.killpg(process.pid, getattr(signal, number))  # as a terminal does it
    error = process.communicate(timeout=300)[1]
    if number == "SIGINT":
        assert process.returncode == 130, error
        interrupted = "rov-fmu: interrupted, no file is half-written; the same command continues the study\n"
        assert without_progress(error) == interrupted
    assert 0 < len(Results(results).runs) < SLOW["runs"]
    kept = {path: path.read_bytes() for path in _parts(results)}
    (results / "runs" / ".part-000000000-000009999.parquet.abc.part").write_bytes(b"a draft")
    same(run_study(plan, results, scheduler=scheduler), slow)
    assert all(path.read_bytes() == content for path, content in kept.items())
    assert not [*results.glob("*/.*")]


@posix
@pytest.mark.long
def test_a_killed_worker_is_missed_by_no_row(foreign: Foreign, tmp_path: Path, slow: Results) -> None:
    alive = set[int]()
    with LocalCluster(n_workers=2, dashboard_address="127.0.0.1:0", local_directory=tmp_path / "cluster") as cluster:
        alive.update(worker.pid for worker in cluster.workers.values())
        assert len(alive) == 2

        def kill(now: StudyProgress) -> None:
            while now.done and alive:
                os.kill(alive.pop(), signal.SIGKILL)

        plan, address = _plan(tmp_path, foreign(), **SLOW), cluster.scheduler_address
        same(run_study(plan, tmp_path / "results", scheduler=address, on_progress=kill), slow)
    assert not alive


def test_a_scheduler_that_is_not_there_is_a_line(
    foreign: Foreign, tmp_path: Path, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rov_fmu.study.run.cluster._WAIT", 1.0)
    scheduler: Any = cluster.scheduler
    (worker,) = scheduler.workers
    for address in ("tcp://127.0.0.1:9", worker, ""):
        with pytest.raises(FileError) as refused:
            run_study(_plan(tmp_path, foreign()), tmp_path / "results", scheduler=address)
        assert str(refused.value) == f"--scheduler {address}: no scheduler of Dask answers there"
    assert not (tmp_path / "results").exists()


@pytest.mark.long
def test_a_scheduler_without_workers_is_told_and_its_workers_are_waited_for(
    foreign: Foreign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rov_fmu.study.run.work._WATCH", 0.05)
    monkeypatch.setattr("rov_fmu.study.run.cluster._WAIT", 0.1)
    told = list[StudyProgress]()
    with LocalCluster(n_workers=0, processes=False, threads_per_worker=1, dashboard_address="127.0.0.1:0") as late:

        def start_one(now: StudyProgress) -> None:
            if not now.has_workers and not any(before.has_workers is False for before in told):
                late.scale(1)
            told.append(now)

        results = run_study(
            _plan(tmp_path, foreign(), runs=4),
            tmp_path / "results",
            scheduler=late.scheduler_address,
            on_progress=start_one,
        )
    assert [now.done for now in told if not now.has_workers][:1] == [0]
    assert [*results.runs.index] == [0, 1, 2, 3]


def _fail(error: Exception) -> Callable[..., None]:
    """Return a function that raises an error."""

    def fail(*_: Any, **__: Any) -> None:
        raise error

    return fail


_VERSION = "a worker cannot run the study. It needs the same version of rov-fmu[study] as this machine"


@pytest.mark.parametrize(
    ("patched", "error", "told"),
    [
        ("do_runs", ValueError("wrong"), StudyError("the workers are lost: wrong")),
        ("do_runs", ValueError(), StudyError("the workers are lost: no reason is known")),
        ("do_runs", CancelledError(), StudyError("the connection to the scheduler is lost. Finished runs are kept")),
        ("Client.submit", KeyError("ours"), KeyError("ours")),
        ("Client.register_plugin", TypeError("old"), StudyError(f"{_VERSION}: old")),
    ],
)
def test_what_goes_wrong_on_the_workers_is_a_line(
    patched: str, error: Exception, told: Exception, do: Callable[..., Results], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"rov_fmu.study.run.cluster.{patched}", _fail(error))
    with pytest.raises(type(told)) as found:
        do()
    assert found.value.args == told.args


@pytest.mark.long
@pytest.mark.parametrize("has_scheduler", [True, False])
def test_an_fmu_without_an_instance_is_a_line(
    has_scheduler: bool, foreign: Foreign, tmp_path: Path, scheduler: str
) -> None:
    with pytest.raises(FileError) as refused:
        run_study(_plan(tmp_path, foreign(3)), tmp_path / "results", scheduler=scheduler if has_scheduler else None)
    assert str(refused.value) == "foreign.fmu: cannot be run: Failed to instantiate model; the FMU: no licence"


@pytest.mark.weekly
def test_a_scheduler_that_goes_takes_nothing_with_it(
    foreign: Foreign, tmp_path: Path, slow: Results, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rov_fmu.study.run.cluster._WAIT", 4.0)
    plan, results = _plan(tmp_path, foreign(), **SLOW), tmp_path / "results"
    with LocalCluster(n_workers=1, dashboard_address="127.0.0.1:0", local_directory=tmp_path / "cluster") as cluster:

        def close(now: StudyProgress) -> None:
            if now.done:
                cluster.close()
                time.sleep(5.0)  # until the client has given up the scheduler

        with pytest.raises(StudyError, match=r"the connection to the scheduler is lost\. Finished runs are kept"):
            run_study(plan, results, scheduler=cluster.scheduler_address, on_progress=close)
    assert 0 < len(Results(results).runs) < SLOW["runs"]
    same(run_study(plan, results, scheduler=scheduler), slow)
