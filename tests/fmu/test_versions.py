"""The descriptions of both versions of FMI are valid and declare the same variables.

They differ in the value references, and in the elements that hold the unit and the bounds of a variable.
"""

from pathlib import Path
from typing import Any

import fmpy
import pytest
from lxml import etree

from rov_fmu.fmu.model_description import NATIVE, build_description, model_description
from rov_fmu.fmu.variables import variables
from rov_fmu.model.rov import Rov
from tests.vehicles import SIX, VEHICLES, a_vehicle

ROVS = VEHICLES | {"six axes": SIX}

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


def described(rov: Rov, fmi: int) -> etree._Element:
    description = model_description(a_vehicle(rov), variables(rov), guid="{1}", interfaces=NATIVE[fmi], fmi=fmi)
    return etree.fromstring(description)


def check_schema(document: etree._Element, name: str) -> None:
    etree.XMLSchema(file=str(SCHEMAS / name)).assertValid(document)


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
    two, three = (described(ROVS[kind], fmi) for fmi in (2, 3))
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
    two, three = (described(ROVS[kind], fmi) for fmi in (2, 3))
    of_two, of_three = ([int(v.get("valueReference")) for v in root.find("ModelVariables")] for root in (two, three))
    assert of_two == [*range(len(of_two))]
    assert of_three == [*range(1, len(of_two) + 2)]  # FMI 3.0 also has the time
    entries = list(three.find("ModelStructure"))
    meant = {int(n) for entry in entries for n in (entry.get("valueReference"), *entry.get("dependencies").split())}
    assert set() < meant <= {*of_three}


@pytest.mark.parametrize("kind", ROVS)
def test_in_fmi_3_the_unit_and_the_bounds_stand_in_the_type_only(kind: str) -> None:
    """FMI Library loses the unit of a variable that has bounds; fmi-sim refuses a unit on a variable."""
    root = described(ROVS[kind], 3)
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
def test_the_description_follows_its_schema(kind: str, fmi: int) -> None:
    check_schema(described(ROVS[kind], fmi), f"fmi{fmi}/fmi{fmi}ModelDescription.xsd")


def test_the_build_description_follows_its_schema_and_names_the_file_to_compile() -> None:
    document = etree.fromstring(build_description("a_rov"))
    check_schema(document, "fmi3/fmi3BuildDescription.xsd")
    (configuration,) = document
    assert configuration.get("modelIdentifier") == "a_rov"
    assert [file.get("name") for file in document.iter("SourceFile")] == ["fmu.c"]


def test_fmi_3_declares_its_capabilities() -> None:
    """A capability that is missing is false."""
    root = described(VEHICLES["VideoRay"], 3)
    assert root.get("fmiVersion") == "3.0"
    assert root.get("instantiationToken") == "{1}"
    both = {
        "modelIdentifier": "an_rov",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    stepped = {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1",
        "providesIntermediateUpdate": "true",
        "mightReturnEarlyFromDoStep": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
        "hasEventMode": "true",
    }
    for interface, can in {"ModelExchange": both, "CoSimulation": both | stepped}.items():
        declared = {key: x for key, x in root.find(interface).attrib.items() if x != "false"}
        assert declared == can
    assert root.find("ScheduledExecution") is None


def test_an_integrator_must_complete_its_steps_where_turns_are_counted() -> None:
    needs = {kind: described(ROVS[kind], 3).find("ModelExchange").get("needsCompletedIntegratorStep") for kind in ROVS}
    assert {kind for kind, answer in needs.items() if answer == "true"} == {"six axes"}


def test_only_inputs_and_outputs_are_available_in_intermediate_update() -> None:
    root = described(VEHICLES["Heavy"], 3)
    updated = {v.get("name") for v in root.iter("Float64") if v.get("intermediateUpdate") == "true"}
    assert updated == {v.name for v in variables(VEHICLES["Heavy"]) if v.causality in ("input", "output")}
