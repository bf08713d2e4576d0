"""The VideoRay's FMU in either version of FMI, for tests that hold for both, and builds without the FMU's page."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import conftest


@pytest.fixture(scope="session", params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def fmi(request: pytest.FixtureRequest) -> int:
    version: int = request.param
    return version


@pytest.fixture(scope="session")
def either_fmu(fmi: int, request: pytest.FixtureRequest) -> Path:
    path: Path = request.getfixturevalue({2: "videoray_fmu", 3: "videoray3_fmu"}[fmi])
    return path


@pytest.fixture(scope="session")
def either_dir(fmi: int, request: pytest.FixtureRequest) -> Path:
    folder: Path = request.getfixturevalue({2: "videoray_dir", 3: "videoray3_dir"}[fmi])
    return folder


@pytest.fixture
def without_page() -> Iterator[None]:
    """Let builds leave out the FMU's page."""
    with conftest.without_page():
        yield
