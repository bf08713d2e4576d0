"""The compiled engine or filter of a vehicle: from the user's cache folder, as the wheel has it, or compiled now."""

import ctypes
import hashlib
import json
import platform
import sys
import warnings
from collections.abc import Callable, Hashable
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Lock

from platformdirs import user_cache_path

from rov_fmu.c.compile import (
    ENGINE_FILE,
    ENGINE_HEADER,
    FILTER_FILE,
    FILTER_LANES_FILE,
    LANES_FILE,
    VECTORS_HEADER,
    BuildError,
    compile_engine,
    compiler_identity,
    engine_flags,
    host_platform,
)
from rov_fmu.c.prebuilt import prebuilt
from rov_fmu.c.source import c_sources
from rov_fmu.equation.layout import Layout
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.output import kept
from rov_fmu.vehicle.vehicle import Vehicle

_FILES = {
    ENGINE_FILE: (ENGINE_HEADER, ENGINE_FILE),
    LANES_FILE: (VECTORS_HEADER, ENGINE_HEADER, ENGINE_FILE, LANES_FILE),
    FILTER_FILE: (FILTER_FILE,),
    FILTER_LANES_FILE: (VECTORS_HEADER, FILTER_FILE, FILTER_LANES_FILE),
}
"""The files of each library; the last one is compiled."""
_LOADED: dict[Hashable, ctypes.CDLL] = {}
"""The libraries that this process has loaded, by the file and the layout of the vehicle."""
_LOADING = Lock()


def engine_sources(layout: Layout, file: Path = ENGINE_FILE) -> dict[str, str]:
    """Return the C files of a library by their names. The last one includes the others."""
    return c_sources(layout) | {path.name: path.read_text(encoding="utf-8") for path in _FILES[file]}


def load_library(vehicle: Vehicle, file: Path = ENGINE_FILE) -> ctypes.CDLL:
    """Return the library of a vehicle made from a file of the engine. It does not depend on the coefficients.

    Raises BuildError when it cannot be compiled or loaded.
    """
    return load_sources((file, vehicle.layout), lambda: engine_sources(vehicle.layout, file))


def load_sources(key: Hashable, sources_of: Callable[[], dict[str, str]]) -> ctypes.CDLL:
    """Return the library of C files (file name to text), the last of which includes the others.

    This process keeps it under the key. Raises BuildError when it cannot be compiled or loaded.
    """
    with _LOADING:
        if key not in _LOADED:
            texts = sources_of()
            try:
                _LOADED[key] = _load(texts)
            except OSError as error:
                raise BuildError(f"the engine cannot be loaded: {error}") from error
        return _LOADED[key]


def _load(texts: dict[str, str]) -> ctypes.CDLL:
    """Load the library of these sources from the cache folder, or from a temporary one when that fails."""
    key = _key(texts)
    folder = user_cache_path("rov-fmu", appauthor=False) / "engine"

    @cache
    def make() -> bytes:
        return prebuilt(host_platform(fmi=3), texts) or compile_engine(texts)

    try:
        return ctypes.CDLL(str(kept(folder, key, make)))
    except OSError as error:
        reason = f"{folder}: the compiled engine cannot be kept there: {error.strerror or error}"
        remedy = "It is compiled for this process alone, which takes some seconds"
        warnings.warn(f"{reason}. {remedy}", UserWarning, stacklevel=2)
    with temporary_folder("rov-fmu-") as temporary:
        return ctypes.CDLL(str(kept(Path(temporary), key, make)))


def _key(texts: dict[str, str]) -> str:
    """Return a digest of everything that the library depends on."""
    *_, file = texts
    machine = sys.platform, platform.machine(), ctypes.sizeof(ctypes.c_void_p)
    processor = _processor() if file in (LANES_FILE.name, FILTER_LANES_FILE.name) else ""
    inputs = json.dumps([texts, engine_flags(file), compiler_identity(), machine, processor], sort_keys=True)
    return hashlib.sha256(inputs.encode()).hexdigest()[:32]


def _processor() -> str:
    """Return what this processor can do, because vectors as wide as its own are used."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return platform.processor()
