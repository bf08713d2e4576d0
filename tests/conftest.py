"""The FMU under test: built once a session by the exporter's own command line, for this machine."""

from pathlib import Path

import fmpy
import pytest
from hypothesis import settings

from rov_fmu.build import chosen_platforms
from rov_fmu.cli import main
from rov_fmu.export.archive import native_content
from rov_fmu.export.compile import compile_all
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.fmi2 import Fmu
from tests.vehicles import EVERYTHING


def pytest_configure(config: pytest.Config) -> None:
    """Properties: the same examples in every run of the default tests, fresh ones in the long run."""
    settings.register_profile("same", derandomize=True, database=None, deadline=None)
    settings.register_profile("fresh", derandomize=False, database=None, deadline=None, print_blob=True)
    settings.load_profile("fresh" if config.option.markexpr == "long" else "same")


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle(VIDEORAY)


@pytest.fixture(scope="session")
def heavy() -> Vehicle:
    return load_vehicle(SHIPPED["bluerov2_heavy"])


@pytest.fixture(scope="session")
def videoray_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    # a path with a space and an umlaut, as users have them
    path = tmp_path_factory.mktemp("FMU für Tests") / "videoray.fmu"
    assert main(["build", "--platform", "host", "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="session")
def videoray_dir(videoray_fmu: Path) -> Path:
    folder = videoray_fmu.with_suffix("")
    fmpy.extract(str(videoray_fmu), unzipdir=str(folder))
    return folder


@pytest.fixture(scope="session")
def videoray3_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("FMU für FMI 3") / "videoray.fmi3.fmu"
    assert main(["build", "--fmi", "3", "--platform", "host", "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="session")
def videoray3_dir(videoray3_fmu: Path) -> Path:
    folder = videoray3_fmu.with_suffix("")
    fmpy.extract(str(videoray3_fmu), unzipdir=str(folder))
    return folder


def unzipped(vehicle: Path, folder: Path, fmi: int = 2) -> Path:
    """The folder of the FMU of a vehicle, without its page."""
    content = native_content(load_vehicle(vehicle), fmi=fmi)
    (library,) = compile_all(chosen_platforms(["host"], fmi), content.sources, content.identifier, fmi=fmi).values()
    host = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    binary = f"binaries/{host}/{content.identifier}{fmpy.sharedLibraryExtension}"
    for name, data in {**content.files, binary: library}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


@pytest.fixture(scope="session")
def heavy_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of the BlueROV2 Heavy, which has sway, lag and coupling."""
    return unzipped(SHIPPED["bluerov2_heavy"], tmp_path_factory.mktemp("heavy"))


@pytest.fixture(scope="session")
def everything_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of a vehicle that has all that one can have."""
    return unzipped(EVERYTHING, tmp_path_factory.mktemp("everything"))


@pytest.fixture(scope="session")
def heavy3_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of FMI 3.0 of the BlueROV2 Heavy."""
    return unzipped(SHIPPED["bluerov2_heavy"], tmp_path_factory.mktemp("heavy3"), fmi=3)


@pytest.fixture(scope="module")
def fmu(videoray_dir: Path) -> Fmu:
    """The shared library, loaded for one file of tests."""
    return Fmu(videoray_dir)
