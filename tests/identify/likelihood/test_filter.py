"""The filter in C agrees with a textbook filter in NumPy and with the engine."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, exp, inf, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.c.compile import C_SOURCES, FILTER_LANES_FILE, VECTORS_HEADER, compile_engine
from rov_fmu.c.simulation import Array, simulate
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.identify.given import with_axes_alone
from rov_fmu.identify.likelihood.filter import DivergedError, Filter, FilterRun, Parameters, Record, Sensor, Slow
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.identify.likelihood.sets import one_set
from tests.vehicles import VIDEORAY, extended
from verification.references.kalman import Belief, Sample, run

DEPTH, VELOCITY = Sensor(HEAVE, is_velocity=False), Sensor(HEAVE, is_velocity=True)
INPUTS = [*VIDEORAY.layout.inputs]
"""The inputs of the VideoRay; the first is the command to port."""
NONE = Slow()
START = {"w": 0.05, "z": 1.0, "F_t": 0.1}
ERRORS = {"w": 0.1, "z": 0.02, "F_t": 0.05}


def heave(**more: float) -> Vehicle:
    """Return the heave of the VideoRay alone, with other or more coefficients."""
    k = extended(VIDEORAY, **more)
    layout = with_axes_alone(k.layout, [HEAVE])
    return Vehicle(layout, {name: k[name] for name in layout.coefficients})


LAGGING = heave(T_top=0.2, F_0_w=0.1)
SWITCHES = np.array([0.0, 0.83, 2.47, 4.1])
COMMANDS = np.array([0.0, 0.6, -0.4, 0.3])


def record(
    sensors: Sequence[Sensor],
    samples: Sequence[tuple[float, int]],
    values: Array | None = None,
    *,
    rows: tuple[Array, Array] = (SWITCHES, COMMANDS),
    between: float = 0.1,
    start: dict[str, float] = START,
    errors: dict[str, float] = ERRORS,
    inputs: Sequence[str] = ("u_t", "Z_ext"),
) -> Record:
    """Return a log with samples of a time and a sensor, whose commands are those of the first input."""
    time, sensor = (np.array(column) for column in zip(*sorted(samples), strict=True))
    told, commands = rows
    numbers = np.zeros((len(told), len(inputs)))
    numbers[:, 0] = commands
    value = np.zeros(len(time)) if values is None else values
    return Record(tuple(sensors), time, value, sensor.astype(np.intc), told - between, told, numbers, start, errors)


def parameters(k: Vehicle, sensors: int, **changes: Any) -> Parameters:
    """Return the parameters of a filter without any slow process, and with white noise of 0.01, with some changes."""
    known = Parameters(
        coefficients=dict(k.coefficients),
        forces=(NONE,) * len(k.layout.axes),
        gain=NONE,
        drifts=(NONE, NONE, NONE),
        white=(0.01,) * sensors,
        noise=(NONE,) * sensors,
    )
    return replace(known, **changes)


# ---- The textbook ----------------------------------------------------------------------------------------------------

WHITE = (0.004, 0.02)
PROCESSES = (Slow(0.3, 2.0), Slow(0.2, 5.0), Slow(0.02, 3.0), Slow(0.006, 0.7), Slow(0.03, 0.4))
"""The slow force, gain and velocity, and the coloured noise of a depth and of a velocity."""
SIZES, TIME_CONSTANTS = (np.array([getattr(one, key) for one in PROCESSES]) for key in ("size", "time_constant"))


def with_all(k: Vehicle) -> Parameters:
    """Return the parameters of a filter for a depth and a velocity with all slow processes and noises."""
    force, gain, drift, *noise = PROCESSES
    drifts = NONE, NONE, drift
    return parameters(k, 2, forces=(force,), gain=gain, drifts=drifts, noise=tuple(noise), white=WHITE)


@dataclass(frozen=True)
class Diver:
    """The heave of one axis with everything that is slow, by hand.

    The states are w, z, F, force, gain, drift, two noises, and what sensors of depth and velocity with a lag show.
    """

    k: Vehicle
    switches: Array
    commands: Array
    lags: Array

    def rates(self, time: float, x: Array) -> Array:
        k, (w, _, F, force, gain, drift, *_) = self.k, x.tolist()
        c = float(self.commands[np.searchsorted(self.switches, time) - 1])
        steady = (k["a_t_top"] * abs(c) + k["b_t_top"]) * c * exp(gain)
        drag = (k["a_d_w"] * abs(w) + k["b_d_w"]) * w
        load = k["alpha_w"] * F + k["F_0_w"] + force - drag
        moved = [load * k["beta_w"] / k["m_rov"], w + drift, (steady - F) / k["T_top"]]
        true = np.array([x[1], w + drift])
        return np.concatenate([moved, -x[3:8] / TIME_CONSTANTS, (true - x[8:]) / self.lags])


def textbook(k: Vehicle, log: Record, lags: Sequence[float] = ()) -> tuple[Array, Array]:
    """Return the innovations and variances of a log of depth and velocity by the textbook filter.

    A sensor with a lag begins at the true value, up to the lag times a rate of 0.1.
    """
    measure: list[Callable[[Array], float]] = [lambda x: float(x[1] + x[6]), lambda x: float(x[0] + x[5] + x[7])]
    if lags:
        measure = [lambda x: float(x[8] + x[6]), lambda x: float(x[9] + x[7])]
    shown = np.eye(10)
    shown[8:] = 0.0
    shown[8, 1] = shown[9, 0] = shown[9, 5] = 1.0
    mean = shown @ [*log.start.values(), *np.zeros(7)]
    P = shown @ np.diag(np.square([*log.errors.values(), *SIZES, 0.0, 0.0])) @ shown.T
    P[8:, 8:] += np.diag(np.square(0.1 * np.array(lags or (0.0, 0.0))))
    belief = Belief(float(log.time[0]), mean, P)
    samples = [
        Sample(t, y, measure[n], WHITE[n])
        for t, y, n in zip(log.time.tolist(), log.value.tolist(), log.sensor.tolist(), strict=True)
    ]
    diver = Diver(k, log.told, log.inputs[:, 0], np.array(lags or (1.0, 1.0)))
    diffusion = np.diag([0.0, 0.0, 0.0, *(2.0 * SIZES**2 / TIME_CONSTANTS), 0.0, 0.0])
    return run(belief, samples, diver.rates, diffusion, log.told.tolist())


def sampled(seed: int = 0, seconds: float = 6.0) -> list[tuple[float, int]]:
    """Return samples of a depth at 5 Hz, and of a velocity at about 12 Hz at irregular times."""
    random = np.random.default_rng(seed)
    irregular = np.cumsum(random.uniform(0.02, 0.14, round(12 * seconds)))
    return [(0.2 * n, 0) for n in range(round(5 * seconds))] + [(t, 1) for t in irregular.tolist() if t < seconds]


def measured(k: Vehicle, log: Record, seed: int = 1, lags: tuple[float, ...] = ()) -> Record:
    """Return the log with values near those of the model."""
    off = Filter(k).run(log, parameters(k, 2, lags=lags), begin=0.0).innovations
    random = np.random.default_rng(seed)
    noise = np.array(WHITE)[log.sensor] * random.standard_normal(len(log.time))
    return replace(log, value=log.value - off + noise)


@pytest.mark.parametrize("lags", [pytest.param((), marks=pytest.mark.long), (0.3, 0.5)])
@pytest.mark.parametrize(("longest", "near"), [(0.1, 0.01), pytest.param(0.00025, 2e-4, marks=pytest.mark.long)])
def test_innovations_and_variances_are_those_of_a_textbook(
    longest: float, near: float, lags: tuple[float, ...]
) -> None:
    """The errors of the filter are of first order in its step, and below 1 % with the usual one of 0.1 s."""
    log = measured(LAGGING, record((DEPTH, VELOCITY), sampled()), lags=lags)
    found = Filter(LAGGING, longest).run(log, replace(with_all(LAGGING), lags=lags))
    off, variances = textbook(LAGGING, log, lags)
    assert 1.0 < np.abs(off / np.sqrt(variances)).max() < 3.0, "outliers count less than in a textbook"
    assert found.variances == pytest.approx(variances, rel=near)
    assert np.abs((found.innovations - off) / np.sqrt(variances)).max() < near


def test_a_lag_of_zero_is_none() -> None:
    """The slow velocity over ground, which goes on to change during a step, makes a small difference."""
    log, known = measured(LAGGING, record((DEPTH, VELOCITY), sampled())), with_all(LAGGING)
    fine = Filter(LAGGING, 0.002)
    at_once, shown = fine.run(log, known), fine.run(log, replace(known, lags=(0.0, 0.0)))
    assert shown.variances == pytest.approx(at_once.variances, rel=1e-3)
    assert np.abs((shown.innovations - at_once.innovations) / np.sqrt(at_once.variances)).max() < 1e-3


@pytest.mark.parametrize("name", ["videoray", "bluerov2_heavy"])
def test_a_heading_with_a_lag_turns_over(name: str) -> None:
    """It is that of the filter y' = (psi - y) / 0.4 s, by the exponential of each interval of 5 ms."""
    k = load_vehicle(SHIPPED[name])
    layout = replace(k.layout, mix={}, pulse=None, has_dead_time=False)
    k, lag, step = Vehicle(layout, {name: k[name] for name in layout.coefficients}), 0.4, 0.005
    start = {"r": 2.0, **({QUATERNION[0]: cos(1.4), QUATERNION[3]: sin(1.4)} if layout.has_attitude else {"psi": 2.8})}
    samples = [(step * n, 0) for n in range(400)]
    log = record([Sensor(YAW, is_velocity=False)], samples, start=start, errors={}, inputs=[*layout.inputs])
    log = replace(log, inputs=np.zeros_like(log.inputs))
    at_once, shown = (-Filter(k).run(log, parameters(k, 1, lags=lags), begin=0.0).innovations for lags in ((), (lag,)))
    psi, expected = np.unwrap(at_once), [float(at_once[0])]
    for begin, end in zip(psi[:-1].tolist(), psi[1:].tolist(), strict=True):
        middle = 0.5 * (begin + end)
        expected.append(middle + (expected[-1] - middle) * exp(-step / lag))
    assert psi.max() > 3.5, "it turns over"
    assert np.remainder(shown - expected + pi, 2.0 * pi) - pi == pytest.approx(0.0, abs=1e-4)


PROBES = (Sensor(YAW, is_velocity=False), Sensor(SURGE, is_velocity=True), Sensor(SURGE, is_velocity=False))
CURRENT = {"V_N": 0.2, "V_E": -0.1}


def test_a_turning_vehicle_measures_its_velocity_over_ground() -> None:
    """The textbook has u, r, x, y, psi and the slow velocity of the water to the north and to the east."""
    k = VIDEORAY
    start = {"u": 0.3, "r": 0.2, "x": 0.0, "y": 0.0, "psi": -1.5}
    errors = {"u": 0.1, "r": 0.1, "x": 0.05, "y": 0.05, "psi": 0.2}
    tau, size, white = 3.0, 0.05, (0.02, 0.03, 0.05)
    samples = [(t, n) for n, rate in enumerate((4.0, 7.0, 1.0)) for t in np.arange(0.0, 5.0, 1.0 / rate).tolist()]
    log = record(PROBES, samples, rows=(np.zeros(1), np.array([0.3])), start=start, errors=errors, inputs=INPUTS)
    F = (k["a_t_rear"] * 0.3 + k["b_t_rear"]) * 0.3 / 2.0  # of the thruster to port alone
    torque = F * k["R"] * sin(k["gamma"])

    def rates(_: float, x: Array) -> Array:
        u, r, _, _, psi, north, east = x.tolist()
        du = (k["alpha_u"] * F - (k["a_d_u"] * abs(u) + k["b_d_u"]) * u) * k["beta_u"] / k["m_rov"]
        dr = (k["alpha_r"] * torque - (k["a_d_r"] * abs(r) + k["b_d_r"]) * r) * k["beta_r"] / k["I_r"]
        moved = [du, dr, u * cos(psi) + CURRENT["V_N"] + north, u * sin(psi) + CURRENT["V_E"] + east, r]
        return np.array([*moved, -north / tau, -east / tau])

    def over_ground(x: Array) -> float:
        return float(x[0] + cos(x[4]) * (CURRENT["V_N"] + x[5]) + sin(x[4]) * (CURRENT["V_E"] + x[6]))

    measure: list[Callable[[Array], float]] = [lambda x: float(x[4]), over_ground, lambda x: float(x[2])]
    water = Slow(size, tau)
    coefficients = {**k.coefficients, **CURRENT}
    known = parameters(k, 3, white=white, drifts=(water, water, NONE), coefficients=coefficients)
    fine = Filter(k, 0.001)
    predicted = -fine.run(log, known, begin=0.0).innovations
    noise = np.array(white)[log.sensor] * np.random.default_rng(2).standard_normal(len(log.time))
    log = replace(log, value=predicted + noise)
    found = fine.run(log, known)
    belief = Belief(0.0, np.array([*start.values(), 0.0, 0.0]), np.diag(np.square([*errors.values(), size, size])))
    told = zip(log.time.tolist(), log.value.tolist(), log.sensor.tolist(), strict=True)
    diffusion = np.diag([*np.zeros(5), *[2.0 * size**2 / tau] * 2])
    off, variances = run(belief, [Sample(t, y, measure[n], white[n]) for t, y, n in told], rates, diffusion)
    assert found.variances == pytest.approx(variances, rel=5e-4)
    assert np.abs((found.innovations - off) / np.sqrt(variances)).max() < 5e-4


@pytest.mark.parametrize(("turned", "scale", "offset"), [(0.0, 1.0, 0.0), (2.1, 1.0, 0.0), (2.1, 1.05, 0.02)])
def test_a_sensor_beside_the_origin_measures_the_turn(turned: float, scale: float, offset: float) -> None:
    """A velocity at a place is that of the origin plus the turn times the place, and a position is beside it.

    A sensor of velocity over ground that is turned to starboard measures along its own directions. What an estimator
    adds is in the frame of the earth. Each sensor then multiplies by its scale, and adds its offset.

    The variances are those of errors of one state at a time.
    """
    k, place, psi = load_vehicle(SHIPPED["bluerov2_heavy"]), np.array([0.4, -0.2, 0.3]), 0.9
    layout = replace(k.layout, mix={}, pulse=None, has_dead_time=False)
    k = Vehicle(layout, {name: k[name] for name in layout.coefficients})
    velocity, turn = {"u": 0.2, "v": -0.1, "w": 0.1}, {"p": -0.3, "q": 0.2, "r": 0.5}
    state = {**velocity, **turn, QUATERNION[0]: cos(0.5 * psi), QUATERNION[3]: sin(0.5 * psi)}
    kinds = ((True, False), (True, True), (False, True))
    sensors = [Sensor(axis, moves, ground) for moves, ground in kinds for axis in (SURGE, SWAY, HEAVE)]
    white, told, filter = 0.01, (np.zeros(1), np.zeros(1)), Filter(k)
    levers = (tuple(place.tolist()),) * len(sensors)
    scales, offsets = (scale,) * len(sensors), tuple(offset * n for n in range(len(sensors)))
    drifts = -2.0 * offset, 3.0 * offset
    known = parameters(k, len(sensors), levers=levers, turn=turned, scales=scales, offsets=offsets, mean_drifts=drifts)

    def predicted(changed: dict[str, float], errors: dict[str, float]) -> tuple[Array, Array]:
        """Return what the sensors measure of a state, and the variances of the first sample of each sensor alone."""
        off, variances = np.zeros(len(sensors)), np.zeros(len(sensors))
        for n in range(len(sensors)):
            log = record(sensors, [(0.0, n)], rows=told, start=state | changed, errors=errors, inputs=[*layout.inputs])
            run = filter.run(log, known)
            off[n], variances[n] = -run.innovations[0], run.variances[0]
        return off, variances

    found, _ = predicted({}, {})
    moved = np.array([*velocity.values()]) + np.cross([*turn.values()], place)
    over_ground = about_z(-turned) @ (moved + about_z(-psi) @ [*drifts, 0.0])
    at_once = np.concatenate([moved, over_ground, about_z(psi) @ place])
    assert found == pytest.approx(scale * at_once + offsets)
    for name in ("u", "v", "p", "q", "r", QUATERNION[2], QUATERNION[3]):
        slope = (predicted({name: state.get(name, 0.0) + 1e-5}, {})[0] - found) / 1e-5
        _, variances = predicted({}, {name: 0.1})
        assert variances == pytest.approx(white**2 + (0.1 * slope) ** 2, rel=1e-3), name


def about_z(angle: float) -> Array:
    """Return the matrix that turns a vector about the vertical axis."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


# ---- The mean --------------------------------------------------------------------------------------------------------


TOLD = {
    "z": DEPTH,
    "w": Sensor(HEAVE, is_velocity=True, over_ground=False),
    "psi": Sensor(YAW, is_velocity=False),
    "r": Sensor(YAW, is_velocity=True),
    "phi": Sensor(ROLL, is_velocity=False),
    "theta": Sensor(PITCH, is_velocity=False),
}
"""Sensors by the variable that they should show."""


@pytest.mark.parametrize("name", ["videoray", "bluerov2_heavy"])
def test_the_mean_is_the_motion_of_the_engine(name: str) -> None:
    """Samples that tell nothing leave the mean to itself. What each sensor should show is a variable of the vehicle."""
    k, random = load_vehicle(SHIPPED[name]), np.random.default_rng(3)
    layout = replace(k.layout, mix={}, pulse=None, has_dead_time=False)
    k = Vehicle(layout, {name: k[name] for name in layout.coefficients})
    inputs, time = [*layout.inputs], 0.1 * np.arange(200.0)
    told = time[::17]
    commands = {name: random.uniform(-0.5, 0.5, len(told)) for name in layout.commands}
    numbers = np.zeros((len(told), len(inputs)))
    for command, values in commands.items():
        numbers[:, inputs.index(command)] = values
    usual = {name: value for name, value in layout.usual_inputs.items() if name not in commands}
    rest, exact = layout.at_rest, dict.fromkeys(layout.state, 1e-9)
    water = usual | {"V_N": 0.2, "V_E": -0.1}
    shown = [name for name in TOLD if name in {*layout.state, *layout.angles}]
    sensor = np.arange(len(time), dtype=np.intc) % len(shown)
    log = Record(tuple(TOLD[name] for name in shown), time, 0.0 * time, sensor, told, told, numbers, rest, exact)
    known = parameters(k, len(shown), white=(1e9,) * len(shown), coefficients={**k.coefficients, **water})
    found = Filter(k).run(log, known, with_states=True)
    held = np.searchsorted(told, time, side="right") - 1
    given = {name: values[held] for name, values in commands.items()}
    run_of = simulate(k, time, {**given, **water, **rest}, [*layout.state, *shown]).values[:, 0]
    motion, variables = run_of[: len(layout.state)], run_of[len(layout.state) :]
    scale = np.maximum(np.ptp(motion, axis=1), 1e-3)
    assert (np.abs(found.states[:, : len(motion)].T - motion).max(axis=1) < 1e-3 * scale).all()
    assert np.ptp(motion[0]) > 0.1
    off = variables[sensor, np.arange(len(time))] + found.innovations
    assert np.abs(np.remainder(off + pi, 2.0 * pi) - pi).max() < 1e-3
    assert np.ptp(variables, axis=1).min() > 0.01


@pytest.mark.parametrize("power", [-0.6, 0.5])
def test_the_mean_has_another_power_of_drag(power: float) -> None:
    """SciPy integrates w and F, ahead and astern, where drag has other coefficients astern."""
    k = heave(T_top=0.2, F_0_w=0.1, a_d_w_reverse=14.0, b_d_w_reverse=0.9)
    time = 0.1 * np.arange(60.0)

    def rates(t: float, x: Array) -> list[float]:
        (w, F), c = x.tolist(), float(COMMANDS[np.searchsorted(SWITCHES, t, side="right") - 1])
        end = "_reverse" if w < 0.0 else ""
        drag = (k[f"a_d_w{end}"] * abs(w) * abs(w / 0.3) ** (power - 0.1 * (w < 0.0)) + k[f"b_d_w{end}"]) * w
        moved = (k["alpha_w"] * F + 0.1 - drag) * k["beta_w"] / k["m_rov"]
        return [moved, ((k["a_t_top"] * abs(c) + k["b_t_top"]) * c - F) / k["T_top"]]

    x, expected = np.array([START["w"], START["F_t"]]), list[Array]()
    for begin, end in zip(SWITCHES, [*SWITCHES[1:], 6.0], strict=True):
        at = time[(time >= begin) & (time < end)]
        run_of = solve_ivp(rates, (begin, end - 1e-12), x, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12)
        expected.append(run_of.sol(at)[0])
        x = run_of.y[:, -1]
    log = record((VELOCITY,), [(t, 0) for t in time.tolist()], between=0.0)
    known = parameters(k, 1, white=(1e9,), powers=((power, power - 0.1, 0.3),))
    found = Filter(k).run(log, known)
    assert -found.innovations == pytest.approx(np.concatenate(expected), abs=1e-4)
    plain = Filter(k).run(log, replace(known, powers=()))
    assert np.abs(plain.innovations - found.innovations).max() > 0.01
    assert (
        Filter(k).run(log, replace(known, powers=((0.0, 0.0, 0.3),))).innovations.tolist() == plain.innovations.tolist()
    )


def test_a_measured_tilt_turns_the_net_weight_and_the_way() -> None:
    """Of a vehicle without roll and pitch; the tilt is the same from the first to the last sample."""
    share, sensors = cos(0.5) * cos(0.3), (TOLD["w"], DEPTH)
    log = record(sensors, [(t, n) for t in (0.25 * np.arange(20.0)).tolist() for n in (0, 1)])
    tilt = np.array([[0.0, 5.0], [0.5, 0.5], [0.3, 0.3]])
    tilted, level = (
        -Filter(k).run(read, parameters(k, 2), begin=0.0).innovations
        for k, read in ((LAGGING, replace(log, tilt=tilt)), (heave(T_top=0.2, F_0_w=0.1 * share), log))
    )
    assert tilted[::2] == pytest.approx(level[::2], rel=1e-9)
    assert tilted[1::2] - START["z"] == pytest.approx(share * (level[1::2] - START["z"]), abs=1e-9)
    assert np.ptp(level[1::2]) > 0.1


def test_diverging_motion_is_an_error() -> None:
    log = record((DEPTH,), [(t, 0) for t in np.arange(0.0, 5.0, 0.1).tolist()])
    known = parameters(LAGGING, 1)
    assert np.isfinite(Filter(LAGGING).run(log, known).innovations).all()
    wild = replace(known, coefficients={**LAGGING.coefficients, "a_d_w": -1e9})
    with pytest.raises(DivergedError):
        Filter(LAGGING).run(log, wild)


# ---- Samples ---------------------------------------------------------------------------------------------------------


def turning(values: Array, k: Vehicle = VIDEORAY) -> FilterRun:
    """Return the run of a vehicle that turns for 20 s, by its heading."""
    time = 0.25 * np.arange(len(values))
    log = record(
        (Sensor(YAW, is_velocity=False),),
        [(t, 0) for t in time.tolist()],
        values,
        rows=(np.zeros(1), np.array([0.4])),
        start={},
        errors={"r": 0.1, "psi": 0.1},
        inputs=INPUTS,
    )
    return Filter(k).run(log, parameters(k, 1, forces=(NONE, NONE, Slow(0.1)), white=(0.02,)))


def test_headings_are_compared_within_half_a_turn() -> None:
    values = -turning(np.zeros(80)).innovations  # whatever they are
    steady = 0.9 * 0.25 * np.arange(80.0) + 0.01 * np.sin(values)
    whole, wrapped = turning(steady), turning(np.remainder(steady + pi, 2.0 * pi) - pi)
    assert steady[-1] > 4.0 * pi
    assert wrapped.innovations == pytest.approx(whole.innovations, abs=1e-9)
    assert np.abs(whole.innovations).max() <= pi


def test_an_outlier_tells_ever_less() -> None:
    """Beyond three standard deviations of the innovation, its weight is 3 / |u|, in the mean and in the covariance."""

    def after(value: float) -> FilterRun:
        log = record((DEPTH,), [(0.0, 0)], np.array([START["z"] + value]))
        return Filter(LAGGING).run(log, parameters(LAGGING, 1), with_states=True)

    deviation = float(np.sqrt(ERRORS["z"] ** 2 + 0.01**2))
    z = Filter(LAGGING).vehicle_states.index("z")
    for u, weight in ((1.0, 1.0), (2.9, 1.0), (6.0, 0.5), (60.0, 0.05)):
        run = after(u * deviation)
        share = weight * ERRORS["z"] ** 2 / deviation**2
        assert float(run.states[0, z]) - START["z"] == pytest.approx(share * u * deviation)
        assert float(run.deviations[0, z]) == pytest.approx(ERRORS["z"] * np.sqrt(1.0 - share))
        assert run.variances == pytest.approx([deviation**2])


# ---- Runs that repeat, and predictions -------------------------------------------------------------------------------


@pytest.mark.parametrize("frozen", [False, True])
@pytest.mark.parametrize("turns", [False, True])
def test_sets_in_lanes_run_like_each_of_them_alone(frozen: bool, turns: bool) -> None:
    """They differ in coefficients, noise, and when commands act. One that diverges leaves the others alone."""
    k = VIDEORAY if turns else LAGGING
    if turns:
        sensors, errors = PROBES, dict.fromkeys(("u", "r", "x", "y", "psi"), 0.1)
        samples = [(0.1 * n, n % 3) for n in range(50)]
        commands = (np.array([0.0, 1.02, 1.4, 3.0]), np.array([0.0, 0.4, -0.3, 0.2]))
        log = record(sensors, samples, rows=commands, start={}, errors=errors, inputs=INPUTS)
        known = parameters(k, 3, forces=(Slow(0.1),) * 3, gain=Slow(0.2, 5.0), coefficients=dict(k.coefficients))
    else:
        log, known = measured(k, record((DEPTH, VELOCITY), sampled())), with_all(k)
    random, of_both, count = np.random.default_rng(7), Filter(k), 11
    sets = replace(
        known,
        coefficients={name: value * random.uniform(0.9, 1.1, count) for name, value in known.coefficients.items()},
        white=tuple(sigma * random.uniform(0.5, 2.0, count) for sigma in known.white),
        powers=tuple((*random.uniform(-0.6, 0.6, (2, count)), 0.3) for _ in k.layout.axes),
        offset=random.uniform(-0.1, 0.1, count),
        width=random.uniform(0.0, 1.0, count),
        count=count,
    )
    first = of_both.run(log, replace(known, width=0.5))
    alone = [of_both.run(log, one_set(sets, n), repeated=first, frozen=frozen) for n in range(count)]
    masses = np.where(np.arange(count) == 5, np.nan, sets.coefficients["m_rov"])
    bad = replace(sets, coefficients={**sets.coefficients, "m_rov": masses})
    found = of_both.run_many(log, bad, first, frozen=frozen)
    assert [n for n, run in enumerate(found) if run is None] == [5]
    for of_set, expected in zip(found, alone, strict=True):
        if of_set is not None:
            scale = np.abs(expected.innovations).max()
            assert of_set.innovations == pytest.approx(expected.innovations, rel=1e-9, abs=1e-9 * scale)
            assert of_set.variances == pytest.approx(expected.variances, rel=1e-9)


def test_functions_of_vectors_are_exact_to_rounding(tmp_path: Path) -> None:
    """They are those of the lanes, beside numbers of 64 bits of mantissa. NaN stays NaN, so that a run diverges."""
    compute = """
        #define EXPORT __attribute__((visibility("default")))
        EXPORT void compute(const double x[], const double y[], double found[], long n) {
            for (long k = 0; k < n; k++) {
                const real a = x[k], b = y[k], each[5] = {sin(a), cos(a), atan2(a, b), exp(b), logarithm(fabs(a))};
                for (int f = 0; f < 5; f++) { found[5 * k + f] = LANE(each[f], k % LANES); }
            }
        }"""
    files = VECTORS_HEADER, C_SOURCES / "real.h", FILTER_LANES_FILE
    library = tmp_path / "functions"
    library.write_bytes(compile_engine({"filter.c": compute} | {path.name: path.read_text() for path in files}))
    random, count = np.random.default_rng(3), 5000
    x = random.uniform(-1.0, 1.0, count) * 10.0 ** random.uniform(-8.0, 5.0, count)
    y = random.uniform(-700.0, 700.0, count)
    y[:6], x[:3] = (0.0, -0.0, 1e-300, -750.0, 750.0, np.nan), (2.0**-0.5, 1.0, -1e-300)
    found = np.zeros((count, 5))
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (x, y, found)]
    ctypes.CDLL(str(library)).compute(*pointers, ctypes.c_long(count))
    a, b = x.astype(np.longdouble), y.astype(np.longdouble)
    with np.errstate(over="ignore", under="ignore"):
        expected = np.column_stack([np.sin(a), np.cos(a), np.arctan2(a, b), np.exp(b), np.log(np.abs(a))]).astype(float)
    expected[3:5, 3] = 0.0, np.inf
    assert found == pytest.approx(expected, rel=1e-15, abs=3e-16, nan_ok=True)


def with_a_gap() -> list[tuple[float, int]]:
    """Return samples at round times, without those between 1.75 and 3.5 s."""
    times = [0.25 * n for n in range(20) if not 7 < n < 14]
    return [(t, n) for t in times for n in (0, 1)]


@pytest.mark.parametrize(
    ("samples", "begin", "span"),
    [(sampled(seconds=5.0), 2.0, inf), (sampled(seconds=5.0), 1.5, 2.0), (with_a_gap(), 0.5, 1.0)],
    ids=["once", "anew", "after a gap"],
)
def test_a_prediction_is_a_run_without_the_samples_since_it_began(
    samples: list[tuple[float, int]], begin: float, span: float
) -> None:
    """By hand, each sample is the only one after those before the last restart."""
    log = measured(LAGGING, record((DEPTH, VELOCITY), samples))
    known, of_heave = with_all(LAGGING), Filter(LAGGING, 0.001)
    found, usual = (of_heave.run(log, known, begin=b, span=s) for b, s in ((begin, span), (1e9, inf)))
    for n, t in enumerate(log.time.tolist()):
        if t < begin:
            assert found.innovations[n] == pytest.approx(usual.innovations[n], abs=1e-12)
            continue
        last = begin if span == inf else begin + span * ((t - begin) // span)
        kept = np.append(np.flatnonzero(log.time < last), n)
        part = replace(log, time=log.time[kept], value=log.value[kept], sensor=log.sensor[kept])
        by_hand = of_heave.run(part, known)
        deviation = np.sqrt(by_hand.variances[-1])
        assert found.innovations[n] == pytest.approx(by_hand.innovations[-1], abs=2e-3 * deviation), t
        assert found.variances[n] == pytest.approx(by_hand.variances[-1], rel=2e-3), t


# ---- Commands --------------------------------------------------------------------------------------------------------

GLIDER = heave(a_d_w=0.0, b_d_w=0.0)
"""A vehicle without drag, whose velocity is the integral of the thrust."""
_THRUST = (GLIDER["a_t_top"] * 0.6 + GLIDER["b_t_top"]) * 0.6
PUSH = GLIDER["alpha_w"] * _THRUST * GLIDER["beta_w"] / GLIDER["m_rov"]
"""Its acceleration at 60 % of full command, m/s2."""


def glided(
    t: float, sensor: Sensor = VELOCITY, *, end: float = 10.0, offset: float = 0.0, width: float = 0.0
) -> tuple[float, float]:
    """Return the mean and the variance of a sensor at a time, divided by PUSH and by its square.

    The push is told at 1 s, half a second after the row before it, and its end at another time.
    """
    log = record(
        (sensor,),
        [(0.0, 0), (t, 0)],
        rows=(np.array([0.0, 1.0, end]), np.array([0.0, 0.6, 0.0])),
        between=0.5,
        start={},
        errors={"w": 1e-9, "z": 1e-9},
    )
    found = Filter(GLIDER, 0.005).run(log, parameters(GLIDER, 1, white=(1e-3,), offset=offset, width=width))
    return -float(found.innovations[1]) / PUSH, (float(found.variances[1]) - 1e-6) / PUSH**2


@pytest.mark.parametrize("t", [0.75, 0.99, 3.0])
def test_a_switch_at_an_unknown_time_has_the_moments_of_a_uniform_time(t: float) -> None:
    """The window of 0.5 s begins at 0.5 s. After it, the variance of the time is h^2 / 12."""
    mean, variance = glided(t, offset=-0.25, width=1.0)
    h, since = 0.5, min(t - 0.5, 0.5)
    assert mean == pytest.approx(since**2 / (2.0 * h) + max(t - 1.0, 0.0), rel=1e-3)
    assert variance == pytest.approx(since**3 / (3.0 * h) - since**4 / (4.0 * h**2), rel=1e-3)
    if t > 1.0:
        assert variance == pytest.approx(h**2 / 12.0, rel=1e-3)


def test_lines_between_rows_lack_as_much_as_each_row_says() -> None:
    """Short forces of twice the size are those of twice the share, and a row says nothing of the rows before it.

    A change along a line has no time of its own, which would add to the variance.
    """
    samples = [(0.05 * n, 0) for n in range(1, 101)]
    log = replace(record([VELOCITY], samples), told=SWITCHES, since=SWITCHES - 0.1)

    def variances(beside: Sequence[float] | None, size: float) -> Array:
        lines = None if beside is None else np.array(beside)[:, None]
        numbers = parameters(LAGGING, 1, short=(Slow(size, 0.05),), width=1.0, offset=-0.05)
        return Filter(LAGGING).run(replace(log, beside=lines), numbers).variances

    usual = variances([1.0, 1.0, 1.0, 1.0], 0.2)
    np.testing.assert_allclose(variances([2.0, 2.0, 2.0, 2.0], 0.1), usual, rtol=1e-12)
    later, row = variances([1.0, 1.0, 5.0, 1.0], 0.2), log.time <= SWITCHES[2]
    np.testing.assert_array_equal(later[row], usual[row])
    row = (log.time > SWITCHES[2] + 0.1) & (log.time < SWITCHES[3])
    assert np.all(later[row] > 1.2 * usual[row])
    jumps = (log.time > SWITCHES[1]) & (log.time < SWITCHES[1] + 0.1)
    assert np.all(variances(None, 0.2)[jumps] > usual[jumps])


@pytest.mark.parametrize("offset", [-0.3, 0.0, 0.4])
def test_an_offset_moves_the_effect_of_a_command(offset: float) -> None:
    mean, variance = glided(2.0, offset=offset)
    assert mean == pytest.approx(1.0 - offset, rel=1e-3)
    assert variance == pytest.approx(0.0, abs=1e-9)
