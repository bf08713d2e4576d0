"""A system of FMUs as files for co-simulation tools: an SSP 1.0 archive, an OSP configuration beside the FMUs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from lxml import etree
from lxml.builder import ElementMaker

PARAMETER_SET = "initial_values"
"""The name of every component's parameter set: Ecos takes those of one name."""
# libcosim, Ecos and OMSimulator look for these prefixes.
_SSP = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
_ssd, _ssc, _ssv, _osp, _oms = (ElementMaker(namespace=_SSP[prefix], nsmap=_SSP) for prefix in _SSP)
_OSE = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"
_ose = ElementMaker(namespace=_OSE, nsmap={None: _OSE})


@dataclass(frozen=True)
class Component:
    """An FMU, the values that it starts with, and its connectors."""

    fmu: Path
    values: Mapping[str, float | bool]
    inputs: Sequence[str]
    outputs: Sequence[str]


@dataclass(frozen=True)
class System:
    """Components, stepped at once every `step` seconds until `stop`."""

    name: str
    components: Mapping[str, Component]
    step: float
    stop: float
    connections: Mapping[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    """From output to input: component and variable."""
    groups: Sequence[str] = ()
    """The same for OSP: variable groups that all components have."""


def write_ssp(path: Path, system: System) -> None:
    """Write the SSP archive: the structure, with one parameter binding a component, and the FMUs."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _document(_structure(system)))
        for component in system.components.values():
            archive.write(component.fmu, f"resources/{component.fmu.name}")


def write_osp(path: Path, system: System) -> None:
    """Write the OSP configuration; the FMUs and their OSP model descriptions stand beside it."""
    simulators = [
        _ose.Simulator(_ose.InitialValues(*_values(_ose, "InitialValue", "variable", component)), name=name,
                       source=component.fmu.name)
        for name, component in system.components.items()
    ]  # fmt: skip
    connections = (
        _ose.VariableGroupConnection(*(_ose.VariableGroup(simulator=s, name=group) for s in system.components))
        for group in system.groups
    )
    algorithm = _ose.BaseStepSize(repr(system.step)), _ose.Algorithm("fixedStep")
    structure = _ose.OspSystemStructure(_ose.StartTime("0.0"), *algorithm, _ose.Simulators(*simulators),
                                        _ose.Connections(*connections), version="0.1")  # fmt: skip
    path.write_bytes(_document(structure))


def _structure(system: System) -> Any:
    connections = (
        _ssd.Connection(startElement=start[0], startConnector=start[1], endElement=end[0], endConnector=end[1])
        for start, end in system.connections.items()
    )
    # How OMSimulator and libcosim are told of the step.
    master = _oms.FixedStepMaster(description="oms-ma", stepSize=repr(system.step), relativeTolerance="1e-4")
    algorithm = _osp.Algorithm(_osp.FixedStepAlgorithm(baseStepSize=repr(system.step)))
    whole = _ssd.System(
        _ssd.Elements(*(_component(name, component) for name, component in system.components.items())),
        _ssd.Connections(*connections),
        _annotations("org.openmodelica", _oms.Annotations(_oms.SimulationInformation(master))),
        name=system.name,
    )
    experiment = _ssd.DefaultExperiment(_annotations("com.opensimulationplatform", algorithm), startTime="0.0",
                                        stopTime=repr(system.stop))  # fmt: skip
    return _ssd.SystemStructureDescription(whole, experiment, name=system.name, version="1.0")


def _component(name: str, component: Component) -> Any:
    connectors = (
        _ssd.Connector(_ssc.Real(), name=variable, kind=kind)
        for kind, variables in (("input", component.inputs), ("output", component.outputs))
        for variable in variables
    )
    values = _ssv.Parameters(*_values(_ssv, "Parameter", "name", component))
    parameters = _ssd.ParameterValues(_ssv.ParameterSet(values, name=PARAMETER_SET, version="1.0"))
    return _ssd.Component(_ssd.Connectors(*connectors), _ssd.ParameterBindings(_ssd.ParameterBinding(parameters)),
                          name=name, source=f"resources/{component.fmu.name}",
                          type="application/x-fmu-sharedlibrary")  # fmt: skip


def _annotations(type_: str, content: Any) -> Any:
    return _ssd.Annotations(_ssc.Annotation(content, type=type_))


def _values(make: ElementMaker, tag: str, named: str, component: Component) -> Iterator[Any]:
    """The values of a component, which both formats have, each in an element of this tag."""
    for name, value in component.values.items():
        typed = make.Boolean(value=str(value).lower()) if isinstance(value, bool) else make.Real(value=repr(value))
        yield make(tag, typed, **{named: name})


def _document(root: Any) -> bytes:
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
