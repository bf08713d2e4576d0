"""The catalogue of channels: the quantities that logs contain, and how every format names them.

One table serves CSV files, ArduSub, PX4, bags and .mat files, the tables [columns] and [topics] of rov.toml,
`--inspect`, and, as JSON, the page that flies. QUANTITIES says what can be measured, with names, units and bounds.
MESSAGES says which fields of which messages measure it, and OUTPUTS which fields contain the commands of thrusters. The
first rule that matches is preferred.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from math import inf, nan, pi
from typing import Any

from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, YAW, Axis
from rov_fmu.io.csv_table import Column

LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "ft": 1.0 / 0.3048}
ANGLES = {"rad": 1.0, "deg": 180.0 / pi, "°": 180.0 / pi}
_SPEEDS, _TURNS = {"kn": 3600.0 / 1852.0}, {"dps": ANGLES["deg"]}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
VOLTAGES = {"V": 1.0, "mV": 1000.0}
PRESSURES = {"Pa": 1.0, "hPa": 0.01, "mbar": 0.01, "kPa": 1e-3, "bar": 1e-5}
"""The units that a file may use, and how many of each make one SI unit."""
ATMOSPHERE, PRESSURE_GRADIENT = 101325.0, 1000.0 * 9.80665
"""The pressure above the water, Pa, and its gradient in fresh water, Pa/m."""
HULL = 0.02, 0.05
"""A barometer is inside the hull if the depth that follows from it changes by less than the first number, m, and if its
pressure differs from that of the atmosphere by less than the second share."""
LEAST_PRESSURE = 0.01
"""The least share of an atmosphere that a barometer under water shows; less is in another unit."""


@dataclass(frozen=True)
class Quantity:
    """A quantity that a sensor measures."""

    name: str
    """The header of its column in a CSV file, and its name in the printout."""
    units: Mapping[str, float] = field(compare=False)
    """The units that a file may use, and how many of each make one of the first, the SI unit."""
    axis: Axis | None = None
    """The axis of the motion; None for a condition, such as the voltage."""
    is_velocity: bool = False
    also: tuple[str, ...] = ()
    """Other headers of its column. They are recognised only together with one of its units."""
    minimum: float = -1e7
    maximum: float = 1e7
    least: float = -inf
    """What is below is no measurement, but what a sensor shows that is not connected."""
    wraps: bool = False
    """True for an angle that sensors wrap at a full turn."""

    @property
    def unit(self) -> str:
        """The SI unit."""
        return next(iter(self.units))

    @property
    def column(self) -> Column:
        """The column of a CSV file."""
        return Column(self.units, True, True, self.minimum, self.maximum, also=self.also)


def _rates(axis: Axis, lengths: Mapping[str, float]) -> dict[str, float]:
    """Return the units of a velocity along or about an axis."""
    return {f"{unit}/s": per for unit, per in lengths.items()} | (_TURNS if axis.is_rotation else _SPEEDS)


def _quantities() -> Iterator[Quantity]:
    symbols = {HEAVE: ("z",), ROLL: ("phi", "roll"), PITCH: ("theta", "pitch"), YAW: ("psi",)}
    for axis in AXES.values():
        lengths = ANGLES if axis.is_rotation else LENGTHS
        short = axis.position != "distance"
        also = (*([f"{axis.name} {axis.position}"] if axis in (HEAVE, YAW) else []), *symbols.get(axis, ()))
        name = axis.position if short else f"{axis.name} distance"
        yield Quantity(name, lengths, axis, also=also, wraps=axis in (ROLL, YAW))
        rate = f"{axis.name} {'rate' if axis.is_rotation else 'speed'}"
        yield Quantity(
            f"{axis.name} velocity", _rates(axis, lengths), axis, True, (axis.velocity, rate), minimum=-1e3, maximum=1e3
        )
    yield Quantity("distance", LENGTHS)
    yield Quantity("pressure", PRESSURES, minimum=0.0, maximum=1e9)
    yield Quantity("voltage", VOLTAGES, also=("battery", "battery voltage"), minimum=0.0, maximum=1e4, least=1.0)


QUANTITIES = {quantity.name: quantity for quantity in _quantities()}
"""All quantities by name. `distance` is the horizontal distance over ground from the first place."""

# ---- Messages --------------------------------------------------------------------------------------------------------

POSITION, EULER, QUATERNION, VELOCITY, RATES = "position", "euler", "quaternion", "velocity", "rates"
"""Vectors: a position; roll, pitch and heading; these as a quaternion w, x, y, z; a linear and an angular velocity."""
VECTORS = {
    POSITION: ("depth", "distance"),
    EULER: ("roll angle", "pitch angle", "heading"),
    QUATERNION: ("roll angle", "pitch angle", "heading"),
    VELOCITY: ("surge velocity", "sway velocity", "heave velocity"),
    RATES: ("roll velocity", "pitch velocity", "yaw velocity"),
}
"""The quantities that follow from the vectors."""
NED, FRD, BY_HEADER = "ned", "frd", ""
"""Frames: north-east-down of the earth; forward, starboard and down of the body; the one that the header of the message
names, which is of REP 103 unless its name says otherwise."""


@dataclass(frozen=True)
class Message:
    """Fields of a kind of message, and what they measure."""

    kind: str
    """A regular expression for the whole type of the message."""
    fields: tuple[str, ...]
    gives: str
    """The name of a quantity, or a vector."""
    unit: str = ""
    """The unit of the numbers; empty for SI units."""
    frame: str = BY_HEADER
    sign: float = 1.0
    topic: str = ""
    """A regular expression that must occur in the name of the topic."""
    unknown: float = nan
    """The number that stands for none."""

    @property
    def factor(self) -> float:
        """How many SI units, of the model's sign, one unit of the message is."""
        return self.sign / (LENGTHS | ANGLES | VOLTAGES | PRESSURES).get(self.unit, 1.0)


@dataclass(frozen=True)
class Output:
    """Fields of a kind of message that contain the commands of thrusters, one field or one topic for each thruster."""

    kind: str
    """A regular expression for the whole type of the message."""
    field: str
    """A regular expression for the whole name of a field. Its group is the number of the output, if it has one."""
    unit: str = ""
    """`us` for pulses, `1` for fractions; empty where the size of the numbers tells."""
    topic: str = ""
    """A regular expression that must occur in the name of the topic. Its group is the number of the thruster, if each
    thruster has a topic of its own."""


def _each(form: str, places: Iterable[object] = "xyz") -> tuple[str, ...]:
    return tuple(form.format(place) for place in places)


_MAVLINK = (
    Message("GLOBAL_POSITION_INT", ("relative_alt",), "depth", "mm", sign=-1.0),
    Message("VFR_HUD", ("alt",), "depth", sign=-1.0),
    Message("SCALED_PRESSURE[23]?", ("press_abs",), "pressure", "hPa"),
    Message("ATTITUDE", ("roll", "pitch", "yaw"), EULER, frame=NED),
    Message("ATTITUDE", ("rollspeed", "pitchspeed", "yawspeed"), RATES, frame=FRD),
    Message("LOCAL_POSITION_NED", ("x", "y", "z"), POSITION, frame=NED),
    Message("LOCAL_POSITION_NED", ("vx", "vy", "vz"), VELOCITY, frame=NED),
    Message("SYS_STATUS", ("voltage_battery",), "voltage", "mV", unknown=65535.0),
)
"""Telemetry of ArduSub, in a .tlog or as JSON by BlueOS."""
_DATAFLASH = (
    Message("CTUN", ("Alt",), "depth", sign=-1.0),
    Message("BARO", ("Alt",), "depth", sign=-1.0),
    Message("ATT", ("Roll", "Pitch", "Yaw"), EULER, "deg", NED),
    Message("[XN]KF1", ("PN", "PE", "PD"), POSITION, frame=NED),
    Message("[XN]KF1", ("Roll", "Pitch", "Yaw"), EULER, "deg", NED),
    Message("[XN]KF1", ("VN", "VE", "VD"), VELOCITY, frame=NED),
    Message("BAT", ("Volt",), "voltage"),
)
_PX4 = (
    Message("vehicle_attitude", _each("q[{}]", range(4)), QUATERNION, frame=NED),
    Message("vehicle_local_position", ("x", "y", "z"), POSITION, frame=NED),
    Message("vehicle_local_position", ("vx", "vy", "vz"), VELOCITY, frame=NED),
    Message("vehicle_odometry", _each("q[{}]", range(4)), QUATERNION, frame=NED),
    Message("vehicle_odometry", _each("position[{}]", range(3)), POSITION, frame=NED),
    Message("vehicle_odometry", _each("velocity[{}]", range(3)), VELOCITY),
    Message("vehicle_odometry", _each("angular_velocity[{}]", range(3)), RATES, frame=FRD),
    Message("vehicle_angular_velocity", _each("xyz[{}]", range(3)), RATES, frame=FRD),
    Message("battery_status", ("voltage_v",), "voltage", unknown=0.0),
)
_POSE = r"geometry_msgs/.*Pose.*"
_TWIST = r"geometry_msgs/.*Twist.*"
_ODOMETRY = r"nav_msgs/.*Odometry"
_IMU = r"sensor_msgs/.*Imu"
_NESTED = ("{0}.{0}.{1}.", "{0}.{1}.", "{1}.")
"""How the messages of ROS nest a part of a pose or a twist: with covariance, with a header, alone."""
_PARTS = (
    ("pose", "position", "xyz", POSITION, _POSE),
    ("pose", "orientation", "wxyz", QUATERNION, _POSE),
    ("twist", "linear", "xyz", VELOCITY, _TWIST),
    ("twist", "angular", "xyz", RATES, _TWIST),
)
_ROS = (
    Message(r"std_msgs/.*(Float|Int)\d+(Stamped)?", ("data",), "depth", topic=r"(?i)(?<![a-z])depth(?![a-z])"),
    *(
        Message(kind, _each(nested.format(whole, part) + "{}", letters), gives)
        for whole, part, letters, gives, alone in _PARTS
        for kind in (_ODOMETRY, alone)
        for nested in _NESTED
    ),
    Message(_IMU, _each("orientation.{}", "wxyz"), QUATERNION),
    Message(_IMU, _each("angular_velocity.{}"), RATES),
    Message(r"sensor_msgs/.*FluidPressure", ("fluid_pressure",), "pressure"),
    Message(r"sensor_msgs/.*BatteryState", ("voltage",), "voltage"),
)
MESSAGES = (*_MAVLINK, *_DATAFLASH, *_PX4, *_ROS)
"""What the messages of all formats measure. Of two sources of a quantity, that of the earlier entry is preferred."""

_ACTUATORS = r"(?i)thruster|motor|actuator|propeller|pwm|command|cmd"
OUTPUTS = (
    Output("SERVO_OUTPUT_RAW", r"servo(\d+)_raw", "us"),
    Output("RCOU", r"C(\d+)", "us"),
    Output("actuator_motors", r"control\[(\d+)\]", "1"),
    Output("actuator_outputs", r"output\[(\d+)\]"),
    Output(r"mavros_msgs/.*RCOut", r"channels\[(\d+)\]", "us"),
    Output(r"std_msgs/.*(Float|Int)\d+(Stamped)?", "data", topic=r"(?i)(?:thruster|motor|propeller)s?\D*(\d+)"),
    Output(r"std_msgs/.*MultiArray(Stamped)?", r"data\[(\d+)\]", topic=_ACTUATORS),
)
"""The outputs to thrusters. What an autopilot says that it sends is preferred to topics that only their names tell."""

FORCE, TORQUE = "force", "torque"
_WRENCH = r"geometry_msgs/.*Wrench(Stamped)?"
WRENCHES = tuple(
    Message(_WRENCH, _each(f"{nested}{part}.{{}}"), part) for nested in ("wrench.", "") for part in (FORCE, TORQUE)
)
"""The wrenches that drive a vehicle: forces in N and moments in N.m along the axes of the body."""

NOT_MEASURED = {
    *("setpoint", "setpoints", "desired", "target", "ref", "reference", "cmd", "command", "commands", "goal", "error"),
    *("trajectory", "waypoint", "waypoints", "plan", "nominal", "gimbal", "set"),
}
"""Words in names of topics of what is wanted and not measured, or not measured of the vehicle."""
NOT_COMMANDED = {
    *("current", "currents", "temperature", "temp", "rpm", "speed", "duty", "voltage", "power", "status", "state"),
    *("feedback", "telemetry", "fault", "enabled"),
    *("force", "forces", "newton", "newtons", "torque", "wrench", "thrust"),
    *("battery", "humidity", "rate", "load", "error", "mode", "id", "armed", "cpu", "gain", "light", "lights"),
    *("stick", "joystick"),
}
"""Words in names of topics and headers that are no commands: telemetry of motor controllers, and forces, which are no
fractions."""
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def words_of(name: str) -> set[str]:
    """Return the words in a name or header in small letters: `cmdVel` and `cmd_vel` have cmd and vel."""
    return {word.casefold() for word in _WORD.findall(name)}


def as_json(axis: Axis) -> list[dict[str, Any]]:
    """Return the quantities of an axis for the page that flies, those that are preferred first.

    In a log of one axis, the short name is enough.
    """
    quantities = [quantity for quantity in QUANTITIES.values() if quantity.axis == axis]
    quantities[1:1] = [QUANTITIES["pressure"]] if axis == HEAVE else []
    return [
        {
            "name": quantity.name,
            "short": "velocity" if quantity.is_velocity else axis.position if quantity.axis else quantity.name,
            "also": quantity.also,
            "units": quantity.units,
            "isPressure": not quantity.axis,
            "isPosition": not quantity.is_velocity,
            "wraps": quantity.wraps,
            "largest": quantity.maximum,
        }
        for quantity in quantities
    ]


@cache
def is_known(kind: str) -> bool:
    """Return True if messages of this type may be recognised."""
    kinds = [message.kind for message in (*MESSAGES, *WRENCHES)] + [output.kind for output in OUTPUTS]
    return any(re.fullmatch(pattern, kind) for pattern in kinds)


FLAGS = (
    (r"\b(dvl|velocity|velocities|vel|speed|twist|bottom|lock)\b", VECTORS[VELOCITY]),
    (r"\b(depth|pressure|baro|barometer)\b", ("depth", "pressure")),
    (r"\b(heading|compass|magnetometer|yaw)\b", ("heading",)),
    (r"\b(attitude|ahrs|orientation|imu)\b", VECTORS[EULER]),
    (r"\b(gyro|rate|rates|imu)\b", VECTORS[RATES]),
    (r"\b(position|pos|distance|usbl|gps)\b", ("distance", "surge distance", "sway distance")),
    (r"\b(voltage|battery)\b", ("voltage",)),
)
"""The words in names of flags of validity, as regular expressions, and the quantities whose flags these are."""

# ---- Headers ---------------------------------------------------------------------------------------------------------

THRUSTER = r"\b(thr|thrusters?|motors?|propellers?|pwm|esc)\b"
COMMANDS = rf"{THRUSTER}|\b(servo|cmd|command|out|outputs?|u) \d+\b|^u \w+$"
"""A regular expression that occurs among the words of an unknown header of a CSV file that is a command."""
HEADERS = (
    ("time", "time|t|timestamp"),
    ("command", "commands?|cmd|throttle|pwm|duty|setpoint|input|output"),
    ("force", "force|thrust|pull|push|bollard|load"),
    ("velocity", "velocity|vel|speed|rate"),
    ("time constant", "tau|constant|time"),
    ("", "|".join(sorted(NOT_MEASURED))),
    ("", "acceleration|accel|acc|covariance|valid|validity|invalid"),
    ("roll velocity", "roll|gyrox|(angular|gyro|rates)( .*)? x"),
    ("pitch velocity", "pitch|gyroy|(angular|gyro|rates)( .*)? y"),
    ("yaw velocity", "yaw|turn|heading|gyroz|(angular|gyro|rates)( .*)? z"),
    ("surge velocity", "surge|forward|ahead|v ?x|(linear|velocity|vel|twist|dvl)( .*)? x"),
    ("sway velocity", "sway|side|sideways|lateral|v ?y|(linear|velocity|vel|twist|dvl)( .*)? y"),
    ("heave velocity", "heave|vertical|v ?z|(linear|velocity|vel|twist|dvl)( .*)? z"),
    ("", "rate|speed"),
    ("depth", "depth|(position|pos)( .*)? z"),
    ("heading", "heading|yaw|compass|hdg|(orientation|orient|euler|rpy|attitude)( .*)? z"),
    ("roll angle", "roll|(orientation|orient|euler|rpy|attitude)( .*)? x"),
    ("pitch angle", "pitch|(orientation|orient|euler|rpy|attitude)( .*)? y"),
    ("voltage", "voltage|battery"),
)
"""The words of unknown headers of CSV files, as regular expressions, and the columns that they seem to mean. A velocity
must have its unit, or be the last component of a vector; other quantities have the likely unit. What the empty name
matches is none of the quantities after it."""
