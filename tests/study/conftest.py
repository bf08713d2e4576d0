"""An FMU that this project did not build, and Dask workers for studies of it."""

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import dask
import fmpy
import pytest
from distributed import LocalCluster

from tests.conftest import Made
from tests.report.conftest import browser, engine, visit
from verification.references.c_programs import compile_c

__all__ = ["browser", "engine", "visit"]
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


@pytest.fixture(scope="package")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    """A worker that the tests of this folder share, because a start takes seconds.

    It has one thread, because each thread starts a process for the FMU in every study.
    """
    with (
        dask.config.set({"temporary-directory": str(tmp_path_factory.mktemp("cluster"))}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as started,
    ):
        yield started


@pytest.fixture(scope="package")
def scheduler(cluster: LocalCluster) -> str:
    """The address of the shared worker's scheduler."""
    return str(cluster.scheduler_address)
