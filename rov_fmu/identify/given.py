"""Reduce the vehicle that rov.toml describes to the part that can be identified from the tests."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rov_fmu.equation.catalogue import (
    ARM,
    AXES,
    AXIS,
    COUPLED_AXES,
    CURVE,
    REVERSE,
    YAW,
    Axis,
)
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.kinds import KINDS
from rov_fmu.io.messages import lines_on, listed
from rov_fmu.io.toml_file import key_line
from rov_fmu.tank.description import Description
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.folder import Folder
from rov_fmu.tank.readers.tank_tables import Row
from rov_fmu.vehicle.geometry import check_layout, check_thruster_places
from rov_fmu.vehicle.quantity import Quantity


@dataclass(frozen=True, eq=False)
class Tests:
    """All tests of a folder, and what is known about their vehicle before the identification."""

    folder: Folder
    """Its findings also tell what was left out of the vehicle and of the files, and its inputs have the base, too."""
    logged: Collection[str]
    """The names of the axes that logs test."""
    axes: Collection[str]
    """The names of all axes that are tested."""
    layout: Layout
    """The axes that are tested or known, and the thrusters that act on them. Of the coefficients to be identified, it
    has only those that every curve and axis needs. The fits add reverse thrust, dead band, lag and load if they find
    them."""
    known: Mapping[str, Quantity]
    """The coefficients that are given, not identified."""
    base: Mapping[str, float]
    """The coefficients of the base and those that are known: the centre of the prior."""
    thrusters: Layout | None
    """The thrusters that give the forces of a wrench along these axes; None where rov.toml does not say."""

    @property
    def description(self) -> Description:
        """The vehicle as rov.toml describes it."""
        assert self.folder.rov_file.description
        return self.folder.rov_file.description

    def rows(self, kind: str) -> Iterator[tuple[str, Sequence[Row]]]:
        """Yield the curves or axes of the vehicle that have a table of this kind, with its rows."""
        names = self.layout.curves_by_name if kind == "thrust" else self.layout.by_name
        for (other, subject), some in self.folder.rows.items():
            if other == kind and subject in names:
                yield subject, some


def narrowed(
    folder: Folder,
    description: Description,
    logged: Collection[str],
    tested: Collection[str],
    useless: Sequence[str],
) -> Tests | None:
    """Reduce the vehicle to the axes that are tested or known, and check that nothing is missing.

    The mistakes are added to those of the folder, and there is no vehicle then. `logged` has the axes that logs test,
    `tested` all that are tested, and `useless` a line for each log that tests nothing. What is left out of the vehicle
    is told first.
    """
    known = {**_kept_from_base(folder, description, logged), **description.known}
    wide = _without_unknown_options(description.layout, known)
    axes = [a for a in wide.bare_axes if a.name in tested or {a.coefficient("a_d"), a.coefficient("b_d")} <= {*known}]
    layout = with_axes_alone(wide, axes)
    if not layout.axes:
        line = f"{folder.path}: no axis is tested: there is no steady_, time_constant_ or log_ file of one"
        folder.mistakes += useless or [line]
        return None
    hardware = [*check_thruster_places(_with_axes(wide, axes))] or [*check_layout(layout)]
    own = None
    if description.thrusters:
        own = replace(description.thrusters, axes=layout.axes)
        if wrong := [*check_thruster_places(own)]:
            hardware += wrong
        else:
            own = with_axes_alone(own, axes)
            hardware += check_layout(own, tested)
    hardware += _missing_hardware(description, layout, known)
    tests = [*_missing_or_doubled_tests(folder, description, logged, layout, known)]
    if hardware or tests or description.tables.vehicle is None:
        folder.rov_file_mistakes += lines_on(description.path, hardware)
        folder.mistakes += lines_on(folder.path, tests)
        return None
    folder.findings[:0] = _left_out(folder, description, layout)
    return Tests(
        folder=folder,
        logged=logged,
        axes=tested,
        layout=layout,
        known={name: known[name] for name in layout.coefficients if name in known},
        base={name: q.value for name, q in {**description.base_quantities, **known}.items()},
        thrusters=own,
    )


def _kept_from_base(folder: Folder, description: Description, logged: Collection[str]) -> dict[str, Quantity]:
    """Return the coefficients of the base that no test replaces."""
    replaced: set[str] = set()
    thrust, steady, times = (folder.astern(kind) for kind in ("thrust", "steady", "time_constant"))
    for curve in description.layout.curves:
        if curve.name in description.requests.lag:
            replaced.add(curve.name_of("T"))
        if curve.name in thrust:
            whole_curve = thrust[curve.name] or f"a_t{REVERSE}" not in curve.keys
            keys = [key for key in CURVE if key != "T"] if whole_curve else ["a_t", "b_t"]
            replaced |= {*map(curve.name_of, keys)}
    for form in description.layout.axes:
        name = form.axis.name
        tests = {"log": name in logged, "steady": name in steady, "time_constant": name in times}
        tests["astern"] = steady.get(name, False)
        told = (kind for kind in KINDS.values() if any(map(tests.get, kind.told_by)))
        replaced |= {form.name_of(key) for kind in told for key in kind.keys}
    return {name: quantity for name, quantity in description.base_quantities.items() if name not in replaced}


# ---- The reduced layout ----------------------------------------------------------------------------------------------


def _without_unknown_options(layout: Layout, known: Collection[str]) -> Layout:
    """Drop the coefficients that a vehicle need not have, unless they are known, and the surface with its waves: many
    logs have no depth, or count it from elsewhere, and would be taken to be in the air."""
    kinds = AXIS | CURVE
    deep = replace(layout, surface=False, waves=False)
    return deep.with_keys(lambda part, key: key in part.keys and (kinds[key].needed or part.name_of(key) in known))


def _with_axes(layout: Layout, axes: Collection[Axis]) -> Layout:
    return replace(layout, axes=tuple(form for form in layout.axes if form.axis in axes))


def with_axes_alone(layout: Layout, axes: Collection[Axis]) -> Layout:
    """Keep these axes, the thrusters and fins that act on them, and the curves and inputs of these."""
    layout = _with_axes(layout, axes)
    thrusters = tuple(t for t in layout.thrusters if any(t in layout.thrusters_along(axis) for axis in axes))
    fins = tuple(fin for fin in layout.fins if any(fin.effect(axis) for axis in axes))
    names = {one.name for one in (*thrusters, *fins)}
    gains_of = ((name, {one: gains[one] for one in gains if one in names}) for name, gains in layout.mix.items())
    layout = replace(
        layout,
        thrusters=thrusters,
        fins=fins,
        mix={name: gains for name, gains in gains_of if any(gains.values())},
        coupled=layout.coupled and all(map(layout.has, COUPLED_AXES)),
    )
    # An input that drives none of the axes has gains that cancel each other.
    driving = {name for axis in axes for name in layout.signs(axis)}
    driving |= {name for fin in fins for name in layout.gains[fin.name]}
    kept = {name: gains for name, gains in layout.mix.items() if f"u_{name}" in driving}
    driven = {name for gains in kept.values() for name, gain in gains.items() if gain} if layout.mix else names
    thrusters = tuple(thruster for thruster in thrusters if thruster.name in driven)
    curves = {thruster.curve for thruster in thrusters}
    curves_left = tuple(curve for curve in layout.curves if curve.name in curves)
    return replace(layout, mix=kept, thrusters=thrusters, curves=curves_left)


def thrusters_along_no_other(layout: Layout, axes: Collection[Axis], kept: Collection[Axis]) -> list[str]:
    """Return the names of the thrusters that drive some axes, and none of those that a vehicle keeps."""
    driving = {thruster.name for axis in kept for thruster in layout.thrusters_along(axis)}
    along = dict.fromkeys(thruster.name for axis in axes for thruster in layout.thrusters_along(axis))
    return [] if layout.has_wrench else [name for name in along if name not in driving]


def with_unseen_axes(tests: Tests, shown: Collection[Axis]) -> Layout:
    """Return the layout, also with the axes about which nothing is known but on whose motion those shown depend.

    The thrusters that turn a vehicle in a dive move it along these axes, too, and this motion takes thrust from them.
    Without a turn, such an axis takes thrust from no other. An axis is left out where more thrusters push along it. If
    the axes are coupled, unseen motion would turn the vehicle by moments that nothing tells, so none is added.
    """
    layout, wide = tests.layout, _without_unknown_options(tests.description.layout, tests.known)

    def is_unseen(axis: Axis) -> bool:
        pushing = {*wide.thrusters_along(axis)}
        return not axis.is_rotation and axis.inertia in tests.base and bool(pushing) and pushing <= {*layout.thrusters}

    axes = [axis for axis in wide.bare_axes if layout.has(axis) or is_unseen(axis)]
    turns = any(axis.is_rotation for axis in shown)
    is_whole = wide.coupled or not turns or len(axes) == len(layout.axes)
    return layout if is_whole else with_axes_alone(wide, axes)


def _left_out(folder: Folder, description: Description, layout: Layout) -> Iterator[Finding]:
    """Yield a finding for each part that is described or tested but not in the layout."""
    for name in dict.fromkeys([*description.axes, *description.logged.by_name]):
        if name not in layout.by_name:
            drag = ", ".join(AXES[name].coefficient(key) for key in ("a_d", "b_d"))
            yield Finding("axis left out", axis=name, words={"drag": drag})
    if layout.fins:
        yield Finding("fins not fitted", words={"fins": listed([fin.name for fin in layout.fins])})
    if description.layout.coupled and not layout.coupled:
        yield Finding("not coupled")
    for (kind, name), (file, *_) in folder.files.items():
        if kind == "thrust" and name not in layout.curves_by_name:
            yield Finding("unused curve", curve=name, file=file)


# ---- Missing and doubled coefficients --------------------------------------------------------------------------------


def _missing_hardware(description: Description, layout: Layout, known: Collection[str]) -> Iterator[str]:
    """Yield a line for each missing mass or dimension, which no test determines."""
    needed: dict[str, Axis] = {form.axis.inertia: form.axis for form in reversed(layout.axes)}
    if layout.has_arm:
        needed |= dict.fromkeys(ARM, YAW)
    for name in layout.coefficients:
        if name in needed and name not in {*known, *description.named}:
            form = f'{name} = {{ value = ..., unit = "{layout.coefficients[name].unit}", source = "..." }}'
            table = ("arm" if name in ARM else "body") if description.has_hardware_tables else "known"
            yield key_line(f"{table}.{name}", f"this key is missing, and the vehicle has {needed[name].name}: {form}")


def _missing_or_doubled_tests(
    folder: Folder, description: Description, logged: Collection[str], layout: Layout, known: Collection[str]
) -> Iterator[str]:
    """Yield a line for each coefficient that neither a test nor rov.toml gives, and for each that both give."""
    thrust, steady = folder.astern("thrust"), folder.astern("steady")
    for curve in layout.curves:
        names = curve.coefficient("a_t"), curve.coefficient("b_t")
        if curve.name not in thrust:
            if not {*names} & {*known, *description.named}:
                how = f"no thrust_{curve.name}*.csv, and [known] in rov.toml does not give {names[0]}"
                about = f'. About will do: thrust = {{ about = 14.0, unit = "N" }} in [curves.{curve.name}]'
                yield f"{how}{about if curve.name in description.tables.curves else ''}"
            continue
        reverse_names = tuple(curve.name_of(f"{key}{REVERSE}") for key in ("a_t", "b_t"))
        for pair in (names, reverse_names) if thrust[curve.name] else (names,):
            if given := [name for name in pair if name in description.known]:
                yield f"rov.toml gives {', '.join(given)}, but there is {folder.files['thrust', curve.name][0]} too"
    for axis in layout.bare_axes:
        drag = [name for name in (axis.coefficient("a_d"), axis.coefficient("b_d")) if name not in known]
        if drag and axis.name not in {*steady, *logged}:
            yield (
                f"no steady_{axis.name}*.csv or log of {axis.name} that counts, and [known] in rov.toml does not give "
                f"{', '.join(drag)}"
            )
