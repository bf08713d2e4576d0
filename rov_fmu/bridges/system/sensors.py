"""The sensors of a vehicle as an FMU in C: what its instruments tell of how it moves, with their faults.

Their inputs are the outputs of the vehicle, with `true_` before their names, and their outputs have these names and are
in the same terminals, so that they stand between a vehicle and its autopilot. `fmu_src/sensors/sensors.c` has the law.

The start values are those of instruments that ROVs have. What no data sheet says is assumed.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from rov_fmu.bridges.autopilot.fmu import VALID
from rov_fmu.c.source import sampled_sources
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import Declaration
from rov_fmu.fmu.terminals import Terminal, terminals, terminals_document
from rov_fmu.fmu.variables import FmuModel, VariableList
from rov_fmu.io.paths import FMU_SRC
from rov_fmu.io.templates import render
from rov_fmu.vehicle.vehicle import Vehicle

PLUGS = ("pose", "body_velocity", "velocity")
"""The terminals of a vehicle that are measured."""
CHANNELS = ("x", "y", "z", "vg_D", *"uvw", "vg_N", "vg_E", "psi", *QUATERNION, *"pqr")
"""What is told, in the order of sensors.c."""
TRUE = "true_"
"""What the name of an input begins with; the name of the output follows."""


class _Instrument(NamedTuple):
    """The start values of an instrument: rate (1/s), delay (s), and the correlation time of its wander (s)."""

    rate: float
    delay: float
    time: float
    words: str


class _Kind(NamedTuple):
    """The unit of what an instrument tells; standard deviations of its noise and its wander, and its resolution."""

    unit: str
    noise: float
    wander: float
    resolution: float
    words: str


_INSTRUMENTS = {
    # Blueprint Subsea SeaTrac X150, UM-140-D00221 p. 48: positions are told in decimetres. The rest is assumed.
    "position": _Instrument(1.0, 0.5, 60.0, "position (USBL)"),
    # TE MS5837-30BA, in the Bar30: 18 ms for a conversion with the largest oversampling. The rate is assumed.
    "depth": _Instrument(20.0, 0.018, 600.0, "depth sensor"),
    # Water Linked DVL A50, range mode 2 (1.5 to 14 m): 5 to 6 Hz. The delay is assumed.
    "velocity": _Instrument(5.0, 0.1, 60.0, "DVL"),
    # Xsens MTi-30, MT0605P: 100 Hz. The delay and the time are assumed.
    "attitude": _Instrument(100.0, 0.01, 60.0, "AHRS"),
}
_KINDS = {
    "position": _Kind("m", 0.1, 0.1, 0.1, "position"),
    "depth": _Kind("m", 0.002, 0.01, 0.001, "depth"),  # MS5837-30BA: 0.2 mbar; its numbers are in 0.1 mbar
    "sinking": _Kind("m/s", 0.01, 0.0, 0.0, "velocity downward"),  # assumed, of a filter with accelerometers
    "velocity": _Kind("m/s", 0.005, 0.001, 0.0001, "velocities"),  # A50: 0.1 cm/s in the long run; the noise is assumed
    "heading": _Kind("rad", 0.0017, 0.017, 0.0, "heading"),  # MTi-30: 1 degree RMS
    "tilt": _Kind("rad", 0.0009, 0.0035, 0.0, "tilt"),  # MTi-30: 0.2 degrees RMS
    "turn": _Kind("rad/s", 0.00086, 5e-5, 0.0, "rates of turn"),  # MTi-1: 0.007 deg/s/sqrt(Hz) up to 50 Hz; 10 deg/h
}
_PLACED = ("position", "depth", "velocity")


def _parameters() -> Iterator[tuple[str, str, float, float, float, str]]:
    """Yield name, unit, start, minimum, maximum and description of the parameters, in the order of sensors.c."""
    yield "ideal", "1", 0.0, 0.0, 1.0, "1: the sensors tell the truth, and no parameter below counts"
    yield "seed", "1", 1.0, 0.0, 2.0**53, "Which noise: a whole number"
    yield "seabed", "m", 0.0, 0.0, 1e6, "Depth of the seabed; 0: it is not known, and the DVL has lock"
    for name, one in _INSTRUMENTS.items():
        yield f"rate_{name}", "1/s", one.rate, 0.0, 1e4, f"Samples per second of the {one.words}; 0: one in each step"
        yield f"delay_{name}", "s", one.delay, 0.0, 1e4, f"Delay of the {one.words}, at most 31 samples"
        yield f"time_{name}", "s", one.time, 0.0, 1e9, f"Correlation time of the wander of the {one.words}"
        yield f"lost_from_{name}", "s", 0.0, 0.0, 1e9, f"Time from which the {one.words} fails"
        yield f"lost_for_{name}", "s", 0.0, 0.0, 1e9, f"For how long the {one.words} fails; 0: never"
    for name, kind in _KINDS.items():
        yield f"noise_{name}", kind.unit, kind.noise, 0.0, 1e6, f"White noise of the {kind.words}"
        yield f"wander_{name}", kind.unit, kind.wander, 0.0, 1e6, f"Wandering offset of the {kind.words}"
        words = "parts of the quaternion" if name == "tilt" else kind.words
        unit = "1" if name == "tilt" else kind.unit
        yield f"resolution_{name}", unit, kind.resolution, 0.0, 1e6, f"Resolution of the {words}"
    for name in _PLACED:
        for side in ("forward", "starboard", "down"):
            words = f"Place of the {_INSTRUMENTS[name].words}, {side} of the vehicle's origin"
            yield f"{side}_{name}", "m", 0.0, -1e3, 1e3, words
    yield "outliers", "1", 0.01, 0.0, 1.0, "Share of positions that are outliers"
    yield "outlier_size", "m", 2.0, 0.0, 1e6, "Standard deviation of the outliers"
    yield "lag_depth", "s", 0.0, 0.0, 1e4, "Time constant of the depth sensor"
    yield "heading_per_ampere", "rad/A", 0.0, -10.0, 10.0, "Turn of the compass by the current of the thrusters"
    yield "altitude_least", "m", 0.05, 0.0, 1e6, "Altitude below which the DVL has no lock"
    yield "altitude_most", "m", 50.0, 0.0, 1e6, "Altitude beyond which the DVL has no lock; 0: none"


def sensors_model(vehicle: Vehicle, step: float) -> FmuModel:
    """Return the model of the FMU of the sensors of a vehicle.

    - `step`: of the default experiment, s.
    """
    layout, made = vehicle.layout, VariableList()
    plugs = [one for one in terminals(layout) if one.name in PLUGS]
    declared = {**layout.pose, **layout.velocities, **layout.over_ground}
    measured = [name for one in plugs for name in one.variables]
    true = {
        name: made.add(f"{TRUE}{name}", declared[name], "input", "continuous", start=float(name == QUATERNION[0]))
        for name in measured
    }
    power = Declaration("A", "Electric current of the thrusters")
    inputs = made.add("electric_current", power, "input", "continuous", start=0.0) + 1
    made.add_clock()
    given: dict[str, Any] = {"initial": "calculated", "dependencies": {}}
    told = {name: made.add(name, declared[name], "output", "continuous", **given) for name in measured}
    times = len(made)
    for name, one in _INSTRUMENTS.items():
        of_sample = Declaration("s", f"When the sample was taken that the {one.words} tells")
        made.add(f"time_of_{name}", of_sample, "output", "continuous", **given)
    flags = len(made)
    for flag, one in zip(VALID, _INSTRUMENTS.values(), strict=True):
        measures = Declaration("1", f"1: the {one.words} measures, 0: it tells its last sample")
        made.add(flag, measures, "output", "continuous", display_unit=None, **given)
    parameters = len(made)
    for name, unit, start, low, high, words in _parameters():
        bounds = {"start": start, "minimum": low, "maximum": high, "display_unit": None}
        made.add(name, Declaration(unit, words), "parameter", "tunable", initial="exact", **bounds)
    known = [one.name for one in made if one.causality in ("input", "parameter")]
    places = {"inputs": inputs, "times": times, "valid": flags, "parameters": parameters, "variables": len(made)}
    of = {key: [places_of.get(name, -1) for name in CHANNELS] for key, places_of in (("real", true), ("told", told))}
    summary = f"Sensors of {vehicle.name}: what its instruments tell, with noise, delays and faults"
    card = f"What it is\n- {summary}.\n- The start values are those of a USBL, a Bar30, a DVL A50 and an MTi-30.\n"
    inward = [
        replace(one, name=TRUE + one.name, causality="input", variables=tuple(map(TRUE.__add__, names)), names=names)
        for one in plugs
        for names in [one.variables]
    ]
    electric = Terminal("electric", "input", "bus", "Electric current of the thrusters", ("electric_current",))
    valid = Terminal("valid", "output", "bus", "Which measurements are valid", tuple(VALID))
    return FmuModel(
        *(f"{vehicle.identifier}_sensors", vehicle.version, vehicle.source, summary, card),
        tuple(made),
        terminals_document([*inward, electric, *plugs, valid]),
        sampled_sources()
        | {
            "model.h": render("sensors.h.j2", **places, **of),
            "step.c": (FMU_SRC / "sensors" / "sensors.c").read_text(encoding="utf-8"),
        },
        has_derivatives=False,
        experiment=(60.0, step),
        parameters_of=dict.fromkeys([*measured, *VALID], known),
    )
