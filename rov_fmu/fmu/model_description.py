"""Write modelDescription.xml (FMI 2.0, section 2.2; FMI 3.0, section 2.4)."""

from collections.abc import Collection, Mapping, Sequence

from rov_fmu.c.compile import UNITY_FILE
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.dependencies import parameters_of
from rov_fmu.equation.units import parsed_unit
from rov_fmu.fmu.card import card_text
from rov_fmu.fmu.terminals import terminals_and_icons
from rov_fmu.fmu.variables import LOG_CATEGORIES, DeclaredVariable, FmuModel, variables
from rov_fmu.io.program import program
from rov_fmu.io.templates import render
from rov_fmu.vehicle.vehicle import Vehicle

PYTHON_NOTE = (
    "Needs a Python on this machine. On Linux an importer that is not itself a Python process must be started with "
    "LD_PRELOAD=/path/to/libpython3.x.so, or it cannot load the library (undefined symbol: _Py_NoneStruct)."
)
"""The text that follows the vehicle's summary in the description of the FMU in pure Python."""
DEAD_TIME_NOTE = (
    "The commands act after a dead time, so they change only in events: use Co-Simulation, or Model Exchange in a tool "
    "that sets inputs in Event Mode."
)
"""The text that follows the summary of a vehicle with a dead time, if the FMU is for Model Exchange."""


def model_of(vehicle: Vehicle) -> FmuModel:
    """Return the model of a vehicle, without its C files."""
    layout = vehicle.layout
    return FmuModel(
        *(vehicle.identifier, vehicle.version, vehicle.source, vehicle.summary, card_text(vehicle)),
        variables(vehicle),
        terminals_and_icons(layout),
        notes=[DEAD_TIME_NOTE] if layout.has_dead_time else [],
        completes_steps=layout.has_attitude or layout.has_dead_time,
        parameters_of=parameters_of(layout),
        voltage_ranges=layout.voltage_ranges,
        has_only_water=layout.has_only_water,
    )


def model_description(
    model: FmuModel,
    *,
    guid: str,
    interfaces: Sequence[str],
    source_files: Sequence[str] = (),
    fmi: int = 2,
    native: bool = True,
) -> bytes:
    """Return the XML document for a version of FMI. The same arguments give the same bytes.

    `interfaces` are the elements of what the FMU offers, such as CoSimulation. `native` is False in pure Python.
    """
    notes = [*model.notes] if "ModelExchange" in interfaces else []
    notes += [] if native else [PYTHON_NOTE]
    description = ". ".join(filter(None, (model.summary, " ".join(notes))))
    declared = model.variables
    if fmi == 3:
        declared = (*declared, DeclaredVariable("time", len(declared), "Time", "s", "independent", "continuous"))
    number, type_names = {v.name: v.index for v in declared}, _type_names(declared)
    return render(
        "modelDescription.xml.j2",
        model=model,
        guid=guid,
        fmi=fmi,
        native=native,
        program=program(),
        description=description,
        interfaces=interfaces,
        source_files=source_files,
        units={name: parsed_unit(name) for name in dict.fromkeys(v.unit for v in declared)},
        types={type_names[v.name]: v for v in declared},
        type_names=type_names,
        log_categories=LOG_CATEGORIES,
        variables=declared,
        number=number,
        numbers=lambda names: " ".join(str(number[name]) for name in names),
        structure=_structure(declared, model.parameters_of, _LISTS[fmi]),
    ).encode()


def build_description(identifier: str) -> bytes:
    """Return sources/buildDescription.xml, which says how to compile the sources (FMI 3.0, section 2.5.1.3.1)."""
    return render("buildDescription.xml.j2", identifier=identifier, file=UNITY_FILE).encode()


def _type_names(variables: Sequence[DeclaredVariable]) -> dict[str, str]:
    """Return the name of the type of each variable by the variable's name: its quantity.

    Types of the same quantity that differ in range, display unit or nominal value are numbered.
    """
    types: dict[tuple[str, tuple[object, ...]], str] = {}
    names: dict[str, str] = {}
    for v in variables:
        quantity = "Command" if v.display_unit == "%" else parsed_unit(v.unit).quantity
        key = quantity, (v.unit, v.display_unit, v.minimum, v.maximum, v.nominal)
        count = sum(known == quantity for known, _ in types)
        names[v.name] = types.setdefault(key, f"{quantity} {count + 1}" if count else quantity)
    return names


_LISTS = {
    2: ("Outputs", "Derivatives", "InitialUnknowns"),
    3: ("Output", "ContinuousStateDerivative", "InitialUnknown"),
}


_Elements = dict[str, dict[str, str]]
"""For each unknown the dependenciesKind of each known."""


def _structure(
    declared: tuple[DeclaredVariable, ...], parameters: Mapping[str, Collection[str]], names: tuple[str, str, str]
) -> dict[str, _Elements]:
    """Return the lists of <ModelStructure> by name. `parameters` are those of `Model.parameters_of`."""
    order = {v.name: v.index for v in declared}
    lists: dict[str, _Elements] = {name: {} for name in names}
    outputs, derivatives, initial = lists.values()

    def add(to: _Elements, variable: DeclaredVariable, known: Mapping[str, str]) -> None:
        to[variable.name] = dict(sorted(known.items(), key=lambda item: order[item[0]]))

    for v in declared:
        if v.dependencies is None:
            continue
        if v.causality == "output":
            add(outputs, v, v.dependencies)
        if v.derivative_of:
            add(derivatives, v, v.dependencies)
        if v.initial in ("calculated", "approx"):
            # In Initialization Mode no parameter is fixed, so the only kinds are constant and dependent (2.2.8). The
            # quaternion is not known yet: it follows from parameters.
            known = {n: kind for n, kind in v.dependencies.items() if n not in QUATERNION}
            at_start = {n: "constant" if kind == "constant" else "dependent" for n, kind in known.items()}
            add(initial, v, at_start | dict.fromkeys(parameters.get(v.name, ()), "dependent"))
    return lists
