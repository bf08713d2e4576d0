"""modelDescription.xml from the variables (FMI 2.0, section 2.2)."""

from collections.abc import Mapping
from dataclasses import dataclass

from rov_fmu.export.interface import LOG_CATEGORIES, PARAMETERS_OF, UNITS, Variable
from rov_fmu.files.templates import render

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
    variables: tuple[Variable, ...],
    *,
    identifier: str,
    head: Mapping[str, str | None],
    interfaces: Mapping[str, Mapping[str, str]],
    source_files: tuple[str, ...] = (),
) -> bytes:
    """The XML document, UTF-8, indented, the same bytes for the same arguments; `head` are attributes of its root."""
    names = {"variableNamingConvention": "structured", "numberOfEventIndicators": "0"}
    return render(
        "modelDescription.xml.j2",
        head={"fmiVersion": "2.0", "modelName": identifier, **head, **names},
        interfaces={name: {"modelIdentifier": identifier, **can} for name, can in interfaces.items()},
        source_files=source_files,
        units={name: UNITS[name] for name in dict.fromkeys(v.unit for v in variables)},
        log_categories=LOG_CATEGORIES,
        experiment=_EXPERIMENT,
        variables=variables,
        index={v.name: v.index for v in variables},
        structure=_structure(variables),
    ).encode()


@dataclass(frozen=True)
class _Unknown:
    """An entry of <ModelStructure>."""

    index: int
    dependencies: str
    kinds: str


def _structure(variables: tuple[Variable, ...]) -> dict[str, list[_Unknown]]:
    index = {v.name: v.index for v in variables}
    lists: dict[str, list[_Unknown]] = {"Outputs": [], "Derivatives": [], "InitialUnknowns": []}

    def add(to: str, variable: Variable, known: Mapping[str, str]) -> None:
        ordered = sorted(known, key=index.__getitem__)
        indices, kinds = (" ".join(map(str, x)) for x in ([index[n] for n in ordered], [known[n] for n in ordered]))
        lists[to].append(_Unknown(variable.index, indices, kinds))

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
            add("InitialUnknowns", v, at_start | dict.fromkeys(PARAMETERS_OF.get(v.name, ()), "dependent"))
    return lists
