"""The description of a vehicle in rov.toml, which stands beside its tests.

The hardware (axes, thrusters, curves) comes from one of three places: the vehicle file that `base` names, the hardware
tables of rov.toml, or, without either, the form of the paper. The coefficients to be identified are left out.
"""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign, cos, hypot, radians, sin
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from rov_fmu.equation.catalogue import (
    ARM,
    AXES,
    HEAVE,
    PITCH,
    REVERSE,
    ROLL,
    SURGE,
    SWAY,
    YAW,
)
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import FAINT, Part, SourcedVector, Thruster, VehicleAxis
from rov_fmu.io.messages import MOST, did_you_mean, lines_on, only, shown, similar
from rov_fmu.io.paths import inside
from rov_fmu.io.toml_file import (
    AS_TUPLE,
    Finite,
    Strict,
    Symbol,
    Toml,
    folder_of,
    join_names,
    key_line,
    parse_toml,
    problem_lines,
    read_toml,
    rule,
    table_model,
)
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.commands import LogKeys
from rov_fmu.vehicle.checks import check_distinct_names, check_names_and_keys, check_quantities, check_tables_of_thrust
from rov_fmu.vehicle.description import Head, Validity
from rov_fmu.vehicle.full_thrust import CurveToFit
from rov_fmu.vehicle.geometry import undriven_axes
from rov_fmu.vehicle.quantity import Quantity
from rov_fmu.vehicle.schema import AXIS_TABLES, NOT_GIVEN, Arm, Axes, Tables, read_tables, to_fit
from rov_fmu.vehicle.schema import MOST as MOST_OF_A_KIND
from rov_fmu.vehicle.shipped import SHIPPED, VIDEORAY, shipped_name
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle

ROV_FILE = "rov.toml"
_GEOMETRY = f"[geometry] of {ROV_FILE}"
"""The source of the directions and places of the thrusters of a base that the file corrects."""
DRAFTED = "A vehicle identified from {}"
"""The description that a draft has, with its source."""
_HARDWARE_TABLES = ("body", "arm", "curves", "thruster", "inputs", "point")
"""The tables that are not allowed together with `base`, because the base has its own; [body] may have `coupling`."""
_FORM = "the form of the paper's vehicle: two rear thrusters ahead, one down"
"""The source of the directions of the thrusters where neither a base nor a table gives any."""
_FILE_TABLES = ("columns", "topics", "valid", "dives", "logs")
"""The tables that explain the files of tests."""


# ---- The keys of the file --------------------------------------------------------------------------------------------


_Window = Annotated[
    tuple[Finite, Finite],
    AS_TUPLE,
    rule(
        "must be [low, high] within -1 ... 1, fractions of the full command: 20 % is 0.2",
        lambda window: -1.0 <= window[0] < window[1] <= 1.0,
    ),
]


_Deviation = Annotated[Finite, rule("must be 0 or above", lambda deviation: deviation >= 0.0)]


def _find_vehicle(name: object, info: ValidationInfo) -> Path:
    """Return the path of the vehicle file in the folder of rov.toml, or of the one that ships. Raises ValueError.

    A path that the command line gives may lie anywhere.
    """
    if isinstance(name, Path):
        return name
    if not isinstance(name, str):
        raise ValueError("must be text in quotes")
    own = inside(folder_of(info), name)
    path = own if os.path.isfile(own) else SHIPPED.get(name)  # noqa: PTH113 (as in vehicle/description.py)
    if not path:
        raise ValueError(
            f"must be a vehicle file in this folder, or one of the vehicles that ship: {', '.join(SHIPPED)}"
            f"{did_you_mean(name, SHIPPED)}"
        )
    return path


_VehicleFile = Annotated[Path, BeforeValidator(_find_vehicle)]

UNUSED = {
    "against": "a report compares with no other vehicle. `rov-fmu fly --against` does",
    "limits": "the next test keeps to no limits",
}
"""The keys of earlier versions, which may still be there, and why nothing reads them."""


def _check_curve_names(value: object) -> object:
    if value is not True and not (isinstance(value, list) and all(isinstance(name, str) for name in value)):
        raise ValueError("must be true, or a list of curves, each in quotes")
    return value if value is True else tuple(dict.fromkeys(value))


_Curves = Annotated[Any, AfterValidator(_check_curve_names)]


class Requests(Strict):
    """The table [fit]: what is fitted in addition to thrust, drag and β."""

    lag: _Curves = ()
    """The curves whose lag is fitted. true means all curves."""
    voltage: bool = False
    """True when thrust depends on the logged voltage: its exponent is fitted."""
    attitude: bool = False
    """True when the vehicle is simulated at the logged roll and pitch."""

    @property
    def quantities(self) -> dict[str, tuple[str, ...]]:
        """The quantities that every log must have, by the key of [fit] that needs them."""
        return {"voltage": ("voltage",) * self.voltage, "attitude": ("roll angle", "pitch angle") * self.attitude}


_Distance = Annotated[Finite, rule("must be from 0.001 to 10 m", lambda x: 0.001 <= x <= 10.0)]


class Geometry(Strict):
    """The table [geometry]: how the thrusters of a base that push ahead and sideways stand on this vehicle."""

    angle: Annotated[Finite, rule("must be between 0 and 90 deg", lambda angle: 0.0 < angle < 90.0)] | None = None
    """From ahead or astern, deg."""
    x: _Distance | None = None
    """How far they are ahead or astern of the centre of mass, m."""
    y: _Distance | None = None
    """The same to either side."""

    def placed(self, layout: Layout) -> Layout:
        """Return the layout of a base with these, where they are given. Each thruster keeps its signs."""

        def own(t: Thruster) -> Thruster:
            X, Y, Z = t.direction.value
            if t not in vectored(layout):
                return t
            if self.angle is not None:
                ahead, across = hypot(X, Y) * cos(radians(self.angle)), hypot(X, Y) * sin(radians(self.angle))
                t = replace(t, direction=SourcedVector((copysign(ahead, X), copysign(across, Y), Z), _GEOMETRY))
            if t.position and not self.x is self.y is None:
                x, y, z = t.place
                place = copysign(self.x or x, x), copysign(self.y or y, y), z
                t = replace(t, position=SourcedVector(place, _GEOMETRY))
            return t

        return replace(layout, thrusters=tuple(map(own, layout.thrusters)))


def vectored(layout: Layout) -> list[Thruster]:
    """Return the thrusters that push both ahead and sideways."""
    return [t for t in layout.thrusters if min(map(abs, t.direction.value[:2])) > FAINT]


def _check_files(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Check that a dive has several files, which are in the folder of rov.toml."""
    if len({*names}) < 2:
        raise ValueError("must be two or more files: a log of one file needs no table")
    for name in names:
        if Path(name).name != name or not (folder_of(info) / name).is_file():
            raise ValueError(f"there is no such file in this folder: {shown(name)}")
    return names


def _check_clocks(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Check that the files of another clock are files of the dive."""
    files = info.data.get("files", names)
    for name in names:
        if name not in files:
            raise ValueError(f"must be of its files, {join_names(files)}: {shown(name)} is not")
    return names


class Dive(Strict):
    """A table [dives.x]: a dive whose commands and measurements are in several files, each with its own times."""

    files: Annotated[tuple[str, ...], AS_TUPLE, AfterValidator(_check_files)]
    """The files, one of which has the commands."""
    other_clock: Annotated[tuple[str, ...], AS_TUPLE, AfterValidator(_check_clocks)] = ()
    """The files whose times come from another clock than the times of the commands."""


def _check_quantities(names: tuple[str, ...]) -> tuple[str, ...]:
    """Check the names of quantities, each of which may begin with a minus."""
    for name in names:
        if (quantity := name.removeprefix("-")) not in QUANTITIES:
            raise ValueError(
                f"there is no such quantity{only(quantity, QUANTITIES, join_names(QUANTITIES))}: {shown(name)}"
            )
    return names


_Flagged = Annotated[
    tuple[str, ...],
    AS_TUPLE,
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),
    AfterValidator(_check_quantities),
]


def _check_axes(names: tuple[str, ...]) -> tuple[str, ...]:
    """Check the names of axes."""
    for name in names:
        if name not in AXES:
            raise ValueError(f"must name axes{only(name, AXES, join_names(AXES))}: {shown(name)}")
    return names


_ArmToFit = to_fit(Arm)
_AxesToFit = table_model("Axes", Axes, {name: (to_fit(table) | None, None) for name, table in AXIS_TABLES.items()})


class RovTables(Tables):
    """The tables of rov.toml that could be read."""

    arm: _ArmToFit | None = None  # type: ignore[valid-type]
    curves: dict[Symbol, CurveToFit] = Field(default={}, max_length=MOST_OF_A_KIND)
    axes: _AxesToFit | None = None  # type: ignore[valid-type]
    base: _VehicleFile | None = None
    """The vehicle file to begin from."""
    vehicle: Head | None = None
    known: dict[str, Quantity] = Field(default={})
    windows: dict[str, _Window] = Field(default={})
    """The range of commands that count, by axis or by thrust_<curve>; rows outside have weight 0 in (7)."""
    validity: Validity | None = None
    against: Any = None
    limits: Any = None
    fit: Requests = Requests()
    geometry: Geometry | None = None
    priors: dict[str, _Deviation] = Field(default={})
    """The deviations of priors by their keys (docs/identify-method.md); 0 means that a number is exact."""
    columns: dict[str, str] = Field(default={})
    """What the headers of CSV files stand for: other headers."""
    topics: dict[str, str] = Field(default={})
    """What the fields of topics stand for: headers of a CSV file."""
    valid: dict[str, _Flagged] = Field(default={})
    """The quantities that are measured only where a column or a field is true, by its name."""
    leave_out: dict[str, Annotated[tuple[str, ...], AS_TUPLE, AfterValidator(_check_axes)]] = Field(default={})
    """The axes about which a log tells nothing that counts, by the file of the log."""
    dives: dict[str, Dive] = Field(default={})
    """The dives of several files, by name."""
    logs: LogKeys = LogKeys()
    """What the logs do not tell."""

    @property
    def has_wrench(self) -> bool:
        """True where the commands of the logs are a wrench: the file says so, or has [body] and no thrusters."""
        has_thrusters = self.base or self.arm or self.thruster or self.curves or self.inputs or self.fin
        return bool(self.logs.wrench or (self.body and not has_thrusters))


class _WholeTables(RovTables):
    """The tables of a rov.toml without a mistake."""

    vehicle: Head


# ---- The description -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Draft:
    """A rov.toml that nobody wrote: what the logs tell, and a vehicle that is assumed."""

    text: str
    """The content of the file."""
    reason: str
    """Why this vehicle is assumed, such as `it has 6 thrusters`; empty if the user names it."""


@dataclass(frozen=True)
class Description:
    """The vehicle as rov.toml describes it, before any test is read."""

    path: Path
    """The path of rov.toml."""
    tables: RovTables
    """The tables of the file; [vehicle] is None where it has a mistake."""
    layout: Layout
    """The largest layout that the vehicle can have: every axis that its thrusters drive, and every coefficient that is
    known."""
    axes: tuple[str, ...]
    """The names of the axes that the base or the file declares, whether or not they are tested."""
    known: Mapping[str, Quantity]
    """The coefficients that the file itself gives, by their names in the FMU."""
    named: tuple[str, ...]
    """The names of all coefficients in the file, including those whose entry has a mistake."""
    base_quantities: Mapping[str, Quantity]
    """The coefficients that the base gives; tests replace them."""
    requests: Requests
    """What is fitted on request, with the names of the curves."""
    measured_at: Mapping[str, float]
    """The voltage at which the thrust of a curve was measured, V, where it is given and thrust depends on it."""
    limits: tuple[str, ...]
    """Sentences about what the model leaves out."""
    base_name: str
    """The name of the base; empty without one."""
    assumed: str = ""
    """Why the base is assumed; empty where a user names it."""
    thrusters: Layout | None = None
    """The thrusters that give the forces on the body, where the logs have these forces and the file has the thrusters.
    `layout` then has the forces in their place."""

    @property
    def has_hardware_tables(self) -> bool:
        """True if the file itself describes the thrusters; otherwise they are those of the base or of the paper."""
        return not self.base_name and bool(self.tables.thruster)

    @cached_property
    def widest(self) -> Layout:
        """The layout with every coefficient that a vehicle with these axes and curves could have."""
        return self.layout.with_keys(lambda *_: True)

    @cached_property
    def unknown(self) -> list[str]:
        """The names of the coefficients in the file that no such vehicle has."""
        return [name for name in self.named if name not in self.widest.coefficients]

    @cached_property
    def logged(self) -> Layout:
        """The layout with the axes of which a log of several axes may have recordings.

        Every autopilot logs roll and pitch. They become recordings only if the file declares these axes. Otherwise they
        are conditions of other recordings. Neither does an axis that the thrusters drive only together with others,
        such as sway by a toe-in.
        """
        forms = [form for form in self.layout.axes if form.axis.name in self.axes or form.axis not in (ROLL, PITCH)]
        undriven = {axis for axis, _ in undriven_axes(replace(self.layout, axes=tuple(forms)))}
        return replace(self.layout, axes=tuple(f for f in forms if f.axis.name in self.axes or f.axis not in undriven))


@dataclass(frozen=True)
class RovFile:
    """What could be read of rov.toml."""

    description: Description | None
    """None where a mistake leaves the hardware unknown."""
    mistakes: Sequence[str]
    """A line for every mistake."""
    tables: RovTables
    explains_files: bool
    """False if a mistake in one of these tables leaves the content of the files unknown."""

    @property
    def layout(self) -> Layout | None:
        """The largest layout that the vehicle can have; None where it is unknown."""
        return self.description.layout if self.description else None


NO_ROV_FILE = RovFile(None, (), RovTables(), explains_files=True)
"""What there is without a rov.toml."""


def read_rov_file(path: Path, base: Path | None = None, draft: Draft | None = None) -> RovFile:
    """Read rov.toml, or a draft in its place. `base` replaces the one that it names. Raises VehicleFileError where
    there is no such file, or where it is not TOML."""
    data = parse_toml(path, draft.text.encode(), VehicleFileError) if draft else read_toml(path, VehicleFileError)
    context = {"folder": path.parent}
    data |= {"base": base} if base else {}
    file, problems, lost = read_tables(data, RovTables, _WholeTables, context)
    vehicle, base_mistakes = None, list[str]()
    try:
        vehicle = load_vehicle(file.base) if file.base else None
    except VehicleFileError as error:
        base_mistakes = str(error).splitlines()
    mistakes = [*_hardware_mistakes(file, lost, data)]
    description, of_hardware = None, {"base", "axes", *_HARDWARE_TABLES}
    if not (base_mistakes or mistakes or lost & of_hardware or _misspelt(lost, _HARDWARE_TABLES)):
        description = _describe(path, file, data, vehicle)
        description = replace(description, assumed=draft.reason if draft else "")
        # _mistakes reports an unknown name in [known]; problems with its value would only repeat that.
        unknown = {("known", name) for name in description.unknown}
        problems = [problem for problem in problems if problem["loc"][:2] not in unknown]
        mistakes = [*_mistakes(file, lost, description)]
    lines = lines_on(path, (*problem_lines(problems, data, RovTables), *mistakes))
    explains_files = not (lost & {*_FILE_TABLES} or _misspelt(lost, _FILE_TABLES))
    return RovFile(description, lines + base_mistakes, file, explains_files)


def _misspelt(lost: Iterable[str], tables: Collection[str]) -> bool:
    """Return True if the name of an unknown table is similar to one of these, such as [boddy] to [body]."""
    return any(similar(name, tables) for name in lost if name not in RovTables.model_fields)


def _hardware_mistakes(file: RovTables, lost: set[str], data: Toml) -> Iterator[str]:
    """Yield a line for every mistake in the hardware tables."""
    present = [name for name in _HARDWARE_TABLES if name in data]
    unused = [f"curves.{name}.electric_current" for name, curve in file.curves.items() if curve.electric_current]
    unused += [name for name in ("surface", "current", "waves") if name in data]
    reason = "identification does not use it. Add it to the identified vehicle file instead"
    yield from (key_line(place, reason) for place in unused)
    if file.geometry and "base" not in data:
        yield key_line("geometry", "is only allowed with base: write direction and position into [[thruster]]")
    if "base" in data:
        for name in present:
            own = {*data[name]} - {"coupling"} if name == "body" and isinstance(data[name], dict) else {name}
            if own:
                but = ", except coupling" if name == "body" else ""
                reason = (
                    f"is not allowed together with base, which has its own{but}; coefficients may be given in [known]"
                )
                yield key_line(name, reason)
        if file.logs.wrench:
            yield key_line("logs.wrench", "is not allowed with base: write its hardware tables here", True)
        return
    for name in ("curves", "thruster") if {*present} - {"body"} else ():
        if name not in data or data[name] in ({}, []):
            form = "[[thruster]]" if name == "thruster" else "[curves.<name>]"
            yield key_line(name, f"this table is missing, and there is {present[0]}: write {form}")
    if {"curves", "thruster"} <= data.keys():
        yield from check_names_and_keys(file, lost, data)
        if file.logs.wrench and not lost & {"curves", "arm"}:
            yield from check_tables_of_thrust(file)  # forces on the body tell no number of the thrusters
            for name, quantity in file.quantities(file.layout).items():
                if quantity is None and name in ARM:
                    yield key_line(f"arm.{name}", "this key is missing, and a thruster has the key arm")


def _describe(path: Path, file: RovTables, data: Toml, base: Vehicle | None) -> Description:
    """Put together the description from the parts of the file and the base."""
    own_layout = file.layout
    start = base.layout if base else _start(file)
    if base and file.body:
        start = replace(start, coupled=file.body.coupling)
    if base and file.geometry:
        start = file.geometry.placed(start)
    start = replace(start, thrusters=tuple(t.opposite if t.name in file.logs.mounted else t for t in start.thrusters))
    known_names = [*data["known"]] if isinstance(data.get("known"), dict) else []
    axis_keys = {form.axis.name: form.keys for form in own_layout.axes}
    layout = _largest_layout(start, axis_keys)
    # With `[fit] voltage`, V_0 belongs to the effect that is fitted.
    names = {curve.name_of("V_0"): curve.name for curve in layout.curves if file.fit.voltage}
    layout = layout.extended({*known_names} - names.keys())
    curves = tuple(curve.name for curve in layout.curves)
    given = {name: quantity for name, quantity in file.quantities(layout).items() if quantity} | dict(file.known)
    return Description(
        path=path,
        tables=file,
        layout=layout,
        axes=tuple(name for name in AXES if name in start.by_name or name in own_layout.by_name),
        known={name: quantity for name, quantity in given.items() if name in layout.coefficients},
        named=tuple(dict.fromkeys([*given, *known_names])),
        base_quantities=_quantities(base.with_(layout)) if base else _thrust_about(file, layout),
        requests=file.fit.model_copy(update={"lag": curves}) if file.fit.lag is True else file.fit,
        measured_at={names[name]: file.known[name].value for name in names.keys() & file.known.keys()},
        limits=file.validity.limits if file.validity else base.limits if base else (),
        base_name=(shipped_name(name) or name.name) if isinstance(name := data.get("base", ""), Path) else name,
        thrusters=own_layout if file.logs.wrench and file.thruster else None,
    )


def _start(file: RovTables) -> Layout:
    """Return the layout to begin with, of a file without a base."""
    own = file.layout
    if file.has_wrench:
        forms = own.axes or tuple(map(VehicleAxis, (SURGE, SWAY, HEAVE, YAW)))
        return replace(Layout.of_wrench(forms), coupled=own.coupled, restoring=own.restoring, cross=own.cross)
    if file.thruster:
        return own
    paper = load_vehicle(VIDEORAY).layout
    thrusters = [replace(one, direction=one.direction._replace(source=_FORM)) for one in paper.thrusters]
    return replace(paper, thrusters=tuple(thrusters))


def _quantities(vehicle: Vehicle) -> dict[str, Quantity]:
    """Return the coefficients that a vehicle's file gives."""
    declarations = vehicle.layout.coefficients
    return {
        name: Quantity(value=vehicle[name], unit=declarations[name].unit, source=one.source, interval=one.interval)
        for name, one in vehicle.basis.items()
        if one.source != NOT_GIVEN
    }


def _thrust_about(file: RovTables, layout: Layout) -> dict[str, Quantity]:
    """Return the coefficients of the curves whose force at full command the file tells about."""
    curves = layout.curves_by_name
    own = ((curves[name], curve.guess) for name, curve in file.curves.items() if name in curves)
    return {curve.name_of(key): quantity for curve, guess in own for key, quantity in guess.items()}


def _largest_layout(layout: Layout, axis_keys: Mapping[str, tuple[str, ...]]) -> Layout:
    """Add every axis that the thrusters drive, and the keys of the file's own axis tables."""
    forms = []
    for name, axis in AXES.items():
        if layout.signs(axis) or name in layout.by_name or name in axis_keys:
            form = layout.by_name.get(name, VehicleAxis(axis))
            forms.append(VehicleAxis(axis, (*form.keys, *axis_keys.get(name, ()))))
    return replace(layout, axes=tuple(forms))


# ---- Mistakes that depend on the vehicle's hardware ------------------------------------------------------------------


def _mistakes(file: RovTables, lost: set[str], description: Description) -> Iterator[str]:
    """Yield a line for every unknown name, impossible number, and missing half of a pair."""
    layout = description.layout
    yield from check_distinct_names(description.widest)  # effects come and go during the identification
    yield from _unknown_effects(layout, description.base_name)
    if thrusters := description.thrusters:  # one table is used as it is
        untold = tuple(replace(curve, tables=curve.tables[1:]) for curve in thrusters.curves)
        yield from _unknown_effects(replace(thrusters, curves=untold), "")
    yield from _mistakes_in_known(file, description)
    if "known" not in lost:
        yield from _missing_halves(file, description)
    yield from _doubled_thrust(file, description)
    yield from _mistakes_in_logs(file.logs, layout)
    windows = [*(f"thrust_{curve.name}" for curve in layout.curves), *layout.by_name]
    for name in file.windows:
        if name not in windows:
            yield key_line(f"windows.{name}", f"there is no such key{only(name, windows, join_names(windows))}")
    curves, requests = layout.curves_by_name, description.requests
    asked = {"lag": ("T", requests.lag), "voltage": ("n_V", tuple(curves) if requests.voltage else ())}
    for key, (coefficient, requested) in asked.items():
        for name in requested:
            if name not in curves:
                yield key_line(f"fit.{key}", f"there is no such curve{only(name, curves, join_names(curves))}", name)
            elif (given := curves[name].name_of(coefficient)) in description.named:
                yield key_line(f"fit.{key}", f"{given} is given, so it cannot be fitted too", name)
    if requests.attitude and (own := [name for name in ("roll", "pitch") if name in description.axes]):
        yield key_line("fit.attitude", f"the vehicle has the axis {join_names(own)}, which is simulated: leave it out")


def _mistakes_in_logs(keys: LogKeys, layout: Layout) -> Iterator[str]:
    """Yield a line for each name in [logs] that is no thruster's, or that of one without a direction to turn round."""
    names = [thruster.name for thruster in layout.thrusters]
    fixed = names if layout.has_wrench else [thruster.name for thruster in layout.thrusters if thruster.arm]
    for key, some in (("reversed", keys.reversed), ("mounted", keys.mounted)):
        for name in some:
            if name not in names:
                yield key_line(f"logs.{key}", f"there is no such thruster{only(name, names)}", name)
            elif key == "mounted" and name in fixed:
                yield key_line("logs.mounted", "has an arm, or is a force on the body: name it in reversed", name)


_UNKNOWN_EFFECTS = {
    "table": "identification fits a_t and b_t in place of a table",
    "V_0": "identification fits the effect of the voltage if [fit] has `voltage`",
}
"""Keys of a thrust curve, and what identification does instead of using them."""
_FITTED = {"a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "c_0_reverse", "T", "k_t", "n_V", "d", "d_reverse"}
"""The keys of a thrust curve that identification fits."""


def _unknown_effects(layout: Layout, base: str) -> Iterator[str]:
    """Yield a line for each effect that identification does not use, and that would make its coefficients wrong.

    The effects are those of rov.toml or of its `base`.
    """
    found: dict[str, str] = {}
    for curve in layout.curves:
        keys = (*curve.keys, *(["table"] if curve.tables else []))
        for key in (key for key in keys if key not in _FITTED):
            found[f"curves.{curve.name}.{key}"] = _UNKNOWN_EFFECTS.get(key, f"identification does not fit {key}")
    if layout.has_dead_time:
        found["commands.T_d"] = "identification finds delays itself"
    if layout.pulse:
        found["commands.pulse"] = "each log says itself what its commands are"
    for key, reason in found.items():
        if base:
            yield key_line("base", f"this vehicle has {key}, but {reason}. Remove it in a copy of the file", base)
        else:
            yield key_line(key, f"{reason}. Leave it out here, and add it to the vehicle file later")


def _mistakes_in_known(file: RovTables, description: Description) -> Iterator[str]:
    possible, unknown = description.widest.coefficients, description.unknown
    for name in unknown[:MOST]:
        yield key_line(f"known.{name}", f"there is no such coefficient of this vehicle{did_you_mean(name, possible)}")
    for _ in unknown[MOST:]:
        yield ""  # is only counted
    yield from check_quantities("known", {name: q for name, q in file.known.items() if name in possible}, possible)
    tables = description.layout.keys_in_file
    for name, quantity in file.quantities(description.layout).items():
        if quantity and name in file.known:
            yield key_line(f"known.{name}", f"is given in [{'.'.join(tables[name][:-1])}] too")


def _doubled_thrust(file: RovTables, description: Description) -> Iterator[str]:
    """Yield a line for each curve whose force at full command is told beside its coefficients."""
    for name, curve in file.curves.items():
        if curve.thrust and (own := description.layout.curves_by_name.get(name)):
            given = [a for a in map(own.coefficient, ("a_t", "b_t")) if a in description.named]
            if given:
                yield key_line(f"curves.{name}.thrust", f"leave it out, because {join_names(given)} is given")


def _missing_halves(file: RovTables, description: Description) -> Iterator[str]:
    """Yield a line for each coefficient without its partner, unless check_names_and_keys reports it already."""
    given, tables = {*description.base_quantities, *description.known}, description.layout.keys_in_file
    parts: tuple[Part, ...] = (*description.layout.curves, *description.layout.axes)
    for part in parts:
        for keys in _PAIRS:
            name, other = map(part.name_of, keys)
            if name in given and other not in given and (name in file.known or not keys[0].endswith(REVERSE)):
                table = "known" if name in file.known else ".".join(tables[name][:-1])
                yield key_line(table, f"{name} is given, but {other} is not")


_THRUST, _DRAG = (("a_t", "b_t"), ("b_t", "a_t")), (("a_d", "b_d"), ("b_d", "a_d"))
_IN_REVERSE = tuple((one + REVERSE, other + REVERSE) for one, other in (*_THRUST, *_DRAG))
_PAIRS = (*_THRUST, *_IN_REVERSE, (f"c_0{REVERSE}", "c_0"))
"""The keys of coefficients of which the first needs the second."""
