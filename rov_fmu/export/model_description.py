"""modelDescription.xml from the variables (FMI 2.0, section 2.2)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lxml import etree

from rov_fmu.export.interface import LOG_CATEGORIES, PARAMETERS_OF, UNITS, Variable


@dataclass(frozen=True)
class DefaultExperiment:
    """<DefaultExperiment>."""

    start: float = 0.0
    stop: float = 10.0
    tolerance: float = 1e-6
    step: float = 0.01


_COMMON = {
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
_CO_SIMULATION = {"canHandleVariableCommunicationStepSize": "true", **_COMMON}

# The interfaces of each flavour and what they can do, as it really is.
NATIVE = {
    "ModelExchange": {**_COMMON, "providesDirectionalDerivative": "true"},
    "CoSimulation": {**_CO_SIMULATION, "maxOutputDerivativeOrder": "1", "providesDirectionalDerivative": "true"},
}
PYTHON = {"CoSimulation": {"needsExecutionTool": "true", **_CO_SIMULATION}}


def model_description(
    variables: tuple[Variable, ...],
    *,
    identifier: str,
    guid: str,
    description: str,
    version: str,
    tool: str,
    interfaces: Mapping[str, Mapping[str, str]] = NATIVE,
    source_files: tuple[str, ...] = (),
    experiment: DefaultExperiment = DefaultExperiment(),
    author: str | None = None,
    copyright: str | None = None,
    license: str | None = None,
) -> bytes:
    """The XML document, UTF-8, indented, the same bytes for the same arguments."""
    root = _element(
        None,
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=identifier,
        guid=guid,
        description=description,
        author=author,
        version=version,
        copyright=copyright,
        license=license,
        generationTool=tool,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    for interface, capabilities in interfaces.items():
        element = _element(root, interface, modelIdentifier=identifier, **capabilities)
        if source_files:
            files = _element(element, "SourceFiles")
            for name in source_files:
                _element(files, "File", name=name)
    _units(root, variables)
    categories = _element(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        _element(categories, "Category", name=name, description=text)
    _element(
        root,
        "DefaultExperiment",
        startTime=_number(experiment.start),
        stopTime=_number(experiment.stop),
        tolerance=_number(experiment.tolerance),
        stepSize=_number(experiment.step),
    )
    _variables(root, variables)
    _structure(root, variables)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _units(root: Any, variables: tuple[Variable, ...]) -> None:
    definitions = _element(root, "UnitDefinitions")
    for name in dict.fromkeys(v.unit for v in variables):
        unit = UNITS[name]
        element = _element(definitions, "Unit", name=name)
        _element(element, "BaseUnit", **{base: str(exponent) for base, exponent in unit.exponents.items()})
        if unit.display:
            _element(element, "DisplayUnit", name=unit.display, factor=_number(unit.factor))


def _variables(root: Any, variables: tuple[Variable, ...]) -> None:
    index = {v.name: v.index for v in variables}
    parent = _element(root, "ModelVariables")
    for v in variables:
        scalar = _element(
            parent,
            "ScalarVariable",
            name=v.name,
            valueReference=str(v.value_reference),
            description=v.description,
            causality=v.causality,
            variability=v.variability,
            initial=v.initial,
        )
        _element(
            scalar,
            "Real",
            unit=v.unit,
            displayUnit=v.display_unit,
            min=_number(v.minimum),
            max=_number(v.maximum),
            nominal=_number(v.nominal),
            start=_number(v.start),
            derivative=str(index[v.derivative_of]) if v.derivative_of else None,
        )


def _structure(root: Any, variables: tuple[Variable, ...]) -> None:
    index = {v.name: v.index for v in variables}

    def unknown(parent: Any, variable: Variable, dependencies: dict[str, str]) -> None:
        known = sorted(dependencies, key=index.__getitem__)
        _element(
            parent,
            "Unknown",
            index=str(variable.index),
            dependencies=" ".join(str(index[name]) for name in known),
            dependenciesKind=" ".join(dependencies[name] for name in known),
        )

    structure = _element(root, "ModelStructure")
    outputs = _element(structure, "Outputs")
    derivatives = _element(structure, "Derivatives")
    initial = _element(structure, "InitialUnknowns")
    for v in variables:
        if v.dependencies is None:
            continue
        known = dict(v.dependencies)
        if v.causality == "output":
            unknown(outputs, v, known)
        if v.derivative_of:
            unknown(derivatives, v, known)
        if v.initial == "calculated":
            # Initialization knows no parameters that are fixed: a factor is constant or not (2.2.8).
            at_start = {name: "constant" if kind == "constant" else "dependent" for name, kind in known.items()}
            at_start |= dict.fromkeys(PARAMETERS_OF.get(v.name, ()), "dependent")
            unknown(initial, v, at_start)


def _element(parent: Any, tag: str, **attributes: str | None) -> Any:
    given = {name: value for name, value in attributes.items() if value is not None}
    return etree.Element(tag, given) if parent is None else etree.SubElement(parent, tag, given)


def _number(value: float | None) -> str | None:
    """The shortest decimal that is exactly this double."""
    return None if value is None else repr(float(value))
