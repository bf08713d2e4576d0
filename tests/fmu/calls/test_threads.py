"""Instances are independent: eight threads use one each, under ThreadSanitizer and AddressSanitizer."""

import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from rov_fmu.fmu.content import native_content
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.c_programs import Ended, clang, compile_c, run_program

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the programs are run on Linux"),
    pytest.mark.skipif(clang() is None, reason="clang with its sanitizers is missing"),
]

PROGRAM = Path(__file__).parent / "threads.c"

# The sanitizers of some clangs cannot place their memory among the random addresses of new kernels. 0x0040000 is
# ADDR_NO_RANDOMIZE; if that is not allowed, the program runs with random addresses.
_WITHOUT_RANDOM_ADDRESSES = (
    "import ctypes, os, sys; ctypes.CDLL(None).personality(0x0040000); os.execv(sys.argv[1], sys.argv[1:])"
)


def run_threads(sources: Mapping[str, str], folder: Path, sanitizers: str, calls: int) -> Ended:
    program = compile_c(PROGRAM, folder / "threads", sources, "-pthread", sanitizers=sanitizers)
    return run_program(sys.executable, "-c", _WITHOUT_RANDOM_ADDRESSES, program, str(calls))


@pytest.mark.parametrize(
    ("fmi", "sanitizers", "calls"),
    [
        pytest.param(3, "thread", 20_000, marks=pytest.mark.long),
        *(
            pytest.param(fmi, sanitizers, 2_000_000, marks=pytest.mark.weekly)
            for fmi in (2, 3)
            for sanitizers in ("thread", "address,undefined")
        ),
    ],
)
def test_eight_threads_get_what_one_thread_gets_without_a_race_or_a_leak(
    vehicle: Vehicle, tmp_path: Path, fmi: int, sanitizers: str, calls: int
) -> None:
    run = run_threads(native_content(vehicle, fmi=fmi).sources, tmp_path, sanitizers, calls)
    assert run.code == 0, run.errors
    assert run.errors == ""
    counts = {name: int(count) for name, count in run.lines}
    assert counts["calls"] == calls
    assert 0.8 * calls < counts["accepted"] < 0.99 * calls  # refused calls are driven too
    assert counts["messages"] > 0.1 * calls
