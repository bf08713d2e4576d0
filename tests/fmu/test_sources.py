"""The C sources in the FMU compile in importers, without warnings."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from rov_fmu.c.compile import WARNINGS, compiler, fmi_headers
from tests.often import often


@pytest.fixture
def zig_as_cc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give CMake the compiler and the build tool from packages, for machines that have none."""
    if os.name == "nt":
        pytest.skip("FMPy asks for Visual Studio on Windows")
    cc = tmp_path / "cc"
    cc.write_text(f'#!/bin/sh\nexec {shlex.join(compiler())} "$@"\n', encoding="utf-8")
    cc.chmod(0o755)
    monkeypatch.setenv("CC", str(cc))
    monkeypatch.setenv("CXX", str(cc))  # CMake requires one, but nothing is compiled with it
    monkeypatch.setenv("CMAKE_GENERATOR", "Ninja")


@pytest.mark.long
@pytest.mark.parametrize("fmi", [3, pytest.param(2, marks=pytest.mark.weekly)], indirect=True)
@pytest.mark.usefixtures("zig_as_cc")
def test_the_cmake_project_that_fmpy_creates_builds_and_simulates(
    either_fmu: Path, either_dir: Path, tmp_path: Path
) -> None:
    """FMPy defines the macros CO_SIMULATION and MODEL_EXCHANGE, so no identifier may have these names."""
    project, build = tmp_path / "a project", tmp_path / "build"
    project.mkdir()
    for command in (
        [sys.executable, "-m", "fmpy", "create-cmake-project", str(either_fmu), "--cmake-project-dir", str(project)],
        ["cmake", "-S", str(project), "-B", str(build)],
    ):
        subprocess.run(command, capture_output=True, check=True)
    shutil.rmtree(project / "binaries")  # so that the binary that is built is simulated
    built = subprocess.run(["cmake", "--build", str(build)], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout
    assert "warning" not in built.stdout
    paths = (project / "videoray.fmu", either_dir)
    ours, theirs = (fmpy.simulate_fmu(str(path), start_values={"u_l": 0.3, "u_r": 0.1}) for path in paths)
    for name in ours.dtype.names:
        assert ours[name] == pytest.approx(theirs[name], rel=1e-12, abs=1e-12)


@often("how", "-O0 -c -o fmu.o", "-O3 -c -o fmu.o")
def test_no_warning_under_the_strictest_flags(either_dir: Path, tmp_path: Path, how: str) -> None:
    more = ["-Wshadow", "-Wundef", "-Wstrict-prototypes", "-Wcast-qual", "-Wvla"]
    flags = ["-std=c11", *WARNINGS, *more, "-isystem", str(fmi_headers())]
    command = [*compiler(), *flags, *how.split(), str(either_dir / "sources" / "fmu.c")]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
