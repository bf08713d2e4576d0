"""The C sources in the FMU compile in importers, without warnings."""

import shutil
import subprocess
from pathlib import Path

import pytest

from rov_fmu.c.compile import WARNINGS, compiler, fmi_headers
from tests.often import often


@often("how", "-O0 -fno-sanitize=undefined -c -o fmu.o", "-O3 -c -o fmu.o")
def test_no_warning_under_the_strictest_flags(either_dir: Path, tmp_path: Path, how: str) -> None:
    """In CMake projects, FMPy defines the macros CO_SIMULATION and MODEL_EXCHANGE, so no identifier has these names."""
    more = ["-Wshadow", "-Wundef", "-Wstrict-prototypes", "-Wcast-qual", "-Wvla", "-DCO_SIMULATION", "-DMODEL_EXCHANGE"]
    flags = ["-std=c11", *WARNINGS, *more, "-isystem", str(fmi_headers())]
    command = [*compiler(), *flags, *how.split(), str(either_dir / "sources" / "fmu.c")]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


_FAST = {
    "gcc": ("-ffast-math", "-Ofast", "-ffinite-math-only", "-funsafe-math-optimizations", "-freciprocal-math"),
    "clang": ("-ffast-math", "-Ofast", "-ffinite-math-only"),
    "zig": ("-ffast-math", "-ffinite-math-only", "-D_M_FP_FAST"),
}
"""Options by which a compiler drops checks for NaN or rounding errors. MSVC defines the last one with /fp:fast."""


@pytest.mark.parametrize("name", _FAST)
def test_options_that_would_accept_nan_are_refused(name: str, videoray_dir: Path) -> None:
    if name != "zig" and not shutil.which(name):
        pytest.skip(f"needs {name}")
    own = compiler() if name == "zig" else [name]
    for option in ("-O3", *_FAST[name]):
        command = [*own, option, "-E", "-I", str(fmi_headers()), str(videoray_dir / "sources" / "fmu.c")]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        refused = result.returncode != 0 and "compile without -ffast-math, -Ofast and /fp:fast" in result.stderr
        assert refused == (option != "-O3"), (option, result.stderr)
