"""An identification as an MCAP file: what each log measured, what the model predicts, and what it cannot explain."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan, nan

import numpy as np
from scipy.spatial.transform import Rotation

from rov_fmu.bridges.mcap import Recording, about_vehicle, nanoseconds
from rov_fmu.c.simulation import Array
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, YAW, Declaration
from rov_fmu.identify.result import Identification, Prediction, UnknownForce
from rov_fmu.io.file_kinds import IDENTIFIED
from rov_fmu.io.groups import grouped
from rov_fmu.report.page.recording import topic_name
from rov_fmu.tank.log import Channel, Commands, Log
from rov_fmu.vehicle.uncertainty import NORMAL


@dataclass(frozen=True, eq=False)
class _Series:
    """Numbers over time: one topic of a log."""

    topic: str
    """The name of the topic behind that of the log."""
    time: Array
    """n: s."""
    columns: Mapping[str, Array]
    """The n values of each number; NaN where there is none."""
    numbers: Mapping[str, Declaration]


def identification_mcap(identification: Identification) -> bytes:
    """Return the logs of an identification as the content of an MCAP file.

    Each log begins at time 0, and its topics begin with its name: `commands`, by thruster, whenever one changes; each
    measured quantity, with its prediction by a fit without it and the 95 % band where there is one; `unknown_force`,
    the slow force along each axis that the model does not explain, with its 95 % interval; and `pose`, with Foxglove's
    schema, the measured attitude and depth, if the log has a heading. All values are in SI units.

    Raises InputError where foxglove-sdk is not installed.
    """
    recording = Recording(about_vehicle(identification.vehicle), IDENTIFIED)
    messages: list[tuple[int, Callable[[], None]]] = []
    for log in identification.folder.logs:
        series = [*_series_of(identification, log)]
        begin = min((float(one.time[0]) for one in series if len(one.time)), default=0.0)
        for one in series:
            write = recording.topic(f"/{topic_name(log.file)}/{one.topic}", one.numbers)
            rows = np.column_stack([*one.columns.values()]).tolist()
            for stamp, row in zip(nanoseconds(one.time - begin), rows, strict=True):
                values = {name: value for name, value in zip(one.columns, row, strict=True) if not isnan(value)}
                messages.append((stamp, partial(write, stamp, values)))
        time, pose = _pose(log)
        if len(time):
            write_pose = recording.poses(f"/{topic_name(log.file)}/pose", pose)
            stamps = nanoseconds(time - begin)
            messages += [(stamp, partial(write_pose, n, stamp)) for n, stamp in enumerate(stamps)]
    for _, write_it in sorted(messages, key=lambda message: message[0]):
        write_it()
    return recording.content()


def _pose(log: Log) -> tuple[Array, dict[str, Array]]:
    """Return the measured attitude and depth at the times of the heading, by the names of the FMU; none without one.

    A log has no horizontal position, and an angle that it does not have is 0.
    """
    heading = log.used(YAW.position)
    time = heading.samples[0] if heading else np.zeros(0)

    def at_times(name: str) -> Array:
        channel = log.used(name)
        if channel is None or not channel.count:
            return np.zeros(len(time))
        return np.interp(time, *channel.unwrapped)

    psi, theta, phi = (at_times(axis.position) for axis in (YAW, PITCH, ROLL))
    attitude = Rotation.from_euler("ZYX", np.column_stack([psi, theta, phi])).as_quat(scalar_first=True)
    return time, {"z": at_times(HEAVE.position), **dict(zip(QUATERNION, attitude.T, strict=True))}


def _series_of(identification: Identification, log: Log) -> Iterator[_Series]:
    """Yield all that is known about a log, each over its own times."""
    if log.commands:
        yield _commands(log.commands)
    predictions = (p for axis in identification.axes for p in axis.predictions)
    own = grouped((p.quantity, p) for p in predictions if p.file == log.file and p.is_judged)
    rest = {c.quantity.name: c for c in log.channels if not c.unused and c.count}
    yield from (_prediction(parts, rest.pop(quantity, None)) for quantity, parts in own.items())
    yield from map(_measured, rest.values())
    yield from (_unknown(force) for force in identification.unknown_forces if force.file == log.file)


def _commands(commands: Commands) -> _Series:
    time = np.unique(commands.time)
    numbers = {
        name: Declaration("1", f"Command of {name}, a fraction of the full command") for name in commands.thrusters
    }
    return _Series("commands", time, dict(zip(numbers, commands.at(time).T, strict=True)), numbers)


def _measured(channel: Channel) -> _Series:
    name, (time, values) = channel.quantity.name, channel.samples
    numbers = {"measured": Declaration(channel.quantity.unit, f"Measured {name}")}
    return _Series(topic_name(name), time, {"measured": values}, numbers)


def _prediction(parts: Sequence[Prediction], channel: Channel | None) -> _Series:
    """Return what was measured of a quantity, and its predictions, each of a part of the log."""
    name, unit = parts[0].quantity, parts[0].unit
    time, measured = (np.concatenate([getattr(part, key) for part in parts]) for key in ("time", "measured"))
    predicted = np.concatenate([part.predicted for part in parts])
    if channel:
        times, values = channel.unwrapped
        left = np.all([(times < p.time[0]) | (times > p.time[-1]) for p in parts], axis=0)
        time, measured = np.append(time, times[left]), np.append(measured, values[left])
    ends = _band(predicted, np.concatenate([part.deviation for part in parts]))
    none, order = np.full(len(time) - len(predicted), nan), np.argsort(time, kind="stable")
    columns = {"measured": measured} | {
        key: np.append(values, none) for key, values in ({"predicted": predicted} | ends).items()
    }
    numbers = {
        "measured": Declaration(unit, f"Measured {name}"),
        "predicted": Declaration(unit, f"The prediction of the {name} by {parts[0].by}"),
        **_edges(unit, f"95 % band of the measured {name}"),
    }
    return _Series(topic_name(name), time[order], {key: values[order] for key, values in columns.items()}, numbers)


def _unknown(unknown: UnknownForce) -> _Series:
    axis = unknown.axis
    columns = {"force": unknown.force, **_band(unknown.force, unknown.deviation)}
    words = f"Slow {'torque' if axis.is_rotation else 'force'} in {axis.name} that the model does not explain"
    numbers = {
        "force": Declaration(axis.load, f"{words}, positive {axis.positive}"),
        **_edges(axis.load, "95 % interval"),
    }
    return _Series(f"unknown_force/{axis.name}", unknown.time, columns, numbers)


def _band(values: Array, deviation: Array) -> dict[str, Array]:
    return {"low": values - NORMAL * deviation, "high": values + NORMAL * deviation}


def _edges(unit: str, words: str) -> dict[str, Declaration]:
    return {end: Declaration(unit, f"{end.capitalize()} end of the {words}") for end in ("low", "high")}
