"""The system of ROV and autopilot as files: two FMUs, videoray.ssp, and a folder with an OSP configuration."""

import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict
from math import pi
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from lxml import etree
from lxml.builder import ElementMaker

from rov_fmu.cli import main
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

HERE = Path(__file__).parent
STOP = 60.0  # s
STEP = 0.05  # s, between two communication points
STEPS = round(STOP / STEP)

DEFAULT = "table9"  # the parameter set that engines take by default

Values = Mapping[str, float | bool]

# The set points, and as much forward stick as holds the place against current and tether.
MISSION: Values = {"z_ref": 5.0, "psi_ref": pi / 2, "surge": 0.26, "depth_hold": True, "heading_hold": True}
# The tether pulls aft, up and to starboard; the current runs westward, at the bow after the turn.
SEA: Values = {"X_ext": -2.0, "Z_ext": -1.5, "N_ext": 0.05, "V_E": -0.2}

# From output to input. What is not connected keeps the value of the parameter set.
CONNECTIONS = {
    ("rov", "z"): ("autopilot", "z"),
    ("rov", "psi"): ("autopilot", "psi"),
    ("autopilot", "u_l"): ("rov", "u_l"),
    ("autopilot", "u_r"): ("rov", "u_r"),
    ("autopilot", "u_t"): ("rov", "u_t"),
}
# The same by the groups of the OSP model descriptions.
GROUPS = ("depth", "heading", "thruster_commands")

OUTPUTS = {
    "rov": ("x", "y", "z", "psi", "u", "w", "r"),
    "autopilot": ("u_l", "u_r", "u_t", "z_d", "psi_d"),
}


def parameter_sets() -> dict[str, dict[str, Values]]:
    """Name to the values of each component: Table 9, and the same with α = β = 1."""
    table9 = asdict(load_vehicle(VIDEORAY).coefficients)
    untuned = {name: 1.0 if name.startswith(("alpha", "beta")) else value for name, value in table9.items()}
    return {
        DEFAULT: {"rov": {**table9, **SEA}, "autopilot": MISSION},
        "alpha_beta_1": {"rov": {**untuned, **SEA}, "autopilot": MISSION},
    }


def build_system(folder: Path) -> None:
    """Write all files. Raises RuntimeError where an FMU cannot be built."""
    folder.mkdir(parents=True, exist_ok=True)
    if main(["build", "--platform", "host", "--osp", "-o", str(folder / "videoray.fmu")]):
        raise RuntimeError("videoray.fmu was not built")
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", str(HERE / "autopilot.py"), "-d", str(folder)]
    subprocess.run(build, check=True)
    shutil.copy(HERE / "Autopilot_OspModelDescription.xml", folder)
    write_ssp(folder / "videoray.ssp", {"rov": folder / "videoray.fmu", "autopilot": folder / "Autopilot.fmu"})
    (folder / "OspSystemStructure.xml").write_bytes(osp_system_structure(parameter_sets()[DEFAULT]))


# ---- SSP 1.0 -------------------------------------------------------------------------------------------------------

# libcosim and Ecos look for these prefixes.
_SSP = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
_ssd, _ssc, _ssv, _osp = (ElementMaker(namespace=_SSP[prefix], nsmap=_SSP) for prefix in _SSP)


def write_ssp(path: Path, fmus: Mapping[str, Path]) -> None:
    """Write the SSP archive: the structure, a parameter set for each way to tune the ROV, the FMUs."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _document(system_structure(fmus)))
        for name, values in parameter_sets().items():
            archive.writestr(f"resources/{name}.ssv", _document(_parameter_set(name, values["rov"])))
        for fmu in fmus.values():
            archive.write(fmu, f"resources/{fmu.name}")


def system_structure(fmus: Mapping[str, Path]) -> Any:
    """SystemStructure.ssd: only connected inputs are connectors, for FMPy sets every one of them at every step."""
    inputs = list(CONNECTIONS.values())
    sets = parameter_sets()
    # The set of the whole system has one name in all components, for Ecos takes one name.
    bindings = {
        "rov": [_ssd.ParameterBinding(source=f"resources/{name}.ssv") for name in sets],
        "autopilot": [
            _ssd.ParameterBinding(_ssd.ParameterValues(_parameter_set(name, values["autopilot"])))
            for name, values in sets.items()
        ],
    }
    components = [
        _ssd.Component(
            _ssd.Connectors(
                *(_connector(name, "input") for element, name in inputs if element == component),
                *(_connector(name, "output") for name in OUTPUTS[component]),
            ),
            _ssd.ParameterBindings(*bindings[component]),
            name=component,
            source=f"resources/{fmu.name}",
            type="application/x-fmu-sharedlibrary",
        )
        for component, fmu in fmus.items()
    ]
    connections = [
        _ssd.Connection(startElement=start[0], startConnector=start[1], endElement=end[0], endConnector=end[1])
        for start, end in CONNECTIONS.items()
    ]
    algorithm = _osp.Algorithm(_osp.FixedStepAlgorithm(baseStepSize=repr(STEP)))
    return _ssd.SystemStructureDescription(
        _ssd.System(_ssd.Elements(*components), _ssd.Connections(*connections), name="station_keeping"),
        _ssd.DefaultExperiment(
            _ssd.Annotations(_ssc.Annotation(algorithm, type="com.opensimulationplatform")),
            startTime="0.0",
            stopTime=repr(STOP),
        ),
        name="station_keeping",
        version="1.0",
    )


def _connector(name: str, kind: str) -> Any:
    return _ssd.Connector(_ssc.Real(), name=name, kind=kind)


def _parameter_set(name: str, values: Values) -> Any:
    parameters = (_ssv.Parameter(_ssv(*_typed(value)), name=variable) for variable, value in values.items())
    return _ssv.ParameterSet(_ssv.Parameters(*parameters), name=name, version="1.0")


# ---- OSP -----------------------------------------------------------------------------------------------------------

_ose = ElementMaker(
    namespace="http://opensimulationplatform.com/MSMI/OSPSystemStructure",
    nsmap={None: "http://opensimulationplatform.com/MSMI/OSPSystemStructure"},
)


def osp_system_structure(values: Mapping[str, Values]) -> bytes:
    """OspSystemStructure.xml, for the folder with the FMUs and their OSP model descriptions."""
    simulators = (
        _ose.Simulator(
            _ose.InitialValues(
                *(_ose.InitialValue(_ose(*_typed(value)), variable=name) for name, value in values[component].items())
            ),
            name=component,
            source=source,
        )
        for component, source in (("rov", "videoray.fmu"), ("autopilot", "Autopilot.fmu"))
    )
    connections = (
        _ose.VariableGroupConnection(*(_ose.VariableGroup(simulator=s, name=group) for s in ("rov", "autopilot")))
        for group in GROUPS
    )
    return _document(
        _ose.OspSystemStructure(
            _ose.StartTime("0.0"),
            _ose.BaseStepSize(repr(STEP)),
            _ose.Algorithm("fixedStep"),
            _ose.Simulators(*simulators),
            _ose.Connections(*connections),
            version="0.1",
        )
    )


def _typed(value: float | bool) -> tuple[str, dict[str, str]]:
    """The element of a value, as both formats have it."""
    return ("Boolean", {"value": str(value).lower()}) if isinstance(value, bool) else ("Real", {"value": repr(value)})


def _document(root: Any) -> bytes:
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
