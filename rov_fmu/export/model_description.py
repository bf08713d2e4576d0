"""modelDescription.xml from the variables (FMI 2.0, section 2.2)."""

from collections.abc import Mapping

from rov_fmu import __version__
from rov_fmu.export.interface import LOG_CATEGORIES, UNITS, Variable, parameters_of
from rov_fmu.files.templates import render
from rov_fmu.motion.layout import Layout
from rov_fmu.vehicle.vehicle import Vehicle

# What is false is written out too, for FMI++ ends where it is absent.
_COMMON = {
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
_CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canRunAsynchronuously": "false",
    **_COMMON,
}

# The interfaces of each flavour and what they can do, as it really is.
NATIVE = {
    "ModelExchange": {**_COMMON, "providesDirectionalDerivative": "true"},
    "CoSimulation": {**_CO_SIMULATION, "maxOutputDerivativeOrder": "1", "providesDirectionalDerivative": "true"},
}
PYTHON = {"CoSimulation": {"needsExecutionTool": "true", **_CO_SIMULATION}}

_EXPERIMENT = {"startTime": 0.0, "stopTime": 10.0, "tolerance": 1e-6, "stepSize": 0.01}


def model_description(
    vehicle: Vehicle,
    variables: tuple[Variable, ...],
    *,
    guid: str,
    interfaces: Mapping[str, Mapping[str, str]],
    source_files: tuple[str, ...] = (),
) -> bytes:
    """The XML document, UTF-8, indented, the same bytes for the same arguments."""
    head = {
        "fmiVersion": "2.0",
        "modelName": vehicle.identifier,
        "guid": guid,
        "description": vehicle.description,
        "author": vehicle.source,
        "version": vehicle.version,
        "license": "MIT, see documentation/licenses/license.txt",
        "generationTool": f"rov-fmu {__version__}",
        "variableNamingConvention": "structured",
        "numberOfEventIndicators": "0",
    }
    return render(
        "modelDescription.xml.j2",
        head=head,
        interfaces={name: {"modelIdentifier": vehicle.identifier, **can} for name, can in interfaces.items()},
        source_files=source_files,
        units={name: UNITS[name] for name in dict.fromkeys(v.unit for v in variables)},
        log_categories=LOG_CATEGORIES,
        experiment=_EXPERIMENT,
        variables=variables,
        index={v.name: v.index for v in variables},
        structure=_structure(variables, vehicle.layout),
    ).encode()


def _structure(variables: tuple[Variable, ...], layout: Layout) -> dict[str, dict[int, dict[int, str]]]:
    """The lists of <ModelStructure>: by index of an unknown, the kinds of the knowns it depends on, by index."""
    index, parameters = {v.name: v.index for v in variables}, parameters_of(layout)
    lists: dict[str, dict[int, dict[int, str]]] = {"Outputs": {}, "Derivatives": {}, "InitialUnknowns": {}}

    def add(to: str, variable: Variable, known: Mapping[str, str]) -> None:
        lists[to][variable.index] = dict(sorted((index[name], kind) for name, kind in known.items()))

    for v in variables:
        if v.dependencies is None:
            continue
        if v.causality == "output":
            add("Outputs", v, v.dependencies)
        if v.derivative_of:
            add("Derivatives", v, v.dependencies)
        if v.initial == "calculated":
            # Initialization knows no parameters that are fixed: a factor is constant or not (2.2.8).
            at_start = {n: "constant" if kind == "constant" else "dependent" for n, kind in v.dependencies.items()}
            add("InitialUnknowns", v, at_start | dict.fromkeys(parameters.get(v.name, ()), "dependent"))
    return lists
