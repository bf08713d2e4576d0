"""Declare every variable of the FMU once.

modelDescription.xml, the table VARIABLES in interface.h, the documentation and the registration with PythonFMU are
derived from `variables`. The order is that of `Layout.variables`: inputs, states, derivatives, calculated variables,
what is kept between steps, coefficients, attitude at the start, outputs that came later. The value reference of a
variable is its place in this order: from 0 in FMI 2.0, from 1 in FMI 3.0.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite
from typing import Any

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Declaration, rate_name
from rov_fmu.equation.dependencies import dependencies_of
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.words import AFLOAT, LEFT_WATER
from rov_fmu.io.templates import render
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True)
class DeclaredVariable:
    """A scalar variable with the attributes of FMI. Its type is Real in FMI 2.0 and Float64 in FMI 3.0.

    `dependencies` maps each known that the variable depends on to its dependenciesKind, for outputs and derivatives.
    """

    name: str
    value_reference: int
    """The value reference in FMI 2.0, which is also the index in the arrays of the C code, from 0."""
    description: str
    unit: str
    causality: str
    variability: str
    initial: str | None = None
    start: float | None = None
    display_unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative_of: str | None = None
    dependencies: Mapping[str, str] | None = None

    @property
    def index(self) -> int:
        """The position in <ModelVariables>, from 1."""
        return self.value_reference + 1

    def reference(self, fmi: int) -> int:
        """Return the value reference in a version of FMI. In 3.0 it is the index, because OMSimulator needs it."""
        return self.value_reference if fmi == 2 else self.index

    @property
    def kind(self) -> str:
        """The variable_kind of interface.h."""
        if self.causality == "input":
            return "INPUT"
        if self.causality == "parameter":
            return self.variability.upper()
        if self.initial == "exact":
            return "STATE"
        if self.variability == "discrete":
            return "MEMORY"
        return "CALCULATED_STATE" if self.name in QUATERNION else "CALCULATED"


class VariableList(list[DeclaredVariable]):
    """The variables of a model that samples its inputs (fmu_src/c/sampled.c), in the order in which they are added."""

    def add(self, name: str, declaration: Declaration, causality: str, variability: str, **rest: Any) -> int:
        """Add a variable; `rest` are further attributes. Return its value reference."""
        given = {"display_unit": declaration.display_unit, **rest}
        about = declaration.description, declaration.unit
        self.append(DeclaredVariable(name, len(self), *about, causality, variability, **given))
        return self[-1].value_reference

    def add_clock(self) -> None:
        """Add the only state, the time since the start, with its derivative."""
        elapsed, rate = Declaration("s", "Time since the start"), Declaration("1", "Rate of the time since the start")
        self.add("elapsed", elapsed, "output", "continuous", initial="exact", start=0.0, dependencies={})
        rest: dict[str, Any] = {"derivative_of": "elapsed", "dependencies": {}, "display_unit": None}
        self.add("der(elapsed)", rate, "local", "continuous", initial="calculated", **rest)


# ---- Descriptions of the derivatives ---------------------------------------------------------------------------------


def _derivatives(layout: Layout) -> dict[str, Declaration]:
    """Return the unit and the description of the derivative of every state."""
    derivatives: dict[str, Declaration] = {}
    for axis in layout.bare_axes:
        derivatives[axis.velocity] = Declaration(f"{axis.unit}2", f"{axis.name.capitalize()} acceleration")
    if layout.has_attitude:
        for name, direction in (("x", "northward"), ("y", "eastward"), ("z", "downward")):
            derivatives[name] = Declaration("m/s", f"Velocity over ground {direction}")
        derivatives |= {name: Declaration("1/s", f"Rate of change of {name}") for name in QUATERNION}
    elif layout.has(SURGE, SWAY):
        derivatives["x"] = _over_ground(layout, "northward", "V_N", {"u": "+ u cos ψ", "v": "- v sin ψ"})
        derivatives["y"] = _over_ground(layout, "eastward", "V_E", {"u": "+ u sin ψ", "v": "+ v cos ψ"})
    if layout.has(HEAVE) and not layout.has_attitude:
        derivatives["z"] = Declaration("m/s", "Velocity over ground downward, w")
    if layout.has(YAW):
        derivatives["psi"] = Declaration("rad/s", "Rate of change of heading, r")
    for name, lagging in layout.lagging.items():
        letter, unit = name[0], "N/s" if lagging.unit == "N" else "1/s"
        derivatives[name] = Declaration(unit, f"Rate of change of {name}, ({letter}(c) - {letter}) / T")
    return derivatives


def _over_ground(layout: Layout, direction: str, current: str, terms: Mapping[str, str]) -> Declaration:
    """Describe a horizontal velocity over ground by its terms. Without yaw, ψ is 0."""
    turns = layout.has(YAW)
    words = [
        term if turns else f"+ {v}" for v, term in terms.items() if v in layout.velocities and (turns or "cos" in term)
    ]
    return Declaration(
        "m/s", f"Velocity over ground {direction}, {' '.join([*words, f'+ {current}']).removeprefix('+ ')}"
    )


def variables(vehicle: Vehicle) -> tuple[DeclaredVariable, ...]:
    """Return all variables of the FMU of a vehicle, in the order of their value references."""
    coefficients = vehicle.layout.coefficients
    return tuple(
        replace(v, start=vehicle[v.name]) if v.name in coefficients else v for v in _variables_of(vehicle.layout)
    )


@lru_cache(maxsize=100)
def units_of(layout: Layout) -> dict[str, str]:
    """Return the unit of each variable that is no parameter, by its name."""
    return {v.name: v.unit for v in _variables_of(layout) if v.causality != "parameter"}


@lru_cache(maxsize=100)
def _variables_of(layout: Layout) -> tuple[DeclaredVariable, ...]:
    """Return the variables of the vehicles with a layout, without the values of the coefficients."""
    result: dict[str, DeclaredVariable] = {}

    def add(name: str, declaration: Declaration, causality: str, variability: str, **rest: Any) -> None:
        low, high = (x if isfinite(x) else None for x in (declaration.minimum, declaration.maximum))
        given = {"display_unit": declaration.display_unit, "minimum": low, "maximum": high, **rest}
        about = declaration.description, declaration.unit
        result[name] = DeclaredVariable(name, layout.places[name], *about, causality, variability, **given)

    for name, declaration in layout.inputs.items():
        variability = "discrete" if name in layout.acting else "continuous"
        add(name, declaration, "input", variability, start=declaration.start, nominal=declaration.nominal)
    for name, declaration in layout.state.items():
        add(
            name,
            declaration,
            "output",
            "continuous",
            initial="approx" if name in QUATERNION else "exact",
            start=float(name == QUATERNION[0]),
            nominal=declaration.nominal,
            dependencies={name: "constant"},
        )
    derivatives, dependencies = _derivatives(layout), dependencies_of(layout)
    for name, rate in ((name, rate_name(name)) for name in layout.state):
        rest = {"derivative_of": name, "dependencies": dependencies[rate]}
        add(rate, derivatives[name], "local", "continuous", initial="calculated", **rest)
    for name, declaration in layout.calculated.items():
        add(name, declaration, "output", "continuous", initial="calculated", dependencies=dependencies[name])
    for name, declaration in layout.memory.items():
        add(name, declaration, "local", "discrete", initial="calculated")
    for name, declaration in (layout.coefficients | layout.initial).items():
        variability = "tunable" if declaration.tunable else "fixed"
        add(name, declaration, "parameter", variability, initial="exact", start=0.0)
    return tuple(result[name] for name in layout.variables)


LOG_CATEGORIES = {
    "logEvents": "Changes of mode: initialization, event mode, reset, termination",
    "logStatusWarning": "A command that saturates, or a call that the standard does not allow; each is logged once",
    "logStatusDiscard": "A refused value, of a variable or of a solver's state: not finite, or outside min ... max",
    "logStatusError": "Illegal calls and arguments, steps past stopTime, results that overflow",
    "logAll": "All of these categories at once",
}
"""The log categories by the standard's names (2.2.4), each with its description."""


@dataclass(frozen=True, eq=False)
class FmuModel:
    """What an FMU is of: a vehicle (`model_of`), or something else that the FMI functions in C can run."""

    identifier: str
    version: str
    source: str
    """Where its numbers are from, in words."""
    summary: str
    card: str
    """The model card as text."""
    variables: tuple[DeclaredVariable, ...]
    terminals: bytes
    """The document terminalsAndIcons.xml."""
    c_files: Mapping[str, str] = field(default_factory=dict)
    """The C files beside those of the FMI functions, by name."""
    notes: Sequence[str] = ()
    """Sentences after the summary, if the FMU is for Model Exchange."""
    completes_steps: bool = False
    """True if Model Exchange must tell that the integrator has completed a step."""
    has_derivatives: bool = True
    """True if the FMU gives partial derivatives and those of its outputs."""
    parameters_of: Mapping[str, Collection[str]] = field(default_factory=dict)
    """The parameters that determine a variable at the start, by the name of the variable."""
    voltage_ranges: Mapping[tuple[float, float], str] = field(default_factory=dict)
    """Those of `Layout.voltage_ranges`."""
    has_only_water: bool = False
    """True for a vehicle without a surface, so that it must not rise above depth 0."""
    experiment: tuple[float, float] = (10.0, 0.01)
    """The stop time and the step of the default experiment, s."""

    def begun(self, start: Mapping[str, Any], stop: float, step: float) -> "FmuModel":
        """Return the model with other start values, for an experiment."""
        made = tuple(replace(v, start=float(start[v.name])) if v.name in start else v for v in self.variables)
        return replace(self, variables=made, experiment=(stop, step))


def interface_header(model: FmuModel, token: str, fmi: int, interfaces: Collection[str]) -> str:
    """Return interface.h: the table of variables for the FMI functions, and their names in a static library."""
    return render(
        "interface.h.j2",
        variables=model.variables,
        first_reference=model.variables[0].reference(fmi),
        identifier=model.identifier,
        token=token,
        fmi=fmi,
        interfaces=interfaces,
        ranges=model.voltage_ranges,
        has_only_water=model.has_only_water,
        afloat=AFLOAT,
        left_water=LEFT_WATER,
        log_categories=LOG_CATEGORIES,
        c_double=lambda value, otherwise: otherwise if value is None else repr(value),
    )
