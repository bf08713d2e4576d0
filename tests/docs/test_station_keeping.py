"""examples/station_keeping: the autopilot's promises, the closed loop, and that engines agree on it."""

import zipfile
from functools import cache
from math import degrees
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd, validate_tree
from lxml import etree

from examples.station_keeping import engines, run
from examples.station_keeping.engines import ENGINES, NAMES, Trajectory
from examples.station_keeping.system import (
    DEFAULT,
    SEA,
    build_system,
    parameter_sets,
    system_files,
)
from examples.systems import PARAMETER_SET
from tests.conftest import Made, without_page

SETS = tuple(parameter_sets())


def _build(folder: Path) -> None:
    """Build the system into a folder, and unzip its FMUs there."""
    with without_page():
        build_system(folder)
    for name in ("Autopilot", "videoray"):
        fmpy.extract(str(folder / f"{name}.fmu"), unzipdir=str(folder / name))


@pytest.fixture(scope="session")
def folder(made_once: Made) -> Path:
    return made_once("station keeping", _build)


plain = cache(engines.plain)


# ---- The autopilot ---------------------------------------------------------------------------------------------------


# ---- The closed loop -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=SETS)
def expected(request: pytest.FixtureRequest) -> tuple[str, Trajectory]:
    return request.param, plain(request.param)


def agree(result: Trajectory, expected: Trajectory) -> None:
    assert set(result) == {f"{component}.{name}" for component, name in NAMES}
    assert max(run.difference(result, expected).values()) <= 1e-9
    depth, heading = run.held(result)
    assert depth <= 0.02
    assert heading <= 2.0


def test_fmpy_holds_and_agrees(folder: Path, expected: tuple[str, Trajectory]) -> None:
    parameters, trajectory = expected
    result = ENGINES["FMPy, SSP"].run(folder, parameters)
    agree(result, trajectory)
    assert np.ptp(result["rov.z"]) > 4.9  # it did dive
    assert degrees(np.ptp(result["rov.psi"])) > 89.0
    assert result["rov.z"].max() < 5.0 + 0.02  # and not beyond
    if parameters == DEFAULT:  # the stick balances current and tether, and it faces the current
        assert trajectory["rov.u"][-1] == pytest.approx(-SEA["V_E"], abs=0.01)


@pytest.mark.long
def test_the_order_of_stepping_makes_a_difference(expected: tuple[str, Trajectory]) -> None:
    parameters, trajectory = expected
    apart = run.difference(plain(parameters, sequential=True), trajectory)
    assert 1e-3 < apart["rov.z"] < 1e-2
    assert max(run.held(plain(parameters, sequential=True))) < 0.02  # it is held all the same


# ---- The files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", SETS)
def test_the_ssp_is_one_that_engines_read(folder: Path, parameters: str) -> None:
    path = system_files(folder, parameters)[0]
    system = read_ssd(str(path)).system  # checked against the schemas of SSP 1.0
    with zipfile.ZipFile(path) as archive:
        names, text = archive.namelist(), archive.read("SystemStructure.ssd")
    assert {c.source for c in system.elements} <= set(names)
    # FMPy sets every input connector at every step, connected or not
    ends = {(c.endElement, c.endConnector) for c in system.connections}
    assert {(e.name, c.name) for e in system.elements for c in e.connectors if c.kind == "input"} == ends
    root = etree.fromstring(text)
    validate_tree(root, "SystemStructureDescription.xsd")
    sets = list(root.iter("{*}ParameterSet"))
    assert [s.get("name") for s in sets] == [PARAMETER_SET] * 2, "Ecos takes those of one name"
    for values in sets:
        validate_tree(values, "SystemStructureParameterValues.xsd")
    (master,) = root.iter("{*}FixedStepMaster")  # for OMSimulator
    assert dict(master.attrib) == {"description": "oms-ma", "stepSize": "0.05", "relativeTolerance": "1e-4"}


# ---- Engines that have to be installed -------------------------------------------------------------------------------


@pytest.mark.interop
@pytest.mark.parametrize("engine", [name for name in ENGINES if "FMPy" not in name])
def test_engines_hold_and_agree(engine: str, folder: Path, expected: tuple[str, Trajectory]) -> None:
    parameters, trajectory = expected
    if reason := ENGINES[engine].missing():
        pytest.skip(f"{engine}: {reason}")
    agree(ENGINES[engine].run(folder, parameters), trajectory)


@pytest.mark.interop
def test_the_command_runs_and_judges(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run.main([str(tmp_path / "system")]) == 0
    told = capsys.readouterr().out
    assert told.count(" ok\n") >= 4
    assert (tmp_path / "system" / "station_keeping.svg").is_file()
    monkeypatch.setattr(run, "DEPTH", 1e-9)
    assert run.main([str(tmp_path / "system")]) == 1
    assert "FAILED" in capsys.readouterr().out
