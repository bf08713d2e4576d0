"""The experiments in the FMU follow the standard, and their expected results do not come from the C code."""

import csv
import io
import os
import platform
from collections.abc import Mapping
from functools import cache
from math import e
from pathlib import Path
from typing import Any

import fmpy
import pytest
from lxml import etree

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.fmu.archive import FOLDER, MANIFEST, archive
from rov_fmu.fmu.reference_results import TOLERANCE, reference_results
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import python
from tests.often import spread
from tests.vehicles import at_rest, four_axes, still
from verification.references import reference
from verification.references.vehicles import IDENTIFIED

_SCHEMAS = Path(fmpy.__file__).parent
_ROLES = (
    "(document|requirement|specification|model|parameter|system|testcase"
    "|experiment(/(smoke-test|validation|uncertainty-analysis))?|result|method|rationale|report|request|delivery"
    "|configuration|signature|serialized-state(/.*)?|meta-data|other)"
)
# The standard's root element, around FMPy's copy of the attributes that all layered standards share.
_FORM = f"""
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:ls="http://fmi-standard.org/fmi-ls-manifest">
  <xs:import namespace="http://fmi-standard.org/fmi-ls-manifest"
    schemaLocation="{(_SCHEMAS / "schema/fmi3/fmi3LayeredStandardManifest.xsd").as_uri()}"/>
  <xs:element name="fmiReferences"><xs:complexType>
    <xs:sequence><xs:element name="Related" maxOccurs="unbounded"><xs:complexType>
      <xs:attribute name="type" type="xs:string"/>
      <xs:attribute name="source" type="xs:anyURI" use="required"/>
      <xs:attribute name="role" use="required"><xs:simpleType><xs:restriction base="xs:string">
        <xs:pattern value="{_ROLES}"/>
      </xs:restriction></xs:simpleType></xs:attribute>
      <xs:attribute name="description" type="xs:string"/>
    </xs:complexType></xs:element></xs:sequence>
    <xs:attributeGroup ref="ls:ALayeredStandardManifest"/>
  </xs:complexType></xs:element>
</xs:schema>
"""


@cache
def _shipped(name: str) -> tuple[Vehicle, Mapping[str, bytes]]:
    """Return a vehicle that ships, without roll and pitch, or one of two others, and its reference results."""
    others = {"identified": IDENTIFIED, "tilted": SHIPPED["bluerov2_heavy"]}
    vehicle = load_vehicle(others[name]) if name in others else four_axes(load_vehicle(SHIPPED[name]))
    return vehicle, reference_results(vehicle)


def _rows(files: Mapping[str, bytes], name: str) -> list[dict[str, float]]:
    lines = csv.DictReader(io.StringIO(files[f"{FOLDER}/{name}"].decode()))
    return [{key: float(value) for key, value in line.items()} for line in lines]


def _parameters(files: Mapping[str, bytes], name: str) -> dict[str, float]:
    parameters = etree.fromstring(files[f"{FOLDER}/{name}"]).iter("{*}Parameter")
    return {p.get("name"): float(p[0].get("value")) for p in parameters}


def _experiments(files: Mapping[str, bytes]) -> dict[str, Any]:
    return {x.get("name"): x for x in etree.fromstring(files[f"{FOLDER}/experiments.exp"])}


@pytest.mark.parametrize("name", spread([*SHIPPED, "identified"], ("videoray", "identified")))
def test_the_files_have_the_form_of_the_standards(name: str) -> None:
    vehicle, files = _shipped(name)
    manifest = etree.fromstring(files[MANIFEST])
    etree.XMLSchema(etree.fromstring(_FORM)).assertValid(manifest)
    attribute = "{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-"
    assert manifest.get(f"{attribute}name") == "org.fmi-standard.fmi-ls-ref"
    assert manifest.get(f"{attribute}description").endswith("information on related files included in an FMU.")
    related = {x.get("source") for x in manifest}
    named = {x.get("source") for path in files if path.endswith(".exp") for x in etree.fromstring(files[path]).iter()}
    listed = {path.removeprefix(f"{FOLDER}/") for path in files} - {"fmi-ls-manifest.xml"}
    assert listed == {path for path in related | named if path and not path.startswith("../")}, (
        "no file too few, none too many"
    )
    schema = etree.XMLSchema(etree.parse(_SCHEMAS / "ssp" / "schema" / "SystemStructureParameterValues.xsd"))
    for path, content in files.items():
        if path.endswith(".ssv"):
            schema.assertValid(etree.fromstring(content))
    for title, experiment in _experiments(files).items():
        assert experiment.find("References").get("source") == f"{title}_expected.csv"
    assert len(archive(files)) < 25_000
    check_experiments_of_axes(vehicle, files)


def check_experiments_of_axes(vehicle: Vehicle, files: Mapping[str, bytes]) -> None:
    """Assert that a vehicle has a step of each axis, twice if it is tuned, and a manoeuvre of all states."""
    experiments = _experiments(files)
    largest = f"{100.0 * vehicle.command_range[1]:g}"
    is_tuned = any(vehicle[name] != 1.0 for name in vehicle.layout.tuning)
    ends = ("_tuned", "_untuned") if is_tuned else ("",)
    steps = [f"{form.axis.name}_{largest}{end}" for form in vehicle.layout.axes for end in ends]
    assert [*experiments] == [*steps, "manoeuvre"]
    moved = _rows(files, experiments["manoeuvre"].find("References").get("source"))[-1]
    assert moved.keys() - {"time"} == (vehicle.layout.state | vehicle.layout.angles).keys() - set(QUATERNION)


def test_a_tuned_vehicle_takes_each_step_with_its_tuning_and_without() -> None:
    vehicle, files = _shipped("videoray")
    experiments = _experiments(files)
    for axis in (form.axis for form in vehicle.layout.axes):
        for name, model in (("tuned", vehicle), ("untuned", vehicle.untuned)):
            experiment = experiments.pop(f"{axis.name}_70_{name}")
            V_ss, Tau = model.response(axis, 0.7)
            rows = _rows(files, experiment.find("References").get("source"))
            start, after_tau, *_, last = rows
            assert start[axis.velocity] == 0.0
            assert after_tau["time"] == pytest.approx(Tau, rel=5e-3)
            assert after_tau[axis.velocity] == pytest.approx((1.0 - 1.0 / e) * V_ss, rel=5e-3)
            assert last[axis.velocity] == pytest.approx(V_ss, rel=1e-3)
            tau = after_tau["time"]
            assert [row["time"] for row in rows] == pytest.approx([0.0, tau, 2.0 * tau, 4.0 * tau, 8.0 * tau])
            attributes = {key: float(experiment.get(key)) for key in ("startTime", "stopTime", "stepSize")}
            assert [*attributes.values()] == pytest.approx([0.0, 8.0 * tau, 0.1 * tau])
            parameters = _parameters(files, experiment.find("Parameters").get("source"))
            assert parameters == {key: model[key] for key in parameters}
            assert len(parameters) == 6
    assert list(experiments) == ["manoeuvre"]


_PHASES = {
    "videoray": """
        0.56 0.56 0.35 0 0 0 0 0
        0.49 0.07 0 0.5 0.5 0.05 0.05 0.05
        -0.49 -0.21 -0.28 0.5 0.5 0.05 0.05 0.05
        0 0 0 0 0 0 0 0""",
    "tilted": """
        -0.9 -0.7 0.7 0.9 0.6 0.4 0.6 0.4 0 0 0 0 0 0 0 0 0
        0 -1 0.6 0.6 -0.2 -0.2 0.2 0.2 0.5 0.5 0.5 0.05 0.05 0.05 0.05 0.05 0.05
        0.6 0.6 -0.2 -1 -0.5 -0.1 -0.7 -0.3 0.5 0.5 0.5 0.05 0.05 0.05 0.05 0.05 0.05
        0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0""",
}
"""The inputs in each phase of the manoeuvre: commands, forces, torques, current.

The VideoRay has 0.7 times 80 % in surge and 50 % in heave at first, and its torque follows from 40 ± 30 %.
"""
_LENGTHS = {"videoray": 2.0, "bluerov2": 0.6, "tilted": 0.4}
"""The length of a phase: 2 s, or 20 of the shortest times in which something changes."""


@pytest.mark.parametrize("name", _LENGTHS)
def test_the_manoeuvre_drives_all_axes_ahead_and_back_with_loads_and_a_current(name: str) -> None:
    (_, files), length = _shipped(name), _LENGTHS[name]
    stimuli = [[*row.values()] for row in _rows(files, "manoeuvre.csv")]
    assert [row[0] for row in stimuli] == pytest.approx([t * length for n in range(4) for t in (n, n + 1)])
    if name in _PHASES:
        phases = [[*map(float, line.split())] for line in _PHASES[name].split("\n")[1:]]
        assert [row[1:] for row in stimuli] == [phase for phase in phases for _ in range(2)]
    times = [row["time"] for row in _rows(files, "manoeuvre_expected.csv")]
    assert times == pytest.approx([0.5 * n * length for n in range(9)])
    if name == "tilted":
        assert _parameters(files, "attitude.ssv") == {"phi_0": 0.6, "theta_0": -0.4, "psi_0": 1.0, "z": 100.0}
        start, *_ = _rows(files, "manoeuvre_expected.csv")
        assert (start["phi"], start["theta"], start["psi"]) == pytest.approx((0.6, -0.4, 1.0))
        of_roll = _experiments(files)["roll_100"]
        assert of_roll.get("description").endswith("Tau = 0.04227 s, without the lag and righting moments")
        assert float(of_roll.get("stopTime")) == pytest.approx(8.0 * 0.071)


def _check(rov: Vehicle, files: Mapping[str, bytes], name: str) -> None:
    """Compare every expected value with a computation in 50 digits."""
    experiment = _experiments(files)[name]
    stimuli, expected = (_rows(files, experiment.find(part).get("source")) for part in ("Stimuli", "References"))
    source = getattr(experiment.find("Parameters"), "attrib", {}).get("source")
    given = _parameters(files, source) if source else {}
    state: Mapping[str, Any] = {key: given.get(key, x) for key, x in at_rest(rov).items()}
    largest = {key: max(0.01, *(abs(row[key]) for row in expected)) for key in expected[0]}
    t = 0.0
    for row in expected[1:]:
        inputs = still(rov) | next(x for x in reversed(stimuli) if x["time"] <= t)
        state = {key: float(x) for key, x in reference.step(rov, inputs, state, row["time"] - t).state.items()}
        t = row["time"]
        for key in row.keys() - {"time"}:
            assert abs(row[key] - state[key]) < 0.2 * TOLERANCE * largest[key], (name, t, key)


@pytest.mark.parametrize(
    ("name", "experiments"),
    [
        ("videoray", ["surge_70_tuned", "manoeuvre"]),
        pytest.param("bluerov2_heavy", ["heave_100"], marks=pytest.mark.long),
        pytest.param("videoray", [], marks=pytest.mark.long),
        *(pytest.param(name, [], marks=pytest.mark.weekly) for name in SHIPPED if name != "videoray"),
    ],
)
def test_expected_values_are_right_to_their_last_digit(name: str, experiments: list[str]) -> None:
    """Those of all experiments if none is named; with coupling and lag, 50 digits take minutes."""
    vehicle, files = _shipped(name)
    for experiment in experiments or _experiments(files):
        _check(vehicle.untuned if experiment.endswith("_untuned") else vehicle, files, experiment)


_HASH = """
import hashlib
from rov_fmu.fmu.reference_results import reference_results
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import EVERYTHING
print(hashlib.sha256(repr(sorted(reference_results(load_vehicle(EVERYTHING)).items())).encode()).hexdigest())
"""


@pytest.mark.long
def test_expected_results_have_the_same_bytes_whatever_the_linear_algebra_of_the_processor() -> None:
    """OpenBLAS computes other last digits on other processors. The expected results must not contain any of its."""
    cores = ("Haswell", "SkylakeX", "Zen") if platform.machine() in ("x86_64", "AMD64") else ("ARMV8",)
    found = {python("-c", _HASH, env=os.environ | {"OPENBLAS_CORETYPE": core}) for core in cores}
    assert len(found) == 1
    assert len(found.pop()) == 65
