"""examples/system: the ROV with autopilot, current and battery is held, and engines agree on it."""

import re
import zipfile
from functools import cache
from math import degrees
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd, validate_tree
from lxml import etree
from pythonfmu import FmuBuilder

from examples.system import engines, run
from examples.system.engines import ENGINES, NAMES, Trajectory
from examples.system.system import (
    CONNECTIONS,
    DEFAULT,
    build_system,
    parameter_sets,
    system_file,
)
from examples.system.with_fmpy import fly
from examples.tether import draw
from rov_fmu.bridges.system import system
from rov_fmu.bridges.system.plan import load_system_plan
from rov_fmu.bridges.system.run import recorded_names
from rov_fmu.bridges.system.ssp import PARAMETER_SET, read_ssp
from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import SHIPPED
from tests.bridges.system.fmus import described_model
from tests.commands import ROOT, Capsys
from tests.conftest import Made, without_page

SETS = tuple(parameter_sets())


def _build(folder: Path) -> None:
    """Build the system into a folder."""
    with without_page():
        build_system(folder)


@pytest.fixture(scope="session")
def folder(made_once: Made) -> Path:
    return made_once("system", _build)


plain = cache(engines.plain)


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


@pytest.mark.parametrize("engine", [name for name in ENGINES if "FMPy" in name])
def test_fmpy_holds_and_agrees(engine: str, folder: Path, expected: tuple[str, Trajectory]) -> None:
    parameters, trajectory = expected
    result = ENGINES[engine].run(folder, parameters)
    agree(result, trajectory)
    assert np.ptp(result["rov.z"]) > 4.9  # it did dive
    assert degrees(np.ptp(result["rov.psi"])) > 89.0
    assert result["rov.z"].max() < 5.0 + 0.02  # and not beyond


@pytest.mark.parametrize("cut", CONNECTIONS, ids=".".join)
def test_every_connection_acts(cut: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    expected = plain(DEFAULT)
    monkeypatch.setattr(engines, "CONNECTIONS", {one: CONNECTIONS[one] for one in CONNECTIONS if one != cut})
    apart = run.difference(engines.plain(DEFAULT), expected)
    assert max(apart.values()) > 1e-4
    if cut[0] == "current":
        assert max(apart["rov.x"], apart["rov.y"]) > 0.1
    if cut == ("battery", "sag"):
        assert apart["autopilot.u_t"] > 1e-3


@pytest.mark.long
def test_the_order_of_stepping_makes_a_difference(expected: tuple[str, Trajectory]) -> None:
    parameters, trajectory = expected
    apart = run.difference(plain(parameters, sequential=True), trajectory)
    assert 1e-5 < apart["rov.z"] < 2e-2
    assert max(run.held(plain(parameters, sequential=True))) < 0.02  # it is held all the same


# ---- The files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", SETS)
def test_the_ssp_is_one_that_engines_read(folder: Path, parameters: str) -> None:
    path = system_file(folder, parameters)
    system = read_ssd(str(path)).system  # checked against the schemas of SSP 1.0
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    assert {c.source for c in system.elements} <= content.keys()
    # FMPy sets every input connector at every step, connected or not
    ends = {(c.endElement, c.endConnector) for c in system.connections}
    assert {(e.name, c.name) for e in system.elements for c in e.connectors if c.kind == "input"} == ends
    root = etree.fromstring(content["SystemStructure.ssd"])
    validate_tree(root, "SystemStructureDescription.xsd")
    sources = [one.get("source") for one in root.iter("{*}ParameterBinding")]
    given = parameter_sets()[parameters]
    assert sources == [f"resources/{e.name}.ssv" for e in system.elements if given[e.name]]
    sets = [etree.fromstring(content[source]) for source in sources]
    assert [s.get("name") for s in sets] == [PARAMETER_SET] * len(sources), "Ecos takes those of one name"
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
def test_the_command_runs_and_judges(tmp_path: Path, capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run.main([str(tmp_path / "system")]) == 0
    told = capsys.readouterr().out
    assert told.count(" ok\n") >= 4
    assert (tmp_path / "system" / "system.svg").is_file()
    monkeypatch.setattr(run, "DEPTH", 1e-9)
    assert run.main([str(tmp_path / "system")]) == 1
    assert "FAILED" in capsys.readouterr().out


# ---- docs/system.md --------------------------------------------------------------------------------------------------

PAGE = (ROOT / "docs" / "system.md").read_text(encoding="utf-8")


def test_the_plan_of_the_page_is_a_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every input that hangs on the world is connected."""
    monkeypatch.setattr(system, "model_fmu", described_model)
    monkeypatch.setattr(system, "lack", lambda _: "")
    path = tmp_path / "tether.toml"
    (block,) = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert len(block.splitlines()) <= 22
    path.write_text(block, encoding="utf-8")
    plan = load_system_plan(path)
    found = system.made(plan, path)
    assert {start[0] for start, *_ in found.connections} == {"rov", "tether", "water", "autopilot"}
    assert [*system.unconnected(plan, found)] == [
        "rov: nothing is connected to X_ext, Z_ext and N_ext, which keep their start values",
        "tether: nothing is connected to y_top, z_top, vg_N_top, vg_E_top and vg_D_top, which keep their start values",
        "autopilot: nothing is connected to mode_u, ref_u, ref_x, stick_w, ref_w, stick_r, ref_r, sag "
        "and 4 others, which keep their start values",
    ]


HEAVY = (ROOT / "examples" / "system" / "heavy.toml").read_text(encoding="utf-8")


def _tethered(folder: Path) -> None:
    """Write the system of the page, which runs for 20 s."""
    (block,) = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    (folder / "plan.toml").write_text(block.replace("stop_time = 60", "stop_time = 20"), encoding="utf-8")


def _with_battery(folder: Path, plan: str = HEAVY, waves: str = "false") -> None:
    """Write the system of the Heavy, whose thrust falls with the voltage of the battery."""
    vehicle = SHIPPED["bluerov2_heavy"].read_text(encoding="utf-8")
    for before, more in (
        ("format", f"waves = {waves}\n"),
        ("c_0", 'V_0 = { value = 16.0, unit = "V", source = "s" }\nn_V = { value = 1.2, unit = "1", source = "s" }\n'),
        ("[surface]", '[battery]\nvoltage = { value = 16.0, unit = "V", source = "s" }\n'),
    ):
        vehicle = vehicle.replace(f"\n{before}", f"\n{more}{before}", 1)
    (folder / "rov.toml").write_text(vehicle, encoding="utf-8")
    plan = plan.replace('"bluerov2_heavy"', '"rov.toml"').replace(
        "connect = [", 'connect = [["battery.battery", "rov.battery"],'
    )
    (folder / "plan.toml").write_text(plan.replace("stop_time = 20", "stop_time = 8"), encoding="utf-8")


def _in_a_seaway(folder: Path) -> None:
    """Write the same in a seaway, which moves the tether, too."""
    ends = ("water.current", "sea.steady"), ("sea.current", "rov.current"), ("sea.waves", "rov.waves")
    sea = ", ".join(f'["{a}", "{b}"]' for a, b in [*ends, ("sea.waves", "tether.waves")])
    plan = HEAVY.replace('["water.current", "rov.current"]', sea)
    values = "{ H_s = 0.5, T_p = 6, spreading = 4, seed = 1 }"
    _with_battery(folder, f'{plan}[component.sea]\ncompanion = "seaway"\nstart = {values}\n', "true")


@pytest.fixture(scope="module", params=[_tethered, _with_battery, _in_a_seaway])
def tethered(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The SSP of a system with a tether, beside which is its motion by the command."""
    pytest.importorskip("moordyn")
    folder = tmp_path_factory.mktemp("tethered")
    request.param(folder)
    assert main(["system", str(folder / "plan.toml"), "-o", str(folder / "plan.ssp"), "--run"]) == 0
    return folder / "plan.ssp"


@pytest.mark.interop
@pytest.mark.parametrize("engine", ["libcosim, SSP", "Ecos, SSP", "FMPy, 30 lines"])
def test_engines_agree_on_tethers(engine: str, tethered: Path) -> None:
    """All states and forces; a tether is stiff, and shows steps that differ in their last bits."""
    if reason := ENGINES[engine].missing():
        pytest.skip(f"{engine}: {reason}")
    motion = np.genfromtxt(tethered.with_suffix(".csv"), delimiter=",", names=True, deletechars="")
    system, steps = read_ssp(tethered), len(motion) - 1
    # Those that follow an input at once are of the next step in Ecos.
    names = [
        (c, name)
        for c, name in recorded_names(system)
        if not system.parts[c].direct.get(name) and system.parts[c].variables[name].kind == "Real"
    ]
    assert {c for c, _ in names} == {*system.parts}
    if engine.startswith("Ecos"):
        found = engines.by_ecos(tethered, names, steps, 0.02)
    elif engine.startswith("libcosim"):
        found = engines.by_libcosim(tethered, names, steps)
    else:
        rows = list(fly(str(tethered), 0.02, steps))
        found = {name: np.array([row[name] for row in rows]) for name in map(".".join, names)}
    for name, values in found.items():
        np.testing.assert_allclose(values, motion[name][1:], rtol=0.0, atol=1e-9, err_msg=name)


def test_the_picture_of_a_tether_shows_it(tmp_path: Path) -> None:
    places = [f"tether.{axis}_{n}" for n in range(3) for axis in "yz"]
    names = ["time", "rov.y", "rov.z", "tether.tension_top", "tether.tension_bottom", *places]
    rows = [",".join(names), *(",".join(map(str, [n] * len(names))) for n in range(5))]
    (tmp_path / "motion.csv").write_text("\n".join(rows), encoding="utf-8")
    draw(tmp_path / "motion.csv", tmp_path / "tether.svg")
    assert "Tension" in (tmp_path / "tether.svg").read_text(encoding="utf-8")


def test_the_controller_of_the_page_holds_the_depth(tmp_path: Path, capsys: Capsys) -> None:
    text = (ROOT / "docs" / "autopilot.md").read_text(encoding="utf-8")
    hold, controller = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (plan,) = re.findall(r"^```toml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    exec(compile(hold, "autopilot.md", "exec"), {})
    assert capsys.readouterr().out == "2.00 m\n"
    (tmp_path / "depth.py").write_text(controller, encoding="utf-8")
    FmuBuilder.build_FMU(tmp_path / "depth.py", dest=tmp_path)
    rov = '[component.rov]\nvehicle = "videoray"\n'
    (tmp_path / "plan.toml").write_text(f"step = 0.05\nstop_time = 60\n{plan}{rov}", encoding="utf-8")
    assert main(["system", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "plan.ssp"), "--run"]) == 0
    motion = np.genfromtxt(tmp_path / "plan.csv", delimiter=",", names=True, deletechars="")
    assert f"{motion['rov.z'][-1]:.2f} m" in text
