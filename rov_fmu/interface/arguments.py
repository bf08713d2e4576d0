"""Check the arguments of a simulation and convert them to arrays; each wrong argument gives one clear line."""

import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from math import ceil, copysign
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import AXES, Declaration
from rov_fmu.equation.layout import Layout
from rov_fmu.io.messages import InputError, brief, only, shown
from rov_fmu.vehicle.quantity import within

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Inputs: TypeAlias = "Mapping[str, Any] | pd.DataFrame"
"""The values of the inputs by name: numbers, arrays or functions of time."""

STEP = 0.01
"""The default time between two results, s, as in the FMU's default experiment."""
_LONGEST = 1e4
"""The longest duration for which a result every STEP is a sensible default, s."""
TIME = "time"
"""The name of the column that holds the times of the inputs themselves."""
_PERCENT = 2.0
"""A command beyond this is probably meant in percent."""
_ONE_LINE = 60
"""The most characters of a value in a message."""


def result_times(stop: float, step: float) -> Array:
    """Return the times of the results, s: round multiples of the step, and the end."""
    time = np.round(step * np.arange(ceil(stop / step)), 12)  # 0.3, and not 3 * 0.1 = 0.30000000000000004
    return np.append(time[time < stop - 1e-9], stop)


def duration_times(duration: Any) -> Array:
    """Return the times of the results for a duration (s). Raises InputError."""
    stop = float(_numbers("time", duration))
    if not STEP <= stop <= _LONGEST:
        raise InputError(
            f"time = {stop:g}: a duration must be within {STEP:g} ... {_LONGEST:g} s; pass the output times"
        )
    return result_times(stop, STEP)


def checked_times(key: str, given: ArrayLike, least: int = 2, *, may_repeat: bool = False) -> Array:
    """Return times (s) as an array. Raises InputError if there are fewer than `least`, or if they are not in ascending
    order.

    `may_repeat` allows equal times.
    """
    times = _numbers(key, given)
    if times.ndim != 1 or len(times) < least:
        raise InputError(f"{key}: must be a sequence of {least} or more times (s), and has the shape {times.shape}")
    steps = np.diff(times)
    if len(wrong := np.flatnonzero(steps < 0.0 if may_repeat else steps <= 0.0)):
        n = int(wrong[0]) + 1
        allowed = "not be less" if may_repeat else "be greater"
        raise InputError(f"{key}[{n}] = {times[n]:.15g}: must {allowed} than the time before it, {times[n - 1]:.15g}")
    return times


def checked_values(
    what: str, given: Mapping[str, Any], declarations: Mapping[str, Declaration], *, many: bool
) -> dict[str, Array]:
    """Return values by name as arrays. Raises InputError if a name is unknown or a value is out of bounds.

    For many vehicles each value is a number, or an array of one number for each vehicle, which becomes a column.
    """
    arrays = {}
    for name in _names(what, given):
        check_name(what, name, declarations)
        key = f"{what}[{name!r}]"
        values = _numbers(key, given[name])
        if values.ndim > many:
            allowed = "a number, or a sequence of one number for each vehicle" if many else "one number"
            raise InputError(f"{key}: must be {allowed}, and has the shape {values.shape}")
        arrays[name] = values[:, np.newaxis] if values.ndim else values
        declaration = declarations[name]
        outside = np.flatnonzero((values < declaration.minimum) | (values > declaration.maximum))
        if len(outside):
            wrong = values.flat[outside[0]]
            try:
                within(float(wrong), declaration)
            except ValueError as error:
                raise InputError(f"{key} = {wrong:.12g}: {error}") from error
    return arrays


def checked_number(key: str, given: ArrayLike) -> float:
    """Return one finite number. Raises InputError for anything else."""
    values = _numbers(key, given)
    if values.ndim:
        raise InputError(f"{key}: must be one number, and has the shape {values.shape}")
    return float(values)


def name_at_start(name: str, layout: Layout) -> str:
    """Return the name of what sets a variable at the start: psi_0 for psi of a vehicle with roll or pitch.

    There, phi, theta and psi follow from the quaternion. Any other name is returned as it is.
    """
    return f"{name}_0" if f"{name}_0" in layout.initial else name


def checked_start(given: Mapping[str, Any], layout: Layout, *, many: bool) -> dict[str, Array]:
    """Return the states, the Euler angles and the delayed commands at the start as arrays, by name.

    Raises InputError if one cannot be used, or if the attitude is given both as a quaternion and as angles.
    """
    renamed: dict[str, Any] = {}
    for name in _names("start", given):
        if (at_start := name_at_start(name, layout)) in renamed:
            raise InputError(f"start[{name!r}]: {at_start} is given, too, which is the same")
        renamed[at_start] = given[name]
    states = checked_values("start", renamed, layout.state | layout.initial | layout.memory, many=many)
    if quaternion := [states[name] for name in QUATERNION if name in states]:
        if angles := states.keys() & layout.initial.keys() - {"psi_0"}:
            raise InputError(
                f"start[{min(angles)!r}]: the attitude is also given as a quaternion. Give only one of the two"
            )
        if not np.all(sum(map(np.abs, quaternion))):
            raise InputError(f"start: the quaternion {', '.join(QUATERNION)} is 0 and has no direction")
    return states


def checked_inputs(
    layout: Layout, time: Array, inputs: Inputs, *, many: bool, told: set[str] | None = None
) -> tuple[Array, dict[str, Array]]:
    """Return the times of the steps and the inputs by name, each held from one time up to the next.

    The times are those of the results, and those between them at which an input changes. An input is a number, or an
    array whose last axis is time. Raises InputError. Warns about commands that saturate, except
    those in `told`, and adds their names to it.
    """
    told = set() if told is None else told
    names = _names("inputs", inputs)
    own = checked_times("inputs['time']", inputs[TIME], 1, may_repeat=True) if TIME in names else None
    times = time if own is None else np.union1d(time, np.clip(own, time[0], time[-1]))
    middles = np.append(0.5 * (times[:-1] + times[1:]), times[-1])
    given: dict[str, Array] = {}
    for name in names:
        if name == TIME:
            continue
        check_name("inputs", name, layout.inputs, layout.by_name)
        value = inputs[name]
        key = f"inputs[{name!r}]"
        if callable(value):
            array = _numbers(f"{key}(t)", value(middles))
            _check_shape(f"{key}(t)", array, len(middles), many)
        else:
            array = _numbers(key, value)
            _check_shape(key, array, len(time if own is None else own), many)
            if own is not None and array.ndim and array.shape[-1] == len(own):
                place = np.searchsorted(own, times, side="right") - 1
                before = layout.inputs[name].start if name in layout.inputs else 0.0
                array = np.where(place >= 0, array[..., np.maximum(place, 0)], before)
        given[name] = array
    values = with_axes(layout, given)
    for name in (name for name in values if name in layout.commands and name not in told):
        for beyond in _beyond(values[name], layout.commands[name]):
            told.add(name)
            warnings.warn(f"{name} reaches {beyond}", UserWarning, stacklevel=4)
    return times, values


def held_inputs(layout: Layout, inputs: Mapping[str, float], told: set[str] | None = None) -> dict[str, float]:
    """Return the values of all inputs of a step, in the order of the layout: those that are given, and the usual ones.

    Raises InputError. Warns about commands that saturate, except those in `told`, and adds their names to it.
    """
    _, values = checked_inputs(layout, np.zeros(1), inputs, many=False, told=told)
    return {**layout.usual_inputs, **{name: value.item() for name, value in values.items()}}


def with_axes(layout: Layout, values: Mapping[str, Array]) -> dict[str, Array]:
    """Return the values of inputs, in which commands along axes have become commands of thrusters.

    The name of an axis, such as `surge`, stands for all commands that drive it. Its value is the fraction of the full
    command in its positive direction: -0.3 in heave is 30 % up. Where two axes share a command, their fractions add up.
    Raises InputError if no thruster drives the axis, or if one of its commands is given, too.
    """
    inputs = {name: value for name, value in values.items() if name in layout.inputs}
    fractions: dict[str, Array] = {}
    for name in (axis for axis in layout.by_name if axis in values):
        if not (signs := layout.signs(AXES[name])):
            raise InputError(f"inputs[{name!r}]: no thruster drives this axis")
        for command, sign in signs.items():
            if command in inputs:
                raise InputError(f"inputs[{command!r}]: {name} drives this input, too")
            fractions[command] = fractions.get(command, np.array(0.0)) + sign * values[name]
    command_of = np.vectorize(layout.command_of, otypes=[np.float64])
    return inputs | {command: command_of(fraction) for command, fraction in fractions.items()}


def _beyond(values: Array, command: Declaration) -> Iterator[str]:
    """Describe a pulse of 0, and the value that exceeds the range of a command most, if there are such values."""
    low, high = command.minimum, command.maximum
    excess = np.maximum(low - values, values - high)
    if command.unit != "1" and np.any(values == 0.0):
        yield "0: commands are pulse widths, and a pulse of 0 means that there is no signal: it acts as neutral"
        excess = np.where(values == 0.0, 0.0, excess)
    if np.max(excess, initial=0.0) <= 0.0:
        return
    value = values.flat[np.argmax(excess)]
    if command.unit == "1":
        percent = " (30 % is 0.3)" if abs(value) > _PERCENT else ""
        yield f"{value:.6g}, which acts as {copysign(1.0, value):g}: commands saturate at ±1{percent}"
    else:
        yield f"{value:.6g}: commands are pulse widths, and saturate at {low:g} and {high:g} {command.unit}"


def _names(what: str, given: Any) -> list[str]:
    """Return the names in a mapping or a data frame. Raises InputError if it is neither."""
    if not hasattr(given, "keys"):
        raise InputError(
            f"{what} = {brief(shown(given), _ONE_LINE)}: must be a mapping from names to values, or a data frame"
        )
    return list(given.keys())


def check_name(what: str, name: str, declarations: Mapping[str, Declaration], also: Collection[str] = ()) -> None:
    """Raise InputError if no variable of this kind has the name, and it is not one of the others."""
    if name not in declarations and name not in also:
        kind = {"inputs": "input", "start": "state", "state": "state", "coefficients": "coefficient"}[what]
        raise InputError(f"{what}[{name!r}]: the vehicle has no such {kind}{only(str(name), [*declarations, *also])}")


def _check_shape(key: str, values: Array, times: int, many: bool) -> None:
    """Raise InputError unless the values are a number, or an array by vehicle and time."""
    if values.ndim > 1 + many or (values.ndim and values.shape[-1] not in ((1, times) if many else (times,))):
        allowed = f"a number, or an array of the shape ({times},), one value for each time"
        allowed += f", or (vehicles, 1), or (vehicles, {times})" if many else ""
        raise InputError(f"{key}: must be {allowed}, and has the shape {values.shape}")


def _numbers(key: str, given: ArrayLike) -> Array:
    """Return finite numbers as an array. Raises InputError for anything else."""
    try:
        array = np.asarray(given)
        if array.dtype.kind not in "biufO":
            raise TypeError
        values = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{key} = {brief(shown(given), _ONE_LINE)}: must be a number, or an array of numbers"
        ) from error
    if len(wrong := np.argwhere(~np.isfinite(values))):
        place = f"[{', '.join(map(str, wrong[0]))}]" if values.ndim else ""
        raise InputError(f"{key}{place} = {values[tuple(wrong[0])]}: must be a finite number")
    return values


def number_of_vehicles(values: Mapping[str, Array]) -> int:
    """Return the number of vehicles that the values are for; a single value holds for all vehicles.

    Raises InputError if the numbers of values differ.
    """
    sizes = {name: len(array) for name, array in values.items() if array.ndim == 2 and len(array) != 1}
    for name, size in sizes.items():
        first, vehicles = next(iter(sizes.items()))
        if size != vehicles or size == 0:
            raise InputError(f"{name}: has values for {size} vehicles, but {first} has values for {vehicles}")
    return next(iter(sizes.values()), 1)


def checked_paths(key: str, given: str | Path | Sequence[str | Path]) -> list[Path]:
    """Return one path or several as a list. Raises InputError if there is none."""
    paths = [given] if isinstance(given, str | Path) else [*given]
    if not paths:
        raise InputError(f"{key} = {shown(given)}: must be a path, or a sequence of one path or more")
    return [Path(path) for path in paths]


def checked_record(record: Sequence[str] | None, layout: Layout, names: Collection[str]) -> list[str]:
    """Return the names of the variables to record. The default is the outputs of the FMU: states and thrust.

    Raises InputError if a name is unknown.
    """
    if record is None:
        return [*layout.state, *layout.calculated]
    for name in [record] if isinstance(record, str) else record:
        if name not in names:
            raise InputError(f"record: the vehicle has no variable {shown(name)}{only(str(name), names)}")
    return [record] if isinstance(record, str) else list(record)
