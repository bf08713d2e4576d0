"""The VideoRay's FMU in both versions of FMI, and a check of many calls in one test."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

import pytest

from tests import fmi, fmi2, fmi3

Case = TypeVar("Case")
WRAPPERS: dict[int, type[fmi.Fmu]] = {2: fmi2.Fmu, 3: fmi3.Fmu}


@pytest.fixture(scope="module", params=WRAPPERS, ids="FMI {}.0".format)
def fmu(request: pytest.FixtureRequest) -> fmi.Fmu:
    """Return the FMU of either version, with its shared library loaded for one file of tests."""
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
    """Return the FMUs by their version of FMI."""
    return {2: fmu2, 3: fmu3}


def failures(cases: Iterable[Case], check: Callable[[Case], None]) -> list[str]:
    """Check every case, and return a message for each that failed."""
    found = []
    for case in cases:
        try:
            check(case)
        except AssertionError as error:
            found.append(f"{case}: {error}")
    return found
