"""The scenarios by name: tank tests and dives of the vehicles that ship."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians

from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from tests.identify.scenarios.scenario import KNOWN_THRUST, VOLTAGE, Expected, Given, sagging
from tests.identify.scenarios.tank import TRUTHS, Logs, Sensor, Tank
from verification.references.pool import Conditions, Tilt

VELOCITY, DISTANCE = Sensor(SURGE, "velocity", 0.02), Sensor(SURGE, "distance", 0.02)
DEPTH, HEADING = Sensor(HEAVE, "depth", 0.005), Sensor(YAW, "heading", radians(0.5))
USUAL = (VELOCITY, DEPTH, HEADING)
"""The sensors of the VideoRay."""
DVL = tuple(Sensor(axis, "velocity", 0.01) for axis in (SURGE, SWAY))
ATTITUDE = tuple(Sensor(axis, axis.position, radians(0.3)) for axis in (ROLL, PITCH, YAW))
ALL_ROUND = (*DVL, DEPTH, *ATTITUDE)
"""The sensors of the Heavy."""

_STEPS, _BETWEEN, _PILOT = Logs(), Logs(between_rows=True), Logs(plan="pilot")
_LAG = {"T_rear": 0.3, "T_top": 0.3}
_FULL = {f"V_0_{curve}": Given(VOLTAGE, "V") for curve in ("rear", "top")}
"""The voltage at which the thrust was measured."""
_LOAD = {"F_0_w": 0.1}
_REVERSE = {
    f"{key}_{curve}_reverse": 0.6 * TRUTHS["videoray"][f"{key}_{curve}"]
    for curve in ("rear", "top")
    for key in ("a_t", "b_t")
}
_UP = {f"{key}_w_reverse": 1.3 * TRUTHS["videoray"][f"{key}_w"] for key in ("a_d", "b_d")}
_DELAY, _FLOW = Conditions(delay=0.2), Conditions(current=(0.06, -0.03))
_SAG, _SATURATION = Conditions(thrust=sagging), Conditions(saturation=0.4)
_TILT, _TETHER = Conditions(tilt=Tilt(radians(10.0))), Conditions(tether=(0.5, 0.5, 0.0))


def _usual(logs: Logs = _STEPS, *effects: str, **more: object) -> Tank:
    return replace(Tank(logs=logs, sensors=USUAL, expected=Expected(effects)), **more)  # type: ignore[arg-type]


def _with(sensors: Sequence[Sensor], sensor: Sensor) -> tuple[Sensor, ...]:
    """Return the sensors with another one along the same axis."""
    return tuple(sensor if other.axis is sensor.axis else other for other in sensors)


_HEAVY = Tank(
    "bluerov2_heavy",
    Logs("pilot", tuple(AXES.values())),
    ALL_ROUND,
    known={"z_B": Given(-0.05, "m")},
    expected=Expected(seconds=120.0),
)
_TWO = Tank(logs=replace(_PILOT, count=2), sensors=(replace(VELOCITY, noise=0.01), DEPTH, HEADING))
"""Two recordings of 60 s."""

COMPLETE: dict[str, Tank] = {
    "clean": _usual(),
    **{
        f"load of {load} N in heave": _usual(Logs(axes=(HEAVE,)), "load of heave", more={"F_0_w": load})
        for load in (0.02, 0.1, 0.3)
    },
    "load": _usual(_STEPS, "load of heave", more=_LOAD),
    "delay": _usual(_STEPS, "dead time", conditions=_DELAY),
    "lag": _usual(_STEPS, "lag", more=_LAG, fit=("lag",)),
    "delay and lag": _usual(_STEPS, "dead time", "lag", more=_LAG, fit=("lag",), conditions=_DELAY),
    "reverse": _usual(
        _STEPS,
        more=_REVERSE,
        priors=KNOWN_THRUST,
        expected=Expected(("reverse thrust",)),
    ),
    "current": _usual(_STEPS, "current", sensors=_with(USUAL, DISTANCE), conditions=Conditions(current=(0.1, 0.0))),
    "load, delay, reverse, correlated noise": _usual(
        Logs(correlation_time=1.0),
        "load of heave",
        "dead time",
        "reverse thrust",
        more=_LOAD | _REVERSE,
        conditions=_DELAY,
        priors=KNOWN_THRUST,
    ),
    "switches between rows at 10 Hz": _usual(replace(_BETWEEN, rate=10.0)),
    "switches between rows at 5 Hz": _usual(replace(_BETWEEN, rate=5.0)),
    "irregular stamps": _usual(Logs(rate=10.0, between_rows=True, scatter=0.8, jitter=0.005)),
    "another current each time": _usual(
        Logs(axes=(SURGE,)), "current", sensors=(DISTANCE,), currents=((0.1, 0.0), (-0.05, 0.0), (0.07, 0.0))
    ),
    "dead band in heave": _usual(Logs(axes=(HEAVE,)), "dead band of top", more={"c_0_top": 0.05}, priors=KNOWN_THRUST),
    "more drag up than down": _usual(Logs(axes=(HEAVE,)), "drag astern of heave", more=_UP),
    **{
        f"noise of {seconds} s in heave": _usual(Logs(axes=(HEAVE,), correlation_time=seconds))
        for seconds in (0.2, 1.0, 3.0)
    },
    "jitter": _usual(Logs(jitter=0.01)),
    "gaps while turning": _usual(Logs(gaps=2)),
    "depth of 1 cm": _usual(sensors=_with(USUAL, replace(DEPTH, noise=0.003, resolution=0.01))),
    "wrap at 180 degrees": _usual(sensors=_with(USUAL, replace(HEADING, wraps=True))),
    "pilot": _usual(_PILOT, expected=Expected(seconds=20.0)),
    "pilot in a current": _usual(_PILOT, "current", conditions=_FLOW),
    "two depth sensors": _usual(_PILOT, sensors=(*USUAL, Sensor(HEAVE, "velocity", 0.01))),
    "two depth sensors of other scales": _usual(
        _PILOT, "sensor scale of heave", sensors=(*USUAL, Sensor(HEAVE, "velocity", 0.01, scale=1.05))
    ),
    "slow depth by a late clock": _usual(_PILOT, "dead time", sensors=_with(USUAL, replace(DEPTH, every=4, late=0.15))),
    "sag with voltage": replace(
        _TWO,
        logs=replace(_TWO.logs, columns=("voltage",)),
        conditions=_SAG,
        known=_FULL,
        fit=("voltage",),
        expected=Expected(("voltage",)),
    ),
    "tilt with roll and pitch": replace(
        _TWO,
        logs=replace(_TWO.logs, columns=("roll", "pitch")),
        conditions=_TILT,
        more={"F_0_w": 0.3},
        fit=("attitude",),
        expected=Expected(("load of heave",)),
    ),
    "heavy": _HEAVY,
    "heavy in a current": replace(_HEAVY, conditions=_FLOW, expected=replace(_HEAVY.expected, effects=("current",))),
}
"""The scenarios whose model is complete: intervals cover, nothing is biased or refused, no alarm is raised."""


def _lacking(*causes: str, effects: tuple[str, ...] = (), unusable: tuple[str, ...] = ()) -> Expected:
    return Expected(effects, causes, complete=False, unusable=unusable)


INCOMPLETE: dict[str, Tank] = {
    "sag": replace(_TWO, conditions=_SAG, expected=_lacking("time", "voltage")),
    "tether": replace(_TWO, conditions=_TETHER, expected=_lacking("distance", unusable=("surge",))),
    "tilt": replace(_TWO, conditions=_TILT, more={"F_0_w": 0.3}, expected=_lacking(effects=("load of heave",))),
    "saturation": replace(_TWO, conditions=_SATURATION, expected=_lacking("command")),
}
"""The scenarios whose model lacks something."""

SCENARIOS: Mapping[str, Tank] = {**COMPLETE, **INCOMPLETE}
