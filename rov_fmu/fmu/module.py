"""The model as a WebAssembly module: the C of the FMU's motion, unchanged, for the page that flies it."""

from rov_fmu.engine.compile import MODULE_SOURCES, compile_module
from rov_fmu.engine.source import sources
from rov_fmu.model.rov import Rov


def module(rov: Rov) -> bytes:
    """Compile the module of a vehicle; the page gives it the numbers. Raises BuildError."""
    page = {path.name: path.read_text(encoding="utf-8") for path in sorted(MODULE_SOURCES.glob("*.[ch]"))}
    return compile_module(page | sources(rov))
