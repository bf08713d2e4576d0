"""Suggest the next test: the one that would narrow the widest interval most, by its Fisher information.

It is a recording of steps from rest, or forces at weak commands where forces were measured before.

The test stays within the limits that rov.toml gives. Enough is known where the widest interval is narrow, or where no
test within the limits would narrow it by a useful amount.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from types import MappingProxyType

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.thrust_fit import forces
from rov_fmu.identify.simulation.limits import MotionError
from rov_fmu.identify.simulation.prepared import prepare
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.io.toml_file import join_names
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.description import TankLimits
from rov_fmu.vehicle.uncertainty import is_factor, quantile

_COMMANDS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
_PULLS = (0.05, 0.1, 0.15, 0.2)
"""The commands of a test of forces. At weak commands the shape of the thrust curve is least known."""
_TIMES = 4
"""The number of forces at each of these commands."""
_RATE = 10.0  # Hz
_HOLDS = 5.0, 60.0
"""The shortest and the longest hold, s. Limits may make a hold shorter."""
_SHORTER = (1.0, 0.5, 0.25, 0.125)
"""The shares of a hold that are tried until the test is within the limits."""
_KNOWN = 0.05
"""Enough is known if half the width of the interval, relative to the value, is at most this."""
_LEAST_PART = 0.1
"""The share of the quadratic part below which a linear part of thrust or drag hardly matters."""
_USEFUL = 0.9
"""A test is useful if it reduces the width of the interval to at most this share."""
_VAGUE = 1e3
"""The assumed standard error of a coefficient that is not identifiable yet, relative to its value."""
REPEATED = "repeat the first step of the dive at its end, because something drifts during the dive"
"""What to do where drift is suspected: the two steps show how much it is."""
NO_LIMITS = TankLimits()
NOISE = {"distance": 0.02, "depth": 0.01, "heading": 0.01, "roll angle": 0.01, "pitch angle": 0.01, "velocity": 0.02}
"""The noise of a typical sensor (m, rad, m/s), where there is no recording."""


@dataclass(frozen=True)
class Sensor:
    """The sensor of a test."""

    quantity: str
    noise: float
    """The standard deviation of a sample at 10 Hz, increased for correlated noise."""


@dataclass(frozen=True)
class NextTest:
    """An experiment, and its effect on the widest interval of an axis."""

    axis: Axis
    coefficient: str
    interval: tuple[float, float] | None
    """The present interval; None where the coefficient is not identifiable yet."""
    width: float
    """Half the width of the interval relative to the value; infinite where there is none."""
    narrowed: float
    """The width of the interval after the test, relative to the present width."""
    words: str
    """The test; empty where no test is within the limits."""
    repeat: bool = False
    """True when the test should be repeated at the end of the dive, because something drifts over it."""

    @property
    def is_known(self) -> bool:
        """True when every interval of the axis is narrow enough."""
        return self.interval is not None and self.width <= _KNOWN

    @property
    def is_useful(self) -> bool:
        """True when the test narrows the interval by a useful amount."""
        return bool(self.words) and self.narrowed <= _USEFUL


def next_test(
    axis: Axis,
    rov: Rov,
    found: Estimate,
    sensor: Sensor,
    limits: TankLimits = NO_LIMITS,
    scales: Mapping[str, float] = MappingProxyType({}),
    *,
    repeat: bool = False,
) -> NextTest | None:
    """Return the best of many tests within the limits; None where nothing is fitted or nothing moves.

    `scales` has the standard deviation of a force (N) of each thrust curve that was tested. `repeat` says that
    something drifts over a dive of the axis.
    """
    if not found.names:
        return None
    error = np.sqrt(np.diag(found.covariance))
    size = np.maximum([_size(axis, rov, name) for name in found.names], 1e-9)
    relative = np.where(np.isfinite(error), quantile(max(found.degrees_of_freedom, 1.0)) * error / size, inf)
    widest = int(np.argmax(relative))
    error = np.maximum(np.where(np.isfinite(error), error, _VAGUE * size), 1e-12 * size)
    prior = np.where(np.isfinite(found.covariance), found.covariance, 0.0) / np.outer(error, error)
    prior[np.diag_indices(len(size))] = 1.0  # in present standard errors
    before = np.linalg.pinv(prior, hermitian=True)
    internal = error * [1.0 / v if is_factor(n) else 1.0 for n, v in zip(found.names, found.values, strict=True)]
    recordings = [*_recordings(axis, rov, limits)]
    if not recordings:
        return None
    tests = [(words, _information(axis, rov, found.names, sensor, command)) for words, command in recordings if words]
    tests += _forces(rov, dict(zip(found.names, error.tolist(), strict=True)), scales, limits)
    best: tuple[float, str] = (1.0, "")
    for words, gained in tests:
        information = gained * np.outer(internal, internal)
        if np.isfinite(information).all():
            after = np.linalg.pinv(before + information, hermitian=True)
            best = min(best, (float(np.sqrt(np.clip(after[widest, widest], 0.0, 1.0))), words))
    name = found.names[widest]
    return NextTest(axis, name, found.interval(name), float(relative[widest]), *best, repeat)


def _size(axis: Axis, rov: Rov, name: str) -> float:
    """Return the size of a coefficient that its interval is compared with.

    A linear part of thrust or drag that is nearly 0 hardly matters, so it is compared with a share of the quadratic
    part at full command.
    """
    size = abs(rov[name])
    for linear, quadratic in (("b_t", "a_t"), ("b_d", "a_d")):
        if name.startswith(linear) and (beside := name.replace(linear, quadratic, 1)) in rov.coefficients:
            fastest = abs(rov.response(axis, 1.0)[0]) if linear == "b_d" and rov.force(axis, 1.0) else 1.0
            size = max(size, _LEAST_PART * abs(rov[beside]) * (fastest if np.isfinite(fastest) else 0.0))
    return size


def _recordings(axis: Axis, rov: Rov, limits: TankLimits) -> Iterator[tuple[str, Array]]:
    """Yield recordings of steps from rest in one or both directions: a phrase, and the command at each sample.

    The phrase is empty where such steps are beyond the limits.
    """
    strongest = limits.command_max
    for level in (*(c for c in _COMMANDS if c < strongest), strongest):
        if not rov.force(axis, level) or not rov.force(axis, -level):
            continue
        Taus = [rov.response(axis, c)[1] for c in (level, -level)]
        longest = float(np.clip(round(4.0 * max(Taus)), *_HOLDS)) if np.isfinite(Taus).all() else _HOLDS[1]
        for ways in ((level,), (level, -level)):
            yield next(_within(axis, rov, limits, ways, longest), ("", np.zeros(0)))


def _within(
    axis: Axis, rov: Rov, limits: TankLimits, ways: tuple[float, ...], longest: float
) -> Iterator[tuple[str, Array]]:
    """Yield tests within the limits, those with the longest holds and rests first."""
    shorter = [max(round(share * longest), 1.0) for share in _SHORTER]
    for hold, rest in dict.fromkeys(pair for some in shorter for pair in ((some, longest), (some, some))):
        levels = [(0.0, rest), *(part for c in ways for part in ((c, hold), (0.0, rest)))]
        command = np.concatenate([np.full(round(seconds * _RATE), c) for c, seconds in levels])
        if len(command) / _RATE <= limits.duration and _fits(axis, rov, limits, command):
            both = " and ".join(f"{c:.0%}" for c in ways)
            step = "steps" if len(ways) > 1 else "a step"
            words = f"a recording of {step} from rest at {both}, {hold:g} s each, with {rest:g} s of rest after each"
            yield words, command


def _fits(axis: Axis, rov: Rov, limits: TankLimits, command: Array) -> bool:
    """Return True if the vehicle stays within the length of the tank until it has come to rest."""
    if axis.is_rotation or limits.tank_length == inf:
        return True
    model = _simulator(axis, rov, "velocity", np.concatenate([command, np.zeros(round(_HOLDS[1] * _RATE))]))
    try:
        (output,) = model.run(np.zeros(1))
    except MotionError:
        return False
    covered = np.cumsum(output.velocity) / _RATE
    return float(np.ptp(np.append(covered, 0.0))) <= limits.tank_length


def _simulator(
    axis: Axis, rov: Rov, quantity: str, command: Array, names: tuple[str, ...] = (), noise: float = 1.0
) -> Simulator:
    """Return the model of a recording of the command."""
    recording = Recording("", axis, quantity, np.arange(len(command)) / _RATE, command, np.zeros(len(command)))
    return Simulator((prepare(recording, rov),), rov, names, (), np.array([noise]))


def _information(axis: Axis, rov: Rov, names: tuple[str, ...], sensor: Sensor, command: Array) -> Array:
    """Return the information of a recording about the coefficients, allowing for unknown initial values. The result is
    NaN if the motion cannot be computed."""
    model = _simulator(axis, rov, sensor.quantity, command, names, sensor.noise)
    x = model.start(dict(rov.coefficients), {})
    try:
        J = model.jacobian(x)
    except MotionError:
        return np.full((len(names), len(names)), np.nan)
    p, gram = len(names), J.T @ J
    cross = gram[:p, p:]
    return np.asarray(gram[:p, :p] - cross @ np.linalg.pinv(gram[p:, p:]) @ cross.T)


def _forces(
    rov: Rov, errors: Mapping[str, float], scales: Mapping[str, float], limits: TankLimits
) -> Iterator[tuple[str, Array]]:
    """Yield tests of the weak forces of each curve within the limits: a phrase, and the information about coefficients.

    `errors` has the standard errors of the coefficients. The derivatives are secants over these, because those by c_0
    and by b_t are alike where b_t is 0.
    """
    pulls = np.array([c for c in _PULLS if c <= limits.command_max])
    if not pulls.size:
        return
    x, levels = np.concatenate([pulls, -pulls]), join_names(f"{c:.0%}" for c in pulls)
    for name, noise in scales.items():
        curve = rov.layout.curves_by_name[name]
        here = forces(curve, rov.coefficients, x)
        changed = (forces(curve, {**rov.coefficients, n: rov[n] + error}, x) for n, error in errors.items())
        J = np.column_stack([(F - here) / error for F, error in zip(changed, errors.values(), strict=True)])
        words = f"{_TIMES} forces of the {name} thrust at each of {levels}, ahead and in reverse"
        yield words, np.asarray(_TIMES / noise**2 * J.T @ J)
