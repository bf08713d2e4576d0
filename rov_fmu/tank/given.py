"""What rov.toml says of a vehicle before any test: what it has, what is known of it, how its tests count.

What it has comes from one of three places: the vehicle that `base` names, the hardware tables of the vehicle file, or,
without either, the form of the paper. Coefficients that are to be identified are left out.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from rov_fmu.io.messages import MOST, did_you_mean, lines_on
from rov_fmu.io.paths import inside
from rov_fmu.io.toml_file import (
    Strict,
    Toml,
    as_tuple,
    folder_of,
    join_names,
    key_line,
    problem_lines,
    read_toml,
    validate,
)
from rov_fmu.model.layout import AXES, AXIS, CURVE, REVERSE, Axis, Declaration, Layout, VehicleAxis, coefficient_name
from rov_fmu.vehicle.checks import check_names_and_keys, check_quantities, readable_parts
from rov_fmu.vehicle.form import Head, Validity
from rov_fmu.vehicle.paper import PAPER, PAPER_SOURCES
from rov_fmu.vehicle.quantity import Finite, Quantity
from rov_fmu.vehicle.schema import NOT_GIVEN, OpenHardware, where
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle

ROV_FILE = "rov.toml"
_OF_BASE = ("body", "arm", "curves", "thruster", "inputs")
"""Tables that a base has already."""


# ---- The form --------------------------------------------------------------------------------------------------------


def _window(window: tuple[float, float]) -> tuple[float, float]:
    if not -1.0 <= window[0] < window[1] <= 1.0:
        raise ValueError("must be [low, high] within -1 ... 1, fractions of full thrust: 20 % is 0.2")
    return window


_Window = Annotated[tuple[Finite, Finite], BeforeValidator(as_tuple), AfterValidator(_window)]


def _vehicle(name: str, info: ValidationInfo) -> str:
    if not _vehicle_file(name, inside(folder_of(info), name)):
        raise ValueError(
            f"must be a vehicle file in this folder, or one of the vehicles that ship: {', '.join(SHIPPED)}"
            f"{did_you_mean(name, SHIPPED)}"
        )
    return name


def _vehicle_file(name: str, path: Path) -> Path | None:
    """The vehicle file at a path, or the one that ships under the name."""
    return path if os.path.isfile(path) else SHIPPED.get(name)  # noqa: PTH113 (as in form.py)


def _curves(value: object) -> object:
    if value is not True and not (isinstance(value, list) and all(isinstance(name, str) for name in value)):
        raise ValueError("must be true, or a list of curves, each in quotes")
    return value if value is True else tuple(dict.fromkeys(value))


class _Fit(Strict):
    """What is fitted beside thrust, drag and β."""

    lag: Annotated[Any, AfterValidator(_curves)] = ()
    """The curves whose thrusters' lag is to be found; true for all."""


class _Readable(OpenHardware):
    """rov.toml as far as it could be read."""

    base: Annotated[str, AfterValidator(_vehicle)] | None = None
    against: Annotated[str, AfterValidator(_vehicle)] | None = None
    vehicle: Head | None = None
    known: dict[str, Quantity] = Field(default={})
    windows: dict[str, _Window] = Field(default={})
    validity: Validity | None = None
    fit: _Fit = _Fit()


class _RovFile(_Readable):
    vehicle: Head


# ---- What it says ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Said:
    """What rov.toml says."""

    path: Path
    head: Head | None
    layout: Layout
    """What the vehicle may have: every axis that its thrusters drive, with the coefficients that are known besides."""
    axes: tuple[str, ...]
    """Those that it is said to have, tests or not."""
    known: Mapping[str, Quantity]
    """What the file itself gives, by the names in the FMU."""
    named: tuple[str, ...]
    """What it gives or tries to give."""
    of_base: Mapping[str, Quantity]
    """What the base gives: tests stand instead of it."""
    thruster_sources: Mapping[str, Mapping[str, str]]
    windows: Mapping[str, tuple[float, float]]
    lag: tuple[str, ...]
    command_range: tuple[float, float] | None
    limits: tuple[str, ...]
    base: Path | None
    base_name: str
    """As it stands in the file."""
    against: Path | None


def read_said(path: Path) -> tuple[Said | None, list[str]]:
    """What rov.toml says, and a line for every mistake in it; None where it does not tell what the vehicle has.

    Raises VehicleFileError where there is no such file, or it is not TOML.
    """
    data, context = read_toml(path, VehicleFileError), {"folder": path.parent}
    _, problems = validate(data, _RovFile, **context)
    file, lost = readable_parts(data, problems, context, _Readable)
    base, of_base = _base(file, path.parent)
    of_hardware = [*_hardware(file, lost, data)]
    said, mistakes = None, of_hardware
    if not (of_base or of_hardware or lost & {"base", "axes", *_OF_BASE}):
        said = _said(path, file, data, base)
        everything = _everything(said.layout)
        strange = {("known", name) for name in said.named if name not in everything}
        problems = [problem for problem in problems if problem["loc"][:2] not in strange]
        mistakes = [*_mistakes(file, lost, said)]
    return said, lines_on(path, (*problem_lines(problems, data, _RovFile), *mistakes)) + of_base


def _base(file: _Readable, folder: Path) -> tuple[Vehicle | None, list[str]]:
    """The vehicle to begin from, and what is wrong with its file."""
    found = _vehicle_file(file.base, folder / file.base) if file.base else None
    try:
        return load_vehicle(found) if found else None, []
    except VehicleFileError as error:
        return None, str(error).splitlines()


def _hardware(file: _Readable, lost: set[str], data: Toml) -> Iterator[str]:
    """A line for what is wrong with the tables that say what the vehicle has."""
    there = [name for name in _OF_BASE if name in data]
    if "base" in data:
        for name in there:
            yield key_line(name, "must not stand beside base, which has its own; coefficients may be given in [known]")
        return
    for name in ("curves", "thruster") if there else ():
        if name not in data or data[name] in ({}, []):
            form = "[[thruster]]" if name == "thruster" else "[curves.<name>]"
            yield key_line(name, f"this table is missing, and there is {there[0]}: write {form}")
    if {"curves", "thruster"} <= data.keys():
        yield from check_names_and_keys(file, lost, data)


def _said(path: Path, file: _Readable, data: Toml, base: Vehicle | None) -> Said:
    own = file.layout
    begun = base.layout if base else own if file.thruster else PAPER
    names = [*(data["known"] if isinstance(data.get("known"), dict) else ())]
    layout = _widened(begun, {form.axis.name: form.keys for form in own.axes}, names)
    known = {name: q for name, q in file.quantities(layout).items() if q} | dict(file.known)
    whose = base.thruster_sources if base else file.thruster_sources if file.thruster else PAPER_SOURCES
    lag = tuple(curve.name for curve in layout.curves) if file.fit.lag is True else file.fit.lag
    against = _vehicle_file(file.against, path.parent / file.against) if file.against else None
    return Said(
        path=path,
        head=file.vehicle,
        layout=layout,
        axes=tuple(name for name in AXES if name in {**begun.kinds, **own.kinds}),
        known={name: q for name, q in known.items() if name in layout.coefficients},
        named=tuple(dict.fromkeys([*known, *names])),
        of_base=_quantities(base) if base else {},
        thruster_sources=whose,
        windows=file.windows,
        lag=lag,
        command_range=file.validity.command_range if file.validity else None,
        limits=file.validity.limits if file.validity else base.limits if base else (),
        base=_vehicle_file(file.base, path.parent / file.base) if file.base else None,
        base_name=file.base or "",
        against=against,
    )


def _quantities(vehicle: Vehicle) -> dict[str, Quantity]:
    """The coefficients of a vehicle that its file gives."""
    metas = vehicle.layout.coefficients
    return {
        name: Quantity(
            value=vehicle.rov[name], unit=metas[name].unit, source=source, interval=vehicle.intervals.get(name)
        )
        for name, source in vehicle.sources.items()
        if source != NOT_GIVEN
    }


def _widened(layout: Layout, tables: Mapping[str, tuple[str, ...]], known: Iterable[str]) -> Layout:
    """With every axis that the thrusters drive, and the coefficients that are known or in the tables of an axis."""
    forms = []
    for axis in _driven(layout, tables):
        form = layout.kinds.get(axis.name, VehicleAxis(axis))
        forms.append(VehicleAxis(axis, (*form.keys, *tables.get(axis.name, ()))))
    return replace(layout, axes=tuple(forms)).extended(known)


def _driven(layout: Layout, also: Iterable[str]) -> Iterator[Axis]:
    """The axes that thrusters drive, and those that the vehicle is said to have."""
    for name, axis in AXES.items():
        if layout.signs(axis) or name in layout.kinds or name in also:
            yield axis


# ---- Mistakes that need to know what the vehicle has -----------------------------------------------------------------


def _mistakes(file: _Readable, lost: set[str], said: Said) -> Iterator[str]:
    """A line for every name that the vehicle does not have, number that it cannot have, and half of a pair."""
    layout, everything = said.layout, _everything(said.layout)
    strange = [name for name in said.named if name not in everything]
    for name in strange[:MOST]:
        yield key_line(f"known.{name}", f"there is no such coefficient of this vehicle{did_you_mean(name, everything)}")
    yield from ("" for _ in strange[MOST:])
    yield from check_quantities("known", {name: q for name, q in file.known.items() if name in everything}, everything)
    tables = dict(where(layout))
    for name in (name for name, q in file.quantities(layout).items() if q and name in file.known):
        yield key_line(f"known.{name}", f"is given in [{'.'.join(tables[name][:-1])}] too")
    if "known" not in lost:
        yield from _halves(file, said)
    windows = [*(f"thrust_{curve.name}" for curve in layout.curves), *layout.kinds]
    for name in file.windows:
        if name not in windows:
            yield key_line(
                f"windows.{name}", f"there is no such key, only {join_names(windows)}{did_you_mean(name, windows)}"
            )
    curves = [curve.name for curve in layout.curves]
    for name in said.lag:
        if name not in curves:
            yield key_line(
                "fit.lag", f"there is no such curve, only {join_names(curves)}{did_you_mean(name, curves)}", name
            )
        elif (T := coefficient_name("T", name)) in said.named:
            yield key_line("fit.lag", f"{T} is given, so it cannot be fitted too", name)


def _everything(layout: Layout) -> dict[str, Declaration]:
    """Every coefficient that the vehicle could have."""
    return replace(
        layout,
        axes=tuple(VehicleAxis(form.axis, tuple(AXIS)) for form in layout.axes),
        curves=tuple(replace(curve, keys=tuple(CURVE)) for curve in layout.curves),
    ).coefficients


def _halves(file: _Readable, said: Said) -> Iterator[str]:
    """One coefficient of a pair without the other, where the tables of the file do not tell already."""
    given, tables = {*said.of_base, *said.known}, dict(where(said.layout))
    for one, other in _pairs(said.layout):
        if one in given and other not in given and (one in file.known or not one.endswith(REVERSE)):
            place = "known" if one in file.known else ".".join(tables[one][:-1])
            yield key_line(place, f"{one} is given, but {other} is not")


def _pairs(layout: Layout) -> Iterator[tuple[str, str]]:
    """Names of coefficients of which the first needs the second."""
    for curve in layout.curves:
        for end in ("", REVERSE):
            a_t, b_t = (coefficient_name(key + end, curve.name) for key in ("a_t", "b_t"))
            yield from ((a_t, b_t), (b_t, a_t))
        yield coefficient_name(f"c_0{REVERSE}", curve.name), coefficient_name("c_0", curve.name)
    for axis in (form.axis for form in layout.axes):
        a_d, b_d = (axis.coefficient(key + REVERSE) for key in ("a_d", "b_d"))
        yield from ((a_d, b_d), (b_d, a_d))
