"""Compile the C of the FMU's motion, unchanged, to a WebAssembly module for the page that flies the vehicle."""

from rov_fmu.engine.compile import MODULE_SOURCES, compile_module
from rov_fmu.engine.source import sources
from rov_fmu.model.layout import Layout


def web_module(layout: Layout) -> bytes:
    """Return the module of a vehicle. The page passes the coefficients to it. Raises BuildError."""
    page = {path.name: path.read_text(encoding="utf-8") for path in sorted(MODULE_SOURCES.glob("*.[ch]"))}
    return compile_module(page | sources(layout))
