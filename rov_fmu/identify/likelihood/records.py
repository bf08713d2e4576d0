"""From a log to what the filter reads: samples in the order of time, rows of inputs, and the start.

Nothing is resampled onto a common grid. Samples that come faster than the vehicle can answer are averaged in groups,
which keeps what they tell and bounds the time of a fit.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import inf
from typing import Any

import numpy as np

from rov_fmu.equation.attitude import INITIAL, QUATERNION, start_formulas
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.expression import compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.filter import DRIFTS, MOST_SENSORS, Record, Sensor
from rov_fmu.identify.result import least_error
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.tank.catalogue import MeasuredQuantity
from rov_fmu.tank.clocks import first_in_each, gaps, held
from rov_fmu.tank.columns import push_along
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.log import LEAST_SAMPLES, Channel, Log
from rov_fmu.tank.quality import gaps_in_words
from rov_fmu.vehicle.vehicle import Vehicle

FASTEST = 20.0
"""Samples per second and sensor that are kept; faster ones are averaged in groups."""
THINNED = 5.0
"""The same for a first, quick fit, which takes single samples and no averages."""
FREE_DECAY = "free decay"
"""The kind of the finding about a log in which a vehicle slows down without thrust."""
_CALM = 0.3
"""The standard deviation of an unknown velocity at the start, m/s or rad/s."""
_MOVING = 1.0
"""The same ahead and sideways of a vehicle that is driven then, or moves along another axis, m/s."""
_LEAST_OF_PIECE = 4
"""The fewest samples in a piece of a log, where the whole log has enough."""
_LEVEL = 0.1
"""The standard deviation of an unknown angle at the start, rad."""
_LEAST_CHANGE = 0.001
"""The least relative change of the voltage that begins a new row of inputs."""
_LEAST_SPEED, _SLOWED = 0.1, 0.5
"""A vehicle slows down by itself if it is faster than the first number at the beginning, m/s or rad/s, and if less than
this share of the speed is left at the end."""
AHEAD = 10.0
"""Positions are predicted over this time, s."""
_ROWS_AHEAD = 10
"""Where commands change between the rows of a log, everything is predicted over so many rows."""
LEAST_COMMAND = 0.05
"""The least change of a command that counts."""
_CLOSE_ROWS, _MOST_CHANGE, _LEAST_LOST = 0.04, 0.5, 0.005
"""Commands are momentary values if rows are farther apart than the first number, s, if more than the second share of
them has another command, and if more than the third share of a command is lost between them."""
_LEAST_BESIDE = 1e-3
"""The least second difference of the thrust that counts, relative to full thrust."""
_LEAST_PUSH = 0.02
"""The smallest change of thrust that tests an axis, as a share of full thrust. Smaller changes are due to a heading or
depth controller, or to rounded pulses."""


@dataclass(frozen=True, eq=False)
class SampledChannel:
    """One channel of a log that the filter reads."""

    channel: Channel
    sensor: Sensor
    noise: float
    """A first guess of the standard deviation of its white noise, SI units."""

    @property
    def axis(self) -> Axis:
        """The axis of the motion that it measures."""
        return self.sensor.axis

    @property
    def quantity(self) -> MeasuredQuantity:
        """What it measures, with the unit."""
        return self.channel.quantity


@dataclass(frozen=True, eq=False)
class SampledLog:
    """A log that is fitted, with the part of the vehicle that it concerns."""

    log: Log
    layout: Layout
    measured: tuple[SampledChannel, ...]
    record: Record
    thinned: Record
    """The same with fewer samples."""
    interval: float
    """The usual time between two rows of commands, s."""
    driven: Collection[Axis]
    """The axes that it tests. Of others, it only tells how the vehicle moved."""
    lost: Mapping[str, float] = field(default_factory=dict)
    """The share of the command along each axis that is lost between its rows, by the axis."""
    is_momentary: bool = False
    """True if its rows have the commands of a moment, between which they follow a straight line, on the average."""

    @property
    def file(self) -> str:
        """The name of the log."""
        return self.log.file

    @property
    def horizon(self) -> float:
        """How far ahead positions are predicted, s, and velocities, too, if commands are lost between rows."""
        return _ROWS_AHEAD * self.interval if self.lost else AHEAD

    def _with_rows(self, **columns: Any) -> "SampledLog":
        """Return the log with other columns of its rows."""
        return replace(self, record=replace(self.record, **columns), thinned=replace(self.thinned, **columns))

    def with_thrust(self, coefficients: Mapping[str, float]) -> "SampledLog":
        """Return the log whose thrusters begin with the steady force of its first commands, with an error of its size:
        what they got before is unknown."""
        first = dict(zip(self.layout.inputs, self.record.inputs[0].tolist(), strict=True))
        forces = self.vehicle(coefficients).commanded(self.layout.usual_inputs | first)
        speeds = {f"n_{name}": first.get(f"u_{name}", 0.0) for name in forces}  # where these lag
        start = {
            state: value for state, value in ({f"F_{name}": F for name, F in forces.items()} | speeds).items() if value
        }
        errors = {state: max(abs(value), _CALM * state.startswith("F")) for state, value in start.items()}
        return self._with_rows(start={**self.record.start, **start}, errors={**self.record.errors, **errors})

    def with_inputs(self, inputs: Array) -> "SampledLog":
        """Return the log with other commands in its rows. Lines between momentary ones would be those of before."""
        assert not self.is_momentary
        return self._with_rows(inputs=inputs)

    @property
    def spans(self) -> Array:
        """How long each row of inputs holds, s: the last one until the last sample, or for the usual time."""
        told = self.record.told
        return np.diff(told, append=max(self.record.time[-1], told[-1] + self.interval))

    def refined(self, interval: float) -> "SampledLog":
        """Return the log with rows that are at most so far apart, s, and have the same commands."""
        told, since = self.record.told, self.record.since
        counts = np.maximum(np.ceil(self.spans / interval - 1e-6), 1.0).astype(int)
        rows = np.repeat(np.arange(len(counts)), counts)
        parts = np.concatenate([np.arange(count) / count for count in counts.tolist()])
        later = told[rows] + parts * self.spans[rows]
        earlier = since[rows] + parts * np.diff(since, append=since[-1] + self.spans[-1])[rows]
        anew = (parts == 0.0).astype(np.intc)
        made = {"told": later, "since": earlier, "inputs": self.record.inputs[rows], "anew": anew}
        if self.record.beside is not None:
            made["beside"] = self.record.beside[rows]
        return self._with_rows(**made)

    @property
    def seen_twice(self) -> list[SampledChannel]:
        """The velocities whose motion a position of the log shows, too."""
        positions = [s for s in self.record.sensors if not s.is_velocity]
        is_horizontal = any(s.is_horizontal for s in positions)
        axes = {s.axis for s in positions}
        velocities = (m for m in self.measured if m.sensor.is_velocity)
        return [m for m in velocities if m.axis in axes or (is_horizontal and m.sensor.is_horizontal)]

    @property
    def shows_horizontal(self) -> bool:
        """True if a horizontal position is measured, or a horizontal velocity over ground."""
        return any(s.is_level and (s.over_ground or not s.is_velocity) for s in self.record.sensors)

    def vehicle(self, coefficients: Mapping[str, float]) -> Vehicle:
        """Return the part of a vehicle that the log concerns."""
        return Vehicle(self.layout, {name: coefficients[name] for name in self.layout.coefficients})

    def thrust(self, coefficients: Mapping[str, float], rows: Array) -> Array:
        """Return the steady thrust of a vehicle along each axis for some rows of inputs, rows x axes, N or N m."""
        vehicle, names, usual = self.vehicle(coefficients), [*self.layout.inputs], self.layout.usual_inputs
        forces = (vehicle.commanded(usual | dict(zip(names, row, strict=True))) for row in rows.tolist())
        return np.array([[vehicle.along(axis, F) for axis in self.layout.bare_axes] for F in forces])

    def with_lines(self, coefficients: Mapping[str, float], full: Mapping[str, float]) -> "SampledLog":
        """Return the log with momentary commands, and with how much lines between them may lack along each axis.

        This is the RMS second difference of the thrust at both ends of a line, relative to full thrust. A line lacks an
        eighth of it in its middle where the thrust is smooth, and up to a half where it jumps between the rows.
        """
        thrust = self.thrust(coefficients, self.record.inputs)
        thrust = thrust / [full.get(axis.name) or 1.0 for axis in self.layout.bare_axes]
        ends = np.zeros_like(thrust)
        if len(thrust) > 2:
            ends = np.pad(np.diff(thrust, 2, axis=0), ((1, 1), (0, 0)), mode="edge")
        after = np.pad(ends[1:], ((0, 1), (0, 0)))
        beside = np.sqrt(0.5 * (ends**2 + after**2) + _LEAST_BESIDE**2)
        return replace(self._with_rows(beside=beside), is_momentary=True)


def recorded(log: Log, layout: Layout) -> SampledLog | None:
    """Return what the filter reads of a log; None if it tests none of these axes."""
    axes, findings = driven_axes(log, layout)
    if not axes:
        return None
    decaying = {finding.axis for finding in findings if finding.kind == FREE_DECAY}
    assert log.commands
    begin = float(log.commands.rows[0])
    measured = tuple(_measured(log, layout))[:MOST_SENSORS]
    lost = lost_between_rows(log, layout)
    if lost:  # where a sensor is more exact than the commands, J is rough
        measured = tuple(replace(m, noise=_least_noise(m)) for m in measured)
    since, told, inputs = _rows(log, layout)
    full = _samples(measured, begin, FASTEST, averaged=True)
    thin = _samples(measured, begin, THINNED, averaged=False)
    start, errors = _start(measured, layout, decaying)
    in_motion = [] if log.axis else _begins_in_motion(measured, layout, inputs[0], start)
    errors |= {axis.velocity: max(errors[axis.velocity], _MOVING) for axis in in_motion}
    sensors = tuple(m.sensor for m in measured)
    record = Record(
        sensors, *full, since, told, inputs, start, errors, _tilt(log, layout), _wanders(measured), bool(in_motion)
    )
    time, value, sensor = thin
    thinned = replace(record, time=time, value=value, sensor=sensor)
    return SampledLog(log, layout, measured, record, thinned, log.commands.interval, axes, lost)


def driven_axes(log: Log, layout: Layout) -> tuple[list[Axis], list[Finding]]:
    """Return the axes of the layout that a log tests, and findings about channels and axes of which it tells nothing.

    A log tests an axis if it measures a motion along it that changes, and if the thrust along it changes, or if the
    vehicle slows down without any: a free decay tells drag relative to inertia. The channels of the other axes still
    tell how the vehicle moved.
    """
    measured: dict[Axis, str] = {}
    slowing: dict[Axis, bool] = {}
    findings = []
    for axis, channel in _channels(log, layout):
        file, quantity = channel.file or log.file, channel.quantity.name
        if kind := _why_left_out(channel):
            numbers = {"count": channel.count, "least": LEAST_SAMPLES} if kind == "too few samples" else {}
            findings.append(about(file, kind, axis.name, quantity=quantity, **numbers))
            continue
        measured.setdefault(axis, file)
        slowing[axis] = slowing.get(axis, False) or _slows_down(channel)
        if log.commands and (some := gaps(channel.time, channel.values)):
            words = gaps_in_words(some, log.begin)
            findings.append(about(file, "gaps", axis.name, quantity=quantity, gaps=words, count=len(some)))
    kinds = {axis: kind for axis in measured if (kind := _without_thrust(log, layout, axis, slowing[axis]))}
    findings += [about(measured[axis], kind, axis.name) for axis, kind in kinds.items()]
    return [axis for axis in measured if kinds.get(axis) in (None, FREE_DECAY)], findings


def lost_between_rows(log: Log, layout: Layout) -> dict[str, float]:
    """Return the share of the command along each axis that is lost between the rows of a log, by the axis.

    A controller changes the commands more often than the log has rows, which are then momentary values. The share is
    that of the variance that straight lines between rows lack. No axis is among them where the commands of rows hold,
    or where rows are so close together that lines follow them.
    """
    commands = log.commands
    if not commands or commands.interval < _CLOSE_ROWS:
        return {}
    if len({*commands.time.tolist()}) < _MOST_CHANGE * len(commands.rows):
        return {}
    values = commands.in_rows
    pushes = {axis.name: push_along(layout, axis, values) for axis in layout.bare_axes}
    lost = {axis: beside_lines(push) for axis, push in pushes.items() if np.ptp(push) > LEAST_COMMAND}
    return {axis: share for axis, share in lost.items() if share > _LEAST_LOST}


def beside_lines(values: Array) -> float:
    """Return the share of the variance of equidistant values that straight lines between them do not have."""
    whole = float(np.var(values))
    return 1.0 - float(np.var(0.5 * (values[1:] + values[:-1]))) / whole if whole > 0.0 else 0.0


def shown_axes(log: Log, layout: Layout) -> list[Axis]:
    """Return the axes of the layout that a log shows. A track shows the heading, too."""
    read = [(axis, channel) for axis, channel in _channels(log, layout) if not _why_left_out(channel)]
    has_track = any(axis in (SURGE, SWAY) and not channel.quantity.is_velocity for axis, channel in read)
    return [*dict.fromkeys(axis for axis, _ in read), *[YAW] * has_track]


def _channels(log: Log, layout: Layout) -> Iterator[tuple[Axis, Channel]]:
    """Yield what a log shows of the axes of the layout, with the axis that each channel concerns."""
    return ((axis, channel) for channel in log.shown if (axis := channel.quantity.axis) and layout.has(axis))


def _wanders(measured: Sequence[SampledChannel]) -> bool:
    """Return True if the same messages have a horizontal position and velocity.

    They are of an estimator. Its position is right in the long run, and its velocity is not the rate of this position:
    errors of accelerations and angles let it wander for seconds.
    """
    sources = [
        {m.channel.source for m in measured if m.sensor.is_horizontal and m.sensor.is_velocity is of}
        for of in (True, False)
    ]
    return not sources[0].isdisjoint(sources[1])


def _why_left_out(channel: Channel) -> str:
    """Return the kind of the finding that says why a channel tells nothing; empty for one that the filter reads."""
    if max(channel.count, channel.of_log) < LEAST_SAMPLES or channel.count < _LEAST_OF_PIECE:
        return "too few samples"
    return "" if np.ptp(channel.values) > 0.0 else "constant motion"


def _slows_down(channel: Channel) -> bool:
    """Return True if a motion is much slower in the last quarter than in the first one. An oscillation may fade."""
    speeds = np.abs(velocities(channel)[1])
    quarter = len(speeds) // 4
    if not quarter:
        return False
    first, last = (float(np.quantile(some, 0.9)) for some in (speeds[:quarter], speeds[-quarter:]))
    return first > _LEAST_SPEED and last < _SLOWED * first


def _without_thrust(log: Log, layout: Layout, axis: Axis, slows_down: bool) -> str:
    """Return the kind of the finding about an axis along which the thrust does not change; empty if it does.

    The thrust must change whatever the coefficients of the thrust curves are. It has a linear and a quadratic term in
    each direction. For the thrusters of one curve, the sum of one of these terms must change. In a log of one command,
    a constant thrust is enough, because the vehicle starts from rest.
    """
    commands, drivers = log.commands, layout.thrusters_along(axis)
    assert commands
    if log.follows_axis and commands.value.any():
        return ""
    of = dict(zip(commands.thrusters, commands.at(commands.time).T, strict=True))
    if slows_down and not any(np.abs(of[t.name]).max() > _LEAST_PUSH for t in drivers if t.name in of):
        return FREE_DECAY
    if log.follows_axis:
        return "constant push"
    if not drivers:
        return "no thruster"
    strongest = max(abs(t.effect(axis)) for t in drivers)
    by_curve = grouped((t.curve, (t.effect(axis) / strongest, of[t.name])) for t in drivers if t.name in of)
    for own, side, power in product(by_curve.values(), (1.0, -1.0), (1, 2)):
        if np.ptp(sum(effect * np.clip(side * c, 0.0, 1.0) ** power for effect, c in own)) > _LEAST_PUSH:
            return ""
    moved = any(np.ptp(of[t.name]) > _LEAST_PUSH for t in drivers if t.name in of)
    return "cancelling thrusters" if moved else "constant push"


def _measured(log: Log, layout: Layout) -> Iterator[SampledChannel]:
    """Yield the channels that the filter reads."""
    for axis, channel in _channels(log, layout):
        if _why_left_out(channel):
            continue
        differences = np.diff(channel.values, 3) / np.sqrt(20.0)  # of white noise, these have its standard deviation
        noise = float(1.4826 * np.median(np.abs(differences))) or float(np.std(differences))
        sensor = Sensor(axis, channel.quantity.is_velocity, over_ground=log.axis is None)  # in a tank, water is ground
        yield SampledChannel(channel, sensor, max(noise, 1e-9))


def unchanged(time: Array, values: Array, span: float) -> float:
    """Return the RMS change of a quantity since the start of its prediction."""
    if span == inf:
        return rms(values - values[0])
    first = np.searchsorted(time, time[0] + span * np.floor((time - time[0]) / span))
    return rms(values - values[first])


def _least_noise(m: SampledChannel) -> float:
    """Return the guess of a channel's noise, or 1 % of its motion if that is more."""
    return least_error(m.noise, unchanged(m.channel.time, m.channel.values, AHEAD))


def _samples(
    measured: Sequence[SampledChannel], begin: float, rate: float, *, averaged: bool
) -> tuple[Array, Array, np.ndarray]:
    """Return the times, the values and the sensors of all samples in the order of time."""
    times, values, sensors = [], [], []
    for n, m in enumerate(measured):
        time, value = m.channel.time, m.channel.values
        first = first_in_each(time, rate, begin)
        if averaged and len(first) < 0.8 * len(time):
            count = np.diff(first, append=len(time))
            time, value = np.add.reduceat(time, first) / count, np.add.reduceat(value, first) / count
        elif not averaged:
            time, value = time[first], value[first]
        times.append(time)
        values.append(value)
        sensors.append(np.full(len(time), n, np.intc))
    time = np.concatenate(times)
    order = np.argsort(time, kind="stable")
    return time[order], np.concatenate(values)[order], np.concatenate(sensors)[order]


def _rows(log: Log, layout: Layout) -> tuple[Array, Array, Array]:
    """Return the times and the inputs of the rows in which an input changes: m, m, and m x inputs.

    A log without a voltage, such as one along a tape, has that of the layout.
    """
    commands = log.commands
    assert commands
    told, first = np.unique(commands.time, return_index=True)
    since = np.minimum(commands.since[first], told)
    voltage = log.used("voltage") if layout.voltage is not None else None
    if voltage:
        time, value = voltage.samples
        kept = [0]
        for n, v in enumerate(value):
            if abs(v - value[kept[-1]]) > _LEAST_CHANGE * abs(value[kept[-1]]):
                kept.append(n)
        rows = np.union1d(told, time[kept])
        told, since = rows, np.where(np.isin(rows, told), held(told, since, rows), rows)
    inputs = np.zeros((len(told), len(layout.inputs)))
    names = [*layout.inputs]
    values = commands.at(told)
    if log.follows_axis:
        assert log.axis
        for row, command in enumerate(values[:, 0]):
            for name, value_of in layout.commands_along(log.axis, command).items():
                inputs[row, names.index(name)] = value_of
    else:
        for column, thruster in zip(values.T, commands.thrusters, strict=True):
            if f"u_{thruster}" in names:
                inputs[:, names.index(f"u_{thruster}")] = column
    if layout.voltage is not None:
        inputs[:, names.index("voltage")] = np.interp(told, time, value) if voltage else layout.voltage
    return since, told, inputs


def _tilt(log: Log, layout: Layout) -> Array:
    """Return times, roll and pitch of a dive of a vehicle that has neither axis, 3 x k; k = 0 if unknown."""
    if log.follows_axis or layout.has_attitude or not log.tilt:
        return np.zeros((3, 0))
    (times, rolls), (time, pitches) = (one.unwrapped for one in log.tilt)
    if min(len(times), len(time)) < LEAST_SAMPLES:
        return np.zeros((3, 0))
    return np.array([time, np.interp(time, times, rolls), pitches])


_attitude = compiled(start_formulas())


def _start(
    measured: Sequence[SampledChannel], layout: Layout, decaying: Collection[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the states at the first sample, and the standard deviations of those that the filter follows.

    A velocity that is not measured is taken to be small, unless it is clearly not, or is that of a free decay.
    """
    start = dict(layout.at_rest)
    first = {(m.axis.name, m.sensor.is_velocity): m for m in measured}
    errors = {name: _CALM for name in layout.state if name not in DRIFTS}

    def of(axis: Axis, *, is_velocity: bool) -> tuple[float, float] | None:
        m = first.get((axis.name, is_velocity))
        return (float(m.channel.values[0]), 3.0 * m.noise) if m else None

    for axis in layout.bare_axes:
        if value := of(axis, is_velocity=True):
            start[axis.velocity], errors[axis.velocity] = value[0], value[1] + 0.1 * _CALM
        elif (m := first.get((axis.name, False))) and (axis in (HEAVE, YAW) or len(layout.axes) == 1):
            _, speeds = velocities(m.channel)
            if len(speeds) and (axis.name in decaying or abs(speeds[0]) > 2.0 * _CALM):
                start[axis.velocity], errors[axis.velocity] = float(speeds[0]), _CALM + 0.5 * abs(float(speeds[0]))
        position = DRIFTS[axis.place]
        if not axis.is_rotation and position in layout.state:
            if value := of(axis, is_velocity=False):
                start[position], errors[position] = value
            elif axis is HEAVE:
                errors[position] = _CALM
    angles = [of(axis, is_velocity=False) for axis in (ROLL, PITCH, YAW)]
    if layout.has_attitude:
        attitude = _attitude({name: angle[0] if angle else 0.0 for name, angle in zip(INITIAL, angles, strict=True)})
        start |= {name: attitude[name] for name in QUATERNION}
        errors |= dict.fromkeys(QUATERNION, _LEVEL)
    elif "psi" in layout.state:
        start["psi"], errors["psi"] = angles[2] or (0.0, _LEVEL)
    return start, errors


def _begins_in_motion(
    measured: Sequence[SampledChannel], layout: Layout, inputs: Array, start: Mapping[str, float]
) -> list[Axis]:
    """Return along which of surge and sway a dive that shows them may begin with any velocity: where this is not
    measured, and the vehicle is driven at the first sample, or sinks, rises or turns. `inputs` are those of the first
    row."""
    shown = {(m.axis, m.sensor.is_velocity) for m in measured}
    axes = [axis for axis in (SURGE, SWAY) if layout.has(axis)]
    commands = [n for n, name in enumerate(layout.inputs) if name in layout.commands]
    moves = any(abs(start.get(axis.velocity, 0.0)) > _LEAST_SPEED for axis in (HEAVE, YAW))
    is_driven = bool(np.abs(inputs[commands]).max(initial=0.0) > _LEAST_PUSH)
    unknown = [axis for axis in axes if (axis, True) not in shown]
    return unknown if (moves or is_driven) and not {SURGE, SWAY}.isdisjoint(axis for axis, _ in shown) else []


def typical(some: Sequence[SampledLog], axis: Axis) -> float:
    """Return a large velocity along an axis in the logs, m/s or rad/s: the 90 % quantile of its size; 0 if unknown."""
    speeds = (np.abs(velocities(m.channel)[1]) for one in some for m in one.measured if m.axis is axis)
    return max((float(np.quantile(of_one, 0.9)) for of_one in speeds if len(of_one)), default=0.0)


def velocities(channel: Channel) -> tuple[Array, Array]:
    """Return times, and the velocity then: as measured, or by how much a position changes in the next second."""
    time, values = channel.time, channel.values
    if channel.quantity.is_velocity:
        return time, values
    later = changes(time, values)
    return time[: len(later)], later / changes(time, time)


def changes(time: Array, values: Array) -> Array:
    """Return by how much values change in about 1 s, from each sample that has another one so much later."""
    lag = max(1, int(np.searchsorted(time, time[0] + 1.0)))
    return values[lag:] - values[:-lag]
