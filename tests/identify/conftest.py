"""Vehicles that are identified once in a run, by the worker that needs them first."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, YAW, Axis
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.given import Tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.fit import Fit, fit_all
from rov_fmu.identify.result import Identification
from rov_fmu.tank.description import NO_ROV_FILE
from tests.conftest import Made
from tests.folders import ARM, HEAD, MASS, TURNS, folder_of, pulled
from tests.recordings import run, write_log
from tests.vehicles import VIDEORAY

Identified = Callable[[str, Callable[[Path], Tests]], Identification]
"""A function that returns the result with a name. Another function writes its tests to a folder, if it is new."""


@pytest.fixture(scope="session")
def identified(made_once: Made) -> Identified:
    """Return what is identified from tests, without what rov.toml says."""

    def found(name: str, write: Callable[[Path], Tests]) -> Identification:
        def fill(folder: Path) -> None:
            result = identify(write(folder / "tests"))
            bare = replace(result.folder, rov_file=NO_ROV_FILE)
            kept = replace(result, folder=bare, vehicle=replace(result.vehicle))
            (folder / "result").write_bytes(pickle.dumps(kept))

        result = pickle.loads((made_once(name, fill) / "result").read_bytes())
        assert isinstance(result, Identification)
        return result

    return found


TRUTH = VIDEORAY.with_(alpha_w=1.0, alpha_r=1.0)
FORCES = {f"thrust_{name}.csv": pulled(TRUTH[f"a_t_{name}"], TRUTH[f"b_t_{name}"]) for name in ("top", "rear")}
KNOWN = f"{HEAD}[known]\n{MASS}{TURNS}{ARM}"
"""A rov.toml of the VideoRay's mass, inertia and arm."""
SHORT = ((0.0, 2.0), (0.3, 8.0), (0.0, 4.0), (-0.2, 6.0))


def with_logs(folder: Path, *logs: tuple[Axis, str, tuple[tuple[float, float], ...]]) -> Tests:
    """Write logs at 10 Hz by their axes, names and plans."""
    path, random = folder_of(folder, KNOWN, FORCES), np.random.default_rng(0)
    for axis, name, plan in logs:
        write_log(path, name, run(TRUTH, axis, plan, 10.0).noisy(random))
    return load_tests(path)


def add_voltage(log: Path, fall: float = 0.03) -> None:
    """Give a log a voltage that falls from 16 V by so much in each row."""
    header, *rows = log.read_text(encoding="utf-8").splitlines()
    volts = [f"{row},{16.0 - fall * n:.4f}" for n, row in enumerate(rows)]
    log.write_text("\n".join([f"{header},voltage [V]", *volts, ""]), encoding="utf-8")


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Tests:
    """Write a short log of heave and one of yaw."""
    return with_logs(tmp_path_factory.mktemp("tests"), (HEAVE, "a", SHORT), (YAW, "a", SHORT))


@pytest.fixture(scope="session")
def fit(short: Tests) -> Fit:
    """Fit the short logs."""
    return fit_all(*begin(short))
