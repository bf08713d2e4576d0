"""The C programs that measure: built with the compiler of the FMU, and run (Linux on x86-64)."""

import asyncio
import platform
import subprocess
import sys
from pathlib import Path

import fmpy.sundials

from rov_fmu.export.archive import native_content
from rov_fmu.export.compile import C_FLAGS, PLATFORMS, WARNINGS, compile_all, compiler, fmi_headers
from rov_fmu.vehicle.vehicle import Vehicle

PLATFORM = "linux64"
_SOURCES = Path(__file__).with_name("c")
_FLAGS = (*C_FLAGS, "-g0", "-fno-asynchronous-unwind-tables")
# a program needs but a part of the FMU's sources
_STRICT = (*WARNINGS, "-Wshadow", "-Wno-unused-function")
# The explicit methods with what is best for them: packed into pairs, RK4 of three axes takes a third longer.
_FASTEST = {"explicit.c": ("-O3", "-fno-slp-vectorize")}


def measurable() -> bool:
    """Whether the programs run on this machine."""
    return sys.platform == "linux" and platform.machine() == "x86_64"


class Programs:
    """The FMU's shared library and the programs beside it, in a folder of their own."""

    def __init__(self, vehicle: Vehicle, folder: Path) -> None:
        content = native_content(vehicle)
        self.folder = folder
        self.library = folder / f"{content.identifier}{PLATFORMS[PLATFORM].suffix}"
        built = asyncio.run(compile_all([PLATFORM], content.sources, content.identifier))
        self.library.write_bytes(built[PLATFORM])
        for name, text in content.sources.items():
            Path(folder, name).write_text(text, encoding="utf-8")

    def run(self, sources: list[str], *arguments: str, work: str = "") -> list[list[str]]:
        """Build a program of C files and run it on the library; the words of each line that it prints."""
        target = ("-target", *PLATFORMS[PLATFORM].targets)
        folders = ("-DFMI2_OVERRIDE_FUNCTION_PREFIX", f"-I{self.folder}", f"-I{fmi_headers()}")
        objects = [f"{source}.o" for source in sources]
        for source, compiled in zip(sources, objects, strict=True):
            flags = (*_FLAGS, *_FASTEST.get(source, ()), *_STRICT, *folders, "-c", "-o", compiled)
            self._compile(*target, *flags, str(_SOURCES / source))
        self._compile(*target, *objects, "-lm", "-ldl", "-o", "program")
        program = [str(self.folder / "program"), str(self.library), *arguments]
        output = subprocess.run(program, check=True, input=work, stdout=subprocess.PIPE, text=True).stdout
        return [line.split() for line in output.splitlines()]

    def _compile(self, *arguments: str) -> None:
        subprocess.run([*compiler(), *arguments], cwd=self.folder, check=True)


def sundials_folder() -> str:
    """Where FMPy has its SUNDIALS libraries."""
    return str(Path(fmpy.sundials.__file__).parent / fmpy.platform_tuple)
