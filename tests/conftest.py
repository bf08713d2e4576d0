"""The FMU under test: built once a session by the exporter's own command line, for this machine."""

from pathlib import Path

import fmpy
import pytest
from hypothesis import settings

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.fmi2 import Fmu


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
def heavy_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of the BlueROV2 Heavy, which has sway, lag and coupling."""
    path = tmp_path_factory.mktemp("heavy") / "heavy.fmu"
    assert main(["build", "bluerov2_heavy", "--platform", "host", "-o", str(path)]) == 0
    fmpy.extract(str(path), unzipdir=str(path.with_suffix("")))
    return path.with_suffix("")


@pytest.fixture(scope="module")
def fmu(videoray_dir: Path) -> Fmu:
    """The shared library, loaded for one file of tests."""
    return Fmu(videoray_dir)
