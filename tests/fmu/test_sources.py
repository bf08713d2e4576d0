"""The C sources in the FMU compile in importers, without warnings."""

import subprocess
from pathlib import Path

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
