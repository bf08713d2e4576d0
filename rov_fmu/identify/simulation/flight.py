"""Simulate a vehicle along the recordings of a file with the engine, for many sets of parameters at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rov_fmu.identify.effects.attitude import Attitude
from rov_fmu.identify.effects.voltage import voltage_at
from rov_fmu.identify.simulation.prepared import PreparedRecording
from rov_fmu.model.layout import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array, Flags

Values = Mapping[str, Array]
"""V numbers by the name of a coefficient, an input, or a variable at the start."""

_SETTLED = 30.0
"""A lagging force depends on the commands of this many time constants before. Earlier commands change it by less than
1e-13."""
_POSITIONS = {HEAVE: "z", ROLL: "phi", PITCH: "theta", YAW: "psi"}
_VAGUE = 0.3
"""The prior standard deviation of a velocity at the start that is not measured, m/s or rad/s."""
_FAST = 1.0
"""The prior standard deviation of a measured velocity at the start, m/s or rad/s. Its real error is much smaller."""
_TILT = 0.1
"""The prior standard deviation of a roll or pitch angle at the start that is not measured, rad."""
_STEP = 0.05
"""The longest step between the times of a simulation whose values are interpolated, s; the error is then below 1e-4."""
_SAME = 1e-3
"""Samples that differ by less share a time of the simulation, s."""


def unmixed(layout: Layout) -> Layout:
    """Return the layout with one command for each thruster."""
    return replace(layout, mix={})


def _middles(nodes: Array) -> Array:
    """Return the middle of the time from each node to the next; an input is held over this time."""
    return np.append(0.5 * (nodes[1:] + nodes[:-1]), nodes[-1])


def _simulate(rov: Rov, nodes: Array, given: Mapping[str, Array], record: Sequence[str], count: int) -> Array:
    """Return the recorded variables of some vehicles at the nodes, variables x vehicles x nodes."""
    from rov_fmu.engine.simulation import simulate  # imported here because commands without recordings do not need it

    return simulate(rov, nodes, given, record, vehicles=count, workers=1).values


@dataclass(frozen=True, eq=False)
class Flight:
    """The recordings of a file, or of a piece of it, that are simulated together."""

    layout: Layout
    members: tuple[PreparedRecording, ...]

    @property
    def attitude(self) -> Attitude | None:
        """The measured attitude, if the vehicle is simulated at it."""
        return self.members[0].attitude

    @property
    def is_linked(self) -> bool:
        """True when the motion along one axis acts on others, or on their sensors."""
        return self.layout.is_linked or self.attitude is not None

    # ---- The start ----

    @cached_property
    def measured(self) -> dict[str, float]:
        """The variables at the start that are fitted because they are measured, with their first values."""
        found: dict[str, float] = {}
        for d in self.members:
            found.setdefault(d.axis.velocity, float(d.velocity[0]))
            if d.recording.is_position:
                found[self._position(d)] = float(d.values[0])
        return found

    @cached_property
    def start_prior(self) -> dict[str, tuple[float, float]]:
        """The likely values and their standard deviations of variables at the start, if axes act on each other.

        Measured velocities have a prior because drag stops even 100 m/s within a sample: the residuals hardly change
        with such a velocity, so the search would not return from there. Unmeasured variables have one because they act
        on measured ones; at the beginning of a file the vehicle is taken to be at rest.
        """
        if not self.layout.is_linked:
            return {}
        found = {name: (value, _FAST) for name, value in self.measured.items() if name in self.layout.velocities}
        if not self.members[0].piece:
            return found
        for name in self.layout.velocities:
            if name not in self.measured:
                found[name] = self._logged(name), _VAGUE
        for name in ("phi", "theta") if self.layout.has_attitude else ():
            if name not in self.measured:
                found[name] = 0.0, _TILT
        return found

    @property
    def start(self) -> dict[str, float]:
        """The fitted variables at the start, with their first guess."""
        return self.measured | {name: value for name, (value, _) in self.start_prior.items()}

    def _position(self, data: PreparedRecording) -> str:
        """Return the name of a position: that of the vehicle's variable, or that of a distance."""
        return _POSITIONS.get(data.axis, f"distance {data.axis.velocity}")

    def _logged(self, name: str) -> float:
        """Return the value at the start of a velocity or heading that is logged beside the recordings, or 0."""
        for d in self.members:
            if name in d.recording.beside:
                return float(np.interp(self.members[0].time[0], d.recording.time, d.recording.beside[name]))
        return 0.0

    # ---- The motion ----

    def outputs(
        self, rov: Rov, values: Values, delays: Sequence[tuple[float, ...]], *, through_water: bool = False
    ) -> list[Array]:
        """Return what the sensor of each recording measures, V x n each, or the velocities through the water instead.

        `values` has V sets of numbers. Each set has a delay of the commands for each recording (s). All sets are
        simulated at the same times, chosen for the first delays. This is possible because the motion, as a function of
        the time of the commands, does not depend on the delays. The results are NaN where the motion cannot be
        computed.
        """
        switches = self.members[0].switches
        nodes = self._nodes(delays[0])
        given = self._given(values, len(delays)) | self._lagging(rov, values, len(delays), float(nodes[0]), switches)
        recorded = self._recorded(values)
        given |= self._commands(switches, nodes)
        if self.attitude:
            given |= self._weight(self.attitude, rov, given, _middles(nodes) + delays[0][0])
        at = dict(zip(recorded, _simulate(rov, nodes, given, recorded, len(delays)), strict=True))
        if self.attitude:
            at |= self.attitude.turned(nodes, at, delays[0][0])
        motion = SimulatedMotion(nodes, at, np.append(np.isin(nodes[1:], switches), False))
        sizes = [(len(delays), len(d.time)) for d in self.members]
        found = [np.empty(size) for size in sizes]
        for n, d in enumerate(self.members):
            for delay, which in _alike([delay[n] for delay in delays]).items():
                part, some = motion, values
                if len(which) < len(delays):
                    part, some = motion.part(which), {name: numbers[which] for name, numbers in values.items()}
                sample = d.time - delay
                if through_water:
                    found[n][which] = part.sampled(d.axis.velocity, sample)
                else:
                    found[n][which] = self._sensed(d, part, some, sample)
        return found

    def _nodes(self, delays: Sequence[float]) -> Array:
        """Return the times of the simulation: the switches, and either the samples or steps of 0.05 s, whichever are
        fewer."""
        samples = [d.time - delay for d, delay in zip(self.members, delays, strict=True)]
        begin, end = min(float(s[0]) for s in samples), max(float(s[-1]) for s in samples)
        switches = self.members[0].switches
        holds = np.unique(np.concatenate([[begin], switches[(switches > begin) & (switches < end)], [end]]))
        between = np.unique(np.concatenate(samples))
        after = np.minimum(np.searchsorted(holds, between), len(holds) - 1)
        near = np.minimum(np.abs(between - holds[after - 1]), np.abs(holds[after] - between)) <= _SAME
        between = between[~near]
        between = between[np.diff(between, prepend=begin) > _SAME]
        exact = np.sort(np.concatenate([holds, between]))
        even = _divided(holds, np.maximum(np.ceil(np.diff(holds) / _STEP - 1e-6), 1.0).astype(int))
        nodes = even if len(even) < len(exact) else exact
        if any(self._position(d).startswith("distance") for d in self.members if d.recording.is_position):
            nodes = _divided(nodes, np.full(len(nodes) - 1, 2))  # Simpson's rule needs the middle of every step
        return nodes

    def _recorded(self, values: Values) -> list[str]:
        """Return the variables that the sensors depend on, and the rates of the states among them."""
        wanted = {d.axis.velocity for d in self.members} | {self._position(d) for d in self.members}
        if (
            self.attitude
            or {"V_N", "V_E"} & values.keys()
            or (self.layout.has_attitude and wanted & {"psi", "phi", "theta"})
        ):
            wanted |= {"psi", "phi", "theta", *self.layout.velocities}
        names = [name for name in self.layout.places if name in wanted]
        return [*names, *(f"der({name})" for name in names if name in self.layout.state)]

    def _given(self, values: Values, count: int) -> dict[str, Array]:
        """Return the coefficients, inputs and states at the start that differ from those of the vehicle."""
        known = {*self.layout.inputs, *self.layout.coefficients, *self.layout.state}
        given = {name: numbers[:, None] for name, numbers in values.items() if name in known}
        angles = ("phi", "theta", "psi") if self.layout.has_attitude else ("psi",) if self.layout.has(YAW) else ()
        for name in angles:
            numbers = values[name] if name in values else np.full(count, self._logged(name))
            given[f"{name}_0" if self.layout.has_attitude else name] = numbers[:, None]
        for name in self.layout.velocities:
            if name not in values and self.members[0].piece:
                given[name] = np.full((count, 1), self._logged(name))
        return given

    def _lagging(self, rov: Rov, values: Values, count: int, begin: float, switches: Array) -> dict[str, Array]:
        """Return the lagging forces at the start, by their commands before.

        They depend on the coefficients of thrust alone, so sets that agree in these are simulated once.
        """
        names = [*self.layout.lagging]
        if not names:
            return {}
        keys = [c.coefficient(key) for c in self.layout.curves for key in c.keys]
        sets = np.column_stack([np.broadcast_to(values.get(key, rov[key]), count) for key in keys])
        sets, which = np.unique(sets, axis=0, return_inverse=True)
        given = {key: numbers[:, None] for key, numbers in zip(keys, sets.T, strict=True)}
        longest = max(float(given[c.coefficient("T")].max()) for c in self.layout.curves if c.has_lag)
        early = begin - _SETTLED * longest
        nodes = np.array([early, *switches[(switches > early) & (switches < begin)], begin])
        found = _simulate(rov, nodes, given | self._commands(switches, nodes), names, len(sets))
        return dict(zip(names, found[:, which.reshape(-1), -1:], strict=True))

    def _commands(self, switches: Array, nodes: Array) -> dict[str, Array]:
        """Return the commands from each time to the next."""
        held = np.maximum(np.searchsorted(switches, nodes, side="right") - 1, 0)
        commands = self.members[0].commands[held].T
        found = {f"u_{t.name}": own[None, :] for t, own in zip(self.layout.thrusters, commands, strict=True)}
        recording = self.members[0].recording
        if self.layout.voltage is not None and "voltage" in recording.context:
            found["voltage"] = voltage_at(recording, _middles(nodes))[None, :]
        return found

    def _weight(self, attitude: Attitude, rov: Rov, given: Mapping[str, Array], time: Array) -> dict[str, Array]:
        """Return the forces from outside that keep the net weight vertical, V x times."""
        if not self.layout.has(HEAVE):
            return {}
        net = given.get("F_0_w", 0.0) + rov.load(self.layout.kinds[HEAVE.name])
        net = net - (rov["F_0_w"] if "F_0_w" in given else 0.0)
        forces = attitude.weight(time)
        return {name: given.get(name, 0.0) + net * forces[name] for name in forces if name in self.layout.inputs}

    # ---- The sensors ----

    def _sensed(self, data: PreparedRecording, motion: "SimulatedMotion", values: Values, sample: Array) -> Array:
        """Return what the sensor of a recording measures at its samples, V x n."""
        name = self._position(data)
        if data.recording.is_position and not name.startswith("distance"):
            return motion.sampled(name, sample)
        if not data.recording.is_position:
            there = {key: motion.sampled(key, sample) for key in ("psi", "phi", "theta") if key in motion.at}
            return motion.sampled(data.axis.velocity, sample) + self._flow(data, there, values)
        v = motion.at[data.axis.velocity] + self._flow(data, motion.at, values)
        nodes = motion.nodes[::2]
        steps = np.diff(nodes) / 6.0 * (v[:, :-1:2] + 4.0 * v[:, 1::2] + v[:, 2::2])
        covered = np.concatenate([np.zeros((len(v), 1)), np.cumsum(steps, axis=1)], axis=1)
        covered = _between(nodes, covered, v[:, ::2], sample)
        return np.asarray(covered - covered[:, :1] + values[name][:, None])

    def _flow(self, data: PreparedRecording, at: Values, values: Values) -> Array | float:
        """Return the velocity of the water along an axis of the vehicle."""
        if data.axis.is_rotation or not {"V_N", "V_E"} & values.keys():
            return 0.0
        north, east = (values[key][:, None] if key in values else 0.0 for key in ("V_N", "V_E"))
        psi, phi, theta = (at.get(key, np.zeros(1)) for key in ("psi", "phi", "theta"))
        ahead, abeam = north * np.cos(psi) + east * np.sin(psi), east * np.cos(psi) - north * np.sin(psi)
        if data.axis is SURGE:
            return np.asarray(ahead * np.cos(theta))
        down = ahead * np.sin(theta)
        if data.axis is SWAY:
            return np.asarray(down * np.sin(phi) + abeam * np.cos(phi))
        return np.asarray(down * np.cos(phi) - abeam * np.sin(phi))


def _divided(nodes: Array, parts: NDArray[np.intp]) -> Array:
    """Divide each step between nodes into a number of equal parts."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    shares = (np.arange(len(first)) - first) / np.repeat(parts, parts)
    return np.append(np.repeat(nodes[:-1], parts) + shares * np.repeat(np.diff(nodes), parts), nodes[-1])


def _alike(numbers: Sequence[float]) -> dict[float, list[int]]:
    """Return the places of each number."""
    found: dict[float, list[int]] = {}
    for n, number in enumerate(numbers):
        found.setdefault(number, []).append(n)
    return found


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """The simulated motion of V vehicles at N nodes."""

    nodes: Array
    at: Values
    """The variables by name, V x N each, with their rates."""
    before_switch: Flags
    """N: True for a step at whose end commands switch, so that accelerations may jump there."""

    def part(self, which: Sequence[int]) -> "SimulatedMotion":
        """Return the motion of some vehicles."""
        return replace(self, at={name: values[which] for name, values in self.at.items()})

    def sampled(self, name: str, sample: Array) -> Array:
        """Return a variable at the samples, V x n."""
        rate = self.at[f"der({name})"] if f"der({name})" in self.at else _euler_rate(name, self.at)
        jumps = None if name in _POSITIONS.values() else self.before_switch
        return _between(self.nodes, self.at[name], rate, sample, jumps)


@np.errstate(all="ignore")  # impossible data may overflow; the result is then not finite
def _between(nodes: Array, values: Array, rates: Array, sample: Array, jumps: Flags | None = None) -> Array:
    """Interpolate values between nodes by cubics with their rates, V x n. At a node the result is the value itself.

    At the end of a step that `jumps`, the rate is unknown, and a parabola is used.
    """
    step = np.clip(np.searchsorted(nodes, sample, side="right") - 1, 0, len(nodes) - 2)
    h = nodes[step + 1] - nodes[step]
    share = (sample - nodes[step]) / h
    gained, first, last = values[:, step + 1] - values[:, step], h * rates[:, step], h * rates[:, step + 1]
    cubic = first + last - 2.0 * gained
    if jumps is not None:
        cubic = np.where(jumps[step], 0.0, cubic)
    return np.asarray(values[:, step] + share * (first + share * (gained - first + (share - 1.0) * cubic)))


def _euler_rate(name: str, at: Values) -> Array:
    """Return the rate of change of an Euler angle."""
    p, q, r = (at.get(key, np.zeros(1)) for key in "pqr")
    across = q * np.sin(at["phi"]) + r * np.cos(at["phi"])
    if name == "theta":
        return np.asarray(q * np.cos(at["phi"]) - r * np.sin(at["phi"]))
    return np.asarray(p + across * np.tan(at["theta"]) if name == "phi" else across / np.cos(at["theta"]))
