"""The VideoRay's FMU in both versions of FMI, and a check of many calls in one test."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import pytest

from tests import fmi, fmi2, fmi3

Case = TypeVar("Case")
WRAPPERS: dict[int, type[fmi.Fmu]] = {2: fmi2.Fmu, 3: fmi3.Fmu}


def modes_of(version: int) -> list[tuple[int, str]]:
    """Return the kinds of instances in a version of FMI, each with its modes."""
    return fmi.EVERY_MODE if version == 2 else fmi3.EVERY_MODE


def of_both_versions(two: str, three: str, is_two_weekly: bool = False) -> Any:
    """Return a fixture: the FMUs of FMI 2.0 and FMI 3.0, loaded for one file of tests, whose folders two others return.

    If `is_two_weekly`, the tests of FMI 2.0, which repeat those of FMI 3.0, run once a week.
    """
    marks = pytest.mark.weekly if is_two_weekly else ()

    @pytest.fixture(scope="module", params=[pytest.param(2, marks=marks), 3], ids="FMI {}.0".format)
    def fmu(request: pytest.FixtureRequest) -> fmi.Fmu:
        version: int = request.param
        return WRAPPERS[version](request.getfixturevalue({2: two, 3: three}[version]))

    return fmu


fmu = of_both_versions("videoray_dir", "videoray3_dir")


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
