"""Every FMU variable, declared once.

modelDescription.xml, the C structs and value references, the documentation and the PythonFMU registration are all
derived from `variables`. Their order is: inputs, state, derivatives, thrust, coefficients. The value reference of a
variable is its place in this order: from 0 in FMI 2.0, from 1 in FMI 3.0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, isfinite
from typing import Any

from rov_fmu.files.templates import render
from rov_fmu.motion.layout import AXES, HEAVE, REVERSE, SURGE, SWAY, YAW, Curve, Layout, Meta, VehicleAxis
from rov_fmu.motion.rov import Rov


@dataclass(frozen=True)
class Unit:
    """An SI unit: its exponents of the FMI base units, and the unit a person reads, value times factor."""

    exponents: Mapping[str, int]
    display: str | None = None
    factor: float = 1.0


_KNOT = 1852.0 / 3600.0  # m/s

UNITS: dict[str, Unit] = {
    "1": Unit({}, "%", 100.0),
    "kg": Unit({"kg": 1}),
    "m": Unit({"m": 1}),
    "s": Unit({"s": 1}),
    "rad": Unit({"rad": 1}, "deg", degrees(1.0)),
    "m/s": Unit({"m": 1, "s": -1}, "knot", 1.0 / _KNOT),
    "rad/s": Unit({"rad": 1, "s": -1}, "deg/s", degrees(1.0)),
    "m/s2": Unit({"m": 1, "s": -2}),
    "rad/s2": Unit({"rad": 1, "s": -2}),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "N/s": Unit({"kg": 1, "m": 1, "s": -3}),
    "N.m": Unit({"kg": 1, "m": 2, "s": -2}),
    "kg.m2": Unit({"kg": 1, "m": 2}),
    "N.s/m": Unit({"kg": 1, "s": -1}),
    "N.s2/m2": Unit({"kg": 1, "m": -1}),
    "N.m.s/rad": Unit({"kg": 1, "m": 2, "s": -1, "rad": -1}),
    "N.m.s2/rad2": Unit({"kg": 1, "m": 2, "rad": -2}),
}


@dataclass(frozen=True)
class Variable:
    """One scalar variable as FMI describes it. Every one is a Real, a Float64 in FMI 3.0.

    `dependencies` maps each known that the variable depends on to its dependenciesKind, for outputs and derivatives.
    """

    name: str
    value_reference: int
    """In FMI 2.0. It is also the place of the variable in the arrays of the C code, from 0."""
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
        """Position in <ModelVariables>, from 1."""
        return self.value_reference + 1

    def reference(self, fmi: int) -> int:
        """Value reference in a version of FMI: in FMI 3.0 the index, because OMSimulator takes one for the other."""
        return self.value_reference if fmi == 2 else self.index

    @property
    def kind(self) -> str:
        """What it is in C: variable_kind of variable.h."""
        if self.causality == "input":
            return "INPUT"
        if self.causality == "parameter":
            return self.variability.upper()
        return "STATE" if self.initial == "exact" else "CALCULATED"


# ---- What depends on what ------------------------------------------------------------------------------------------


def _driving(layout: Layout, form: VehicleAxis) -> dict[str, str]:
    """What the force of an axis depends on: commands, or forces that lag behind them."""
    found: dict[str, str] = {}
    for thruster in layout.drivers(form.axis):
        lags = layout.curve_of[thruster.name].has_lag
        found |= {f"F_{thruster.name}": "tunable"} if lags else dict.fromkeys(layout.gains[thruster.name], "dependent")
    return found


def _derivatives(layout: Layout) -> dict[str, tuple[Meta, dict[str, str]]]:
    """The derivative of every state: what it is, and the knowns that it depends on with their dependenciesKind."""
    found: dict[str, tuple[Meta, dict[str, str]]] = {}
    for form in layout.axes:
        axis = form.axis
        known = {**_driving(layout, form), axis.external: "tunable", axis.velocity: "dependent"}
        if layout.coupled and axis is not HEAVE:
            known |= dict.fromkeys((SURGE.velocity, SWAY.velocity, YAW.velocity), "dependent")
        found[axis.velocity] = (
            Meta(f"{axis.unit}2", f"{axis.name.capitalize()} acceleration, {axis.equations[1]}"),
            known,
        )
    if layout.has(SURGE, SWAY):
        found["x"] = _over_ground(layout, "northward", "V_N", {"u": "+ u cos ψ", "v": "- v sin ψ"})
        found["y"] = _over_ground(layout, "eastward", "V_E", {"u": "+ u sin ψ", "v": "+ v cos ψ"})
    if layout.has(HEAVE):
        found["z"] = Meta("m/s", "Rate of change of depth, w"), {"w": "constant"}
    if layout.has(YAW):
        found["psi"] = Meta("rad/s", "Rate of change of heading, r"), {"r": "constant"}
    for thruster in layout.thrusters:
        if (name := f"F_{thruster.name}") in layout.lagging:
            commands = dict.fromkeys(layout.gains[thruster.name], "dependent")
            found[name] = Meta("N/s", f"Rate of change of {name}, (F(c) - F) / T"), {**commands, name: "fixed"}
    return found


def _over_ground(layout: Layout, way: str, current: str, terms: Mapping[str, str]) -> tuple[Meta, dict[str, str]]:
    """A horizontal velocity over ground: a term of each velocity; ψ is 0 without yaw."""
    turns = layout.has(YAW)
    known = {"psi": "dependent"} if turns else {}
    terms = {v: term if turns else f"+ {v}" for v, term in terms.items()
             if v in layout.velocities and (turns or "cos" in term)}  # fmt: skip
    known |= dict.fromkeys(terms, "dependent" if turns else "constant")
    words = " ".join([*terms.values(), f"+ {current}"]).removeprefix("+ ")
    return Meta("m/s", f"Velocity over ground {way}, {words}"), {current: "constant", **known}


def _coefficients_of_thrust(curve: Curve) -> list[str]:
    return [curve.coefficient(key) for key in curve.keys]


def _calculated_of(layout: Layout) -> dict[str, dict[str, str]]:
    """What each calculated variable of the thrusters depends on."""
    found: dict[str, dict[str, str]] = {}
    for name in layout.thrust:
        of_curve = [t for t in layout.drivers(YAW) if name == f"tau_{t.curve}"] if layout.has(YAW) else []
        thrusters = of_curve or [t for t in layout.thrusters if name == f"F_{t.name}"]
        found[name] = {}
        for thruster in thrusters:
            if layout.curve_of[thruster.name].has_lag:
                found[name][f"F_{thruster.name}"] = "constant" if thruster.position else "fixed"
            else:
                found[name] |= dict.fromkeys(layout.gains[thruster.name], "dependent")
    return found


def parameters_of(layout: Layout) -> dict[str, tuple[str, ...]]:
    """The coefficients that each calculated variable depends on during initialization."""
    found: dict[str, tuple[str, ...]] = {}
    arm = ("R", "gamma") if layout.has_arm else ()
    for thruster in layout.thrusters:
        curve = layout.curve_of[thruster.name]
        if curve.has_lag:
            found[f"der(F_{thruster.name})"] = tuple(_coefficients_of_thrust(curve))
        else:
            found[f"F_{thruster.name}"] = tuple(_coefficients_of_thrust(curve))
    for curve in layout.turning_curves:
        steady = () if curve.has_lag else tuple(_coefficients_of_thrust(curve))
        by_arm = any(t.arm and t.position is None for t in layout.drivers(YAW) if t.curve == curve.name)
        found[f"tau_{curve.name}"] = steady + (arm if by_arm else ())
    for form in layout.axes:
        axis = form.axis
        names: list[str] = []
        for curve in layout.curves:
            if not curve.has_lag and any(t.curve == curve.name for t in layout.drivers(axis)):
                names += _coefficients_of_thrust(curve)
        names += arm if axis is YAW else ()
        own = [form.coefficient(key) for key in form.keys]
        names += [axis.inertia, *own, axis.coefficient("alpha"), axis.coefficient("beta")]
        if layout.coupled and axis is not HEAVE:
            for other in (layout.kinds[a.name] for a in (SURGE, SWAY)):
                names += [other.axis.inertia, *(other.coefficient(key) for key in other.keys if key == "m_a"),
                          other.axis.coefficient("beta")]  # fmt: skip
        found[f"der({axis.velocity})"] = tuple(dict.fromkeys(names))
    return found


def variables(rov: Rov) -> tuple[Variable, ...]:
    """All variables of the FMU of a vehicle, in the order of their value references."""
    layout = rov.layout
    result: list[Variable] = []

    def add(name: str, meta: Meta, causality: str, variability: str, **rest: Any) -> None:
        bounds = {end: x for end, x in (("minimum", meta.minimum), ("maximum", meta.maximum)) if isfinite(x)}
        given = {"display_unit": UNITS[meta.unit].display, **bounds, **rest}
        result.append(Variable(name, len(result), meta.description, meta.unit, causality, variability, **given))

    for name, meta in layout.inputs.items():
        add(name, meta, "input", "continuous", start=0.0, nominal=meta.nominal)
    for name, meta in layout.state.items():
        add(name, meta, "output", "continuous", initial="exact", start=0.0, nominal=meta.nominal,
            dependencies={name: "constant"})  # fmt: skip
    derivatives, calculated = _derivatives(layout), _calculated_of(layout)
    for name in layout.state:
        meta, known = derivatives[name]
        add(f"der({name})", meta, "local", "continuous", initial="calculated", derivative_of=name,
            dependencies=known)  # fmt: skip
    for name, meta in layout.thrust.items():
        add(name, meta, "output", "continuous", initial="calculated", display_unit=None, dependencies=calculated[name])
    for name, meta in layout.coefficients.items():
        add(name, meta, "parameter", "tunable" if meta.tunable else "fixed", initial="exact",
            start=rov[name], display_unit=None if meta.unit == "1" else UNITS[meta.unit].display)  # fmt: skip
    return tuple(result)


ENDS = ("", REVERSE)
"""Of the keys of what holds forward, and in reverse."""

# Names by the standard (2.2.4) and what is said in each.
LOG_CATEGORIES = {
    "logEvents": "Changes of mode: initialization, event mode, reset, termination",
    "logStatusWarning": "A command beyond ±1 that saturates, a call or a time that the standard does not foresee; once",
    "logStatusDiscard": "A refused value, of a variable or of a solver's state: not finite, or outside min ... max",
    "logStatusError": "Illegal calls and arguments, steps past stopTime, results that overflow",
    "logAll": "All of these categories at once",
}

# ---- The same declaration for the C compiler -----------------------------------------------------------------------


def model_header(rov: Rov) -> str:
    """model.h: what the vehicle has, for the mathematics; a variable is known by its place, REF_<name>."""
    layout = rov.layout
    names = [v.name for v in variables(rov) if not v.derivative_of]

    def ref(name: str | None) -> str:
        return f"REF_{name}" if name is not None else "NONE"

    def if_given(name: str, key: str, of: Curve | VehicleAxis) -> str:
        return ref(name) if key in of.keys else "NONE"

    curves = [
        {
            "name": curve.name,
            "share": repr(1.0 / curve.together),
            "a_t": [ref(curve.coefficient(f"a_t{end}")) for end in ENDS],
            "b_t": [ref(curve.coefficient(f"b_t{end}")) for end in ENDS],
            "c_0": [if_given(curve.coefficient(f"c_0{end}"), "c_0", curve) for end in ENDS],
            "lag": if_given(curve.coefficient("T"), "T", curve),
            "torque": ref(f"tau_{curve.name}" if curve in layout.turning_curves else None),
        }
        for curve in layout.curves
    ]
    most = max(1, *(len(gains) for gains in layout.gains.values()))
    nothing = (next(iter(layout.commands)), 0.0)
    driving = {name: [*gains.items(), *[nothing] * (most - len(gains))] for name, gains in layout.gains.items()}
    thrusters = [
        {
            "name": t.name,
            "curve": [curve.name for curve in layout.curves].index(t.curve),
            "force": ref(f"F_{t.name}"),
            "effect": [repr(t.effect(f.axis)) if t in layout.drivers(f.axis) else "0.0" for f in layout.axes],
            "by_arm": int(t.position is None and t.arm != 0),
            "command": [ref(command) for command, _ in driving[t.name]],
            "gain": [repr(gain) for _, gain in driving[t.name]],
        }
        for t in layout.thrusters
    ]
    places = {form.axis.name: place for place, form in enumerate(layout.axes)}
    kinds = {name.upper(): places.get(name, "NONE") for name in AXES}
    axes = [
        {
            "external": ref(form.axis.external),
            "inertia": ref(form.axis.inertia),
            "added": if_given(form.coefficient("m_a"), "m_a", form),
            "a_d": [ref(form.coefficient(f"a_d{end}")) for end in ENDS],
            "b_d": [ref(form.coefficient(f"b_d{end}")) for end in ENDS],
            "load": if_given(form.coefficient("F_0"), "F_0", form),
            "alpha": ref(form.axis.coefficient("alpha")),
            "beta": ref(form.axis.coefficient("beta")),
        }
        for form in layout.axes
    ]
    return render(
        "model.h.j2", layout=layout, names={v.name: v.value_reference for v in variables(rov) if v.name in names},
        axes=axes, curves=curves, thrusters=thrusters, kinds=kinds,
        n={"drivers": most, "inputs": len(layout.inputs), "commands": len(layout.commands), "states": len(layout.state),
           "lagging": len(layout.lagging), "thrust": len(layout.thrust), "coefficients": len(layout.coefficients)},
        ref=lambda name: ref(name if name in names else None),
    )  # fmt: skip


def interface_header(rov: Rov, identifier: str, token: str, fmi: int = 2) -> str:
    """interface.h: what the FMI layer knows of the variables, and the names of the functions in a static library."""
    return render(
        "interface.h.j2",
        variables=variables(rov),
        first_reference=variables(rov)[0].reference(fmi),
        identifier=identifier,
        token=token,
        fmi=fmi,
        log_categories=LOG_CATEGORIES,
        c_double=lambda value, otherwise: otherwise if value is None else repr(value),
    )
