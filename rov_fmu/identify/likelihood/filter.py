"""The extended Kalman filter of the identification, in C (fmu_src/engine/filter.c).

It runs through the samples of one log with one set of parameters, or with several at once. The model of the log is a
stochastic differential equation around the vehicle's equation of motion; filter.c states it.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.compile import FILTER_FILE, FILTER_LANES_FILE
from rov_fmu.c.library import load_library
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import HEAVE, REVERSE, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.identify.likelihood.kinds import Action
from rov_fmu.io.messages import RovError
from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.vehicle.vehicle import Vehicle

Indices = NDArray[np.intc]
_Value = TypeVar("_Value")
Number = float | Array
"""A number, or an array of one for each set of parameters."""

STATE, OVER_GROUND, ANGLE = range(3)
"""What a sensor measures: a state, a velocity over ground along an axis of the body, or an angle of the attitude."""
DRIFTS = ("x", "y", "z")
MOST_SENSORS = 16
_USUAL_RATE = {False: 0.1, True: 0.3}
"""How fast a measured value changes when a log begins, per second (standard deviation): False for a translation, True
for a rotation."""
AT_ORIGIN = (0.0, 0.0, 0.0)
"""The place of a sensor at the origin."""
_CURRENT = ("V_N", "V_E", "V_D")
_LEARNS = 5.0
"""The time within which the filter learns a velocity that no sensor measures, s."""


@dataclass(frozen=True)
class Sensor:
    """What one sensor of a log measures."""

    axis: Axis
    is_velocity: bool
    over_ground: bool = True
    """False for a velocity through the water."""

    @property
    def is_level(self) -> bool:
        """True for a velocity or a position ahead or to starboard, or north or east."""
        return self.axis.place < 2 and not self.axis.is_rotation

    @property
    def is_horizontal(self) -> bool:
        """True for one over ground."""
        return self.over_ground and self.is_level

    @property
    def is_horizontal_velocity(self) -> bool:
        """True for a velocity over ground ahead or to starboard."""
        return self.is_velocity and self.is_horizontal


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
    wanders: bool = False
    """True if the slow horizontal velocity is an error of the sensors of velocity, which those of position do not have.
    """
    in_motion: bool = False
    """True if the vehicle moves at the first sample with a velocity that nothing measures."""
    beside: Array | None = None
    """m x axes: how large the short forces are after each row, relative to their size. If it is not None, commands
    change along straight lines from row to row."""
    anew: Indices | None = None
    """m: 0 for a row that goes on with the change of the row before, and shares its delay. None: there is none."""

    @property
    def uncounted(self) -> int:
        """How many samples at the begin do not count in J: those from which the filter learns an unknown velocity.

        Their errors come from the start, and what explains them is a wrong vehicle.
        """
        end = self.time[0] + min(_LEARNS, 0.5 * (self.time[-1] - self.time[0]))
        return int(np.searchsorted(self.time, end)) if self.in_motion else 0

    def after(self, begin: float) -> Flags:
        """Return which samples belong to a prediction that starts `begin` (s) after the first one.

        The time is rounded as in `_arrays`. A last sample before the start would have the error of a prediction from
        the first sample, when the velocities of a vehicle in motion were unknown.
        """
        return np.asarray(self.time - self.time[0] >= begin)


@dataclass(frozen=True)
class Slow:
    """A slow process: its stationary standard deviation and its time constant (s). Size 0: there is none."""

    size: Number = 0.0
    time_constant: Number = 10.0


@dataclass(frozen=True, eq=False)
class Parameters:
    """One set of parameters of the filter, or several: each number may be an array with a value for each set."""

    coefficients: Mapping[str, Number]
    """The coefficients of the vehicle, and inputs that are constant, such as the current V_N and V_E."""
    forces: tuple[Slow, ...]
    """The slow force along each axis of the layout, N or N m."""
    gain: Slow
    """The slow change of the logarithm of all thrust."""
    drifts: tuple[Slow, Slow, Slow]
    """The slow velocity over ground to the north, to the east and down, m/s."""
    white: tuple[Number, ...]
    """The standard deviation of the white noise of each sensor."""
    noise: tuple[Slow, ...]
    """The coloured noise of each sensor."""
    short: tuple[Slow, ...] = ()
    """The force along each axis of what momentary commands lack between their rows, N or N m. Empty: there is none."""
    levers: tuple[tuple[Number, ...], ...] = ()
    """The place of each sensor of velocity or position: forward of the origin, to starboard, and down, m."""
    turn: Number = 0.0
    """How far the sensors of velocity over ground are turned to starboard about the vertical axis of the body, rad."""
    scales: tuple[Number, ...] = ()
    """What each sensor multiplies its quantity by. Empty: 1."""
    offsets: tuple[Number, ...] = ()
    """What each sensor then adds, SI units. Empty: 0."""
    mean_drifts: tuple[Number, ...] = (0.0, 0.0)
    """What sensors add to the velocity over ground to the north and to the east, m/s. Positions do not have it."""
    lags: tuple[Number | None, ...] = ()
    """The time constant of each sensor, s; None for one that measures at once. Empty: all do."""
    powers: tuple[tuple[Number, Number, float], ...] = ()
    """By axis: q ahead and astern, and V, of the drag a |v| v |v/V|^q in place of the quadratic one. Empty: all are
    quadratic."""
    offset: Number = 0.0
    """How much later than its row a command acts, s."""
    width: Number = 0.0
    """The length of the window within which it acts, relative to the time between two rows."""
    units: Mapping[str, Number] = field(default_factory=dict)
    """The unit of a state by its name, or of the slow force along an axis by the name of the axis; 1 for all others.

    Gains are kept in these units. If the units grow with the scale of all forces, this scale changes nothing that a run
    with frozen gains predicts, as it should be.
    """
    inputs: Array | None = None
    """The rows of inputs, if they are others than those of the record: sets x rows x inputs, or equal for all sets."""
    count: int = 1
    """The number of sets."""

    @property
    def slow(self) -> list[Slow]:
        """All slow and short processes, in the order of filter.c."""
        return [*self.forces, *(self.short or [Slow()] * len(self.forces)), self.gain, *self.drifts, *self.noise]


@dataclass(frozen=True, eq=False)
class FilterRun:
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
        *((name, ctypes.c_void_p) for name in ("time", "value", "sensor", "kind", "place", "since", "told", "anew")),
        *((name, ctypes.c_void_p) for name in ("start", "error", "active")),
        *((name, ctypes.c_ssize_t) for name in ("tilts", "wanders")),
        *((name, ctypes.c_void_p) for name in ("tilt_time", "roll", "pitch", "beside")),
        *((name, ctypes.c_double) for name in ("longest", "changing", "share")),
    ]


class _Mode(ctypes.Structure):
    _fields_ = [("repeats", ctypes.c_int), ("begin", ctypes.c_double), ("span", ctypes.c_double)]


class _Output(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_void_p) for name in ("innovation", "variance", "pieces", "gain", "states", "deviations")
    ]


class _Set(ctypes.Structure):
    _fields_ = [("numbers", ctypes.c_void_p), ("inputs", ctypes.c_void_p)]


class DivergedError(RovError):
    """The motion of the model overflows."""


class Filter:
    """The filter of one layout. The runs of different parameters are independent, so threads may share it."""

    def __init__(self, vehicle: Vehicle, longest: float = 0.1, changing: float = 0.0125, share: float = 0.5) -> None:
        """Load the filter. Raises BuildError.

        `longest` is the longest step of the mean, s, and `changing` that in which a command changes. No step is longer
        than this share of the fastest time constant.
        """
        layout = vehicle.layout
        self.layout, self._steps, self._vehicle = layout, (longest, changing, share), vehicle
        self._libraries: dict[Path, tuple[Callable[..., None], list[int]]] = {}
        self.states, axes, sensors, self.variables, self.inputs, *_ = self._library(FILTER_FILE)[1]
        assert (axes, sensors) == (len(layout.axes), MOST_SENSORS)
        self._indices = layout.places
        self._records: dict[tuple[Record, tuple[bool, ...]], tuple[_Record, list[object]]] = {}
        self._where = np.array(_where(layout, self._indices), np.intc)
        self.vehicle_states = [*layout.state]
        first = len(self.vehicle_states) + MOST_SENSORS  # after what the sensors with a lag measure
        self.force, self.short = first, first + axes
        self.gain, self.drift = self.short + axes, self.short + axes + 1
        self.noise = self.drift + len(DRIFTS)
        """The indices of the slow processes among the states of the filter."""

    def indices_of(self, slow: Action, axis: str) -> list[int]:
        """Return the indices of a slow process among the states of the filter; none where the vehicle lacks its axis.

        A velocity along no axis is the horizontal one.
        """
        if slow == "force":
            return [index for index, form in enumerate(self.layout.axes, self.force) if form.axis.name == axis]
        if slow == "gain":
            return [self.gain]
        return [self.drift + 2] if axis == HEAVE.name else [self.drift, self.drift + 1]

    def run(
        self,
        record: Record,
        parameters: Parameters,
        *,
        repeated: FilterRun | None = None,
        frozen: bool = False,
        begin: float = -1.0,
        span: float = inf,
        with_states: bool = False,
    ) -> FilterRun:
        """Run through a log.

        `repeated` gives the steps of an earlier run, so that results are smooth functions of the parameters; with
        `frozen`, also its gains, and no covariance is computed. With `begin` >= 0 the innovations are those of a
        prediction that starts anew at `begin`, and after each `span`. Raises DivergedError.
        """
        n, states = len(record.time), self.states
        pieces = np.ones(n, np.intc) if repeated is None else repeated.pieces
        gains = repeated.gains if repeated is not None and frozen else np.zeros((n, states))
        asked = (n, states) if with_states else (0, 0)
        found = FilterRun(np.zeros(n), np.zeros(0 if frozen else n), pieces, gains, np.zeros(asked), np.zeros(asked))
        mode = _Mode(0 if repeated is None else 2 if frozen else 1, begin, min(span, 1e300))
        if self._run(FILTER_FILE, record, parameters, mode, [found]):
            raise DivergedError
        return found

    def run_many(
        self,
        record: Record,
        parameters: Parameters,
        repeated: FilterRun,
        *,
        frozen: bool,
        begin: float = -1.0,
        span: float = inf,
    ) -> list[FilterRun | None]:
        """Run through a log with several sets of parameters, each in a lane of the processor's vectors.

        All have the same slow processes, and repeat the steps of an earlier run and, with `frozen`, its gains. They
        compute no gains of their own. A run that diverges is None and leaves the others alone. `begin` and `span` are
        those of `run`.
        """
        n, gains = len(record.time), repeated.gains if frozen else np.zeros((0, 0))
        found = [
            FilterRun(np.zeros(n), np.zeros(0 if frozen else n), repeated.pieces, gains)
            for _ in range(parameters.count)
        ]
        mode = _Mode(2 if frozen else 1, begin, min(span, 1e300))
        failed = self._run(FILTER_LANES_FILE, record, parameters, mode, found)
        return [None if k in failed else run for k, run in enumerate(found)]

    def _library(self, file: Path) -> tuple[Callable[..., None], list[int]]:
        """Return the function run_filter of a file, and its sizes."""
        if file not in self._libraries:
            library, sizes = load_library(self._vehicle, file), (ctypes.c_int * 8)()
            library.filter_sizes(sizes)
            library.run_filter.restype = None
            self._libraries[file] = library.run_filter, list(sizes)
        return self._libraries[file]

    def _run(
        self, file: Path, record: Record, parameters: Parameters, mode: _Mode, runs: Sequence[FilterRun]
    ) -> set[int]:
        """Run through a log with sets of parameters, write the runs, and return the indices of those that diverge."""
        run, (*_, held, whole, lanes) = self._library(file)
        log, failed = self._record(record, parameters), set[int]()
        numbers, inputs = self._numbers(parameters), _inputs(record, parameters)
        memory = np.zeros((whole + len(record.told) * held) // 8 + 8)
        aligned = ctypes.c_void_p(-(-memory.ctypes.data // 64) * 64)
        where = ctypes.c_void_p(self._where.ctypes.data)
        for first in range(0, len(runs), lanes):
            indices = [min(first + lane, len(runs) - 1) for lane in range(lanes)]
            results = [
                (run.innovations, run.variances, run.pieces, run.gains, run.states, run.deviations)
                for run in (runs[k] for k in indices)
            ]
            given = (_Set * lanes)(
                *(_Set(*(array.ctypes.data + k * array.strides[0] for array in (numbers, inputs))) for k in indices)
            )
            outputs = (_Output * lanes)(
                *(_Output(*(array.ctypes.data if array.size else None for array in own)) for own in results)
            )
            diverged = (ctypes.c_int * lanes)()
            run(where, ctypes.byref(log), given, ctypes.byref(mode), outputs, diverged, aligned)
            failed |= {k for k, has_diverged in zip(indices, diverged, strict=True) if has_diverged}
        return failed

    def _numbers(self, parameters: Parameters) -> Array:
        """Return the struct `parameters` of filter.c for each set, as a row of an array."""
        at: list[Number] = [0.0] * self.variables
        for name, value in parameters.coefficients.items():
            if name in self._indices:
                at[self._indices[name]] = value
        slow = [*parameters.slow, *[Slow()] * (MOST_SENSORS - len(parameters.noise))]
        levers = _for_all(parameters.levers, AT_ORIGIN)
        lags = [lag if lag is not None else 0.0 for lag in parameters.lags]
        units: list[Number] = [1.0] * self.states
        axes = [form.axis.name for form in self.layout.axes]
        for first, names in ((0, self.vehicle_states), (self.force, axes), (self.short, axes)):
            units[first : first + len(names)] = [parameters.units.get(name, 1.0) for name in names]
        powers = parameters.powers or ((0.0, 0.0, 1.0),) * len(axes)
        columns = [
            *at,
            *(one.size for one in slow),
            *(one.time_constant for one in slow),
            *_for_all(parameters.white, 1.0),
            *_for_all(lags, 0.0),
            *(part for lever in levers for part in lever),
            parameters.turn,
            *_for_all(parameters.scales, 1.0),
            *_for_all(parameters.offsets, 0.0),
            *(*parameters.mean_drifts, 0.0),
            *units,
            *(number for column in zip(*powers, strict=True) for number in column),
            *(parameters.offset, parameters.width),
        ]
        found = np.empty((parameters.count, len(columns)))
        for n, column in enumerate(columns):
            found[:, n] = column
        return found

    def _record(self, record: Record, parameters: Parameters) -> _Record:
        """Return the struct `record`, which is made once for each log and set of states with a covariance."""
        lagging = [lag is not None for lag in parameters.lags or [None] * len(record.sensors)]
        acting = (*lagging, *(bool(np.all(one.size > 0.0)) for one in parameters.slow))
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
        sensors, lagged = len(record.sensors), len(self.vehicle_states)
        active[lagged : lagged + sensors] = acting[:sensors]
        active[self.force : self.force + len(acting) - sensors] = acting[sensors:]
        active[-1] = 1
        error[lagged : lagged + sensors] = [_USUAL_RATE[sensor.axis.is_rotation] for sensor in record.sensors]
        anew = np.ones(len(record.told), np.intc) if record.anew is None else record.anew
        arrays: list[Array | Indices] = [
            *(np.ascontiguousarray(array, np.float64) for array in (record.time - first, record.value)),
            np.ascontiguousarray(record.sensor, np.intc),
            *(np.array(column, np.intc) for column in zip(*kinds, strict=True)),
            *(np.ascontiguousarray(array, np.float64) for array in (record.since - first, record.told - first)),
            *(anew, start, error, active),
        ]
        sizes = len(record.time), len(record.told), len(record.sensors)
        tilt = [np.ascontiguousarray(row) for row in record.tilt - np.array([[first], [0.0], [0.0]])]
        beside = None if record.beside is None else np.ascontiguousarray(record.beside)
        pointers = [array.ctypes.data for array in arrays], [array.ctypes.data for array in tilt]
        others = None if beside is None else beside.ctypes.data
        kept: list[object] = [*arrays, *tilt, beside]
        tilts = len(tilt[0]), record.wanders
        return _Record(*sizes, *pointers[0], *tilts, *pointers[1], others, *self._steps), kept

    def _kind(self, sensor: Sensor) -> tuple[int, int]:
        """Return the kind and the index of a sensor, as filter.c wants them."""
        axis = sensor.axis
        if sensor.is_velocity:
            through_water = axis.is_rotation or not sensor.over_ground
            return (STATE, self._indices[axis.velocity]) if through_water else (OVER_GROUND, axis.place)
        if axis.is_rotation:
            state = "psi" if axis is YAW else ""
            return (STATE, self._indices[state]) if state in self.vehicle_states else (ANGLE, axis.place)
        return STATE, self._indices[DRIFTS[axis.place]]


def _inputs(record: Record, parameters: Parameters) -> Array:
    """Return the rows of inputs of each set. The C code reads as many as the record has."""
    found = np.ascontiguousarray(record.inputs if parameters.inputs is None else parameters.inputs, np.float64)
    return np.broadcast_to(found, (parameters.count, *record.inputs.shape))


def _for_all(values: Sequence[_Value], absent: _Value) -> list[_Value]:
    """Return the values of MOST_SENSORS sensors, of which the last ones are absent."""
    return [*values, *[absent] * (MOST_SENSORS - len(values))]


def _where(layout: Layout, indices: Mapping[str, int]) -> Sequence[int]:
    """Return the struct `places` of filter.c."""

    def of(names: Sequence[str], among: Mapping[str, object]) -> list[int]:
        return [indices[name] if name in among else -1 for name in names]

    axes = layout.bare_axes
    drags = [[form.coefficient(key) for key in ("a_d", f"a_d{REVERSE}")] for form in layout.axes]
    return [
        *of([axis.external for axis in axes], layout.inputs),
        *(max(index, 0) for column in zip(*drags, strict=True) for index in of(column, indices)),
        *(-1 if axis.is_rotation else axis.place for axis in axes),
        *(axis.place if axis.is_rotation else -1 for axis in axes),
        *of(_CURRENT, layout.inputs),
        *of(DRIFTS, layout.state),
        *of([QUATERNION[0], "psi"], layout.state),
        *of([layout.by_name[HEAVE.name].name_of("F_0") if layout.has(HEAVE) else ""], layout.coefficients),
        min((indices[name] for name in layout.health.values()), default=0),
        len(layout.health),
    ]
