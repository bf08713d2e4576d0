"""The model as a WebAssembly module: the C of the FMU's mathematics as it is, for the page that flies it."""

from rov_fmu.export.compile import C_SOURCES, MODULE_SOURCES, compile_module
from rov_fmu.export.interface import model_header
from rov_fmu.motion.rov import Rov

_MATHEMATICS = ("riccati.c", "rov.c", "track.c", "series.c", "rov_step.c")


def module(rov: Rov) -> bytes:
    """The module of what a vehicle has; the page gives it the numbers. Raises BuildError."""
    paths = [*(C_SOURCES / name for name in _MATHEMATICS), *sorted(MODULE_SOURCES.glob("*.[ch]"))]
    sources = {path.name: path.read_text(encoding="utf-8") for path in paths}
    return compile_module({**sources, "model.h": model_header(rov)})
