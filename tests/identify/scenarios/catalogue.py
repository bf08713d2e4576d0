"""The scenarios as data: the vehicle, its tests, its sensors, and what disturbs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import radians
from typing import Literal

from rov_fmu.model.layout import AXES, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.pool import with_more
from verification.references.pool import NOTHING, Conditions, Tilt


@dataclass(frozen=True)
class Sensor:
    """A sensor along or about an axis, with a column in every log."""

    axis: Axis
    quantity: str
    """`velocity` over ground, or the position along the axis: distance, depth, heading, roll angle, pitch angle."""
    noise: float
    """The standard deviation, SI units."""
    every: int = 1
    """The sensor measures in every row, in every second row ..."""
    late: float = 0.0
    """How much later than the clock of the commands its clock is, s."""
    scale: float = 1.0
    """The factor of its values."""
    resolution: float = 0.0
    """The smallest difference of its values, SI units; 0 for none."""
    wraps: bool = False
    """True when an angle is logged within ±180°; otherwise it is continuous."""


@dataclass(frozen=True)
class Logs:
    """The logs of a scenario, and the errors of their times and values."""

    plan: Literal["steps", "pilot"] = "steps"
    """`steps`: tests of each axis alone, by PLANS of tests/recordings.py. `pilot`: all axes at once."""
    axes: tuple[Axis, ...] = (SURGE, HEAVE, YAW)
    """The axes that are tested."""
    count: int = 3
    """The number of recordings (of each axis, with `steps`)."""
    seconds: float = 60.0
    rate: float = 20.0
    """Rows per second."""
    between_rows: bool = False
    """True when commands switch at any time, not only at rows."""
    scatter: float = 0.0
    """The scatter of the times of the rows, as a share of the time between two rows."""
    jitter: float = 0.0
    """The standard deviation of the error of each time stamp, s."""
    gaps: int = 0
    """The number of gaps of 4 s in each recording, while the vehicle is driven."""
    correlation_time: float = 0.0
    """The correlation time of the noise, s; 0 for white noise."""
    columns: tuple[str, ...] = ()
    """More columns, which are measured without noise: voltage, roll, pitch."""


@dataclass(frozen=True)
class Scenario:
    """Logs of a vehicle under some conditions. The identification knows nothing of `more` and `conditions`."""

    vehicle: str = "videoray"
    logs: Logs = Logs()
    sensors: tuple[Sensor, ...] = ()
    more: Mapping[str, float] = field(default_factory=dict)
    """Other coefficients of the true vehicle."""
    conditions: Conditions = NOTHING
    currents: tuple[tuple[float, float], ...] = ()
    """The current of each recording, where they differ."""
    rov_file: str = ""
    """More lines of rov.toml."""
    effects: tuple[str, ...] = ()
    """The kinds of findings about effects that are really there."""
    unexplained: tuple[str, ...] = ()
    """The axes where the model cannot explain the data; none for a complete model."""

    @property
    def truth(self) -> Rov:
        """The true vehicle."""
        return with_more(TRUTHS[self.vehicle], **self.more)

    @property
    def recorded(self) -> tuple[Axis, ...]:
        """The axes with a sensor, in the order of the states."""
        there = {sensor.axis.name for sensor in self.sensors} & {axis.name for axis in self.logs.axes}
        return tuple(axis for axis in AXES.values() if axis.name in there)

    @property
    def coefficients(self) -> tuple[str, ...]:
        """The names of the coefficients that are judged."""
        return tuple(axis.coefficient(key) for axis in self.recorded for key in ("a_d", "b_d", "beta"))


TRUTHS = {
    "videoray": load_vehicle(SHIPPED["videoray"]).rov.replaced({"beta_u": 0.8}),
    "bluerov2_heavy": load_vehicle(SHIPPED["bluerov2_heavy"]).rov.replaced({"z_B": -0.05}),
}
"""The true vehicles. β of the VideoRay in surge differs from 1, where a fit may start. The centre of buoyancy of the
Heavy lies 5 cm above that of mass, so that a pilot without an autopilot can fly it."""
UPRIGHT = '[known]\nz_B = { value = -0.05, unit = "m", source = "measured" }\n'
"""The lines of rov.toml about the Heavy's centre of buoyancy."""

_VOLTAGE = 16.0
"""The voltage of a full battery, V."""
_EXPONENT = 1.5
"""Thrust is proportional to this power of the voltage."""


def voltage(time: float) -> float:
    """Return the voltage (V) of a battery that loses 10 % in a minute."""
    return _VOLTAGE * (1.0 - 0.1 * time / 60.0)


def sagging(time: float) -> float:
    """Return the factor of the thrust under that voltage."""
    return float((voltage(time) / _VOLTAGE) ** _EXPONENT)


# ---- Vehicles and sensors --------------------------------------------------------------------------------------------

VELOCITY, DISTANCE = Sensor(SURGE, "velocity", 0.02), Sensor(SURGE, "distance", 0.02)
DEPTH, HEADING = Sensor(HEAVE, "depth", 0.005), Sensor(YAW, "heading", radians(0.5))
USUAL = (VELOCITY, DEPTH, HEADING)
"""The sensors of the VideoRay."""
DVL = tuple(Sensor(axis, "velocity", 0.01) for axis in (SURGE, SWAY))
ATTITUDE = tuple(Sensor(axis, axis.position, radians(0.3)) for axis in (ROLL, PITCH, YAW))
ALL_ROUND = (*DVL, DEPTH, *ATTITUDE)
"""The sensors of the Heavy."""

_BETWEEN = Logs(between_rows=True)
_PILOT = Logs(plan="pilot")
_LAG = {"T_rear": 0.3, "T_top": 0.3}
_FIT_LAG = "[fit]\nlag = true\n"
_MEASURED = f'{{ value = {_VOLTAGE}, unit = "V", source = "measured" }}'
_FIT_VOLTAGE = f"[fit]\nvoltage = true\n[known]\nV_0_rear = {_MEASURED}\nV_0_top = {_MEASURED}\n"
"""The lines of rov.toml about a battery at whose full voltage the thrust was measured."""
_LOAD = {"F_0_w": 0.1}
_REVERSE = {
    f"{key}_{curve}_reverse": 0.6 * TRUTHS["videoray"][f"{key}_{curve}"]
    for curve in ("rear", "top")
    for key in ("a_t", "b_t")
}
_UP = {f"{key}_w_reverse": 1.3 * TRUTHS["videoray"][f"{key}_w"] for key in ("a_d", "b_d")}
_DELAY, _FLOW = Conditions(delay=0.2), Conditions(current=(0.06, -0.03))
_FLOWS = ("current north", "current east")
_HEAVY = Scenario("bluerov2_heavy", Logs("pilot", tuple(AXES.values()), rate=20.0), ALL_ROUND, rov_file=UPRIGHT)
_TWO = Scenario(logs=replace(_PILOT, count=2), sensors=(replace(VELOCITY, noise=0.01), DEPTH, HEADING))
"""Two recordings of 60 s for tests of the model's structure."""
_TILT = Conditions(tilt=Tilt(radians(10.0)))


def _usual(logs: Logs = Logs(), **more: object) -> Scenario:
    return replace(Scenario(logs=logs, sensors=USUAL), **more)  # type: ignore[arg-type]


def _with(sensors: Sequence[Sensor], sensor: Sensor) -> tuple[Sensor, ...]:
    """Return the sensors with another one along the same axis."""
    return tuple(sensor if other.axis is sensor.axis else other for other in sensors)


COMPLETE: dict[str, Scenario] = {
    "clean": _usual(),
    **{
        f"load of {load} N in heave": _usual(Logs(axes=(HEAVE,)), more={"F_0_w": load}, effects=("load",))
        for load in (0.02, 0.1, 0.3)
    },
    "load": _usual(more=_LOAD, effects=("load",)),
    "delay": _usual(conditions=_DELAY, effects=("delay",)),
    "lag": _usual(more=_LAG, rov_file=_FIT_LAG, effects=("lag",)),
    "delay and lag": _usual(more=_LAG, rov_file=_FIT_LAG, conditions=_DELAY, effects=("delay", "lag")),
    "reverse": _usual(more=_REVERSE, effects=("reverse thrust",)),
    "current": _usual(sensors=_with(USUAL, DISTANCE), conditions=Conditions(current=(0.1, 0.0)), effects=("current",)),
    "load, delay, reverse, correlated noise": _usual(
        Logs(correlation_time=1.0),
        more=_LOAD | _REVERSE,
        conditions=_DELAY,
        effects=("load", "delay", "reverse thrust"),
    ),
    "switches between rows at 10 Hz": _usual(replace(_BETWEEN, rate=10.0), effects=("delay",)),
    "switches between rows at 5 Hz": _usual(replace(_BETWEEN, rate=5.0), effects=("delay",)),
    "irregular stamps": _usual(Logs(rate=10.0, between_rows=True, scatter=0.8, jitter=0.005), effects=("delay",)),
    "another current each time": _usual(
        Logs(axes=(SURGE,)), sensors=(DISTANCE,), currents=((0.1, 0.0), (-0.05, 0.0), (0.07, 0.0)), effects=("current",)
    ),
    "dead band in heave": _usual(Logs(axes=(HEAVE,)), more={"c_0_top": 0.05}, effects=("dead band",)),
    "more drag up than down": _usual(Logs(axes=(HEAVE,)), more=_UP, effects=("reverse drag",)),
    **{
        f"noise of {seconds} s in heave": _usual(Logs(axes=(HEAVE,), correlation_time=seconds))
        for seconds in (0.2, 1.0, 3.0)
    },
    "jitter": _usual(Logs(jitter=0.01), effects=("delay",)),
    "gaps while turning": _usual(Logs(gaps=2)),
    "depth of 1 cm": _usual(sensors=_with(USUAL, replace(DEPTH, noise=0.003, resolution=0.01))),
    "wrap at 180 degrees": _usual(sensors=_with(USUAL, replace(HEADING, wraps=True))),
    "pilot": _usual(_PILOT),
    "pilot in a current": _usual(_PILOT, conditions=_FLOW, effects=_FLOWS),
    "two depth sensors": _usual(_PILOT, sensors=(*USUAL, Sensor(HEAVE, "velocity", 0.01))),
    "slow depth by a late clock": _usual(
        _PILOT, sensors=_with(USUAL, replace(DEPTH, every=4, late=0.15)), effects=("delay",)
    ),
    "sag with voltage": replace(
        _TWO,
        logs=replace(_TWO.logs, columns=("voltage",)),
        conditions=Conditions(thrust=sagging),
        rov_file=_FIT_VOLTAGE,
        effects=("voltage",),
    ),
    "tilt with roll and pitch": replace(
        _TWO,
        logs=replace(_TWO.logs, columns=("roll", "pitch")),
        conditions=_TILT,
        more={"F_0_w": 0.3},
        rov_file="[fit]\nattitude = true\n",
        effects=("load",),
    ),
    "heavy": _HEAVY,
    "heavy in a current": replace(_HEAVY, conditions=_FLOW, effects=_FLOWS),
}
"""The scenarios whose model is complete: intervals cover, β is unbiased, nothing is refused, nothing is unexplained."""

INCOMPLETE: dict[str, Scenario] = {
    "sag": replace(_TWO, conditions=Conditions(thrust=sagging), unexplained=("surge", "heave", "yaw")),
    "tether": replace(_TWO, conditions=Conditions(tether=(0.5, 0.5, 0.0)), unexplained=("surge",)),
    "tilt": replace(_TWO, conditions=_TILT, more={"F_0_w": 0.3}, unexplained=("heave", "yaw")),
    "saturation": replace(_TWO, conditions=Conditions(saturation=0.4), unexplained=("surge", "heave", "yaw")),
    "scale": replace(
        _TWO,
        sensors=(*_with(_TWO.sensors, replace(DEPTH, scale=1.02)), Sensor(HEAVE, "velocity", 0.01)),
        unexplained=("heave",),
    ),
}
"""The scenarios whose model lacks something: the findings say that it does not explain the data, and where."""

SCENARIOS = COMPLETE | INCOMPLETE
