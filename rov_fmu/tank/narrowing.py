"""From what rov.toml says and what was tested to the vehicle that can be identified, and all that is known of it."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.model.layout import (
    ARM,
    AXES,
    AXIS,
    CURVE,
    REVERSE,
    SURGE,
    SWAY,
    YAW,
    Axis,
    CoefficientKind,
    Layout,
    coefficient_name,
)
from rov_fmu.model.rov import Rov
from rov_fmu.tank.given import Said
from rov_fmu.vehicle.form import Head
from rov_fmu.vehicle.geometry import check_layout, places
from rov_fmu.vehicle.quantity import Quantity

UNKNOWN = 1.0
"""What stands for a coefficient that is yet to be found."""
_COUPLED = (SURGE, SWAY, YAW)


@dataclass(frozen=True)
class Given:
    """What is given beforehand of the vehicle that the tests lead to."""

    head: Head
    rov: Rov
    """What it has: axes that were tested or are known, and the thrusters that act on them. Its numbers are those known,
    1 for those to be found. Of what is to be found only the coefficients are there that every curve and axis has; fits
    add reverse, dead band, lag, load where they find them."""
    known: Mapping[str, Quantity]
    """Coefficients of it that are given, not identified."""
    thruster_sources: Mapping[str, Mapping[str, str]]
    """Where direction and position of each thruster come from."""
    lag: tuple[str, ...]
    """Curves whose thrusters' lag is to be found."""
    windows: Mapping[str, tuple[float, float]]
    """Of thrust_<curve> and of axes by their names: rows at commands outside weigh nothing, (7)."""
    command_range: tuple[float, float] | None
    against: Path | None
    """A vehicle file to set beside."""
    base: Path | None = None
    """A vehicle file that gives what the tests do not."""
    base_name: str = ""
    """As rov.toml has it."""
    limits: tuple[str, ...] = ()
    """What was found of the vehicle that the model leaves out, in sentences."""


@dataclass(frozen=True)
class Tested:
    """What a folder tests."""

    thrust: Mapping[str, tuple[str, bool]]
    """By curve: a file, and whether commands below zero count."""
    steady: Mapping[str, bool]
    """By axis: whether commands below zero count."""
    time_constants: Collection[str]
    """By axis, as the next."""
    logs: Collection[str]

    @property
    def axes(self) -> set[str]:
        """All that are tested."""
        return {*self.steady, *self.time_constants, *self.logs}


def narrowed(said: Said, tested: Tested, folder: Path) -> tuple[Given | None, list[str], list[str]]:
    """What is given, a line for all that is missing or too much, and notes on what is left out."""
    known = {**_kept(said, tested), **said.known}
    wide = _without(said.layout, {*known})
    axes = [form.axis for form in wide.axes if _can_be(form.axis, tested, known)]
    layout = _narrow(wide, axes)
    if not layout.axes:
        return None, [f"{folder}: no axis is tested: there is no steady_, time_constant_ or log_ file of one"], []
    unplaced = [*places(_with(wide, axes))] or [*check_layout(layout)]
    mistakes = [f"{said.path}: {words}" for words in (*unplaced, *_missing(said, layout, known))]
    mistakes += [f"{folder}: {words}" for words in _too_little(said, tested, layout, known)]
    if mistakes or said.head is None:
        return None, mistakes, []
    return _given(said, said.head, layout, known), [], [*_left_out(said, tested, layout)]


def _given(said: Said, head: Head, layout: Layout, known: Mapping[str, Quantity]) -> Given:
    names = layout.coefficients
    return Given(
        head=head,
        rov=Rov(layout, {name: known[name].value if name in known else UNKNOWN for name in names}),
        known={name: known[name] for name in names if name in known},
        thruster_sources={t.name: said.thruster_sources[t.name] for t in layout.thrusters},
        lag=tuple(curve.name for curve in layout.curves if curve.name in said.lag),
        windows=said.windows,
        command_range=said.command_range,
        against=said.against,
        base=said.base,
        base_name=said.base_name,
        limits=said.limits,
    )


# ---- What tests stand instead of -------------------------------------------------------------------------------------


def _kept(said: Said, tested: Tested) -> dict[str, Quantity]:
    """What the base gives and no test finds anew."""
    gone = {coefficient_name("T", name) for name in said.lag}
    for curve in said.layout.curves:
        if curve.name in tested.thrust:
            _, backward = tested.thrust[curve.name]
            whole = backward or f"a_t{REVERSE}" not in curve.keys
            keys = [key for key in CURVE if key != "T"] if whole else ["a_t", "b_t"]
            gone |= {coefficient_name(key, curve.name) for key in keys}
    for axis in (form.axis for form in said.layout.axes):
        logged, backward = axis.name in tested.logs, tested.steady.get(axis.name, False)
        drag = ["a_d", "b_d"] if logged or axis.name in tested.steady else []
        drag += ["a_d_reverse", "b_d_reverse"] if logged or backward else []
        drag += ["F_0"] if logged else []
        drag += ["beta"] if logged or axis.name in tested.time_constants else []
        gone |= {axis.coefficient(key) for key in drag}
    return {name: q for name, q in said.of_base.items() if name not in gone}


# ---- What is left of the vehicle -------------------------------------------------------------------------------------


def _without(layout: Layout, known: Collection[str]) -> Layout:
    """Without the coefficients that a vehicle need not have, where they are not known."""

    def left(keys: tuple[str, ...], kinds: Mapping[str, CoefficientKind], of: str) -> tuple[str, ...]:
        return tuple(key for key in keys if kinds[key].needed or coefficient_name(key, of) in known)

    axes = tuple(replace(form, keys=left(form.keys, AXIS, form.axis.velocity)) for form in layout.axes)
    curves = tuple(replace(curve, keys=left(curve.keys, CURVE, curve.name)) for curve in layout.curves)
    return replace(layout, axes=axes, curves=curves)


def _can_be(axis: Axis, tested: Tested, known: Collection[str]) -> bool:
    """Whether an axis is tested or known."""
    return axis.name in tested.axes or {axis.coefficient("a_d"), axis.coefficient("b_d")} <= {*known}


def _with(layout: Layout, axes: Collection[Axis]) -> Layout:
    return replace(layout, axes=tuple(form for form in layout.axes if form.axis in axes))


def _narrow(layout: Layout, axes: Collection[Axis]) -> Layout:
    """With these axes alone: without thrusters that act on none of them, curves and inputs that no thruster has."""
    layout = _with(layout, axes)
    thrusters = tuple(t for t in layout.thrusters if any(t in layout.drivers(axis) for axis in axes))
    names, curves = {t.name for t in thrusters}, {t.curve for t in thrusters}
    mix = {
        name: {driven: gain for driven, gain in gains.items() if driven in names} for name, gains in layout.mix.items()
    }
    layout = replace(
        layout,
        curves=tuple(curve for curve in layout.curves if curve.name in curves),
        thrusters=thrusters,
        mix={name: gains for name, gains in mix.items() if any(gains.values())},
        coupled=layout.coupled and all(layout.has(axis) for axis in _COUPLED),
    )
    driving = {name for axis in axes for name in layout.signs(axis)}  # of the others the gains cancel
    return replace(layout, mix={name: gains for name, gains in layout.mix.items() if f"u_{name}" in driving})


def _left_out(said: Said, tested: Tested, layout: Layout) -> Iterator[str]:
    """What the vehicle was said to have, or was tested, and is not there."""
    if axes := [name for name in said.axes if name not in layout.kinds]:
        drag = join_names(AXES[name].coefficient(key) for name in axes for key in ("a_d", "b_d"))
        yield f"{join_names(axes)}: neither tested nor known ({drag}), so the vehicle has no {' and no '.join(axes)}"
    if said.layout.coupled and not layout.coupled:
        yield "surge, sway and yaw are not coupled, which needs all three"
    for name, (file, _) in tested.thrust.items():
        if name not in {curve.name for curve in layout.curves}:
            yield f"{file}: the thrusters of curve {name} act on no axis that is tested or known, so it is not used"


# ---- What is missing -------------------------------------------------------------------------------------------------


def _missing(said: Said, layout: Layout, known: Collection[str]) -> Iterator[str]:
    """Mass and geometry, which no test tells."""
    needed: dict[str, Axis] = {form.axis.inertia: form.axis for form in reversed(layout.axes)}
    needed |= dict.fromkeys(ARM, YAW) if layout.has_arm else {}
    for name in layout.coefficients:
        if name in needed and name not in {*known, *said.named}:
            yield key_line(f"known.{name}", f"this key is missing, and the vehicle has {needed[name].name}")


def _too_little(said: Said, tested: Tested, layout: Layout, known: Collection[str]) -> Iterator[str]:
    """What neither a test nor rov.toml tells, and what both tell."""
    for curve in layout.curves:
        names = curve.coefficient("a_t"), curve.coefficient("b_t")
        if curve.name not in tested.thrust:
            if not {*names} & {*known, *said.named}:
                yield f"no thrust_{curve.name}*.csv, and rov.toml does not give {names[0]}"
            continue
        file, backward = tested.thrust[curve.name]
        backward_names = tuple(name for name in (f"{name}{REVERSE}" for name in names) if backward)
        for pair in (names, backward_names):
            if given := [name for name in pair if name in said.known]:
                yield f"rov.toml gives {', '.join(given)}, but there is {file} too"
    for axis in (form.axis for form in layout.axes):
        drag = [name for name in (axis.coefficient("a_d"), axis.coefficient("b_d")) if name not in known]
        if drag and axis.name not in {*tested.steady, *tested.logs}:
            yield (
                f"no steady_{axis.name}*.csv or log_{axis.name}*.csv that counts, and rov.toml does not give "
                f"{', '.join(drag)}"
            )
