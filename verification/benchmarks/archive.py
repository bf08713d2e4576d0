"""The archive: its size, its load time, and its build time with an empty and with a warm cache of the compiler."""

import ctypes
import os
import subprocess
import sys
import tempfile
import timeit
from pathlib import Path

import fmpy
import numpy as np

from verification.references.fmpy_slave import fmpy_slave

_CACHES = ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR")


def build(output: Path, platforms: list[str]) -> tuple[int, float, float]:
    """Build the FMU twice. Return its size (bytes), and the seconds with an empty and with a warm cache."""
    command = [sys.executable, "-m", "rov_fmu", "build", "-o", str(output)]
    command += [word for name in platforms for word in ("--platform", name)]
    with tempfile.TemporaryDirectory(prefix="cache-", ignore_cleanup_errors=True) as cache:
        environment = {**os.environ, **dict.fromkeys(_CACHES, cache)}
        cold, warm = timeit.repeat(
            lambda: subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL), number=1, repeat=2
        )
    return output.stat().st_size, cold, warm


def load(archive: Path, folder: Path, repetitions: int) -> list[float]:
    """Load the archive repeatedly with FMPy. Return median times (s).

    They are the times to unzip it, to read its description, to load the library and instantiate, and to load the
    library alone.
    """
    fmpy.extract(str(archive), str(folder))
    name = fmpy.read_model_description(str(folder)).coSimulation.modelIdentifier
    library = folder / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"

    def extract() -> None:
        with tempfile.TemporaryDirectory() as other:
            fmpy.extract(str(archive), other)

    works = (
        extract,
        lambda: fmpy.read_model_description(str(folder)),
        lambda: fmpy_slave(folder).freeInstance(),
        lambda: fmpy.freeLibrary(ctypes.CDLL(str(library))._handle),
    )
    return [float(np.median(timeit.repeat(work, number=1, repeat=repetitions))) for work in works]
