"""The limits of a fit. No vehicle is beyond them, so a fit that ends at a limit is refused."""

from collections.abc import Iterator, Sequence
from math import exp, log

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.dead_band import DeadBand
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.identify.effects.load import Load
from rov_fmu.identify.least_squares import bounds
from rov_fmu.identify.simulation.prepared import PreparedRecording, axes_of
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import REVERSE, Axis, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_LEAST_BETA = 1e-3
_DRAG = 20.0
"""The largest drag, relative to the one that balances the strongest thrust at the highest velocity."""


class MotionError(ArithmeticError):
    """The motion cannot be computed with these coefficients."""


class NoFitError(ValueError):
    """No vehicle fits some recordings. The message is one line with their files and the reason."""

    def __init__(self, files: str, reason: str) -> None:
        super().__init__(f"{files}: {reason}")
        self.reason = reason


def limits(
    base: Rov, data: Sequence[PreparedRecording], names: Sequence[str], extras: Sequence[Effect], size: int
) -> tuple[Array, Array]:
    """Return lower and upper limits of x: coefficients (internal), extras, and unlimited initial values."""
    low, high = bounds(names, size - len(names))
    setting = Setting([d.recording for d in data], base)
    for axis in axes_of(data):
        strongest, fastest = setting.strongest(axis), max(d.speed for d in data if d.axis is axis)
        for power, key in enumerate(("b_d", "a_d"), 1):
            for name in (axis.coefficient(key + end) for end in ("", REVERSE)):
                if name in names and fastest > 0.0:
                    high[names.index(name)] = min(high[names.index(name)], _DRAG * strongest / fastest**power)
        if (beta := axis.coefficient("beta")) in names:
            low[names.index(beta)] = log(_LEAST_BETA)
    for curve in base.layout.curves:  # with a dead band, b_t must not be negative
        if curve.coefficient("c_0") in names or DeadBand(curve.name) in extras:
            for name in {curve.coefficient("b_t"), curve.coefficient("b_t" + REVERSE)} & {*names}:
                low[names.index(name)] = 0.0
    for n, extra in enumerate(extras, len(names)):
        low[n], high[n] = extra.bounds(setting)
    return low, high


def check_limits(
    base: Rov, data: Sequence[PreparedRecording], names: Sequence[str], extras: Sequence[Effect], x: Array
) -> None:
    """Check that no drag, β or load is at its limit. Raises NoFitError."""
    low, high = limits(base, data, names, extras, len(x))
    for axis in axes_of(data):
        own = [d.recording for d in data if d.axis is axis]
        if what := next(_at_limit(axis, own, names, extras, x, low, high), None):
            files = ", ".join(dict.fromkeys(r.file for r in own))
            raise NoFitError(
                files,
                f"no vehicle with this thrust and mass moves like this in {axis.name}. The best fit ends "
                f"at a limit: {what}. Check the units, the signs, and the order and directions of the thrusters",
            )


def check_thrust(rov: Rov, data: Sequence[PreparedRecording]) -> None:
    """Check that each thrust curve that drives a recorded axis is possible, as fitted curves may not be.

    Raises NoFitError.
    """
    for curve in rov.layout.curves:
        own = [d.recording for d in data if curve in curves_of(rov.layout, d.axis)]
        if own and (what := next(_impossible_thrust(rov, curve), None)):
            files = join_names(dict.fromkeys(recording.file for recording in own))
            axes = join_names(dict.fromkeys(recording.axis.name for recording in own))
            raise NoFitError(
                files,
                f"no possible {curve.name} thrust explains the motion in {axes}. The best fit has "
                f"{what}. Check the units, the signs, and the order and directions of the thrusters",
            )


def _impossible_thrust(rov: Rov, curve: Curve) -> Iterator[str]:
    """Yield a phrase for each coefficient beyond its bounds, and each direction in which full command does not push."""
    for name in map(curve.coefficient, curve.keys):
        declared = rov.layout.coefficients[name]
        if not declared.minimum <= rov[name] <= declared.maximum:
            yield f"{name} = {rov[name]:.3g}"
    for command in (1.0, -1.0):
        force = rov.curve_force(curve, command)
        if force * command <= 0.0:
            yield f"{force:.3g} N at {command:.0%}"


def _at_limit(
    axis: Axis,
    own: Sequence[Recording],
    names: Sequence[str],
    extras: Sequence[Effect],
    x: Array,
    low: Array,
    high: Array,
) -> Iterator[str]:
    """Yield a phrase for each coefficient or load at its limit."""
    near = np.where(np.isfinite(high - low), 1e-6 * (high - low), 0.0)
    at_low, at_high = x <= low + near, x >= high - near
    drag = [axis.coefficient(key + end) for key in ("a_d", "b_d") for end in ("", REVERSE)]
    beta = axis.coefficient("beta")
    for n, name in enumerate(names):
        if (name in drag and at_high[n]) or (name == beta and (at_low[n] or at_high[n])):
            yield f"{name} = {exp(x[n]) if name == beta else x[n]:.3g}"
    for n, extra in enumerate(extras, len(names)):
        if isinstance(extra, Load) and any(map(extra.concerns, own)) and (at_low[n] or at_high[n]):
            yield f"a load of {x[n]:.3g} {axis.load}"
