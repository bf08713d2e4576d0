"""The parameters of the likelihood: their priors, of the kinds of kinds.py, and how they enter the model."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from itertools import product
from math import log, pi
from operator import attrgetter
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import COUPLED_AXES, GEOMETRY, HEAVE, PITCH, REVERSE, ROLL, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import FAINT, Curve, Part, SourcedVector, Thruster
from rov_fmu.identify.likelihood.curves import Drags, Quadratic, nearest_drag
from rov_fmu.identify.likelihood.filter import AT_ORIGIN, Parameters, Sensor, Slow
from rov_fmu.identify.likelihood.kinds import (
    ABSENT,
    ARMS,
    DIRECTION,
    INERTIA,
    KINDS,
    LAG,
    LEAST_LAG,
    NEUTRAL,
    OFFSET,
    OWN_CURVE,
    PLACED,
    POWER,
    POWER_ASTERN,
    PRIORS,
    SENSOR_OFFSET,
    SENSOR_SCALE,
    SHIFT,
    STRENGTH,
    TURN,
    WANDER,
    WHITE,
    WIDTH,
    Coordinate,
    Kind,
)
from rov_fmu.identify.likelihood.prior import Prior
from rov_fmu.identify.likelihood.records import SampledChannel, SampledLog
from rov_fmu.io.groups import grouped
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import push_along
from rov_fmu.vehicle.vehicle import Vehicle

_QUIETER = 2.0
"""The white noise is at least exp(-2) of what the differences of the samples show: rounding is never taken as exact.
Where commands change between rows, it is at least all of it, because J is rough where a sensor is more exact."""
_LINEAR = 0.3
"""The deviation of the linear share of a quadratic thrust curve, which measured forces determine."""
ADAPTED = "; adapted to the tests"
"""The end of the source of a number of the base that a fit changed."""
HORIZONTAL = "horizontal"
"""What has a slow velocity along no axis of the body."""
CURRENT = ("to the north", "to the east")
"""The parts of a current."""
CENTRE = {"forward": "x_B", "to starboard": "y_B", "down": "z_B"}
"""The coordinates of the centre of buoyancy."""
_PLACES = (*CENTRE,)
"""The parts of the place of a sensor."""
_GEOMETRY = (ARMS, "", "g_r"), (SHIFT, "ahead", "x_T"), (SHIFT, "to starboard", "y_T")
"""The parameters of the places of thrusters: the kind, the part, and the coefficient."""
_LEAST_POWER = -0.9
"""The least q of quadratic drag. With -1, it would be linear drag once more."""
_MOTION_STEP = 3e-6
"""The relative change of z for the derivatives of the motion: kinks are rarely within it, and rounding errors add
less than a per cent."""
_LEAST_WIDTH = 0.1
"""The least width, relative to the time between two rows, that a derivative compares with none."""


@dataclass(frozen=True)
class Parameter(Coordinate):
    """One parameter of the likelihood."""

    kind: str
    """Its key in KINDS, such as `quadratic drag`. Those with a `null` are effects."""
    of: str
    """The name of the axis, the curve or the file that has it; empty for the vehicle."""
    part: str = ""
    """Which of several, such as `north` or a quantity."""
    log: int | None = None
    """The index of the log that alone has it."""
    sets: tuple[str, ...] = ()
    """The names of the coefficients that are its number."""

    @property
    def key(self) -> tuple[str, str, str]:
        """What no other parameter of a table has: the kind, what has it, and which part."""
        return self.kind, self.of, self.part

    @property
    def is_fixed(self) -> bool:
        """True if no fit changes it. It has no error, and nothing in J depends on its prior."""
        return self.low == self.high

    @property
    def is_effect(self) -> bool:
        """True for an effect of the motion, which may be absent from the vehicle."""
        return self.null is not None and self.of_motion and not self.is_fixed

    @property
    def of_kind(self) -> Kind:
        """What all parameters of its kind are."""
        return KINDS[self.kind]

    @property
    def step(self) -> float:
        """The change of z for its numerical derivative."""
        if not self.of_motion:
            return 1e-2 if self.is_log else 1e-3
        return _MOTION_STEP * (1.0 if self.is_log else self.deviation)

    def step_at(self, z: float) -> float:
        """Return the change of z for its numerical derivative where it is z.

        What the width of a window adds to the variances grows with its square. A derivative near 0 would not show it,
        and each step of a fit would go to the mean of the prior.
        """
        is_width = not (self.of_motion or self.is_log)
        return max(self.step, self.low + _LEAST_WIDTH - z) if is_width else self.step


def has_place(sensor: Sensor) -> bool:
    """Return True for a sensor of a velocity or a horizontal position. Its place changes what it measures of a turn."""
    return not sensor.axis.is_rotation and (sensor.is_velocity or sensor.axis is not HEAVE)


def _of_estimator(part: str) -> str:
    """Return the name of an estimator's offset to the north or the east: it integrates accelerations along these."""
    return f"velocity {part}"


def with_same_lag(sensor: Sensor) -> str:
    """Return which sensors of a vehicle share the lag of this one, in words."""
    if sensor.is_velocity:
        return "of the turn rate sensor" if sensor.axis.is_rotation else "of the velocity sensor"
    own = {HEAVE: "depth", YAW: "heading", ROLL: "attitude", PITCH: "attitude"}
    return f"of the {own.get(sensor.axis, 'position')} sensor"


@dataclass(frozen=True)
class Table:
    """All parameters, with the vehicle that they change."""

    layout: Layout
    """The layout with every coefficient that a parameter may change."""
    base: Mapping[str, float]
    """The coefficients where every effect is absent, and all other coefficients have their prior means."""
    full: Mapping[str, float]
    """By axis: the thrust or torque at full command, N or N m."""
    parameters: tuple[Parameter, ...]
    exact: frozenset[str] = frozenset()
    """The names of the coefficients that no parameter changes."""
    prior: Prior | None = None
    """What the parameters were made from; None for a table of no log."""

    @property
    def known(self) -> Prior:
        """What the parameters were made from."""
        assert self.prior
        return self.prior

    def each(self, key: str) -> np.ndarray:
        """Return a number of each parameter, such as its `mean`, or `of_kind.is_size`."""
        return np.array([*map(attrgetter(key), self.parameters)])

    def scales_of_forces(self, z: Array) -> Array:
        """Return the directions along which the motion stays the same, k x p.

        Along one of them, thrust, drag, load and inertia grow alike, of axes that share no thruster with others. Along
        another one, a curve has more thrust, and its thrusters have less strength.
        """
        return np.where(self.each("is_log"), 1.0, self._scaled(z)) * self._powers_of_scales

    def with_scales(self, z: Array, changes: Array) -> Array:
        """Return the coordinates after changes of the logarithms of k scales of forces."""
        powers = changes @ self._powers_of_scales
        return np.asarray(z + np.where(self.each("is_log"), powers, np.expm1(powers) * self._scaled(z)))

    def _scaled(self, z: Array) -> Array:
        """Return what is proportional to a force of each coordinate that is no logarithm."""
        return np.asarray(z - np.array([0.0 if p.kind == STRENGTH else p.null or 0.0 for p in self.parameters]))

    @cached_property
    def _powers_of_scales(self) -> Array:
        """The powers of the scales of forces to which each number is proportional, k x p."""
        power, of = self.each("of_kind.force_power"), [p.of for p in self.parameters]
        # The axes that share a thruster have one scale: the names of the axes, and the gains of their thrusters.
        groups, curves = list[tuple[set[str], set[int]]](), dict[int, list[int]]()
        for axis in self.layout.bare_axes:
            names, gains = {axis.name}, set[int]()
            if self.layout.coupled and axis in COUPLED_AXES:
                names |= {one.name for one in COUPLED_AXES}
            for t in self.layout.thrusters_along(axis):
                strength, scale = self.index(STRENGTH, t.name), self.index("thrust scale", self.shared(t.curve))
                if strength is not None and not self.parameters[strength].is_fixed:
                    gains.add(strength)
                    if scale is not None:
                        curves.setdefault(scale, []).append(strength)
                elif scale is not None:
                    gains.add(scale)
            # This axis joins all groups that have one of its gains, or an axis that is coupled to it.
            linked = [one for one in groups if one[0] & names or one[1] & gains]
            names, gains = names.union(*(one[0] for one in linked)), gains.union(*(one[1] for one in linked))
            groups = [*(one for one in groups if one not in linked), (names, gains)]
        rows = [np.where([name in names for name in of], power, 0.0) for names, _ in groups]
        for row, (_, gains) in zip(rows, groups, strict=True):
            row[[*gains]] = 1.0
        for scale, strengths in curves.items():
            row = np.zeros(len(of))
            row[scale], row[strengths] = 1.0, -1.0
            rows.append(row)
        return np.array(rows).reshape(-1, len(of))

    def index(self, kind: str, of: str = "", part: str = "") -> int | None:
        """Return the index of a parameter, or None."""
        return self._indices.get((kind, of, part))

    @cached_property
    def _indices(self) -> dict[tuple[str, str, str], int]:
        return {p.key: n for n, p in enumerate(self.parameters)}

    # The coordinates of p parameters are an array of p numbers, or of p x n for n sets of parameters. All that follows
    # from them is then a number, or an array of n.

    def get(self, z: Array, kind: str, of: str = "", part: str = "", default: Any = 0.0) -> Any:
        """Return the number that a coordinate stands for, or a default where there is no such parameter."""
        index = self.index(kind, of, part)
        return default if index is None else self.parameters[index].number(z[index])

    def coefficients(self, z: Array) -> dict[str, Any]:
        """Return all coefficients of the layout for the coordinates of the parameters."""
        values: dict[str, Any] = dict(self.base)
        for p, coordinate in zip(self.parameters, z, strict=True):
            for name in p.sets:
                values[name] = p.number(coordinate)
        if (angle := self.index(DIRECTION, YAW.name)) is not None:
            given = self.parameters[angle].mean
            values["g_u"], values["g_v"] = np.cos(z[angle]) / np.cos(given), np.sin(z[angle]) / np.sin(given)
        for axis in self.layout.bare_axes:
            beta = axis.coefficient("beta")
            values[beta] = self.base[beta] / self.get(z, INERTIA, axis.name, default=1.0)
        for curve in self.layout.curves:
            self._curve(values, z, curve)
        self._astern(values, z, "drag astern", ("a_d", "b_d"), self.layout.by_name)
        self._astern(values, z, "dead band astern", ("c_0",), self.layout.curves_by_name)
        for name, (source, thruster) in self._own_curves.items():
            curve, shared = (self.layout.curves_by_name[one] for one in (name, source))
            factors = {f"{key}{REVERSE}": np.exp(self.get(z, OWN_CURVE, thruster)) for key in ("a_t", "b_t", "d")}
            off = self.get(z, NEUTRAL, thruster)
            bands = {"c_0": -off, f"c_0{REVERSE}": off}
            for key in curve.keys:
                value = values.get(shared.coefficient(key), 0.0) * factors.get(key, 1.0)
                values[curve.coefficient(key)] = np.maximum(value + bands[key], 0.0) if key in bands else value
        return values | {name: self.base[name] for name in self.exact}

    @property
    def _own_curves(self) -> Mapping[str, tuple[str, str]]:
        return self.prior.own_curves if self.prior else {}

    def shared(self, curve: str) -> str:
        """Return the name of the curve that has the parameters of a curve."""
        return self._own_curves.get(curve, (curve, ""))[0]

    def _astern(
        self, values: dict[str, Any], z: Array, kind: str, keys: Sequence[str], parts: Mapping[str, Part]
    ) -> None:
        """Set the coefficients astern of some parts to those ahead, times the ratio of the base and a parameter's."""
        for key, (of, part) in product(keys, parts.items()):
            ahead, astern = part.coefficient(key), part.coefficient(f"{key}{REVERSE}")
            if astern != ahead:
                ratio = self.base[astern] / self.base[ahead] if self.base[ahead] else 1.0
                values[astern] = values[ahead] * (ratio * np.exp(self.get(z, kind, of)))

    def _curve(self, values: dict[str, Any], z: Array, curve: Curve) -> None:
        scale = self.get(z, "thrust scale", curve.name, default=1.0)
        reverse = np.exp(self.get(z, "reverse thrust", curve.name))
        if "k_t" in curve.keys:
            values[curve.coefficient("k_t")] *= scale
        linear = self.get(z, "linear thrust", curve.name)
        astern = self.get(z, "linear thrust", curve.name, "astern", default=linear)
        for end, ratio, moved in (("", 1.0, linear), (REVERSE, reverse, astern)):
            names = [curve.name_of(f"{key}{end}") for key in ("a_t", "b_t")]
            if names[0] in values:
                a, b = (self.base[name] for name in names)
                values[names[0]] = scale * ratio * (a - moved * (a + b))
                values[names[1]] = scale * ratio * (b + moved * (a + b))
        if "d" in curve.keys and not curve.tables:
            usual = _lost(curve, self.base)
            lost = self.get(z, "advance", curve.name, default=usual)
            astern = np.exp(self.get(z, "advance astern", curve.name))
            for end, own in ((REVERSE, astern), ("", 1.0)):  # both may be the same coefficient
                full = values[curve.coefficient(f"a_t{end}")] + values[curve.coefficient(f"b_t{end}")]
                relative = _lost(curve, self.base, end) / usual if usual else 1.0
                values[curve.coefficient(f"d{end}")] = lost * own * relative * full
        if "T" in curve.keys:
            lag = curve.coefficient("T")
            values[lag] = self.get(z, LAG, default=max(values[lag], LEAST_LAG))

    def force_unit(self, z: Array, axis: Axis) -> Any:
        """Return what the size of a slow force is relative to, N or N m: full thrust, in proportion to the inertia.

        The data do not tell the scale of all forces.
        """
        return self.full.get(axis.name, 1.0) * self.get(z, INERTIA, axis.name, default=1.0)

    def model(self, z: Array) -> tuple[Vehicle, Drags]:
        """Return the vehicle, and the powers of its drag. No lag is shorter than the least one."""
        coefficients = self.coefficients(z)
        lags = (curve.coefficient("T") for curve in self.layout.curves if "T" in curve.keys)
        coefficients |= {name: np.maximum(coefficients[name], LEAST_LAG) for name in lags}
        powers = {axis.name: self.powers(z, axis) for axis in self.layout.bare_axes}
        return Vehicle(self.layout, coefficients), Drags(powers)

    def powers(self, z: Array, axis: Axis) -> tuple[Any, Any, float]:
        """Return q ahead and astern, and V, of the drag a |v| v |v/V|^q along an axis. V does not change with z.

        It is the velocity at which the drag of the prior is a quarter of the full thrust. So a is a drag at about half
        command, which the data tell beside q. Exact drag is quadratic.
        """
        a, b = (self.base.get(axis.coefficient(key), 0.0) for key in ("a_d", "b_d"))
        force = 0.25 * self.full.get(axis.name, 0.0) or a + b
        typical = float(2.0 * force / (b + np.sqrt(b * b + 4.0 * a * force))) if force else 1.0
        if axis.coefficient("a_d") in self.exact:
            return 0.0, 0.0, typical
        q = self.get(z, POWER, axis.name)
        return q, np.maximum(q + self.get(z, POWER_ASTERN, axis.name), _LEAST_POWER), typical

    def nearest_drags(self, z: Array, top: Mapping[str, float]) -> Iterator[Quadratic]:
        """Yield the linear and quadratic drag, ahead and astern, nearest to that of each axis with another power.

        `top` has the largest tested speed of the axes, m/s or rad/s. Without one, it is V.
        """
        coefficients = self.coefficients(z)
        for axis in self.layout.bare_axes:
            *powers, typical = self.powers(z, axis)
            for end, q in zip(("", REVERSE), powers, strict=True) if any(map(np.any, powers)) else ():
                names = [axis.coefficient(f"{key}{end}") for key in ("a_d", "b_d")]
                drag = {name: coefficients[name] for name in names if name in coefficients}
                if drag:
                    yield nearest_drag(axis.name, drag, q, typical, top.get(axis.name, typical))

    def of_file(self, z: Array, top: Mapping[str, float]) -> "Table":
        """Return a table whose drag is that of a vehicle file, linear and quadratic, at some coordinates."""
        drag = {name: value for one in self.nearest_drags(z, top) for name, value in one.coefficients.items()}
        return replace(self, base={**self.base, **drag}, exact=self.exact.union(drag))

    def thrusters_in_file(self, z: Array) -> tuple[Thruster, ...]:
        """Return the thrusters with the directions and the places at some coordinates."""
        c = self.coefficients(z)

        def placed(t: Thruster) -> Thruster:
            (X, Y, Z), (x, y, depth) = t.direction.value, t.place
            direction = c["g_u"] * X, c["g_v"] * Y, Z
            place = c["g_r"] * x + c["x_T"], c["g_r"] * y + c["y_T"], depth
            now = []
            for before, value in ((t.direction, direction), (t.position or t.direction, place)):
                is_same = np.allclose(before.value, value, rtol=0.0, atol=FAINT)
                now.append(before if is_same else SourcedVector(value, before.source + ADAPTED))
            return replace(t, direction=now[0], position=now[1])

        return tuple(map(placed, self.layout.thrusters)) if self.layout.is_uncertain else self.layout.thrusters

    def of_vehicle(self, vehicle: Vehicle) -> "Table":
        """Return a table whose coefficients are those of a vehicle. An effect that the vehicle lacks is absent. Its
        thrusters stand as given."""
        values, keys_in_file = dict(vehicle.with_(self.layout).coefficients), self.layout.keys_in_file
        values |= {key: self.base[key] for key in GEOMETRY if self.layout.is_uncertain}
        parts = {keys[:-1] for keys in vehicle.layout.keys_in_file.values()}
        names = {keys: name for name, keys in keys_in_file.items()}
        for name, (*part, key) in keys_in_file.items():  # a coefficient astern stands after that ahead
            ahead = values.get(names.get((*part, key.removesuffix(REVERSE)), ""))
            if name not in values and tuple(part) in parts and (value := ABSENT.get(key, ahead)) is not None:
                values[name] = value
        return replace(self, base={**self.base, **values}, exact=frozenset(values))

    def of_log(self, z: Array, sampled: SampledLog) -> Parameters:
        """Return the sets of parameters of the filter for a log."""
        file, layout = sampled.file, sampled.layout
        coefficients = self.coefficients(z)
        for part, name in zip(CURRENT, ("V_N", "V_E"), strict=True):
            coefficients[name] = self.get(z, "current", file, part)
        axes = layout.bare_axes
        units = {axis.name: self.force_unit(z, axis) for axis in axes}
        for thruster, curve in ((t, c) for t, c in layout.curve_of.items() if not c.has_rotors):
            units[curve.lagging(thruster)] = self.get(z, "thrust scale", self.shared(curve.name), default=1.0)

        def slow(kind: str, of: str = "", unit: Any = 1.0) -> Slow:
            process = KINDS[kind].slow
            assert process
            return Slow(unit * self.get(z, kind, of), process.time_constant)

        along, down = Slow(), Slow()
        if sampled.shows_horizontal:
            along = slow(WANDER if sampled.record.wanders else "slow velocity", HORIZONTAL)
        if layout.has(HEAVE) and any(s.axis is HEAVE for s in sampled.record.sensors):
            down = slow("slow velocity", HEAVE.name)
        noises = [self.noise(z, m.quantity.name) for m in sampled.measured]
        powers = [self.powers(z, axis) for axis in axes]
        levers = {key: tuple(self.get(z, kind, "", part) for part in _PLACES) for key, kind in PLACED.items()}
        return Parameters(
            coefficients=coefficients,
            forces=tuple(slow("slow force", a.name, units[a.name]) for a in axes),
            units=units,
            short=tuple(Slow(units[a.name] * self.get(z, "short force", a.name), 0.5 * sampled.interval) for a in axes)
            if sampled.is_momentary
            else (),
            gain=slow("slow gain"),
            drifts=(along, along, down),
            white=tuple(white for white, _, _ in noises),
            noise=tuple(Slow(coloured, time) for _, coloured, time in noises),
            lags=tuple(self.get(z, "sensor lag", "", with_same_lag(m.sensor), None) for m in sampled.measured),
            levers=tuple(levers[m.sensor.is_velocity] if has_place(m.sensor) else AT_ORIGIN for m in sampled.measured),
            turn=self.get(z, TURN),
            scales=tuple(
                np.exp(self.get(z, SENSOR_SCALE, m.axis.name)) if m.sensor.is_velocity else 1.0
                for m in sampled.measured
            ),
            offsets=tuple(self.get(z, SENSOR_OFFSET, file, m.quantity.name) for m in sampled.measured),
            mean_drifts=tuple(self.get(z, SENSOR_OFFSET, file, _of_estimator(part)) for part in CURRENT),
            offset=self.get(z, OFFSET, file) + self.get(z, "dead time"),
            width=self.get(z, WIDTH, file),
            powers=tuple(powers),
            inputs=self.followed(z, sampled),
            count=1 if z.ndim == 1 else z.shape[1],
        )

    def noise(self, z: Array, quantity: str) -> tuple[Any, Any, Any]:
        """Return the standard deviations of the white and the coloured noise of a sensor, and the correlation time."""
        white = self.get(z, WHITE, quantity)
        coloured = white * self.get(z, "coloured noise", quantity)
        return white, coloured, self.get(z, "correlation time", quantity, default=1.0)

    def wander(self, z: Array, sampled: SampledLog, sensor: Sensor) -> Any:
        """Return the standard deviation of what wanders of a sensor's values in a log; 0 unless it is an estimator's
        velocity."""
        return self.get(z, WANDER, HORIZONTAL) if sampled.record.wanders and sensor.is_horizontal_velocity else 0.0

    def row_noise(self, z: Array, name: str) -> Any:
        """Return the relative noise of the rows of a table."""
        return self.get(z, "row noise", name)

    @property
    def least_lag(self) -> float:
        """The lag of a vehicle without one, s: the least one if there is a parameter, and otherwise 0."""
        return 0.0 if self.index(LAG) is None else LEAST_LAG

    def limit(self, z: Array) -> Any:
        """Return the strongest command that the thrusters follow."""
        return self.get(z, "command limit", default=1.0)

    def with_larger_dead_bands(self, z: Array) -> Array:
        """Return the coordinates with larger dead bands of measured curves, and linear shares that make up for them.

        A linear share of 2 d almost makes up for a dead band d, as a (c - d)^2 is almost a c^2 - 2 a d c.
        """
        larger = z.copy()
        for n, p in enumerate(self.parameters):
            band = self.index("dead band", p.of)
            if p.kind == "linear thrust" and not p.is_fixed and band is not None:
                d = self.parameters[band].deviation
                larger[n], larger[band] = z[n] + 2.0 * d, z[band] + d
        return larger

    def followed(self, z: Array, sampled: SampledLog) -> Array:
        """Return the inputs that thrusters follow, by limits and a drop of the voltage: (sets x) rows x inputs."""
        some = np.broadcast_arrays(self.limit(z), self.get(z, "slew limit"), self.get(z, "voltage drop"))
        numbers = np.reshape(some, (3, -1)).T
        if (numbers == numbers[0]).all():
            return _followed(sampled, *numbers[0].tolist())
        return np.array([_followed(sampled, *each) for each in numbers.tolist()])

    def push(self, z: Array, sampled: SampledLog, axis: Axis) -> Array:
        """Return the command along an axis that thrusters follow at each row, relative to all at full command."""
        commands = dict(zip(sampled.layout.inputs, self.followed(z, sampled).T, strict=True))
        return push_along(sampled.layout, axis, {t.name: commands[f"u_{t.name}"] for t in sampled.layout.thrusters})


@lru_cache(64)
def _followed(sampled: SampledLog, limit: float, rise: float, drop: float) -> Array:
    """Return the inputs of a log that thrusters can follow. Most sets of parameters that run together have the same.

    `rise` is the least time from rest to full command, s.
    """
    found = sampled.record.inputs
    if sampled.log.follows_axis or (limit >= 1.0 and rise == drop == 0.0):
        return found
    found = found.copy()
    indices = [n for n, name in enumerate(sampled.layout.inputs) if name in sampled.layout.commands]
    for n in indices:
        found[:, n] = np.clip(found[:, n], -limit, limit)
        if rise > 0.0:
            found[:, n] = [*_ramped(found[:, n].tolist(), sampled.spans.tolist(), rise)]
    # Power and thrust grow about with the square of a command. The load is the mean of these squares.
    load = np.mean(found[:, indices] ** 2, axis=1)
    found[:, indices] *= np.sqrt(np.maximum(1.0 - drop * load, 0.0))[:, None]
    return found


def _ramped(values: Sequence[float], spans: Sequence[float], rise: float) -> Iterator[float]:
    """Yield the mean over each row of a command that moves at a limited rate to that of the row, and then stays."""
    now = values[0]
    for value, span in zip(values, spans, strict=True):
        change, ramp = value - now, rise * abs(value - now)
        if ramp < span:
            now = value
            yield value - 0.5 * change * ramp / span
        else:
            before = now
            now += np.copysign(span / rise, change)
            yield 0.5 * (before + now)


def table_of(known: Prior, logs: Sequence[SampledLog], row_noises: Sequence[str]) -> Table:
    """Return all parameters for some logs. `row_noises` are the names of the tables whose rows have noise."""
    every = _parameters(known, logs, row_noises)
    parameters = tuple(p for p in every if p.deviation > 0.0 and p.of not in known.own_curves)
    return Table(known.layout, known.coefficients, known.full, parameters, known.exact, known)


Make = Callable[..., Parameter]
"""A function that returns a parameter of a kind. One whose prior is exact has the deviation 0, and is left out."""


def _parameters(known: Prior, logs: Sequence[SampledLog], row_noises: Sequence[str]) -> Iterator[Parameter]:
    def prior(key: str) -> float:
        """Return a deviation. Where the thrust is exact, so is its shape."""
        is_exact = key.startswith(("thrust_", "dead_band")) and prior("thrust") == 0.0
        return 0.0 if is_exact else known.deviations.get(key, PRIORS[key].deviation)

    def make(
        kind: str,
        of: str = "",
        part: str = "",
        deviation: float | None = None,
        parts: Iterable[Part] = (),
        **own: Any,
    ) -> Parameter:
        declared = KINDS[kind]
        usual = {one.name: getattr(declared, one.name) for one in fields(Coordinate)}
        if deviation is None:
            deviation = prior(declared.prior.key) if declared.prior else declared.deviation
        names = (one.coefficient(declared.keys[0]) for one in parts if declared.is_coefficient)
        usual["sets"] = tuple(name for name in names if name in known.layout.coefficients)
        return Parameter(kind, of, part, **usual | {"deviation": deviation} | own)

    if logs or known.has_times:
        T = max((known.coefficients[c.coefficient("T")] for c in known.curves if "T" in c.keys), default=0.0)
        width = prior("lag")
        yield make(LAG, deviation=width and max(width, T), mean=T) if known.with_lag else make(LAG)
    if logs:
        for part, key in CENTRE.items():
            if key in {*known.layout.restoring} - known.exact:
                yield make("centre of buoyancy", "", part, offset=known.coefficients[key], sets=(key,))
        yield make("dead time")
        if any("n_V" in c.keys for c in known.curves):
            yield make("voltage", parts=known.layout.curves)
        yield from _of_sensors(logs, make)
    if known.layout.is_uncertain:
        if (angle := _angle(known.layout)) is not None:
            yield make(DIRECTION, YAW.name, mean=angle, low=0.5 * angle, high=0.5 * (angle + 0.5 * pi), null=angle)
        for kind, part, key in _GEOMETRY:
            yield make(kind, YAW.name, part, sets=(key,))
    yield from _of_curves(known, make, prior("thrust_shape"))
    yield from _advance(known, make)
    yield from _of_axes(known, make)
    for number, sampled in enumerate(logs):
        yield from _of_one_log(sampled, number, make)
    yield from _of_noise(known, logs, make)
    if logs:
        yield from _of_structure(known, make)
    for name in row_noises:
        yield make("row noise", name)


def _angle(layout: Layout) -> float | None:
    """Return the angle from ahead, rad, if all thrusters that push ahead or sideways have the same one."""
    parts = [np.abs(t.direction.value) for t in layout.thrusters]
    level = [(ahead, sideways) for ahead, sideways, _ in parts if max(ahead, sideways) > FAINT]
    angles = {round(float(np.arctan2(sideways, ahead)), 9) for ahead, sideways in level}
    is_one = len(angles) == 1 and all(min(one) > FAINT for one in level)
    return angles.pop() if is_one else None


def _of_curves(known: Prior, make: Make, shape: float) -> Iterator[Parameter]:
    for curve in known.curves:
        name = curve.name
        is_measured = name in known.measured_curves
        yield make("thrust scale", name, deviation=1.0 if is_measured else known.thrust_errors.get(name))
        if curve.tables:
            continue
        has_reverse = f"a_t{REVERSE}" in curve.keys and curve.coefficient(f"a_t{REVERSE}") not in known.exact
        is_told_astern = has_reverse and known.measured_curves.get(name, False)
        if shape:
            for end in ("", REVERSE) if is_told_astern else ("",):
                low, width = _least_linear(curve, known.coefficients, end), _LINEAR if is_measured else None
                yield make("linear thrust", name, "astern" if end else "", low=low, deviation=width)
        if has_reverse:
            # Forces that were measured astern are data, and not an effect that may be absent.
            null = {"null": None} if is_told_astern else {}
            yield make("reverse thrust", name, deviation=0.5 if is_measured else None, **null)
        band, astern = (curve.coefficient(f"c_0{end}") for end in ("", REVERSE))
        if "c_0" in curve.keys and band not in known.exact and shape:
            yield make("dead band", name, mean=known.coefficients[band], parts=[curve])
            if is_told_astern and astern not in known.exact | {band}:
                yield make("dead band astern", name)


def _advance(known: Prior, make: Make) -> Iterator[Parameter]:
    """Yield the loss of thrust with speed of each curve. Forces at rest, even exact ones, do not tell it."""
    for curve in known.layout.curves:
        if "d" in curve.keys and not curve.tables and curve.coefficient("d") not in known.exact:
            yield make("advance", curve.name, mean=_lost(curve, known.coefficients))
            if f"d{REVERSE}" in curve.keys:
                yield make("advance astern", curve.name)


def _lost(curve: Curve, c: Mapping[str, float], end: str = "") -> float:
    """Return the share of the full thrust of a curve ahead or astern that is lost per speed of advance, s/m."""
    lost, a, b = (c[curve.coefficient(f"{key}{end}")] for key in ("d", "a_t", "b_t"))
    return lost / (a + b)


def _least_linear(curve: Curve, c: Mapping[str, float], end: str) -> float:
    """Return the least linear share of a thrust beside that of its prior, with which it is not negative.

    A negative share would take the place of a dead band d, because a (c - d)^2 is almost a c^2 - 2 a d c.
    """
    a, b = (c[curve.name_of(f"{key}{end}")] for key in ("a_t", "b_t"))
    return -b / (a + b)


def _fixed(p: Parameter, z: float = 0.0) -> Parameter:
    """Return a parameter that stays where it is. All models have the same parameters."""
    return replace(p, mean=z, low=z, high=z)


def _of_structure(known: Prior, make: Make) -> Iterator[Parameter]:
    """Yield what hypotheses about the structure may free, which else stays at what is known, or where it changes
    nothing, and the strength of each thruster that shares a curve."""
    for kind in (kind for kind, one in KINDS.items() if one.is_of_structure):
        for of, name in known.layout.health.items() if KINDS[kind].of_thruster else [("", "")]:
            row = make(kind, of, sets=(name,) if KINDS[kind].is_coefficient else ())
            absent = known.coefficients.get(name, 0.0) if row.sets else row.null or 0.0
            if {*row.sets} <= {*known.layout.coefficients}:
                if kind == STRENGTH and _may_differ(known, of):
                    yield replace(row, mean=absent)
                else:
                    yield row if (kind, of) in known.freed else _fixed(row, absent)


def _may_differ(known: Prior, name: str) -> bool:
    """Return True for a thruster that shares a curve with others. One alone is as strong as its curve says."""
    types = {of: known.own_curves.get(curve.name, (curve.name,))[0] for of, curve in known.layout.curve_of.items()}
    return not known.layout.has_wrench and [*types.values()].count(types[name]) > 1


def _of_axes(known: Prior, make: Make) -> Iterator[Parameter]:
    for axis in (*known.fitted, *known.unseen):
        form = known.layout.by_name[axis.name]
        for name, kind in KINDS.items():
            if kind.concerns(known, form):
                yield make(name, axis.name, parts=[form], **kind.own(known, form))


def _of_one_log(sampled: SampledLog, number: int, make: Make) -> Iterator[Parameter]:
    file, half = sampled.file, 0.5 * sampled.interval
    share, width = (0.5, {"mean": 1.0, "low": 1.0}) if sampled.is_momentary else (1.0, {})
    yield make(OFFSET, file, mean=-half, deviation=max(share * half, 0.005), log=number)
    yield make(WIDTH, file, log=number, **width)
    directions = CURRENT if "psi" in sampled.layout.state or sampled.layout.has_attitude else CURRENT[:1]
    for part in directions if sampled.shows_horizontal else ():
        yield make("current", file, part, log=number)
    offsets = {m.quantity.name: m.quantity.unit for m in _with_offset(sampled)}
    if sampled.record.wanders:
        offsets |= dict.fromkeys(map(_of_estimator, directions), "m/s")
    for part, unit in offsets.items():
        yield make(SENSOR_OFFSET, file, part, unit=unit, log=number)


def _with_offset(sampled: SampledLog) -> Iterator[SampledChannel]:
    """Yield the velocities whose own offset a position tells.

    That of an estimator is in the frame of the earth. A horizontal velocity through the water differs from the change
    of a position by a current, too.
    """
    for m in sampled.seen_twice:
        if not m.sensor.is_level or (m.sensor.over_ground and not sampled.record.wanders):
            yield m


def _of_sensors(logs: Sequence[SampledLog], make: Make) -> Iterator[Parameter]:
    """Yield the places of the sensors whose velocity or position changes as the vehicle turns, and all lags."""
    for is_velocity, kind in PLACED.items():
        turns = {
            form.axis
            for sampled in logs
            for form in sampled.layout.axes
            if form.axis.is_rotation
            and any(s.is_velocity == is_velocity and has_place(s) for s in sampled.record.sensors)
        }
        for part in _PLACES if turns - {YAW} else _PLACES[:2] if turns else ():
            yield make(kind, "", part)
    for axis in {m.axis: None for one in logs for m in one.seen_twice}:
        yield make(SENSOR_SCALE, axis.name)
    for part in sorted({with_same_lag(sensor) for one in logs for sensor in one.record.sensors}):
        yield make("sensor lag", "", part)


def _of_noise(known: Prior, logs: Sequence[SampledLog], make: Make) -> Iterator[Parameter]:
    moving = {name for one in logs for name in one.layout.by_name}
    for axis in known.layout.bare_axes:
        if axis.name in moving and known.full[axis.name]:  # also if no test fits it: its motion may be unstable
            yield make("slow force", axis.name)
            if own := [one.is_momentary for one in logs if one.lost and axis.name in one.layout.by_name]:
                short = make("short force", axis.name)
                yield short if any(own) else _fixed(short, short.mean)
    if logs and not known.layout.fins:
        yield make("slow gain")
    if any(s.axis is HEAVE for one in logs for s in one.record.sensors):
        yield make("slow velocity", HEAVE.name)
    horizontal = {one.record.wanders for one in logs if one.shows_horizontal}
    if False in horizontal:
        yield make("slow velocity", HORIZONTAL)
    if True in horizontal:
        yield make(WANDER, HORIZONTAL)
    noises = grouped((m.quantity.name, m.noise) for one in logs for m in one.measured)
    quieter = 0.0 if any(one.lost for one in logs) else _QUIETER
    for quantity, some in noises.items():
        mean = log(sorted(some)[len(some) // 2])
        yield make(WHITE, quantity, mean=mean, low=mean - quieter)
        yield make("coloured noise", quantity)
        yield make("correlation time", quantity)
