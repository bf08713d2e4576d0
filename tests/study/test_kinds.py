"""Every kind of FMU, and any number of workers anywhere, give the same rows."""

import builtins
import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
from distributed import LocalCluster

from rov_fmu import Results, run_study
from rov_fmu.cli import main
from rov_fmu.report.progress import StudyProgress
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import without_progress
from tests.folders import beside
from tests.study.conftest import same

RUNS = 24
PLAN = """stop_time = 4.0
step = 0.1
runs = 24
seed = 3
[inputs]
u_l.ramps = [[0.0, 0.0], [1.0, 0.5], [2.0, 0.5], [2.0, -0.2]]
u_r = 0.3
[vary]
alpha_u.normal = { mean = 1.1, sd = 0.1 }
m_rov.uniform = [6.0, 7.0]
V_N.values = [0.0, 0.2]
[figures]
final_x = "final(x)"
drift = "mean(out['der(x)'])"
[keep]
outputs = ["u", "psi"]
"""
"""A plan for an FMU that has the variables of the VideoRay; the key that names the FMU stands before it."""


def _plan(folder: Path, fmu: Path | None) -> Path:
    """Write a plan for an FMU, or for the shipped VideoRay."""
    path = folder / "plan.toml"
    source = f'fmu = "{beside(fmu, folder)}"' if fmu else 'vehicle = "videoray"'
    path.write_text(f"{source}\n{PLAN}at = [1.0, 4.0]\n[set]\nw = 0.1\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory, videoray_fmu: Path, scheduler: str) -> Results:
    folder = tmp_path_factory.mktemp("native")
    return run_study(_plan(folder, videoray_fmu), folder / "results", scheduler=scheduler)


def test_the_rows_are_the_steps_of_the_mathematics(native: Results) -> None:
    """Some runs are repeated in Python, which shares no code with the FMU."""
    rov = load_vehicle(VIDEORAY)
    for number, run in native.runs.iloc[::6].iterrows():
        own = type(rov)(rov.layout, {**rov.coefficients, "alpha_u": run.alpha_u, "m_rov": run.m_rov})
        state = dict.fromkeys(rov.layout.state, 0.0) | {"w": 0.1}
        inputs = dict.fromkeys(rov.layout.inputs, 0.0) | {"V_N": run.V_N, "u_r": 0.3}
        for n in range(40):
            left = 0.05 * (n + 0.5) if n < 10 else 0.5 if n < 20 else -0.2
            state = own.step(inputs | {"u_l": left}, state, 0.1)
        assert run.final_x == pytest.approx(state["x"], rel=1e-9), number
        last = native.trajectories([int(str(number))]).iloc[-1]
        assert (last.t, last.u, last.psi) == pytest.approx((4.0, state["u"], state["psi"]), rel=1e-9)
    runs = pd.read_parquet(native.folder / "runs")  # other tools can read a folder of Parquet files as one table
    assert sorted(runs.columns) == [
        "V_N",
        "alpha_u",
        "drift",
        "final_x",
        "m_rov",
        "reason",
        "run",
        "status",
        "trajectory",
    ]


def test_an_fmu_of_fmi_3_gives_the_same_rows_and_leaves_the_workers_as_they_were(
    tmp_path: Path, videoray3_fmu: Path, native: Results, cluster: LocalCluster
) -> None:
    progress: list[StudyProgress] = []
    plan, address = _plan(tmp_path, videoray3_fmu), cluster.scheduler_address
    same(run_study(plan, tmp_path / "results", scheduler=address, on_progress=progress.append), native, 1e-11)
    link = cluster.dashboard_link
    assert [progress[0], progress[-1]] == [StudyProgress(0, RUNS, 0, link), StudyProgress(RUNS, RUNS, 0, link)]
    scheduler: Any = cluster.scheduler
    (worker,) = scheduler.workers.values()
    assert not [*Path(worker.local_directory).rglob("modelDescription.xml")]


def test_a_vehicle_in_lanes_and_its_fmu_give_the_same_rows_and_the_lanes_load_neither_dask_nor_fmpy(
    tmp_path: Path, videoray_fmu: Path, native: Results, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(vehicle: Vehicle, path: Path, platforms: list[str]) -> SimpleNamespace:
        assert (vehicle.identifier, path.name, platforms) == ("videoray", "videoray.fmu", ["host"])
        return SimpleNamespace(path=videoray_fmu)

    plan = _plan(tmp_path, None)
    given = ["study", str(plan), "-o", str(tmp_path / "lanes"), "--part", "1/1"]
    program = f"import sys; from rov_fmu.cli import main; assert main({given}) == 0; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "numpy" in loaded
    assert not {"distributed", "dask", "fmpy", "matplotlib", "rov_fmu.build"} & {*loaded}
    lanes = run_study(plan, tmp_path / "lanes", merge=True)
    same(lanes, native, 1e-12)
    assert (tmp_path / "lanes" / "study.json").exists()
    monkeypatch.setattr("rov_fmu.build.build_fmu", built)
    same(run_study(plan, tmp_path / "results", scheduler=scheduler), native, 1e-11)


@pytest.mark.weekly
def test_an_fmu_of_pythonfmu_gives_the_same_rows(tmp_path: Path, native: Results) -> None:
    assert main(["build", "--backend", "pythonfmu", "-o", str(tmp_path / "python.fmu")]) == 0
    same(run_study(_plan(tmp_path, tmp_path / "python.fmu"), tmp_path / "results", workers=1), native, 1e-11)


@pytest.mark.long
def test_a_full_disk_is_a_line_and_what_is_done_is_kept(
    tmp_path: Path,
    videoray_fmu: Path,
    native: Results,
    monkeypatch: pytest.MonkeyPatch,
    scheduler: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plan, folder = _plan(tmp_path, videoray_fmu), tmp_path / "results"
    fsync = os.fsync

    def full(descriptor: int) -> None:
        if list((folder / "runs").glob("part-*")):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    with monkeypatch.context() as patched:
        patched.setattr("rov_fmu.study.run.work._LEAST", 0.0)
        patched.setattr("rov_fmu.study.run.work._TASK", 1e-4)
        patched.setattr(os, "fsync", full)
        assert main(["study", str(plan), "-o", str(folder), "--scheduler", scheduler]) == 2
    line = without_progress(capsys.readouterr().err)
    assert line.startswith(f"rov-fmu: {folder}")
    assert line.endswith("cannot be written: No space left on device\n")
    assert line.count("\n") == 1
    assert 0 < len(Results(folder).runs) < RUNS
    same(run_study(plan, folder, scheduler=scheduler), native, 1e-11)


def test_without_its_packages_the_command_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real: Callable[..., Any] = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.startswith("rov_fmu.study"):
            raise ModuleNotFoundError("No module named 'dask'", name="dask")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    assert main(["study", "plan.toml", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "rov-fmu: study: needs dask: pip install 'rov-fmu[study]'\n"
