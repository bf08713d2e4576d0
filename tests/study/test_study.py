"""Complete studies: the rows are those of the closed form, also after an FMU or the study itself has died."""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pandas as pd
import pytest
from distributed import LocalCluster

from rov_fmu import Results, build_fmu, load, run_study
from rov_fmu.cli import main
from rov_fmu.io.messages import FileError
from rov_fmu.io.output import WriteError
from rov_fmu.report.progress import StudyProgress
from tests.commands import without_progress
from tests.folders import beside

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


def _same(results: Results, other: Results) -> None:
    pd.testing.assert_frame_equal(results.runs, other.runs, check_exact=True)
    pd.testing.assert_frame_equal(results.trajectories(), other.trajectories(), check_exact=True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, foreign: Foreign) -> Results:
    """The results of an undisturbed study."""
    folder = tmp_path_factory.mktemp("whole")
    return run_study(_plan(folder, foreign()), folder / "results", workers=2)


def test_the_rows_are_those_of_the_closed_form(whole: Results) -> None:
    runs = whole.runs
    assert runs.index.tolist() == [*range(40)]
    assert {*runs.status} == {"done"}
    assert runs.end.to_numpy() == pytest.approx(_expected(runs, 2.0).to_numpy(), rel=1e-12)
    assert runs.sooner.to_numpy() == pytest.approx(_expected(runs, 1.0).to_numpy(), rel=1e-12)
    long, bands = whole.trajectories(), whole.bands("y", (0.0, 0.5, 1.0))
    assert long.t.tolist() == [*bands.index] * 40 == [0.0, 0.5, 1.0, 1.5, 2.0] * 40
    for t, part in long.groupby("t"):
        y: Any = _expected(runs, t)
        assert part.y.to_numpy() == pytest.approx(y.to_numpy(), rel=1e-12)
        assert [bands[q][t] for q in bands] == pytest.approx([y.min(), y.median(), y.max()], rel=1e-12, abs=1e-15)
    assert whole.trajectories([3, 5]).run.tolist() == [3] * 5 + [5] * 5


def test_a_run_that_fails_is_a_row_with_its_reason_and_the_rest_goes_on(foreign: Foreign, tmp_path: Path) -> None:
    progress: list[StudyProgress] = []
    plan = _plan(tmp_path, foreign(), 30, 'bad = "1/(mode - mode)"', "mode.values = [0, 1, 6, 7, 8, 9]")
    results = run_study(plan, tmp_path / "results", workers=1, on_progress=progress.append)
    warns = results.runs["mode"].isin([0, 9])
    failed, others = results.runs[~warns], results.runs[warns]
    assert {*zip(failed["mode"], failed.reason, strict=True)} == {
        (1, "the step at 1 s: error; the FMU: the pump is blocked"),
        (6, "setting the inputs at 1 s: discard"),
        (7, "reading at 0.1 s: discard"),
        (8, "initialization: error"),
    }
    assert failed[["end", "sooner"]].isna().all(axis=None)
    assert {*others.status} == {"incomplete"}
    assert {*others.reason} == {"bad: division by zero"}
    assert {*results.trajectories().run} == {*others.index}
    assert [progress[0].failed, progress[-1].failed] == [0, len(failed)]
    assert [*results.failed.index, *results.incomplete.index] == [*failed.index, *others.index]


@posix
@pytest.mark.parametrize(
    ("mode", "reason"), [(2, "ended its process: SIGABRT"), (4, "did not return within time_limit = 2 s")]
)
def test_a_run_that_ends_its_process_or_does_not_return_fails_alone(
    mode: int, reason: str, foreign: Foreign, tmp_path: Path
) -> None:
    (tmp_path / "rows.csv").write_text(f"a,mode\n0.5,0\n0.5,{mode}\n0.5,0\n")
    plan = _plan(tmp_path, foreign(), limit=2.0)
    text = plan.read_text().partition("[vary]")[0]
    head = text.replace("runs = 40\nseed = 5\n", 'samples = "rows.csv"\n')
    plan.write_text(head + "[figures]\nend = 'y[-1]'\n")
    runs = run_study(plan, tmp_path / "results", workers=1).runs
    assert runs.status.tolist() == ["done", "failed", "done"]
    assert runs.reason[1] == f"the FMU {reason}"
    assert runs.end[0] == runs.end[2]


def test_more_runs_and_parts_of_a_plan_go_on_and_a_damaged_file_is_told(
    foreign: Foreign, tmp_path: Path, whole: Results, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "results"
    run_study(_plan(tmp_path, foreign(), 20), folder, workers=1)
    kept = min((folder / "runs").iterdir())
    content = kept.read_bytes()
    kept.touch()
    at = kept.stat().st_mtime_ns
    plan = _plan(tmp_path, foreign(), 40)
    for part in ("2/2", "1/2"):
        assert main(["study", str(plan), "-o", str(folder), "--workers", "1", "--part", part]) == 0
    assert kept.stat().st_mtime_ns == at
    _same(run_study(plan, folder, workers=1), whole)
    kept.write_bytes(content[:-9])
    with pytest.raises(FileError, match="remove the file that is damaged, and its runs are done again"):
        _ = Results(folder).runs
    kept.unlink()
    _same(run_study(plan, folder, workers=1), whole)
    assert "is complete" in capsys.readouterr().out


def test_a_vehicle_has_the_rows_of_its_fmu(videoray_fmu: Path, tmp_path: Path) -> None:
    plan = _plan(tmp_path, videoray_fmu, 9)
    text = plan.read_text().partition("[inputs]")[0] + (
        '[inputs]\nu_l = 0.5\n[vary]\nm_rov.uniform = [6.0, 7.0]\n[keep]\noutputs = ["u", "x", "r"]\n'
        '[figures]\nV = "V_ss(u)"\nx = "x[-1]"\n'
    )
    (tmp_path / "fmu.toml").write_text(text)
    (tmp_path / "rov.toml").write_text(f'vehicle = "videoray"\n{text.partition(chr(10))[2]}')
    one, other = (run_study(tmp_path / name, tmp_path / f"{name}.d", workers=1) for name in ("fmu.toml", "rov.toml"))
    pd.testing.assert_frame_equal(one.runs, other.runs, rtol=1e-12, atol=1e-13)
    pd.testing.assert_frame_equal(one.trajectories(), other.trajectories(), rtol=1e-12, atol=1e-13)


@pytest.mark.long
def test_workers_of_dask_give_the_same_bits(
    foreign: Foreign, tmp_path: Path, whole: Results, scheduler: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = _plan(tmp_path, foreign())
    _same(run_study(plan, tmp_path / "results", scheduler=scheduler), whole)
    (tmp_path / "rov.toml").write_text(
        'vehicle = "videoray"\nstop_time = 2.0\nstep = 0.1\nruns = 9\ninputs = { u_l = 0.5 }\n'
        '[vary]\nm_rov.uniform = [6.0, 7.0]\n[keep]\noutputs = ["x"]\n'
    )
    _same(
        *(run_study(tmp_path / "rov.toml", tmp_path / str(n), scheduler=at) for n, at in enumerate((scheduler, None)))
    )
    line = ["study", str(plan), "-o", str(tmp_path / "other"), "--scheduler", "tcp://127.0.0.1:9"]
    assert main(line) == 2
    assert "--scheduler tcp://127.0.0.1:9: no scheduler of Dask answers there" in capsys.readouterr().err
    assert main([*line, "--workers", "1"]) == 2
    assert "leave --workers out" in capsys.readouterr().err


@posix
@pytest.mark.long
def test_the_runs_of_a_worker_that_dies_are_repeated(foreign: Foreign, tmp_path: Path, whole: Results) -> None:
    with (
        dask.config.set({"temporary-directory": str(tmp_path)}),
        LocalCluster(n_workers=2, dashboard_address="127.0.0.1:0") as cluster,
    ):

        def kill(now: StudyProgress) -> None:
            if now.done == 5:
                os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

        address = cluster.scheduler_address
        _same(run_study(_plan(tmp_path, foreign()), tmp_path / "r", scheduler=address, on_progress=kill), whole)


def test_rows_of_another_plan_are_not_replaced_unasked(foreign: Foreign, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    run_study(_plan(tmp_path, foreign(), 40), folder, workers=1)
    plan = str(_plan(tmp_path, foreign(), 4, 'more = "y[0]"'))
    assert main(["study", plan, "-o", str(folder), "--workers", "1"]) == 2
    assert len(Results(folder).runs) == 40
    assert main(["study", plan, "-o", str(folder), "--workers", "1", "--force"]) == 0
    assert len(pd.read_parquet(folder / "runs")) == 4


def test_a_folder_of_an_earlier_version_is_refused_in_one_line(
    foreign: Foreign, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its description named no files of blocks."""
    folder, plan = tmp_path / "results", _plan(tmp_path, foreign(), 2)
    (folder / "runs").mkdir(parents=True)
    (folder / "runs" / "part-000000000-000000001.parquet").write_bytes(b"PAR1")
    (folder / "study.json").write_text('{"format": 2, "made_by": "rov-fmu 0.2.0", "runs": 2, "plan": {}}')
    words = "study.json: is not the description of a study of this version: name another folder, or use --force"
    with pytest.raises(FileError, match=words):
        Results(folder)
    with pytest.raises(FileError, match=words):
        run_study(plan, folder, workers=1)
    assert main(["study", str(plan), "-o", str(folder), "--workers", "1"]) == 2
    assert without_progress(capsys.readouterr().err) == f"rov-fmu: {folder / words}\n"
    assert main(["study", str(plan), "-o", str(folder), "--workers", "1", "--force"]) == 0
    assert len(Results(folder).runs) == len([*(folder / "runs").iterdir()]) == 2


@pytest.mark.long
def test_nothing_is_written_for_an_fmu_that_cannot_run_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What another plan did stays, also with --force."""
    other = "win64" if sys.platform != "win32" else "linux64"
    build_fmu(load("videoray"), tmp_path / "other.fmu", platforms=[other])
    plan, folder = tmp_path / "plan.toml", tmp_path / "results"
    plan.write_text(
        'fmu = "other.fmu"\nstep = 0.1\nstop_time = 1.0\nruns = 2\n[vary]\nalpha_u = { uniform = [1.0, 2.0] }\n'
        '[keep]\noutputs = ["u"]\n'
    )
    for rows in ((), ("000000000-another-rows.parquet",)):
        for row in rows:
            (folder / "runs").mkdir(parents=True)
            (folder / "runs" / row).write_bytes(b"")
        assert main(["study", str(plan), "-o", str(folder), "--force"]) == 2
        assert "other.fmu: cannot be run: " in without_progress(capsys.readouterr().err)
        assert [one.name for one in folder.rglob("*.*")] == [*rows]


def test_what_cannot_be_done_is_a_line(
    foreign: Foreign, tmp_path: Path, whole: Results, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(FileError, match="nowhere"):
        Results(tmp_path / "nowhere")
    with pytest.raises(FileError, match="no trajectory of 'z' is kept, only y"):
        whole.bands("z")
    plan = _plan(tmp_path, foreign(), 2)
    with pytest.raises(WriteError, match="Not a directory"):
        run_study(plan, plan / "results")
    assert main(["study", str(plan), "-o", str(tmp_path / "r"), "--part", "3/2"]) == 2
    assert "must be a part and their number" in without_progress(capsys.readouterr().err)
