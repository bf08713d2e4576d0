"""An FMU that this project did not build, and Dask workers for studies of it."""

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import pytest
from distributed import LocalCluster

from tests.conftest import Made
from verification.references.c_programs import compile_c

HERE = Path(__file__).parent
_REALS = ("a", "b", "c", "u", "y")


def _description() -> str:
    reals = "".join(
        f'<ScalarVariable name="{name}" valueReference="{n}" causality="{causality}" variability="{variability}" {end}'
        for n, (name, causality, variability, end) in enumerate(
            [
                *(
                    (p, "parameter", "fixed", 'initial="exact"><Real start="0" min="-10" max="10"/></ScalarVariable>')
                    for p in _REALS[:3]
                ),
                ("u", "input", "continuous", '><Real start="0"/></ScalarVariable>'),
                ("y", "output", "continuous", 'initial="exact"><Real start="0"/></ScalarVariable>'),
            ]
        )
    )
    others = "".join(
        f'<ScalarVariable name="{name}" valueReference="{n}" causality="parameter" variability="fixed" initial="exact">'
        f'<{kind} start="{start}"/></ScalarVariable>'
        for name, n, kind, start in (
            ("gain", 0, "Integer", "1"),
            ("mode", 1, "Integer", "0"),
            ("fast", 0, "Boolean", "false"),
        )
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="{f}">'
        '<CoSimulation modelIdentifier="foreign"/>'
        f'<ModelVariables>{reals}{others}</ModelVariables><ModelStructure><Outputs><Unknown index="5"/></Outputs>'
        '<InitialUnknowns><Unknown index="5"/></InitialUnknowns></ModelStructure></fmiModelDescription>'
    )


@pytest.fixture(scope="session")
def foreign(made_once: Made) -> Callable[..., Path]:
    """A function that builds the FMU; the argument selects what its fmi2Reset does (see foreign.c)."""

    def fill(folder: Path, reset: int) -> None:
        name = f"foreign{fmpy.sharedLibraryExtension}"
        library = compile_c(
            HERE / "foreign.c", folder / name, {}, "-shared", "-fPIC", f"-DRESET={reset}", "-Wno-unused-parameter"
        )
        with zipfile.ZipFile(folder / "foreign.fmu", "w") as fmu:
            fmu.writestr("modelDescription.xml", _description())
            fmu.write(library, f"binaries/{fmpy.platform}/{name}")

    def made(reset: int = 0) -> Path:
        return made_once(f"foreign{reset}", lambda folder: fill(folder, reset)) / "foreign.fmu"

    return made


@pytest.fixture(scope="session")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    """Workers that tests share, because starting some for each test takes seconds."""
    folder = tmp_path_factory.mktemp("cluster")
    places = {"dashboard_address": "127.0.0.1:0", "local_directory": folder}
    with LocalCluster(n_workers=2, threads_per_worker=2, **places) as started:
        yield started


@pytest.fixture(scope="session")
def scheduler(cluster: LocalCluster) -> str:
    """The address of the shared workers' scheduler."""
    return str(cluster.scheduler_address)
