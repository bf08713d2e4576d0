"""The known results of fits hold with the kernels of other processors, and with the lowest versions that are allowed.

A fit adds in another order there, so it ends a little apart.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cli.test_wheel import interpreter, lowest
from tests.commands import ROOT
from tests.frozen import test_known_results
from tests.often import spread
from verification.fresh_environment import environment

SIMD = np.show_config(mode="dicts")["SIMD Extensions"]
"""What NumPy uses of this processor; its versions have other names for the same."""
FOUND = {*SIMD["baseline"], *SIMD["found"]}
AVX_512 = " ".join(name for name in SIMD["found"] if name.startswith(("AVX512", "X86_V4")))
KERNELS = {
    "Nehalem": ({"OPENBLAS_CORETYPE": "Nehalem"}, {"SSE3", "X86_V2"} & FOUND),
    "Haswell": ({"OPENBLAS_CORETYPE": "Haswell"}, {"AVX2", "X86_V3"} & FOUND),
    "SkylakeX": ({"OPENBLAS_CORETYPE": "SkylakeX"}, AVX_512),
    "NumPy without AVX-512": ({"NPY_DISABLE_CPU_FEATURES": AVX_512}, AVX_512),
}
"""The variables that choose the kernels of OpenBLAS and of NumPy, and what of this processor they need."""
TOOLS = ("filelock", "hypothesis", "mpmath", "pytest", "pytest-xdist")
"""What the tests of known results import besides the dependencies."""


@pytest.mark.parametrize("name", spread(KERNELS, (), ["Nehalem"]))
def test_the_fits_end_alike_with_other_kernels(name: str) -> None:
    kernels, needed = KERNELS[name]
    if not needed:
        pytest.skip("this processor does not have what they use")
    check_fits(sys.executable, **kernels)


@pytest.mark.weekly
def test_the_fits_end_alike_with_the_lowest_versions(tmp_path: Path) -> None:
    python = next(filter(None, map(interpreter, ("3.10", "3.11", "3.12", "3.13"))), None)
    if python is None:
        pytest.skip("the lowest versions of NumPy and SciPy have no packages for the interpreters here")
    check_fits(environment(tmp_path / "venv", "-r", lowest(tmp_path, "dependencies"), *TOOLS, python=python).python)


def check_fits(python: str, **variables: str) -> None:
    """Run the tests of the known results of fits, the long ones too, in a process of their own."""
    file = test_known_results.__file__
    command = [python, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-m", "", "-k", "identify", file]
    ran = subprocess.run(command, cwd=ROOT, env=os.environ | variables, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-3000:]
