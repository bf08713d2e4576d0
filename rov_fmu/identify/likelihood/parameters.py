"""The parameters of the likelihood: one table with what each is, its prior, and how it enters the model.

Every parameter has a coordinate z with a normal prior, z ~ N(mean, deviation). A positive number enters as exp(z). The
deviations are those that an engineer would accept; PRIORS has them with their reasons, and [priors] of rov.toml may
change them. No deviation is estimated from one effect.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import inf, log
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import CURVE, HEAVE, PITCH, REVERSE, ROLL, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, VehicleAxis
from rov_fmu.identify.likelihood.curves import COUNT, Shapes
from rov_fmu.identify.likelihood.filter import AT_ORIGIN, Parameters, Sensor, Slow
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.identify.result import PLACED
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True)
class Prior:
    """A deviation that priors use, with its reason."""

    deviation: float
    words: str
    """What deviates."""
    reason: str


PRIORS = {
    "thrust": Prior(0.10, "all forces of a curve, relatively", "two thrusters of one type, or a maker's table"),
    "thrust_shape": Prior(0.10, "the shape of a curve, relative to its force", "published curves differ so"),
    "thrust_reverse": Prior(0.10, "thrust astern to thrust ahead, relatively", "propellers are made for one direction"),
    "dead_band": Prior(0.05, "the command at which thrust begins", "speed controllers have 2 to 8 %"),
    "dead_band_astern": Prior(0.3, "ln of the dead band astern to that ahead", "propellers are made for one direction"),
    "advance": Prior(0.2, "the share of full thrust lost per m/s ahead", "propellers give no thrust at 3 to 10 m/s"),
    "lag": Prior(0.15, "the time constant of the thrusters, s", "small thrusters need 0.05 to 0.3 s"),
    "dead_time": Prior(0.05, "the time from a command to its effect, s", "links of one or two control periods"),
    "inertia": Prior(0.5, "ln of the effective inertia", "added mass is 0.3 to 2 times the mass"),
    "quadratic_drag": Prior(1.0, "ln of the quadratic drag", "a factor of 2.7 about another vehicle or the data"),
    "linear_drag": Prior(1.5, "ln of the linear drag", "it depends on the speed range, the hull and the tether"),
    "drag_astern": Prior(0.2, "ln of the drag astern to the drag ahead", "few hulls differ by more than 20 %"),
    "buoyancy": Prior(0.02, "each coordinate of the centre of buoyancy, m", "floats and ballast are moved so far"),
    "load": Prior(0.05, "a constant load relative to full thrust", "vehicles are trimmed to a few per cent"),
    "current": Prior(0.1, "the current, m/s", "tests are made in calm water"),
    "sensor_lag": Prior(0.3, "the time constant of a sensor, s", "navigation filters smooth over 0 to 0.5 s"),
    "sensor_place": Prior(0.3, "the place of a sensor of velocity or position, m", "it is near the vehicle's origin"),
    "voltage": Prior(0.5, "the exponent of thrust over voltage", "1 to 2 in published tables"),
    "slow_force": Prior(2.5, "ln of the size of a slow force", "0.1 % of full thrust, within a factor of 12"),
    "slow_gain": Prior(
        0.35, "ln of the size of a slow change of thrust", "1 %, to a factor of 2, or it acts as thrust"
    ),
    "slow_velocity": Prior(2.5, "ln of the size of a slow velocity over ground", "1 mm/s, within a factor of 12"),
    "white_noise": Prior(0.7, "ln of a sensor's white noise", "seen in the differences of its samples"),
    "coloured_noise": Prior(1.0, "ln of a sensor's coloured noise, and of its correlation time", "filters in sensors"),
}
"""All deviations by their keys in [priors] of rov.toml. 0 means that the number is exact, or that a slow process is
absent. The noise of a sensor is never exact."""

_SIZES = {"force": (0.001, 1e-7, 0.1), "gain": (0.01, 1e-6, 0.2), "velocity": (0.001, 1e-7, 0.3)}
"""The usual, the least and the largest size of each slow process: relative to full thrust, a fraction, and m/s."""
SLOW = {"slow force": 8.0, "slow gain": 60.0, "slow velocity": 8.0}
"""The time constants of the slow processes, s."""
_COLOURED = (0.3, 2.0)
"""The usual coloured noise relative to the white noise, and its usual correlation time, s."""
_QUIETER = 2.0
"""The white noise is at least exp(-2) of what the differences of the samples show: rounding is never taken as exact."""
_LINEAR = 0.3
"""The deviation of the linear share of a quadratic thrust curve, which measured forces determine."""
CURRENT = ("to the north", "to the east")
"""The parts of a current."""
_PLACES = ("forward", "to starboard", "down")
"""The parts of the place of a sensor."""
CENTRE = {"forward": "x_B", "to starboard": "y_B", "down": "z_B"}
"""The coordinates of the centre of buoyancy."""
USUAL_EXPONENT = 1.5
"""The usual exponent of thrust over voltage."""
_USUAL_LAG = 0.05
"""The usual time constant of the lag of thrusters, s."""
_MOTION_STEP = 3e-6
"""The relative change of z for the derivatives of the motion: kinks are rarely within it, and rounding errors add
less than a per cent."""
LEAST_LAG = 0.02
"""The least time constant of a lag, s. A shorter one cannot be told from the time of the commands."""

_ABSENT = {"F_0": 0.0, "c_0": 0.0, "d": 0.0, "n_V": 0.0, "T": LEAST_LAG}
"""The values of coefficients that a vehicle file may lack. Those astern are then equal to those ahead."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of the likelihood."""

    kind: str
    """What it is, such as `quadratic drag`. Those with a `null` are effects."""
    of: str
    """The name of the axis, the curve or the file that has it; empty for the vehicle."""
    part: str = ""
    """Which of several, such as `north` or a quantity."""
    mean: float = 0.0
    deviation: float = 1.0
    """The prior of its coordinate z."""
    is_log: bool = False
    """True if the number is exp(z)."""
    low: float = -inf
    high: float = inf
    """The bounds of z."""
    null: float | None = None
    """The z at which an effect is absent."""
    of_motion: bool = True
    """False for noise and slow processes, which change the covariance of the filter and not its mean."""
    log: int | None = None
    """The index of the log that alone has it."""
    unit: str = "1"

    @property
    def is_effect(self) -> bool:
        """True for an effect of the motion, which may be absent from the vehicle."""
        return self.null is not None and self.of_motion

    @property
    def is_slow_size(self) -> bool:
        """True for the size of a slow process."""
        return self.kind in SLOW

    @property
    def step(self) -> float:
        """The change of z for its numerical derivative."""
        if not self.of_motion:
            return 1e-2 if self.is_log else 1e-3
        return _MOTION_STEP * (1.0 if self.is_log else self.deviation)


def has_place(sensor: Sensor) -> bool:
    """Return True for a sensor of a velocity or a horizontal position. Its place changes what it measures of a turn."""
    return not sensor.axis.is_rotation and (sensor.is_velocity or sensor.axis is not HEAVE)


def with_same_lag(sensor: Sensor) -> str:
    """Return which sensors of a vehicle share the lag of this one, in words."""
    if sensor.is_velocity:
        return "of the turn rate sensor" if sensor.axis.is_rotation else "of the velocity sensor"
    own = {HEAVE: "depth", YAW: "heading", ROLL: "attitude", PITCH: "attitude"}
    return f"of the {own.get(sensor.axis, 'position')} sensor"


_noise = partial(Parameter, is_log=True, of_motion=False)
"""The parameter of a noise or of the size of a slow process."""


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
    shape_deviation: float = PRIORS["thrust_shape"].deviation
    exact: frozenset[str] = frozenset()
    """The names of the coefficients that no parameter changes."""

    def place(self, kind: str, of: str = "", part: str = "") -> int | None:
        """Return the index of a parameter, or None."""
        return self._places.get((kind, of, part))

    @cached_property
    def _places(self) -> dict[tuple[str, str, str], int]:
        return {(p.kind, p.of, p.part): n for n, p in enumerate(self.parameters)}

    # The coordinates of p parameters are an array of p numbers, or of p x n for n sets of parameters. All that follows
    # from them is then a number, or an array of n.

    def get(self, z: Array, kind: str, of: str = "", part: str = "", default: Any = 0.0) -> Any:
        """Return the number that a coordinate stands for, or a default where there is no such parameter."""
        place = self.place(kind, of, part)
        if place is None:
            return default
        return np.exp(z[place]) if self.parameters[place].is_log else z[place]

    def coefficients(self, z: Array) -> dict[str, Any]:
        """Return all coefficients of the layout for the coordinates of the parameters."""
        found: dict[str, Any] = dict(self.base)
        for form in self.layout.axes:
            self._axis(found, z, form)
        for curve in self.layout.curves:
            self._curve(found, z, curve)
        for part, key in CENTRE.items():
            if key in found:
                found[key] = found[key] + self.get(z, "centre of buoyancy", "", part)
        return found | {name: self.base[name] for name in self.exact}

    def _axis(self, found: dict[str, Any], z: Array, form: VehicleAxis) -> None:
        axis = form.axis
        for key, kind in (("a_d", "quadratic drag"), ("b_d", "linear drag")):
            name = axis.coefficient(key)
            found[name] = self.get(z, kind, axis.name, default=found[name])
            astern = f"{key}{REVERSE}"
            if (reverse := axis.coefficient(astern)) in self.layout.coefficients:
                ratio = self._ratio(reverse, name) * np.exp(self.get(z, "drag astern", axis.name))
                found[reverse] = found[name] * ratio
        beta = axis.coefficient("beta")
        found[beta] = self.base[beta] / self.get(z, "inertia", axis.name, default=1.0)
        if (load := form.coefficient("F_0")) in self.layout.coefficients:
            found[load] = self.base[load] + self.full.get(axis.name, 0.0) * self.get(z, "load", axis.name)

    def _ratio(self, astern: str, ahead: str) -> float:
        """Return a coefficient astern of the base relative to that ahead; 1 if that ahead is 0."""
        return self.base[astern] / self.base[ahead] if self.base[ahead] else 1.0

    def _curve(self, found: dict[str, Any], z: Array, curve: Curve) -> None:
        scale = self.get(z, "thrust scale", curve.name, default=1.0)
        reverse = np.exp(self.get(z, "reverse thrust", curve.name))
        if "k_t" in curve.keys:
            found[curve.coefficient("k_t")] *= scale
        linear = self.get(z, "linear thrust", curve.name)
        astern = self.get(z, "linear thrust", curve.name, "astern", default=linear)
        for end, ratio, moved in (("", 1.0, linear), (REVERSE, reverse, astern)):
            names = [curve.name_of(f"{key}{end}") for key in ("a_t", "b_t")]
            if names[0] in found:
                a, b = (self.base[name] for name in names)
                found[names[0]] = scale * ratio * (a - moved * (a + b))
                found[names[1]] = scale * ratio * (b + moved * (a + b))
        if "c_0" in curve.keys:
            band, other = (curve.coefficient(key) for key in ("c_0", f"c_0{REVERSE}"))
            found[band] = self.get(z, "dead band", curve.name, default=found[band])
            if other != band:
                ratio = self._ratio(other, band) * np.exp(self.get(z, "dead band astern", curve.name))
                found[other] = found[band] * ratio
        if "d" in curve.keys and not curve.tables:
            lost = self.get(z, "advance", curve.name, default=_lost(curve, self.base))
            full = found[curve.coefficient("a_t")] + found[curve.coefficient("b_t")]
            ahead = curve.coefficient("d")
            for name in (ahead, curve.coefficient(f"d{REVERSE}")):
                found[name] = self._ratio(name, ahead) * lost * full
        if "T" in curve.keys:
            lag = curve.coefficient("T")
            found[lag] = np.maximum(self.get(z, "lag", default=found[lag]), LEAST_LAG)
        if "n_V" in curve.keys:
            found[curve.coefficient("n_V")] = self.get(z, "voltage", default=found[curve.coefficient("n_V")])

    def force_unit(self, z: Array, axis: Axis) -> Any:
        """Return what the size of a slow force is relative to, N or N m: full thrust, in proportion to the inertia.

        The data do not tell the scale of all forces.
        """
        return self.full.get(axis.name, 1.0) * self.get(z, "inertia", axis.name, default=1.0)

    def model(self, z: Array) -> tuple[Vehicle, Shapes]:
        """Return the vehicle, and the deviations of the shapes of its curves."""
        coefficients = self.coefficients(z)
        return Vehicle(self.layout, coefficients), self._shapes(z, coefficients)

    def _shapes(self, z: Array, coefficients: Mapping[str, Any]) -> Shapes:
        found, bands = {}, {}
        for curve in self.layout.curves:
            if (first := self.place("thrust shape", curve.name, "1")) is not None:
                found[curve.name] = self.shape_deviation * z[first : first + COUNT]
                ahead, astern = (coefficients.get(curve.coefficient(f"c_0{end}"), 0.0) for end in ("", REVERSE))
                bands[curve.name] = (ahead, astern)
        reverse = {curve.name for curve in self.layout.curves if curve.coefficient(f"a_t{REVERSE}") in self.exact}
        return Shapes(found, bands, frozenset(reverse))

    def of_vehicle(self, vehicle: Vehicle) -> "Table":
        """Return a table whose coefficients are those of a vehicle. An effect that the vehicle lacks is absent."""
        values, places = dict(vehicle.with_(self.layout).coefficients), self.layout.keys_in_file
        parts = {keys[:-1] for keys in vehicle.layout.keys_in_file.values()}
        names = {keys: name for name, keys in places.items()}
        for name, (*part, key) in places.items():  # a coefficient astern stands after that ahead
            ahead = values.get(names.get((*part, key.removesuffix(REVERSE)), ""))
            if name not in values and tuple(part) in parts and (value := _ABSENT.get(key, ahead)) is not None:
                values[name] = value
        return replace(self, base={**self.base, **values}, exact=frozenset(values), shape_deviation=0.0)

    def of_log(self, z: Array, one: SampledLog) -> Parameters:
        """Return the sets of parameters of the filter for a log."""
        file, layout = one.log.file, one.layout
        found = self.coefficients(z)
        shapes = self._shapes(z, found)
        for part, name in zip(CURRENT, ("V_N", "V_E"), strict=True):
            found[name] = self.get(z, "current", file, part)
        whole = self.get(z, "slow gain")
        axes = [form.axis for form in layout.axes]
        units = {axis.name: self.force_unit(z, axis) for axis in axes}
        for thruster, curve in layout.curve_of.items():
            units[f"F_{thruster}"] = self.get(z, "thrust scale", curve.name, default=1.0)

        def drift(axis: Axis | None) -> Slow:
            size = self.get(z, "slow velocity", axis.name if axis else "horizontal")
            return Slow(size, SLOW["slow velocity"])

        along = drift(None) if one.has_positions or one.has_velocities else Slow()
        down = drift(HEAVE) if any(s.axis is HEAVE for s in one.record.sensors) else Slow()
        white, noise = [], []
        for m in one.measured:
            quantity = m.channel.quantity.name
            sigma = self.get(z, "white noise", quantity)
            white.append(sigma)
            coloured = self.get(z, "coloured noise", quantity) * sigma
            noise.append(Slow(coloured, self.get(z, "correlation time", quantity, default=1.0)))
        levers = {key: tuple(self.get(z, kind, "", part) for part in _PLACES) for key, kind in PLACED.items()}
        is_inside = HEAVE.name in layout.by_name
        return Parameters(
            coefficients=found,
            forces=tuple(Slow(units[a.name] * self.get(z, "slow force", a.name), SLOW["slow force"]) for a in axes),
            units=units,
            gain=Slow(whole, SLOW["slow gain"]),
            drifts=(along, along, down if is_inside else Slow()),
            white=tuple(white),
            noise=tuple(noise),
            lags=tuple(self._lag(z, m.sensor) for m in one.measured),
            levers=tuple(levers[m.sensor.is_velocity] if has_place(m.sensor) else AT_ORIGIN for m in one.measured),
            offset=self.get(z, "logging offset", file) + self.get(z, "dead time"),
            width=self.get(z, "logging width", file),
            inputs=shapes.inputs(layout, one.record.inputs),
            count=1 if z.ndim == 1 else z.shape[1],
        )

    def _lag(self, z: Array, sensor: Sensor) -> Any:
        """Return the lag of a sensor; None if it has none."""
        place = self.place("sensor lag", "", with_same_lag(sensor))
        return None if place is None else z[place]


@dataclass(frozen=True)
class Beginning:
    """What is known before any test is fitted, from which the priors are made."""

    layout: Layout
    coefficients: Mapping[str, float]
    """All coefficients of the layout. Those of axes that nothing gives are guesses from the data."""
    fitted: Sequence[Axis]
    """The axes whose motion is tested."""
    curves: Sequence[Curve]
    """The curves that drive these axes."""
    measured_curves: Mapping[str, bool]
    """The curves whose forces were measured, and whether astern, too. Their scale and shape are those of the rows."""
    with_lag: bool
    """True if the base or the file gives a lag."""
    guessed: Sequence[str]
    """The names of the axes whose drag is guessed from the data."""
    full: Mapping[str, float]
    deviations: Mapping[str, float]
    """The table [priors] of rov.toml."""
    exact: frozenset[str] = frozenset()
    """The names of the coefficients that no fit changes."""
    thrust_errors: Mapping[str, float] = field(default_factory=dict)
    """The relative standard error of a curve's forces, by its name, where rov.toml gives it."""
    unseen: Sequence[Axis] = ()
    """The axes along which the dives move, and that no test shows. Their drag and inertia are about those given."""
    has_times: bool = False
    """True if there are tables of time constants, which contain the lag."""
    bent: frozenset[str] = frozenset()
    """The curves whose shape deviates. The others are quadratic, and the fit determines their linear share."""


def table_of(known: Beginning, logs: Sequence[SampledLog], row_noises: Sequence[str]) -> Table:
    """Return all parameters for some logs. `row_noises` are the names of the tables whose rows have noise."""
    shape = known.deviations.get("thrust_shape", PRIORS["thrust_shape"].deviation)
    found = tuple(_parameters(known, logs, row_noises))
    return Table(known.layout, known.coefficients, known.full, found, shape, known.exact)


def _parameters(known: Beginning, logs: Sequence[SampledLog], row_noises: Sequence[str]) -> Iterator[Parameter]:
    def prior(key: str) -> float:
        """Return a deviation. Where the thrust is exact, so is its shape."""
        is_exact = key.startswith(("thrust_", "dead_band")) and prior("thrust") == 0.0
        return 0.0 if is_exact else known.deviations.get(key, PRIORS[key].deviation)

    found = [*_of_curves(known, prior), *_advance(known, prior("advance")), *_of_axes(known, prior)]
    if (logs or known.has_times) and prior("lag"):
        T = max((known.coefficients[c.coefficient("T")] for c in known.curves if "T" in c.keys), default=0.0)
        mean, width = (T, max(prior("lag"), T)) if known.with_lag else (_USUAL_LAG, prior("lag"))
        yield Parameter("lag", "", mean=mean, deviation=width, low=LEAST_LAG, null=LEAST_LAG, unit="s")
    if logs:
        for part, key in CENTRE.items():
            if prior("buoyancy") and key in {*known.layout.restoring} - known.exact:
                yield Parameter("centre of buoyancy", "", part, deviation=prior("buoyancy"), null=0.0, unit="m")
        if prior("dead_time"):
            yield Parameter("dead time", "", deviation=prior("dead_time"), low=0.0, null=0.0, unit="s")
        if prior("voltage") and any("n_V" in c.keys for c in known.curves):
            low, high = CURVE["n_V"].minimum, CURVE["n_V"].maximum  # an effect that is absent is below
            yield Parameter(
                "voltage", "", mean=USUAL_EXPONENT, deviation=prior("voltage"), low=low, high=high, null=0.0
            )
        yield from _of_sensors(logs, prior)
    yield from (p for p in found if p.deviation > 0.0)
    for number, one in enumerate(logs):
        yield from _of_one_log(one, number, prior)
    yield from _of_noise(known, logs, prior)
    for name in row_noises:
        yield _noise("row noise", name, mean=log(0.03), deviation=1.0, low=log(1e-3))


def _of_curves(known: Beginning, prior: Callable[[str], float]) -> Iterator[Parameter]:
    for curve in known.curves:
        name = curve.name
        is_measured = name in known.measured_curves
        scale = 1.0 if is_measured else known.thrust_errors.get(name, prior("thrust"))
        shape = prior("thrust_shape")
        yield Parameter("thrust scale", name, deviation=scale, is_log=True)
        if curve.tables:
            continue
        has_reverse = f"a_t{REVERSE}" in curve.keys and curve.coefficient(f"a_t{REVERSE}") not in known.exact
        is_told_astern = has_reverse and known.measured_curves.get(name, False)
        if shape:
            shapes = [Parameter("thrust shape", name, str(n + 1)) for n in range(COUNT)]
            ends = ("", REVERSE) if is_told_astern else ("",)
            linear = [_linear(curve, known.coefficients, end, _LINEAR if is_measured else shape) for end in ends]
            bends = name in known.bent
            yield from shapes if bends else map(_held, shapes)
            yield from map(_held, linear) if bends else linear
        if has_reverse:
            ratio = 0.5 if is_measured else prior("thrust_reverse")
            # Forces that were measured astern are data, and not an effect that may be absent.
            yield Parameter("reverse thrust", name, deviation=ratio, null=None if is_told_astern else 0.0)
        if "c_0" in curve.keys and curve.coefficient("c_0") not in known.exact and shape:
            mean = known.coefficients[curve.coefficient("c_0")]
            width = prior("dead_band")
            yield Parameter("dead band", name, mean=mean, deviation=width, low=0.0, high=0.5, null=0.0)
            astern = curve.coefficient(f"c_0{REVERSE}")
            if is_told_astern and astern not in known.exact | {curve.coefficient("c_0")}:
                yield Parameter("dead band astern", name, deviation=prior("dead_band_astern"), null=0.0)


def _advance(known: Beginning, deviation: float) -> Iterator[Parameter]:
    """Yield the loss of thrust with speed of each curve. Forces at rest, even exact ones, do not tell it."""
    for curve in known.layout.curves:
        if "d" in curve.keys and not curve.tables and curve.coefficient("d") not in known.exact:
            mean = _lost(curve, known.coefficients)
            yield Parameter("advance", curve.name, mean=mean, deviation=deviation, low=0.0, null=0.0, unit="s/m")


def _lost(curve: Curve, c: Mapping[str, float]) -> float:
    """Return the share of the full thrust of a curve that is lost per speed of advance, s/m."""
    return c[curve.coefficient("d")] / (c[curve.coefficient("a_t")] + c[curve.coefficient("b_t")])


def _linear(curve: Curve, c: Mapping[str, float], end: str, deviation: float) -> Parameter:
    """Return the parameter of the linear share of a thrust.

    It is not negative. A negative share would take the place of a dead band d, because a (c - d)^2 is almost
    a c^2 - 2 a d c.
    """
    a, b = (c[curve.name_of(f"{key}{end}")] for key in ("a_t", "b_t"))
    return Parameter("linear thrust", curve.name, "astern" if end else "", deviation=deviation, low=-b / (a + b))


def _held(p: Parameter) -> Parameter:
    """Return a parameter that stays 0. All models of the curves have the same parameters."""
    return replace(p, deviation=1e-3, low=0.0, high=0.0)


def _of_axes(known: Beginning, prior: Callable[[str], float]) -> Iterator[Parameter]:
    for axis in (*known.fitted, *known.unseen):
        name, c = axis.name, known.coefficients
        if axis.coefficient("beta") not in known.exact:
            yield Parameter("inertia", name, deviation=prior("inertia"), is_log=True)
        for key, kind, width in (
            ("a_d", "quadratic drag", prior("quadratic_drag")),
            ("b_d", "linear drag", prior("linear_drag")),
        ):
            if axis.coefficient(key) not in known.exact:
                mean = log(max(c[axis.coefficient(key)], 1e-9))
                yield Parameter(kind, name, mean=mean, deviation=width, is_log=True)
        free = {*known.layout.coefficients} - known.exact
        if axis in known.fitted and axis.coefficient(f"a_d{REVERSE}") in free:
            yield Parameter("drag astern", name, deviation=prior("drag_astern"), null=0.0)
        if (load := known.layout.by_name[name].coefficient("F_0")) in free and known.full[name]:
            null = -c[load] / known.full[name]
            yield Parameter("load", name, deviation=prior("load"), null=null)


def _of_one_log(one: SampledLog, number: int, prior: Callable[[str], float]) -> Iterator[Parameter]:
    file, half = one.log.file, 0.5 * one.interval
    least = max(half, 0.005)
    yield Parameter("logging offset", file, mean=-half, deviation=least, log=number, unit="s")
    yield Parameter("logging width", file, mean=0.5, deviation=0.5, low=0.0, high=1.0, of_motion=False, log=number)
    if (one.has_positions or one.has_velocities) and prior("current"):
        for part in CURRENT if "psi" in one.layout.state or one.layout.has_attitude else CURRENT[:1]:
            yield Parameter("current", file, part, deviation=prior("current"), null=0.0, log=number, unit="m/s")


def _of_sensors(logs: Sequence[SampledLog], prior: Callable[[str], float]) -> Iterator[Parameter]:
    """Yield the places of the sensors whose velocity or position changes as the vehicle turns, and all lags."""
    for is_velocity, kind in PLACED.items():
        turns = {
            form.axis
            for one in logs
            for form in one.layout.axes
            if form.axis.is_rotation and any(s.is_velocity == is_velocity and has_place(s) for s in one.record.sensors)
        }
        parts = _PLACES if turns - {YAW} else _PLACES[:2] if turns else ()
        for part in parts if prior("sensor_place") else ():
            yield Parameter(kind, "", part, deviation=prior("sensor_place"), null=0.0, unit="m")
    lags = {with_same_lag(sensor) for one in logs for sensor in one.record.sensors}
    for part in sorted(lags) if prior("sensor_lag") else ():
        yield Parameter("sensor lag", "", part, deviation=prior("sensor_lag"), low=0.0, null=0.0, unit="s")


def _of_noise(known: Beginning, logs: Sequence[SampledLog], prior: Callable[[str], float]) -> Iterator[Parameter]:
    def size(kind: str, of: str, key: str) -> Iterator[Parameter]:
        """Yield the size of a slow process, unless it is exactly 0."""
        usual, least, largest = _SIZES[key]
        if deviation := prior(f"slow_{key}"):
            mean, low, high = log(usual), log(least), log(largest)
            yield _noise(kind, of, mean=mean, deviation=deviation, low=low, high=high, null=low)

    moving = {form.axis.name for one in logs for form in one.layout.axes}
    for axis in (form.axis for form in known.layout.axes):
        if axis.name in moving and known.full[axis.name]:  # also if no test fits it: its motion may be unstable
            yield from size("slow force", axis.name, "force")
    if logs and not known.layout.fins:
        yield from size("slow gain", "", "gain")
    if any(s.axis is HEAVE for one in logs for s in one.record.sensors):
        yield from size("slow velocity", HEAVE.name, "velocity")
    if any(one.has_positions or one.has_velocities for one in logs):
        yield from size("slow velocity", "horizontal", "velocity")
    noises: dict[str, list[float]] = {}
    for one in logs:
        for m in one.measured:
            noises.setdefault(m.channel.quantity.name, []).append(m.noise)
    for quantity, some in noises.items():
        white, coloured = prior("white_noise"), prior("coloured_noise")
        mean = log(sorted(some)[len(some) // 2])
        yield _noise("white noise", quantity, mean=mean, deviation=white, low=mean - _QUIETER)
        usual, time = _COLOURED
        yield _noise("coloured noise", quantity, mean=log(usual), deviation=coloured)
        yield _noise("correlation time", quantity, mean=log(time), deviation=coloured, unit="s")
