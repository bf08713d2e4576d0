"""Vehicles that are identified once in a run, by the worker that needs them first."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from rov_fmu.identify.beginning import Tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.result import Identification
from rov_fmu.tank.description import NO_ROV_FILE
from tests.conftest import Made

Identified = Callable[[str, Callable[[Path], Tests]], Identification]
"""A function that returns the result with a name. Another function writes its tests to a folder, if it is new."""


@pytest.fixture(scope="session")
def identified(made_once: Made) -> Identified:
    """Return what is identified from tests, without what rov.toml says and the vehicle to compare with."""

    def found(name: str, write: Callable[[Path], Tests]) -> Identification:
        def fill(folder: Path) -> None:
            result = identify(write(folder / "tests"))
            bare = replace(result.folder, rov_file=NO_ROV_FILE)
            kept = replace(result, folder=bare, vehicle=replace(result.vehicle), against=None)
            (folder / "result").write_bytes(pickle.dumps(kept))

        result = pickle.loads((made_once(name, fill) / "result").read_bytes())
        assert isinstance(result, Identification)
        return result

    return found
