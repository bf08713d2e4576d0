"""The FMU in both versions of FMI."""

from pathlib import Path

import pytest

from tests import fmi, fmi2, fmi3

WRAPPERS: dict[int, type[fmi.Fmu]] = {2: fmi2.Fmu, 3: fmi3.Fmu}


@pytest.fixture(scope="module", params=WRAPPERS, ids="FMI {}.0".format)
def fmu(request: pytest.FixtureRequest) -> fmi.Fmu:
    """The shared library of either version, loaded for one file of tests."""
    version: int = request.param
    return WRAPPERS[version](request.getfixturevalue({2: "videoray_dir", 3: "videoray3_dir"}[version]))


@pytest.fixture(scope="module")
def fmu2(videoray_dir: Path) -> fmi2.Fmu:
    return fmi2.Fmu(videoray_dir)


@pytest.fixture(scope="module")
def fmu3(videoray3_dir: Path) -> fmi3.Fmu:
    return fmi3.Fmu(videoray3_dir)


@pytest.fixture(scope="module")
def fmus(fmu2: fmi2.Fmu, fmu3: fmi3.Fmu) -> dict[int, fmi.Fmu]:
    """By version of FMI."""
    return {2: fmu2, 3: fmu3}
