"""An FMU that this project did not build."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

from tests.conftest import Made
from verification.references.c_programs import compile_c

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def foreign(made_once: Made) -> Callable[..., Path]:
    """A function that returns the FMU; the argument selects how it can be reset (see foreign.c)."""
    name = f"foreign{fmpy.sharedLibraryExtension}"

    def fill(folder: Path) -> None:
        library = compile_c(HERE / "foreign.c", folder / name, {}, "-shared", "-fPIC", "-Wno-unused-parameter")
        description = (HERE / "foreign.xml").read_text(encoding="utf-8")
        for reset in range(4):
            (folder / f"{reset}").mkdir()
            with zipfile.ZipFile(folder / f"{reset}" / "foreign.fmu", "w") as fmu:
                fmu.writestr("modelDescription.xml", description.replace("{0}", f"{{{reset}}}"))
                fmu.write(library, f"binaries/{fmpy.platform}/{name}")

    folder = made_once("foreign", fill)
    return lambda reset=0: folder / f"{reset}" / "foreign.fmu"
