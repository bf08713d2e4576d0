"""The archive: its size, and how long it takes to load and to build, with the compiler's cache empty and warm."""

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np

from checks.fmi2 import fmpy_slave

_CACHES = ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR")


@dataclass(frozen=True)
class Built:
    """Size in bytes; seconds with an empty cache and after that, the whole command."""

    size: int
    cold: float
    warm: float


@dataclass(frozen=True)
class Loaded:
    """Seconds, medians: to unzip with FMPy, to read the description, to load the library and instantiate; of that,
    the library alone."""

    extract: float
    describe: float
    instantiate: float
    library: float


def build(output: Path, platforms: list[str]) -> Built:
    """Build the FMU twice with the exporter's command line, first with an empty cache."""
    seconds = []
    with tempfile.TemporaryDirectory(prefix="cache-", ignore_cleanup_errors=True) as cache:
        command = [sys.executable, "-m", "rov_fmu", "build", "-o", str(output)]
        command += [word for name in platforms for word in ("--platform", name)]
        for _ in range(2):
            start = time.perf_counter()
            environment = {**os.environ, **dict.fromkeys(_CACHES, cache)}
            subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
            seconds.append(time.perf_counter() - start)
    return Built(output.stat().st_size, *seconds)


def load(archive: Path, folder: Path, repetitions: int) -> Loaded:
    """Load the archive again and again through FMPy."""
    fmpy.extract(str(archive), str(folder))
    description = fmpy.read_model_description(str(folder))
    name = description.coSimulation.modelIdentifier
    library = folder / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"

    def load_library() -> None:
        fmpy.freeLibrary(ctypes.CDLL(str(library))._handle)

    def extract() -> None:
        with tempfile.TemporaryDirectory() as other:
            fmpy.extract(str(archive), other)

    return Loaded(
        _median(extract, repetitions),
        _median(lambda: fmpy.read_model_description(str(folder)), repetitions),
        _median(lambda: fmpy_slave(folder).freeInstance(), repetitions),
        _median(load_library, repetitions),
    )


def _median(work: Callable[[], object], repetitions: int) -> float:
    def seconds() -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    return float(np.median([seconds() for _ in range(repetitions)]))
