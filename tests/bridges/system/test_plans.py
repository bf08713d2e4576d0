"""Plans of systems: what is connected, and what does not fit, in one line each; nothing is written then."""

import json
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fmpy.ssp.ssd import read_ssd

from rov_fmu.bridges.system import companion as companions
from rov_fmu.bridges.system import system
from rov_fmu.bridges.system.connections import MismatchError, SystemStructure, connected, loop
from rov_fmu.bridges.system.part import SystemFmu
from rov_fmu.bridges.system.plan import load_system_plan
from rov_fmu.bridges.system.ssp import read_ssp
from rov_fmu.cli import main
from rov_fmu.fmu.archive import is_unchanged
from rov_fmu.fmu.terminals import port_of
from rov_fmu.fmus import fmu
from rov_fmu.fmus.description import described as described_here
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, read_vehicle
from rov_fmu.vehicle.writer import vehicle_text
from tests.bridges.system.fmus import described, described_model, foreign
from tests.commands import ROOT, Capsys, without_progress
from tests.often import spread
from tests.vehicles import in_waves

PLAN = """
step = 0.1
stop_time = 1.0
connect = [
  ["rov.point_bow", "tether.bottom"],
  ["water.current", "rov.current"],
  ["water.profile", "tether.profile"],
  ["rov.z", "water.z"],
  ["a.y", "b.u"],
]
[component.rov]
vehicle = "videoray"
point = { bow = [0.2, 0.0, -0.1] }
start = { z = 3.0 }
[component.tether]
companion = "tether"
start = { length = 20.0 }
[component.water]
companion = "current"
[component.a]
fmu = "foreign.fmu"
[component.b]
fmu = "foreign.fmu"
"""
LAST = '["a.y", "b.u"],'


@cache
def _of_shape(name: str, shape: str) -> bytes:
    return companions.companion(name, **json.loads(shape))


def _companion(name: str, **shape: Any) -> bytes:
    return _of_shape(name, json.dumps(shape))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder, with FMUs, where vehicles are described and not compiled."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(system, "model_fmu", described_model)
    # It takes most of the time to start a process that reads an FMU of others: tests of `prove` do.
    monkeypatch.setattr(fmu, "read_description", lambda _, folder: described_here(str(folder)))
    monkeypatch.setattr(system, "companion", _companion)
    for name, content in {
        "foreign": foreign(),
        "feet": foreign("ft", m="1", factor="0.3048"),
        "metres": foreign("metre", m="1"),
        "unitless": foreign(""),
        "switch": foreign("", "Boolean"),
        "delayed": foreign(follows=False),
        "broken": b"no FMU",
        "ports": foreign(terminals="<x><Terminals><Terminal name='t'/>"),
    }.items():
        Path(f"{name}.fmu").write_bytes(content)


def told(text: str, capsys: Capsys) -> list[str]:
    """Write a plan, run the command, and return the lines of its error."""
    Path("plan.toml").write_text(text, encoding="utf-8")
    before = sorted(Path().iterdir())
    assert main(["system", "plan.toml", "-o", "my.ssp"]) == 2
    assert sorted(Path().iterdir()) == before, "nothing is half-written"
    return without_progress(capsys.readouterr().err).splitlines()


PILOT = 'for = "component" belongs to companion = "autopilot" or "sensors", which needs it'
WRONG = {
    "a component that is not there": (LAST, '["rovv.y", "b.u"],', "there is no component 'rovv', only rov, tether"),
    "a variable that is not there": (LAST, '["a.yy", "b.u"],', "a: the FMU has no variable or terminal 'yy'"),
    "an input as a start": (LAST, '["a.u", "b.u"],', "a.u has causality input: a connection begins at an output"),
    "a unit": ("foreign.fmu", "feet.fmu", "rov.z is in m, and a.u in ft: a third entry is the factor"),
    "a type": ("foreign.fmu", "switch.fmu", "rov.z is of type Real, and a.u of type Boolean"),
    "a terminal and a variable": (LAST, '["rov.pose", "b.u"],', "rov.pose is a terminal and b.u a variable"),
    "a port of another kind": (LAST, '["rov.thrusters", "tether.top"],', "these terminals are of different kinds: rov"),
    "an input twice": (LAST, '["rov.x", "water.z"],', "water.z takes one connection, and connect#4 connects it too"),
    "a port twice": (LAST, '["tether.bottom", "rov.point_bow"],', "takes one connection, and connect#1 connects"),
    "a factor between ports": (
        '"tether.bottom"]',
        '"tether.bottom", -1.0]',
        "rov.point_bow and tether.bottom are terminals, which take no factor",
    ),
    "a place without the force": (
        '["rov.point_bow", "tether.bottom"]',
        ", ".join(f'["rov.{name}_bow", "tether.{name}_bottom"]' for name in ("x", "y", "z", "vg_N", "vg_E", "vg_D")),
        "connect: tether.bottom is connected by half: nothing is connected to rov.F_N_bow",
    ),
    "a velocity without a place": (
        LAST,
        '["rov.vg_N_bow", "tether.vg_N_top"],',
        "connect: tether.top is connected by half: nothing is connected to tether.x_top",
    ),
    "a port of nothing": (
        'fmu = "foreign.fmu"',
        'fmu = "foreign.fmu"\nport = { tip = { x = "yy" } }',
        "component.a.port.tip: the FMU has no variable or terminal 'yy'",
    ),
    "a port with the name of a variable": (
        'fmu = "foreign.fmu"',
        'fmu = "foreign.fmu"\nport = { y = ["y"] }',
        "component.a.port.y: the FMU has a variable or a terminal of this name",
    ),
    "a port that is a number": (
        'fmu = "foreign.fmu"',
        'fmu = "foreign.fmu"\nport = { tip = { x = ["y", 0.0] } }',
        "must be { member = ",
    ),
    "a file that nobody reads": (
        'companion = "tether"',
        'companion = "tether"\nfile = "foreign.fmu"',
        "component.tether.file: the companion tether takes no file",
    ),
    "two seabeds": (
        "length = 20.0 }\n[component.water]",
        "length = 20.0, seabed = 20 }\n[component.water]\nstart = { seabed = 30 }",
        "component.tether.start.seabed = 20.0: component.water.start.seabed is 30.0: there is one seabed",
    ),
    "a loop": (LAST, '["a.y", "b.u"], ["b.y", "a.u"],', "connect: a.y -> b.u -> b.y -> a.u -> a.y is a loop without"),
    "a start value of nothing": ("length = 20.0", "lenght = 20.0", "tether.start.lenght = 20.0: the FMU has no"),
    "a calculated start": ("length = 20.0", "tension_top = 2.0", "cannot be set, because the FMU computes it"),
    "a start that cannot be": (
        "length = 20.0",
        "mass = 0.0",
        "tether.start.mass = 0.0: must be within 0.0001 ... 10000",
    ),
    "a start that is text": ("length = 20.0", 'length = "20"', "must be a number"),
    "a component with a point": ("component.water]", 'component."a.b"]', "component.a.b = 'a.b': must be at most 30"),
    "a file that is no FMU": ("foreign.fmu", "broken.fmu", "broken.fmu: is not an FMU, or is damaged"),
    "damaged terminals": ("foreign.fmu", "ports.fmu", "ports.fmu: terminalsAndIcons/terminalsAndIcons.xml: not XML"),
    "a file elsewhere": ("foreign.fmu", "../foreign.fmu", "must lead to a place inside the folder of this file"),
    "two kinds": ('companion = "tether"', 'companion = "tether"\nfmu = "foreign.fmu"', "must have one of vehicle, fmu"),
    "coefficients of another vehicle": (
        "start = { z = 3.0 }",
        'coefficients = "bluerov2_heavy"',
        "component.rov.coefficients: ",
    ),
    "the time": ("stop_time = 1.0", "stop_time = 1.05", "stop_time = 1.05: must be a whole number of steps of 0.1 s"),
    "a plot of nothing": ("step = 0.1", 'step = 0.1\nplot = ["rov.zz"]', "plot = 'rov.zz': must name variables"),
    "too many steps": ("step = 0.1\nstop_time = 1.0", "step = 1e-9\nstop_time = 1e9", "at most 10000000"),
    "a number of many digits": ("z = 3.0", f"z = {'9' * 400}", "must be a finite number"),
    "an autopilot of nothing": ("fmu =", 'companion = "autopilot"\n#', PILOT),
    "a current for a vehicle": ('"current"', '"current"\nfor = "rov"', PILOT),
    "an autopilot of the water": (
        "fmu =",
        'companion = "autopilot"\nfor = "water"\n#',
        "a.for = 'water': must be a component that has a vehicle",
    ),
    "an autopilot of a fish": (
        "fmu =",
        'companion = "autopilot"\nfor = "fish"\n#',
        "a.for = 'fish': must be a component that has a vehicle",
    ),
    "the plan of a study": (PLAN, "vary = 3\nstep = 1", "must be the plan of a system (TOML), and not the plan of a"),
}


@pytest.mark.parametrize("case", spread(WRONG, [*WRONG][::2], WRONG))
@pytest.mark.usefixtures("folder")
def test_what_does_not_fit_is_one_line(case: str, capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(system, "model_fmu")  # nothing is compiled for a plan that does not fit
    old, new, message = WRONG[case]
    assert old in PLAN
    # Of the two foreign FMUs, one is replaced, and is connected to the vehicle.
    other = PLAN.replace(LAST, '["rov.z", "a.u"],') if old == "foreign.fmu" else PLAN
    lines = told(other.replace(old, new, 1), capsys)
    assert len(lines) == 1 or case in ("coefficients of another vehicle", "a port twice", "two kinds"), lines
    assert lines[0].startswith("rov-fmu: ")
    assert message in lines[0], lines


@pytest.mark.usefixtures("folder")
def test_every_mistake_is_told_at_once(capsys: Capsys) -> None:
    text = PLAN.replace(LAST, '["x.y", "b.u"], ["a.y", "y.u"],').replace("length = 20.0", "lenght = 20.0")
    keys = [line.split(": ")[2].split(" = ")[0] for line in told(text, capsys)]
    assert keys == ["component.tether.start.lenght", "connect#5", "connect#6"]


@pytest.mark.usefixtures("folder")
def test_a_package_that_is_missing_is_one_line(capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(companions, "find_spec", lambda _: None)
    (line,) = told(PLAN, capsys)
    assert line.endswith("component.tether.companion = 'tether': needs moordyn: pip install 'rov-fmu[system]'")
    assert main(["system", "--list"]) == 0
    assert "needs moordyn" in capsys.readouterr().out


@pytest.mark.usefixtures("folder")
def test_a_port_that_is_forgotten_is_told(capsys: Capsys) -> None:
    lines = [line for line in PLAN.replace(LAST, "").splitlines() if "point_" not in line]
    Path("plan.toml").write_text("\n".join(lines), encoding="utf-8")
    assert main(["system", "plan.toml", "-o", "my.ssp"]) == 0
    assert "rov: the port point_bow is not connected, so its inputs keep" in capsys.readouterr().err


MANY = """
step = 0.1
stop_time = 1.0
connect = [
  ["b.point_bow", "two.bottom"], ["rov.point_bow", "one.bottom"], ["crane.tip", "one.top"],
  ["water.current", "b.current"], ["water.current", "rov.current"], ["water.profile", "one.profile"],
  ["two.profile", "water.profile"], ["deep.current", "cage.water"], ["cage.water", "deep.pose"],
]
[component.rov]
vehicle = "videoray"
point = { bow = [0.2, 0.0, -0.1] }
start = { z = 3.0 }
[component.b]
vehicle = "videoray"
point = { bow = [0.2, 0.0, -0.1] }
[component.one]
companion = "tether"
start = { seabed = 12.0 }
[component.two]
companion = "tether"
[component.water]
companion = "current"
file = "water.csv"
[component.deep]
companion = "current"
[component.crane]
fmu = "metres.fmu"
port = { tip = { z = ["y", -0.3048] } }
[component.cage]
companion = "current"
port = { water = { z = "V_N", V_N = "z" } }
"""


@pytest.mark.usefixtures("folder")
def test_a_field_and_ports_of_the_plan_are_handed_on() -> None:
    """The water serves both vehicles where they are, and both tethers with all rows of its file and the seabed."""
    rows = [f"0,{z},0.1,0" for z in range(40)]
    Path("water.csv").write_text("\n".join(["time,z,V_N,V_E", *rows]), encoding="utf-8")
    unlike = MANY.replace('"V_N", V_N = "z"', '["V_N", 10.0], V_N = ["z", 0.1]')
    Path("plan.toml").write_text(unlike, encoding="utf-8")
    plan = load_system_plan(Path("plan.toml"))
    found = system.made(plan, Path("plan.toml"))
    sources = {one.end: one for one in found.connections}
    assert sources["water", "z"].start == ("b", "z"), "the first one that is served has the plain names"
    assert sources["water", "z_rov"].start == ("rov", "z")
    assert sources["b", "V_N"].start == ("water", "V_N")
    assert sources["rov", "V_N"].start == ("water", "V_N_rov")
    assert sources["one", "depth_41"].start == sources["two", "depth_41"].start == ("water", "depth_41")
    assert ("one", "depth_42") not in sources
    assert start_of(found, "water", "seabed") == 12.0
    assert sources["one", "z_top"] == (("crane", "y"), ("one", "z_top"), -0.3048, 0.0)
    assert [start_of(found, "one", name) for name in ("seabed", "difference_top")] == [12.0, 1.0]
    assert sources["deep", "z"] == (("cage", "V_N"), ("deep", "z"), 10.0, 0.0)
    assert sources["cage", "z"] == (("deep", "V_N"), ("cage", "z"), 10.0, 0.0), "a member is 0.1 of this variable"
    told = [*system.unconnected(plan, found)]
    assert "one: the velocity of top is the change of its place, because it is not connected" in told


SEA = """
step = 0.1
stop_time = 1.0
connect = [
  ["water.current", "sea.steady"], ["sea.waves", "line.waves"], ["water.profile", "line.profile"],
  ["sea.current", "a.current"], ["sea.waves", "a.waves"], ["b.current", "sea.current"], ["b.point_bow", "line.bottom"],
]
[component.a]
vehicle = "rov.toml"
[component.b]
vehicle = "rov.toml"
point = { bow = [0.2, 0.0, -0.1] }
start = { z = 4.0 }
[component.line]
companion = "tether"
start = { seabed = 25.0 }
[component.sea]
companion = "seaway"
[component.water]
companion = "current"
"""


@pytest.mark.usefixtures("folder")
def test_a_sea_serves_vehicles_with_their_own_currents_and_every_node_of_a_tether(
    capsys: Capsys,
) -> None:
    Path("rov.toml").write_text(vehicle_text(in_waves(load_vehicle(VIDEORAY))))
    Path("plan.toml").write_text(SEA)
    plan = load_system_plan(Path("plan.toml"))
    found = system.made(plan, Path("plan.toml"))
    sources = {one.end: one.start for one in found.connections}
    assert sources["b", "V_N"] == ("sea", "V_N_b")
    assert sources["sea", "U_N"] == ("water", "V_N"), "the current of each place is asked at the vehicle's own depth"
    assert sources["water", "z"] == ("a", "z")
    assert sources["sea", "U_N_b"] == ("water", "V_N_b")
    assert sources["water", "z_b"] == ("b", "z")
    assert [start_of(found, "water", name) for name in ("z", "z_b", "seabed")] == [0.0, 4.0, 25.0]
    assert [start_of(found, "sea", name) for name in ("z_b", "seabed", "step")] == [4.0, 25.0, 0.1]
    for n in (0, 20):
        assert sources["line", f"A_D_p{n}"] == ("sea", f"A_D_line_{n}")
        assert sources["sea", f"x_line_{n}"] == ("line", f"x_p{n}")
    assert not {name for name in found.parts["sea"].variables if name.startswith("U_N_line")}
    assert not [line for line in system.unconnected(plan, found) if line.startswith(("sea", "water"))]
    lines = told(
        SEA.replace("seabed = 25.0", "seabed = 25.0, mass = -1").replace('seaway"', 'seaway"\nstart.H_s = -1'), capsys
    )
    assert [line.partition("component.")[2] for line in lines] == [
        "line.start.mass = -1: must be within 0.0001 ... 10000 kg/m",
        "sea.start.H_s = -1: must be within 0 ... 100 m",
    ]


@pytest.mark.usefixtures("folder")
def test_a_plan_becomes_a_system(capsys: Capsys) -> None:
    text = PLAN.replace(LAST, '["a.y", "b.u", 2.0],').replace("[component.b]", "start = { k = 4 }\n[component.b]")
    Path("plan.toml").write_text(text, encoding="utf-8")
    assert main(["system", "plan.toml", "-o", "my.ssp"]) == 0
    printed = capsys.readouterr()
    assert "Wrote my.ssp" in printed.out
    assert "rov: nothing is connected to u_l, u_r, u_t, X_ext, Z_ext and N_ext, which keep" in printed.err
    found = read_ssp(Path("my.ssp"))
    names = port_of(with_point().layout.points[0]).members
    into = {variable for variable in names if found.parts["rov"].variables[variable].causality == "input"}
    ends = {one.end: one.start for one in found.connections}
    assert {("rov", name) for name in into} <= ends.keys()
    assert {start[1] for start in ends.values() if start[0] == "rov"} == names.keys() - into | {"z"}
    assert start_of(found, "rov", "z") == 3.0
    assert start_of(found, "water", "z") == 3.0, "a connected input begins as its source"
    assert found.values == {"rov": {}, "tether": {}, "water": {}, "a": {"k": 4.0}, "b": {}}
    (told,) = [line for line in printed.err.splitlines() if "start values of" in line]
    assert told.endswith("do not read the start values of a in the SSP, nor libcosim those of outputs: set them there")
    assert "do not read the factors of connections in the SSP, here to b.u: take another tool" in printed.err
    for part in (found.parts["rov"], found.parts["tether"]):
        experiment = part.description.defaultExperiment
        assert (float(experiment.stopTime), float(experiment.stepSize)) == (1.0, 0.1)
    assert [one.factor for one in found.connections if one.end == ("b", "u")] == [2.0]
    structure = zipfile.ZipFile("my.ssp").read("SystemStructure.ssd").decode()
    assert structure.count('suppressUnitConversion="true"') == structure.count('factor="2.0"') == 1
    # FMPy validates the structure and the parameter sets, and sets every input that is a connector.
    elements = read_ssd("my.ssp").system.elements
    connectors = {(e.name, c.name) for e in elements for c in e.connectors if c.kind == "input"}
    assert connectors == {one.end for one in found.connections}
    content = Path("my.ssp").read_bytes()
    assert main(["system", "plan.toml", "-o", "my.ssp"]) == 0, "it may replace its own file"
    assert Path("my.ssp").read_bytes() == content
    Path("my.ssp").write_bytes(content.replace(b"rov.fmu", b"Rov.fmu"))
    assert not is_unchanged(Path("my.ssp"))
    assert main(["system", "plan.toml", "-o", "my.ssp"]) == 2


def start_of(system: SystemStructure, component: str, name: str) -> float:
    """Return the start value that the FMU of a component has by itself, for importers that read no other."""
    return system.parts[component].variables[name].start


def with_point() -> Vehicle:
    point = b'\n[[point]]\nname = "bow"\nposition = { value = [0.2, 0, -0.1], unit = "m", source = "drawing" }\n'
    return read_vehicle(VIDEORAY, VIDEORAY.read_bytes() + point)


def parts(**content: bytes) -> dict[str, SystemFmu]:
    return {name: SystemFmu.open(Path(name), one, is_ours=True) for name, one in content.items()}


@pytest.mark.usefixtures("folder")
def test_components_of_one_kind_share_an_fmu() -> None:
    alike = "[component.{}]\nvehicle = 'videoray'\npoint.bow = [0.2, 0.0, -0.1]\nstart.z = {}\n"
    text = PLAN.replace("[component.a]", f"{alike.format('copy', 3)}{alike.format('deep', 4)}[component.a]")
    Path("plan.toml").write_text(text, encoding="utf-8")
    found = system.made(load_system_plan(Path("plan.toml")), Path("plan.toml")).parts
    assert found["copy"] is found["rov"]
    assert found["deep"] is not found["rov"], "it begins elsewhere"
    assert found["a"] is found["b"]


def test_units_are_alike_if_they_are_the_same_quantity() -> None:
    has = parts(
        m=foreign(), metre=foreign("metre", m="1"), none=foreign(""), feet=foreign("ft", m="1", factor="0.3048")
    )
    has["own"] = parts(own=foreign("m", m="1"))["own"]
    for first, second in (("m", "own"), ("own", "metre"), ("m", "none"), ("none", "feet"), ("feet", "feet")):
        connected(f"{first}.y", f"{second}.u", 1.0, has)
    for first, second in (("own", "feet"), ("feet", "metre")):
        with pytest.raises(MismatchError, match="a third entry is the factor"):
            connected(f"{first}.y", f"{second}.u", 1.0, has)
        connected(f"{first}.y", f"{second}.u", 0.3048, has)


def test_a_terminal_that_is_not_read_whole_is_none() -> None:
    member = '<TerminalMemberVariable variableName="u" memberName="u"/>'
    for more, names in (("", ["t"]), ("<Terminal name='inner'/>", []), ("<TerminalStreamMemberVariable/>", [])):
        text = f"<x><Terminals><Terminal name='t'>{member}{more}</Terminal></Terminals></x>"
        assert [*parts(a=foreign(terminals=text))["a"].terminals] == names


def test_a_loop_with_a_delay_is_allowed() -> None:
    has = parts(a=foreign(), b=foreign(), late=foreign(follows=False))
    around = [connected(f"{x}.y", f"{y}.u", 1.0, has)[0] for x, y in (("a", "b"), ("b", "late"), ("late", "a"))]
    assert loop(SystemStructure(has, {}, around)) == []
    closed = [*around[:1], *connected("b.y", "a.u", 1.0, has)]
    assert loop(SystemStructure(has, {}, closed)) == ["a.y", "b.u", "b.y", "a.u", "a.y"]


def test_ports_of_two_vehicles_and_of_companions_are_of_one_kind() -> None:
    """What a vehicle calls the members of its port is what a tether calls them."""
    vehicle = with_point()
    has = parts(rov=described(vehicle), tether=companions.companion("tether"))
    for end in ("top", "bottom"):
        found = connected("rov.point_bow", f"tether.{end}", 1.0, has)
        assert len(found) == len(port_of(vehicle.layout.points[0]).members) == 9
        assert {one.start[0] for one in found if one.end[0] == "rov"} == {"tether"}
        assert {has["tether"].variables[one.end[1]].unit for one in found if one.end[0] == "tether"} == {"m", "m/s"}
        assert {has["tether"].variables[one.start[1]].unit for one in found if one.start[0] == "tether"} == {"N"}
    with pytest.raises(MismatchError, match=r"F_N is an input of rov.point_bow and an input of rov.point_bow"):
        connected("rov.point_bow", "rov.point_bow", 1.0, has)


IN_PYTHON = [name for name in companions.COMPANIONS if name not in companions.OF_VEHICLES]


@pytest.mark.parametrize("name", IN_PYTHON)
def test_companions_have_units_and_the_same_bytes(name: str) -> None:
    content = companions.companion(name)
    assert companions.companion(name) == content
    part = SystemFmu.open(Path(name), content, is_ours=True)
    slave = companions.slave_of(name)(instance_name=name)
    assert part.variables.keys() == slave.variables.keys()
    for variable, (causality, start, unit, text) in slave.variables.items():
        v = part.variables[variable]
        assert (v.causality, v.description) == (causality, text)
        if v.type == "Real":
            assert v.unit == unit
            assert causality == "output" or float(v.start) == pytest.approx(start, rel=1e-15)
    assert {member for one in part.terminals.values() for member in one.values()} <= part.variables.keys()
    assert part.direct == {}, "outputs change with a step"


def test_the_list_names_every_companion_with_its_variables(capsys: Capsys) -> None:
    assert main(["system", "--list"]) == 0
    printed = capsys.readouterr().out
    assert "autopilot: holds the vehicle of `for`" in printed
    assert "sensors: tells what instruments on the vehicle of `for` measure" in printed
    assert "noise_velocity" in printed
    for name in IN_PYTHON:
        assert f"{name}: {companions.slave_of(name).description}" in printed
        assert all(variable in printed for variable in companions.slave_of(name)(instance_name=name).variables)


@pytest.mark.usefixtures("folder")
def test_the_plan_of_a_stranger_is_bounded(capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    many = "\n".join(f'[component.c{n}]\nfmu = "foreign.fmu"' for n in range(101))
    (line,) = told(f"step = 1.0\nstop_time = 1.0\n{many}", capsys)
    assert "component" in line
    monkeypatch.setattr(system, "_MOST_BYTES", 100_000)
    (line,) = told(PLAN, capsys)
    assert "the FMUs have more than 100,000 bytes in all" in line


@pytest.mark.usefixtures("folder")
def test_an_autopilot_moves_no_fins(capsys: Capsys) -> None:
    Path("remus100.toml").write_bytes((ROOT / "examples" / "remus100" / "remus100.toml").read_bytes())
    tables = '[component.fins]\nvehicle = "remus100.toml"\n[component.pilot]\ncompanion = "autopilot"\nfor = "fins"'
    (line,) = told(f"step = 0.02\nstop_time = 1.0\n{tables}", capsys)
    assert "moves thrusters alone, and not the fins" in line
