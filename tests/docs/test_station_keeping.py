"""examples/station_keeping: the autopilot's promises, the closed loop, and that engines agree on it."""

import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from math import degrees, pi, radians
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.ssd import read_ssd, validate_tree
from lxml import etree

from examples.station_keeping import engines, run
from examples.station_keeping.engines import ENGINES, NAMES, Trajectory
from examples.station_keeping.system import (
    DEFAULT,
    SEA,
    STEP,
    build_system,
    parameter_sets,
    system_files,
)
from examples.systems import PARAMETER_SET
from tests.conftest import Made, without_page
from verification.references.fmpy_slave import keep_loaded

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


class Fmu:
    """An FMU that runs in FMPy, variables by name."""

    def __init__(self, folder: Path, **values: float | bool) -> None:
        description = fmpy.read_model_description(str(folder), validate=False)
        self.variables = {v.name: v for v in description.modelVariables}
        identifier = description.coSimulation.modelIdentifier
        self.slave = FMU2Slave(
            guid=description.guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=identifier
        )
        self.time = 0.0
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.set(**values)
        self.slave.exitInitializationMode()

    def set(self, **values: float | bool) -> None:
        for name, value in values.items():
            variable = self.variables[name]
            put = self.slave.setBoolean if variable.type == "Boolean" else self.slave.setReal
            put([variable.valueReference], [value])

    def get(self, *names: str) -> list[float]:
        return list(self.slave.getReal([self.variables[name].valueReference for name in names]))

    def step(self, times: int = 1, /, **values: float | bool) -> None:
        self.set(**values)
        for _ in range(times):
            self.slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=STEP)
            self.time += STEP

    def stop(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


Start = Callable[..., Fmu]


@pytest.fixture
def start(folder: Path) -> Iterator[Start]:
    """Return a function that starts an FMU with values. All are stopped in the end."""
    keep_loaded(folder / "Autopilot")
    running = []

    def start_one(name: str, **values: float | bool) -> Fmu:
        running.append(Fmu(folder / name, **values))
        return running[-1]

    yield start_one
    for fmu in running:
        fmu.stop()


COMMANDS = ("u_l", "u_r", "u_t")


# ---- The autopilot ---------------------------------------------------------------------------------------------------


def test_commands_keep_their_limits(start: Start) -> None:
    autopilot = start(
        "Autopilot", depth_hold=True, heading_hold=True, z_ref=50.0, psi_ref=3.0, surge=1.0, u_max=0.6, u_rate=2.0
    )
    rows = []
    for n in range(1000):
        if n == 300:
            autopilot.set(z_ref=-50.0, psi_ref=-3.0, surge=-1.0)
        autopilot.step()
        rows.append(autopilot.get(*COMMANDS))
    assert np.abs(rows).max() <= 0.6
    assert rows[-1] == pytest.approx([-0.6, 0.6, -0.6])  # it ends at all limits
    assert np.abs(np.diff(rows, axis=0)).max(axis=0) == pytest.approx(2.0 * STEP)  # and went there as fast as it may


LOOPS = {
    "depth": ("depth_hold", "z_ref", "z", "heave", "u_t"),
    "heading": ("heading_hold", "psi_ref", "psi", "yaw", "u_l"),
}
"""The switch, target, measured value, stick and command of each loop."""


@pytest.mark.parametrize("loop", LOOPS)
def test_the_integral_does_not_wind_up(start: Start, loop: str) -> None:
    switch, target, measured, _, command = LOOPS[loop]
    away = 2.0

    def steps_at_the_limit(T_t: float) -> int:
        """It is held fast for a minute, comes free and passes the target: how long the command stays at its limit."""
        autopilot = start("Autopilot", T_t=T_t, **{switch: True, target: away})
        autopilot.step(round(60.0 / STEP))
        assert autopilot.get(command) == [1.0]
        for n in range(round(60.0 / STEP)):
            autopilot.step(**{measured: min(2.0 * away, 0.01 * n)})
            if autopilot.get(command)[0] < 1.0:
                break
        return n

    free, wound_up = steps_at_the_limit(1.0), steps_at_the_limit(1e9)
    assert free <= 200  # before it is there
    assert wound_up >= 1000


@pytest.mark.parametrize("loop", LOOPS)
def test_a_hold_goes_on_without_a_jump(start: Start, loop: str) -> None:
    switch, target, measured, stick, command = LOOPS[loop]
    rate = 0.12
    autopilot = start("Autopilot", **{stick: 0.45, target: 3.0})
    for n in range(40):
        autopilot.step(**{measured: rate * n * STEP})
    (before,) = autopilot.get(command)
    assert before == pytest.approx(0.45)
    autopilot.step(**{measured: rate * 40 * STEP, switch: True})
    assert autopilot.get(command) == pytest.approx([before], abs=1e-9)
    autopilot.step(**{measured: rate * 41 * STEP})
    assert autopilot.get(command) == pytest.approx([before], abs=0.15)  # then it starts towards the target
    assert autopilot.get(command)[0] > before


def test_a_compass_may_wrap(start: Start) -> None:
    def commands(wrapped: bool) -> list[list[float]]:
        autopilot = start("Autopilot", heading_hold=True, psi=radians(340.0), psi_ref=radians(20.0))
        rows = []
        for n in range(200):
            psi = radians(340.0 + 0.25 * n)
            autopilot.step(psi=psi % (2.0 * pi) if wrapped else psi)
            rows.append(autopilot.get(*COMMANDS))
        return rows

    found = np.array(commands(True))
    assert found == pytest.approx(np.array(commands(False)), abs=1e-9)
    assert found[4, 0] > 0.0, "the short way round: to starboard, through north"


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
