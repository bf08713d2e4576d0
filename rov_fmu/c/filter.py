"""The extended Kalman filter of the identification, in C (fmu_src/engine/filter.c).

It runs through the samples of one log with one set of parameters. The model of the log is a stochastic differential
equation around the vehicle's equation of motion; filter.c states it.
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.compile import FILTER_FILE
from rov_fmu.c.library import load_library
from rov_fmu.c.simulation import places_of
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]
Indices = NDArray[np.intc]

STATE, OVER_GROUND, ANGLE = range(3)
"""What a sensor measures: a state, a velocity over ground along an axis of the body, or an angle of the attitude."""
DRIFTS = ("x", "y", "z")
MOST_SENSORS = 16
_CURRENT = ("V_N", "V_E", "V_D")


@dataclass(frozen=True)
class Sensor:
    """What one sensor of a log measures."""

    axis: Axis
    is_velocity: bool
    over_ground: bool = True
    """False for a velocity through the water."""


@dataclass(frozen=True, eq=False)
class Record:
    """One log as the filter reads it. n samples in the order of time, m rows of inputs, s sensors."""

    sensors: tuple[Sensor, ...]
    time: Array
    """n: s."""
    value: Array
    """n: SI units. Angles may wrap."""
    sensor: Indices
    """n: the index of the sensor."""
    since: Array
    """m: the time before which the inputs of the row did not act, s."""
    told: Array
    """m: the time of the row, s, ascending."""
    inputs: Array
    """m x inputs of the layout. All that do not change by a row are 0 and stand among the parameters."""
    start: Mapping[str, float]
    """The states of the vehicle at the first sample, by name; the others are 0."""
    errors: Mapping[str, float]
    """The standard deviations of all states of the vehicle that the sensors concern."""
    tilt: Array = field(default_factory=lambda: np.zeros((3, 0)))
    """3 x k: times (s), and the measured roll and pitch (rad) of a vehicle that has neither axis; k = 0 or k >= 2."""


@dataclass(frozen=True)
class Slow:
    """A slow process: its stationary standard deviation and its time constant (s). Size 0: there is none."""

    size: float = 0.0
    time_constant: float = 10.0


@dataclass(frozen=True)
class Parameters:
    """One set of parameters of the filter."""

    coefficients: Mapping[str, float]
    """The coefficients of the vehicle, and inputs that are constant, such as the current V_N and V_E."""
    forces: tuple[Slow, ...]
    """The slow force along each axis of the layout, N or N m."""
    gain: Slow
    """The slow change of the logarithm of all thrust."""
    drifts: tuple[Slow, Slow, Slow]
    """The slow velocity over ground to the north, to the east and down, m/s."""
    white: tuple[float, ...]
    """The standard deviation of the white noise of each sensor."""
    noise: tuple[Slow, ...]
    """The coloured noise of each sensor."""
    offset: float = 0.0
    """How much later than its row a command acts, s."""
    width: float = 0.0
    """The length of the window within which it acts, relative to the time between two rows."""
    units: Mapping[str, float] = field(default_factory=dict)
    """The unit of a state by its name, or of the slow force along an axis by the name of the axis; 1 for all others.

    Gains are kept in these units. If the units grow with the scale of all forces, this scale changes nothing that a run
    with frozen gains predicts, as it should be.
    """
    inputs: Array | None = None
    """The rows of inputs, if they are others than those of the record."""


@dataclass(frozen=True, eq=False)
class Run:
    """What the filter found in a log of n samples."""

    innovations: Array
    """n: measured minus predicted."""
    variances: Array
    """n: the variance of each innovation by the model; empty in a run with frozen gains."""
    pieces: Indices
    gains: Array
    states: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """n x states of the filter after each sample, if they were asked for."""
    deviations: Array = field(default_factory=lambda: np.zeros((0, 0)))


class _Record(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_ssize_t) for name in ("samples", "rows", "sensors")),
        *((name, ctypes.c_void_p) for name in ("time", "value", "sensor", "kind", "place", "since", "told")),
        *((name, ctypes.c_void_p) for name in ("start", "error", "active")),
        ("tilts", ctypes.c_ssize_t),
        *((name, ctypes.c_void_p) for name in ("tilt_time", "roll", "pitch")),
        *((name, ctypes.c_double) for name in ("longest", "changing", "share")),
    ]


class _Mode(ctypes.Structure):
    _fields_ = [("repeats", ctypes.c_int), ("begin", ctypes.c_double), ("span", ctypes.c_double)]


class _Output(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_void_p) for name in ("innovation", "variance", "pieces", "gain", "states", "deviations")
    ]


class DivergedError(Exception):
    """The motion of the model overflows."""


class Filter:
    """The filter of one layout. The runs of different parameters are independent, so threads may share it."""

    def __init__(self, vehicle: Vehicle, longest: float = 0.1, changing: float = 0.0125, share: float = 0.5) -> None:
        """Load the filter. Raises BuildError.

        `longest` is the longest step of the mean, s, and `changing` that in which a command changes. No step is longer
        than this share of the fastest time constant.
        """
        layout = vehicle.layout
        self.layout, self._steps = layout, (longest, changing, share)
        library = load_library(vehicle, FILTER_FILE)
        sizes = (ctypes.c_int * 6)()
        library.filter_sizes(sizes)
        self.states, axes, sensors, self.variables, self.inputs, self.held = sizes
        assert (axes, sensors) == (len(layout.axes), MOST_SENSORS)
        self._run = library.run_filter
        self._places = places_of(layout)
        self._records: dict[tuple[Record, tuple[bool, ...]], tuple[_Record, list[object]]] = {}
        self._where = np.array(_where(layout, self._places), np.intc)
        self.vehicle_states = [*layout.state]
        first = len(self.vehicle_states)
        self.force, self.gain, self.drift = first, first + axes, first + axes + 1
        self.noise = self.drift + len(DRIFTS)
        """The places of the slow processes among the states of the filter."""

    def run(
        self,
        record: Record,
        parameters: Parameters,
        *,
        repeated: Run | None = None,
        frozen: bool = False,
        begin: float = -1.0,
        span: float = inf,
        with_states: bool = False,
    ) -> Run:
        """Run through a log.

        `repeated` gives the steps of an earlier run, so that results are smooth functions of the parameters; with
        `frozen`, also its gains, and no covariance is computed. With `begin` >= 0 the innovations are those of a
        prediction that starts anew at `begin`, and after each `span`. Raises DivergedError.
        """
        n = len(record.time)
        numbers = self._numbers(parameters)
        log = self._record(record, parameters)
        rows = np.ascontiguousarray(record.inputs if parameters.inputs is None else parameters.inputs, np.float64)
        pieces = np.ones(n, np.intc) if repeated is None else repeated.pieces
        gains = repeated.gains if repeated is not None and frozen else np.zeros((n, self.states))
        found = Run(
            np.zeros(n),
            np.zeros(0 if frozen else n),
            pieces,
            gains,
            np.zeros((n, self.states) if with_states else (0, 0)),
            np.zeros((n, self.states) if with_states else (0, 0)),
        )
        first, last = (found.innovations, found.variances), (gains, found.states, found.deviations)
        arrays: list[Array | Indices] = [*first, pieces, *last]
        output = _Output(*(array.ctypes.data if array.size else None for array in arrays))
        mode = _Mode(0 if repeated is None else 2 if frozen else 1, begin, min(span, 1e300))
        scratch = np.zeros(len(record.told) * self.held // 8)
        where, set_of, inputs, scratched = (
            ctypes.c_void_p(array.ctypes.data) for array in (self._where, numbers, rows, scratch)
        )
        if self._run(where, ctypes.byref(log), set_of, inputs, ctypes.byref(mode), ctypes.byref(output), scratched):
            raise DivergedError
        return found

    def _numbers(self, parameters: Parameters) -> Array:
        """Return the struct `parameters` of filter.c as an array."""
        at = np.zeros(self.variables)
        for name, value in parameters.coefficients.items():
            if name in self._places:
                at[self._places[name]] = value
        idle = [Slow()] * (MOST_SENSORS - len(parameters.noise))
        slow = [*parameters.forces, parameters.gain, *parameters.drifts, *parameters.noise, *idle]
        white = [*parameters.white, *(1.0 for _ in idle)]
        sizes, constants = [one.size for one in slow], [one.time_constant for one in slow]
        units = np.ones(self.states)
        names = [*self.vehicle_states, *(form.axis.name for form in self.layout.axes)]
        units[: len(names)] = [parameters.units.get(name, 1.0) for name in names]
        return np.concatenate([at, sizes, constants, white, units, [parameters.offset, parameters.width]])

    def _record(self, record: Record, parameters: Parameters) -> _Record:
        """Return the struct `record`, which is made once for each log and set of states with a covariance."""
        slow = [*parameters.forces, parameters.gain, *parameters.drifts, *parameters.noise]
        acting = tuple(one.size > 0.0 for one in slow)
        found = self._records.get((record, acting))
        if found is None:  # another thread may have made it meanwhile, and its arrays must stay alive
            found = self._records.setdefault((record, acting), self._arrays(record, acting))
        return found[0]

    def _arrays(self, record: Record, acting: Sequence[bool]) -> tuple[_Record, list[object]]:
        """Return the struct `record` with its arrays, which must stay alive."""
        kinds = [self._kind(sensor) for sensor in record.sensors]
        first = float(record.time[0])  # the numbers near 1e9 of a clock are too coarse for small changes of a delay
        start, error = np.zeros(self.states), np.zeros(self.states)
        active = np.zeros(self.states, np.intc)
        for n, name in enumerate(self.vehicle_states):
            start[n], error[n] = record.start.get(name, 0.0), record.errors.get(name, 0.0)
            active[n] = name in record.errors
        active[self.force : self.force + len(acting)] = acting
        active[-1] = 1
        arrays: list[Array | Indices] = [
            *(np.ascontiguousarray(array, np.float64) for array in (record.time - first, record.value)),
            np.ascontiguousarray(record.sensor, np.intc),
            *(np.array(column, np.intc) for column in zip(*kinds, strict=True)),
            *(np.ascontiguousarray(array, np.float64) for array in (record.since - first, record.told - first)),
            *(start, error, active),
        ]
        sizes = len(record.time), len(record.told), len(record.sensors)
        tilt = [np.ascontiguousarray(row) for row in record.tilt - np.array([[first], [0.0], [0.0]])]
        pointers = [array.ctypes.data for array in arrays], [array.ctypes.data for array in tilt]
        return _Record(*sizes, *pointers[0], len(tilt[0]), *pointers[1], *self._steps), [*arrays, *tilt]

    def _kind(self, sensor: Sensor) -> tuple[int, int]:
        """Return the kind and the place of a sensor, as filter.c wants them."""
        axis = sensor.axis
        if sensor.is_velocity:
            through_water = axis.is_rotation or not sensor.over_ground
            return (STATE, self._places[axis.velocity]) if through_water else (OVER_GROUND, axis.place)
        if axis.is_rotation:
            state = "psi" if axis is YAW else ""
            return (STATE, self._places[state]) if state in self.vehicle_states else (ANGLE, axis.place)
        return STATE, self._places[DRIFTS[axis.place]]


def _where(layout: Layout, places: Mapping[str, int]) -> Sequence[int]:
    """Return the struct `places` of filter.c."""

    def of(names: Sequence[str], among: Mapping[str, object]) -> list[int]:
        return [places[name] if name in among else -1 for name in names]

    axes = [form.axis for form in layout.axes]
    return [
        *of([axis.external for axis in axes], layout.inputs),
        *(-1 if axis.is_rotation else axis.place for axis in axes),
        *of(_CURRENT, layout.inputs),
        *of(DRIFTS, layout.state),
        *of([QUATERNION[0], "psi"], layout.state),
        *of([HEAVE.coefficient("F_0")], layout.coefficients),
    ]
