"""The descriptions of both versions of FMI, and of one interface or both, are valid and declare the same variables.

They differ in the value references, and in the elements that hold the unit and the bounds of a variable.
"""

from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.validation import validate_model_description
from lxml import etree

import rov_fmu
from rov_fmu.c import compile as build_options
from rov_fmu.cli import main
from rov_fmu.fmu.content import native_content
from rov_fmu.fmu.model_description import DEAD_TIME_NOTE, PYTHON_NOTE, build_description, model_description
from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE
from tests.fmi import CO_SIMULATION, INTERFACES, MODEL_EXCHANGE
from tests.fmu.calls.conftest import WRAPPERS
from tests.vehicles import SIX, THRUST_EFFECTS, VEHICLES, a_vehicle, pulsed

ROVS = VEHICLES | {"six axes": SIX, "dead time": load_vehicle(THRUST_EFFECTS)}
ROVS["pulse widths"] = pulsed(ROVS["dead time"], (1100.0, 1480.0, 1900.0))

SCHEMAS = Path(fmpy.__file__).with_name("schema")
TIME = {
    "name": "time",
    "description": "Time",
    "causality": "independent",
    "variability": "continuous",
    "unit": "s",
}
_OF_A_VARIABLE = ("name", "description", "causality", "variability", "initial")
_OF_A_NUMBER = ("unit", "displayUnit", "min", "max", "nominal", "start")
_LISTS = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
}


def described(rov: Vehicle, fmi: int) -> etree._Element:
    both = build_options.INTERFACES["both"]
    description = model_description(a_vehicle(rov), variables(rov), guid="{1}", interfaces=both, fmi=fmi)
    return etree.fromstring(description)


@cache
def of_kind(kind: str, fmi: int) -> etree._Element:
    """Return the description of a vehicle in ROVS, which tests only read."""
    return described(ROVS[kind], fmi)


@cache
def schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(file=str(SCHEMAS / name))


def declared(root: etree._Element) -> dict[str, dict[str, Any]]:
    """Return every variable by name, with the attributes that FMI 2.0 has in a child and FMI 3.0 in a type."""
    types = {of.get("name"): of for of in root.iter("Float64Type")}
    found = {}
    numbers = list(root.find("ModelVariables"))
    by_reference = {v.get("valueReference"): v.get("name") for v in numbers}
    for v in numbers:
        attributes = {key: v.get(key) for key in _OF_A_VARIABLE}
        parts = [v, types[v.get("declaredType")]] if types else list(v)
        attributes |= {key: x for key in _OF_A_NUMBER for of in parts if (x := of.get(key)) is not None}
        if (of := parts[0].get("derivative")) is not None:
            attributes["derivative"] = by_reference[of] if types else numbers[int(of) - 1].get("name")
        found[v.get("name")] = {key: x for key, x in attributes.items() if x is not None}
    return found


def structure(root: etree._Element, fmi: int) -> dict[str, list[tuple[str, list[str], str]]]:
    """Return the lists of <ModelStructure> in order: each unknown with its knowns and their kinds, by name."""
    numbers = list(root.find("ModelVariables"))
    name = {str(n): v.get("name") for n, v in enumerate(numbers, 1)}
    if fmi == 3:
        name = {v.get("valueReference"): v.get("name") for v in numbers}
    found = {}
    for of_2, of_3 in _LISTS.items():
        unknowns = root.findall(f"ModelStructure/{of_3}" if fmi == 3 else f"ModelStructure/{of_2}/Unknown")
        found[of_2] = [
            (
                name[u.get("valueReference" if fmi == 3 else "index")],
                [name[known] for known in u.get("dependencies").split()],
                u.get("dependenciesKind"),
            )
            for u in unknowns
        ]
    return found


def units(root: etree._Element) -> dict[str, bytes]:
    return {unit.get("name"): etree.tostring(unit, method="c14n").strip() for unit in root.iter("Unit")}


@pytest.mark.parametrize("kind", ROVS)
def test_both_versions_declare_the_same(kind: str) -> None:
    two, three = (of_kind(kind, fmi) for fmi in (2, 3))
    variables_2, variables_3 = declared(two), declared(three)
    assert variables_3.pop("time") == TIME
    assert list(variables_3) == list(variables_2)
    assert variables_3 == variables_2
    assert structure(three, 3) == structure(two, 2)
    units_3 = units(three)
    assert b'<BaseUnit s="1">' in units_3["s"]  # the unit of the time
    assert units_3 == units(two) | {"s": units_3["s"]}
    same = ("Category", "DefaultExperiment")
    assert [dict(e.attrib) for e in three.iter(*same)] == [dict(e.attrib) for e in two.iter(*same)]


@pytest.mark.parametrize("kind", ROVS)
def test_fmi_2_numbers_variables_from_0_and_fmi_3_from_1(kind: str) -> None:
    """OMSimulator takes the references in ModelStructure for positions in ModelVariables, from 1.

    It ends with "bad dependency on variable with index 0" where there is no such position, and else takes the variable
    at that position for the one that is meant.
    """
    two, three = (of_kind(kind, fmi) for fmi in (2, 3))
    of_two, of_three = ([int(v.get("valueReference")) for v in root.find("ModelVariables")] for root in (two, three))
    assert of_two == [*range(len(of_two))]
    assert of_three == [*range(1, len(of_two) + 2)]  # FMI 3.0 also has the time


@pytest.mark.parametrize("kind", ROVS)
def test_in_fmi_3_the_unit_and_the_bounds_stand_in_the_type_only(kind: str) -> None:
    """FMI Library loses the unit of a variable that has bounds; fmi-sim refuses a unit on a variable."""
    root = of_kind(kind, 3)
    types = {of.get("name"): of for of in root.iter("Float64Type")}
    variables_of = list(root.find("ModelVariables"))
    for v in variables_of:
        assert not {"unit", "displayUnit", "quantity", "min", "max", "nominal"} & {*v.attrib}, v.get("name")
        assert types[v.get("declaredType")].get("unit"), v.get("name")
    attributes = [tuple(sorted((key, x) for key, x in of.attrib.items() if key != "name")) for of in types.values()]
    assert len({*attributes}) == len(attributes) == len(root.findall("TypeDefinitions/*")), (
        "one type per unit, range and nominal"
    )
    assert {*types} == {v.get("declaredType") for v in variables_of}
    assert not {*types} & {v.get("name") for v in variables_of}, "the names of types and variables differ"


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", ROVS)
def test_the_description_follows_its_schema_and_the_rules_of_fmpy(kind: str, fmi: int, tmp_path: Path) -> None:
    document = of_kind(kind, fmi)
    schema(f"fmi{fmi}/fmi{fmi}ModelDescription.xsd").assertValid(document)
    schema("fmi3/fmi3BuildDescription.xsd").assertValid(etree.fromstring(build_description("a_rov")))
    (tmp_path / "modelDescription.xml").write_bytes(etree.tostring(document))
    description = fmpy.read_model_description(str(tmp_path), validate=False)
    are_new = fmi == 2  # FMI 3.0 has the same names, as test_both_versions_declare_the_same holds
    assert validate_model_description(description, validate_variable_names=are_new, validate_model_structure=True) == []


def test_the_description_says_what_an_importer_must_do() -> None:
    rov, one = a_vehicle(ROVS["dead time"]), a_vehicle(ROVS["Heavy"])
    for of, interface, is_native, notes in (
        *((rov, interface, True, [DEAD_TIME_NOTE]) for interface in ("me", "both")),
        (rov, "cs", True, []),
        (one, "both", True, []),
        (one, "cs", False, [PYTHON_NOTE]),
    ):
        offered = build_options.INTERFACES[interface]
        xml = model_description(of, variables(of), guid="", interfaces=offered, native=is_native)
        assert etree.fromstring(xml).get("description") == ". ".join([of.summary, *notes])


# ---- rov-fmu build --interface ----

KINDS = {"cs": (CO_SIMULATION, MODEL_EXCHANGE), "me": (MODEL_EXCHANGE, CO_SIMULATION)}
"""The kind of instance that an FMU offers, and the one that it refuses."""


@pytest.mark.parametrize(
    ("platforms", "systems"),
    [
        (["linux64"], ["Linux"]),
        (["win64", "aarch64-linux"], ["Linux", "Windows"]),
        ([*build_options.PLATFORMS], ["Linux", "Windows", "macOS"]),
    ],
)
def test_an_fmu_lists_what_its_own_binaries_need(platforms: list[str], systems: list[str], vehicle: Vehicle) -> None:
    content = native_content(vehicle, fmi=3, platforms=platforms)
    _, _, *lines = content.files["documentation/externalDependencies.txt"].decode().splitlines()
    assert [line.split()[0] for line in lines] == systems


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_description_has_the_elements_of_the_interface_and_its_own_guid(fmi: int, vehicle: Vehicle) -> None:
    contents = {name: native_content(vehicle, fmi=fmi, interface=name) for name in build_options.INTERFACES}
    for name, kinds in build_options.INTERFACES.items():
        root = etree.fromstring(contents[name].files["modelDescription.xml"])
        assert tuple(one.tag for one in root if one.tag in ("ModelExchange", "CoSimulation")) == kinds
        assert [file.get("name") for file in root.iter("File")] == ["fmu.c"] * len(kinds) * (fmi == 2)
    assert len({content.guid for content in contents.values()}) == 3
    assert contents["both"] == native_content(vehicle, fmi=fmi)


@pytest.mark.long
@pytest.mark.parametrize("interface", KINDS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_of_one_interface_runs_proves_itself_and_refuses_the_other(
    fmi: int, interface: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = tmp_path / "bare.fmu", tmp_path / "bare"
    options = ["--fmi", str(fmi), "--interface", interface, "--platform", "host", "-o", str(path)]
    assert main(["build", str(BARE), *options]) == 0
    assert "The FMU is valid. In a run, " in capsys.readouterr().out
    assert main(["prove", str(path)]) == 0
    name = {CO_SIMULATION: "co-simulation", MODEL_EXCHANGE: "model-exchange"}
    offered, refused = KINDS[interface]
    assert main(["prove", str(path), "--interface", name[refused]]) == 2
    assert f"has no {name[refused]}, only {name[offered]}\n" in capsys.readouterr().err
    fmpy.extract(str(path), unzipdir=str(folder))
    page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
    assert f"<dt>{INTERFACES[offered]}</dt>" in page
    assert f"<dt>{INTERFACES[refused]}</dt>" not in page
    (library,) = (folder / "binaries").glob("*/*")
    fmu = WRAPPERS[fmi](folder, library)
    with fmu.instance(offered) as rov:
        rov.start()
    with pytest.raises(AssertionError, match=f"this FMU is for {INTERFACES[offered]} only"):
        fmu.instance(refused)


def test_an_interface_that_an_fmu_cannot_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for options, line in (
        (["--backend", "pythonfmu", "--interface", "me"], "--interface me: PythonFMU makes Co-Simulation (cs) alone"),
        (["--osp", "--interface", "me"], "--interface me: libcosim and the OSP tools, which --osp is for, run"),
        (["--interface", "model-exchange"], "must be one of cs, me, both; did you mean me?"),
    ):
        assert main(["build", str(BARE), *options]) == 2
        err = capsys.readouterr().err
        assert line in err
        assert err.count("\n") == 1
    with pytest.raises(build_options.OptionError, match="there is no interface 'ms', only cs, me, both"):
        rov_fmu.load(BARE).build("bare.fmu", interface="ms")
    assert not [*tmp_path.iterdir()]
