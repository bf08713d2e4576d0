"""When a motion comes to rest, to the last digits, in Python and in C; where the force is small, artanh loses them."""

import ctypes
from collections.abc import Callable

import pytest
from mpmath import mp

from checks.c_programs import compile_c
from checks.reference import DIGITS
from rov_fmu.export.compile import C_SOURCES
from rov_fmu.motion.riccati import time_to_rest

TimeToRest = Callable[[float, float, float, float], float]
# D from imaginary by 0 to B, and x to 1 - 1e-15.
CASES = [
    (0.5, 1.0, -(10.0**power) * part, v0)
    for power in (-15, -12, -9, -6, -3, -1, 0, 3)
    for part in (0.5, 0.8, 1.0)
    for v0 in (1e-3, 0.3, 1.0, 40.0)
]
# D^2 overflows by A C, and by B^2; here and where it underflows it comes from roots.
CASES += [
    (50.0, 1.0, -1e307, 40.0),
    (6.5, 0.4, -2.7e307, 1.0),
    (0.5, 1e160, -1e160, 0.3),
    (1e-150, 1e-160, -1e-150, 0.3),
]


@pytest.fixture(scope="module", params=["Python", "C"])
def function(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> TimeToRest:
    if request.param == "Python":
        return time_to_rest
    folder = tmp_path_factory.mktemp("rest")
    program = folder / "rest.c"
    program.write_text(
        '#include "riccati.c"\n'
        "double rest(double, double, double, double);\n"
        "double rest(double A, double B, double C, double v0) { return riccati_time_to_rest(A, B, C, v0); }\n",
        encoding="utf-8",
    )
    library = compile_c(program, folder / "rest.so", C_SOURCES, "-shared", "-Wno-unused-function")
    rest = ctypes.CDLL(str(library)).rest
    rest.argtypes, rest.restype = [ctypes.c_double] * 4, ctypes.c_double
    found: TimeToRest = rest
    return found


@pytest.mark.parametrize("case", CASES, ids=str)
def test_it_is_exact(function: TimeToRest, case: tuple[float, float, float, float]) -> None:
    with mp.workdps(2 * DIGITS):
        A, B, C, v0 = map(mp.mpf, case)
        D = mp.sqrt(mp.mpc(B * B + 4 * A * C))
        x = D * v0 / (B * v0 - 2 * C)
        exact = mp.re(2 * mp.atanh(x) / D) if D else 2 * v0 / (B * v0 - 2 * C)
        off = float(abs(function(*case) / exact - 1))
    assert off <= 2e-15
