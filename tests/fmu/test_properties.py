"""Any vehicle has a valid description, the same in both versions of FMI, with the right groups and dependencies."""

import random
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.validation import validate_model_description
from lxml import etree

from rov_fmu.c import compile as build_options
from rov_fmu.equation.parts import Vector
from rov_fmu.fmu.model_description import build_description, model_description, model_of
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import spread
from tests.vehicles import (
    EVERYTHING,
    SIX,
    THRUST_EFFECTS,
    VEHICLES,
    a_vehicle,
    numbered,
    pulsed,
    random_body,
    random_vehicle,
    tied,
    with_axes,
)
from verification.references.rigid_vehicle import QUATERNION, calculated

Point = dict[str, float]
Slopes = dict[tuple[str, str], float]


ROVS = VEHICLES | {"six axes": SIX, "dead time": load_vehicle(THRUST_EFFECTS), "everything": load_vehicle(EVERYTHING)}
ROVS |= {f"{axes} alone": with_axes(axes) for axes in ("q", "wp", "upr")}
_POINTS: dict[str, Vector] = {"tether": (-0.3, 0.1, -0.2), "hook": (0.2, -0.1, 0.4)}
ROVS |= {f"tied, {name}": tied(VEHICLES[name], **_POINTS) for name in ("VideoRay", "yaw only", "heave only")}
ROVS |= {"tied, Heavy": tied(VEHICLES["Heavy"], hook=(0.2, -0.1, 0.4)), "tied, six": tied(SIX, **_POINTS)}
_OF_REFERENCE = [*ROVS.keys() - {"dead time"}]
"""The vehicles of which the reference has the equations."""
ROVS |= {"drawn, four axes": random_vehicle(random.Random(0)), "drawn, six": random_body(random.Random(0), "uvwpqr")}
ROVS["pulse widths"] = pulsed(ROVS["dead time"], (1100.0, 1480.0, 1900.0))

KINDS = spread(
    ROVS,
    (
        "VideoRay",
        "heave only",
        "dead time",
        "everything",
        "six axes",
        "tied, Heavy",
        "tied, six",
        "pulse widths",
        "drawn, six",
    ),
    ("yaw only", "tied, yaw only", "drawn, four axes", "q alone"),
)
"""The default tests take each part of a vehicle once, and the weekly ones all combinations."""

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
    description = model_description(model_of(a_vehicle(rov)), guid="{1}", interfaces=both, fmi=fmi)
    return etree.fromstring(description)


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


@pytest.mark.parametrize("kind", KINDS)
def test_the_description_is_valid_and_that_of_both_versions(kind: str, tmp_path: Path) -> None:
    """FMI 2.0 numbers variables from 0, and FMI 3.0 from 1. OMSimulator takes the references in ModelStructure for
    positions in ModelVariables, from 1: it ends with "bad dependency on variable with index 0", or takes another one.
    """
    two, three = (described(ROVS[kind], fmi) for fmi in (2, 3))
    variables_2, variables_3 = declared(two), declared(three)
    assert variables_3.pop("time") == TIME
    assert list(variables_3) == list(variables_2)
    assert variables_3 == variables_2
    assert structure(three, 3) == structure(two, 2)
    units_3 = units(three)
    assert b'<BaseUnit s="1">' in units_3["s"]  # the unit of the time
    no_ampere = re.compile(rb'\n *<BaseUnit A="[^"]*".*</BaseUnit>')  # fmi-sim refuses A in FMI 3.0
    assert units_3 == {name: no_ampere.sub(b"", text) for name, text in units(two).items()} | {"s": units_3["s"]}
    same = ("Category", "DefaultExperiment")
    assert [dict(e.attrib) for e in three.iter(*same)] == [dict(e.attrib) for e in two.iter(*same)]
    for fmi, document in ((2, two), (3, three)):
        references = [int(v.get("valueReference")) for v in document.find("ModelVariables")]
        assert references == [*range(fmi - 2, len(variables_2) + 2 * (fmi - 2))], "FMI 3.0 also has the time"
        schema(f"fmi{fmi}/fmi{fmi}ModelDescription.xsd").assertValid(document)
        (tmp_path / "modelDescription.xml").write_bytes(etree.tostring(document))
        description = fmpy.read_model_description(str(tmp_path), validate=False)
        assert validate_model_description(description, fmi == 2, validate_model_structure=True) == []


@pytest.mark.parametrize("kind", KINDS)
def test_in_fmi_3_the_unit_and_the_bounds_stand_in_the_type_only(kind: str) -> None:
    """FMI Library loses the unit of a variable that has bounds; fmi-sim refuses a unit on a variable."""
    schema("fmi3/fmi3BuildDescription.xsd").assertValid(etree.fromstring(build_description("a_rov")))
    root = described(ROVS[kind], 3)
    types = {of.get("name"): of for of in root.iter("Float64Type")}
    variables_of = list(root.find("ModelVariables"))
    for v in variables_of:
        assert not {"unit", "displayUnit", "quantity", "min", "max", "nominal"} & {*v.attrib}, v.get("name")
        assert types[v.get("declaredType")].get("unit"), v.get("name")
    attributes = [tuple(sorted((key, x) for key, x in of.attrib.items() if key != "name")) for of in types.values()]
    assert len({*attributes}) == len(attributes) == len(root.findall("TypeDefinitions/*")), "one for each of its kind"
    assert {*types} == {v.get("declaredType") for v in variables_of}
    assert not {*types} & {v.get("name") for v in variables_of}, "the names of types and variables differ"


# ---- Terminals ----


def terminals_of(document: bytes) -> dict[str, etree._Element]:
    """Return the terminals of a document by name, after a check against the schema."""
    root = etree.fromstring(document)
    schema("fmi3/fmi3TerminalsAndIcons.xsd").assertValid(root)
    found = root.findall("Terminals/Terminal")
    named = {terminal.get("name"): terminal for terminal in found}
    assert len(named) == len(found)
    return named


def members(terminal: etree._Element) -> list[str]:
    return [member.get("variableName") for member in terminal.iter("TerminalMemberVariable")]


@pytest.mark.parametrize("kind", KINDS)
def test_every_input_and_output_is_in_one_terminal(kind: str) -> None:
    """The members of a terminal have the same causality, unless it is the port of a point; its name is unique."""
    declared = {v.name: v.causality for v in variables(ROVS[kind])}
    found = terminals_of(terminals_and_icons(ROVS[kind].layout))
    grouped = [name for terminal in found.values() for name in members(terminal)]
    assert sorted(grouped) == sorted(name for name, causality in declared.items() if causality in {"input", "output"})
    for point in ROVS[kind].layout.points:
        port = found[f"point_{point.name}"]
        names = [*(f"F_{d}" for d in "NED"), *"xyz", *(f"vg_{d}" for d in "NED")]
        assert [v.get("memberName") for v in port.iter("TerminalMemberVariable")] == names
        assert members(port) == [f"{name}_{point.name}" for name in names]
        assert [declared[name] for name in members(port)] == ["input"] * 3 + ["output"] * 6
        assert port.get("matchingRule") == "bus"
    for name, terminal in found.items():
        assert name.startswith("point_") or len({declared[member] for member in members(terminal)}) == 1
        assert terminal.get("terminalKind") is None
        variable_names = terminal.findall("TerminalMemberVariable")
        assert {v.get("variableKind") for v in variable_names} == {"signal"}
        assert len({v.get("memberName") for v in variable_names}) == len(variable_names)


@pytest.mark.parametrize("kind", KINDS)
def test_every_velocity_says_of_what_it_is_and_those_over_ground_are_outputs(kind: str) -> None:
    """The derivative of a position is a velocity over ground; derivatives are local.

    CasADi, Jaxonomy and PathSim-FMI refuse an output whose name is no identifier. Some importers ignore case.
    """
    declared, position = {v.name: v for v in variables(ROVS[kind])}, [x for x in "xyz" if x in ROVS[kind].layout.state]
    assert all(v.causality == "local" for v in declared.values() if v.derivative_of)
    assert all(v.name.isidentifier() for v in declared.values() if v.causality in {"input", "output"})
    over_ground = [f"vg_{'NED'['xyz'.index(x)]}" for x in position]
    assert [*declared][-len(ROVS[kind].layout.added) :][: len(over_ground)] == over_ground
    names = [name.lower() for name in declared]
    assert all(names.count(name.lower()) == 1 for name in ROVS[kind].layout.added)
    for v in (v for v in declared.values() if v.unit == "m/s"):
        assert re.search("current" if v.causality == "input" else "(over ground|through the water)", v.description)
        is_over_ground = v.name.startswith("vg_") or v.name in {f"der({x})" for x in position}
        assert ("over ground" in v.description) == is_over_ground


# ---- Dependencies, against slopes of the equations of the reference ----


def slopes(rov: Vehicle, point: Point, knowns: Sequence[str]) -> Slopes:
    """Return central differences at a point of inputs, states and coefficients."""
    found = {}
    for known in knowns:
        step = 1e-6 * max(1.0, abs(point[known]))
        ends = []
        for x in (point[known] + step, point[known] - step):
            ends.append({name: float(y) for name, y in calculated(rov, point | {known: x}, float).items()})
        for name, above in ends[0].items():
            slope = (above - ends[1][name]) / (2.0 * step)
            found[name, known] = 0.0 if abs(slope) < 1e-7 else slope
    return found


def motions(names: Sequence[str], rng: random.Random, pairs: int) -> list[Point]:
    """Return pairs of random motions, the second of which has the opposite signs."""
    found = []
    for _ in range(pairs):
        point = {name: rng.uniform(-0.9, 0.9) for name in names}
        found += [point, {name: -x for name, x in point.items()}]
    return found


def parameters(rov: Vehicle, rng: random.Random, tunable: Sequence[bool]) -> Point:
    of = rov.layout.coefficients
    return {n: x * (rng.uniform(0.6, 1.4) if of[n].tunable in tunable else 1.0) for n, x in rov.coefficients.items()}


def vary(values: Sequence[float]) -> bool:
    return max(values) - min(values) > 1e-4 * max(map(abs, values))


def dependencies(rov: Vehicle, of: str) -> dict[tuple[str, str], str]:
    """Return a list of <ModelStructure>: each unknown and known with the kind of their dependency."""
    return {
        (unknown, known): kind
        for unknown, knowns, kinds in structure(described(rov, 2), 2)[of]
        for known, kind in zip(knowns, kinds.split(), strict=True)
    }


# The default tests have the vehicle with most effects.
_SOME = ("everything", "tied, VideoRay")
_KINDS = [*spread(sorted(_OF_REFERENCE), _SOME, ("six axes", "surge without drag", "with an input mix"))]


def pairs_of(kind: str) -> int:
    """Return how many pairs of motions show every dependency of a vehicle."""
    return 2 if ROVS[kind].layout.has_attitude or kind in _SOME else 4


@pytest.mark.parametrize("kind", _KINDS)
def test_declared_dependencies_are_those_of_the_equations(kind: str) -> None:
    rov, rng = numbered(ROVS[kind].layout), random.Random(1)
    knowns = [*rov.layout.inputs, *rov.layout.state]
    moving = motions(knowns, rng, pairs_of(kind))
    sets = [parameters(rov, rng, tunable) for tunable in ([], [False], [True])]
    samples = [[slopes(rov, m | k, knowns) for m in moving] for k in sets]

    def strongest(pair: tuple[str, str]) -> str | None:
        values = [[sample[pair] for sample in of_set] for of_set in samples]
        if not any(map(any, values)):
            return None
        if any(map(vary, values)):
            return "dependent"
        start, fixed, tunable = (of_set[0] for of_set in values)
        return "tunable" if vary([start, tunable]) else "fixed" if vary([start, fixed]) else "constant"

    found = {pair: strength for pair in samples[0][0] if (strength := strongest(pair))}
    outputs = {v.name for v in variables(rov) if v.causality == "output"}
    rates = {v.name for v in variables(rov) if v.derivative_of}
    assert {pair: s for pair, s in found.items() if pair[0] in outputs} == dependencies(rov, "Outputs")
    assert {pair: s for pair, s in found.items() if pair[0] in rates} == dependencies(rov, "Derivatives")


_BEYOND_THEIR_RANGES = [(angle, f"{angle}_0") for angle in ("phi", "theta", "psi")]
_BEYOND_THEIR_RANGES += [("phi", "theta_0"), ("psi", "theta_0")]


@pytest.mark.parametrize("kind", _KINDS)
def test_declared_initial_dependencies_are_those_of_the_equations(kind: str) -> None:
    """The knowns are inputs, states and parameters; the only kinds are constant and dependent (2.2.8).

    A quaternion is not known. It follows from the Euler angles at the start, which differ from the later ones where
    they are beyond their ranges.
    """
    rov, rng = numbered(ROVS[kind].layout), random.Random(2)
    known = {*rov.layout.inputs, *rov.layout.state, *rov.layout.initial} - {*QUATERNION}
    points = [m | parameters(rov, rng, [False, True]) for m in motions(sorted(known), rng, pairs_of(kind))]
    samples = [slopes(rov, point, list(point)) for point in points]
    values = {pair: [sample[pair] for sample in samples] for pair in samples[0] if pair[0] not in known}
    found = {  # the kind for a parameter, such as the place of a point, is always dependent
        pair: "dependent" if vary(of) or pair[1] in rov.coefficients else "constant"
        for pair, of in values.items()
        if any(of)
    }
    found |= dict.fromkeys(_BEYOND_THEIR_RANGES if rov.layout.has_attitude else (), "dependent")
    assert found == dependencies(rov, "InitialUnknowns")
