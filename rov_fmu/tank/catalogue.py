"""The catalogue of channels: the quantities that logs contain, and how every format names them.

One table serves CSV files, ArduSub, PX4, bags and .mat files, the tables [columns] and [topics] of rov.toml,
`inspect`, and, as JSON, the page that flies. QUANTITIES says what can be measured, with names, units and bounds.
MESSAGES says which fields of which messages measure it, and OUTPUTS which fields contain the commands of thrusters. The
first rule that matches is preferred.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from math import inf, nan, pi
from typing import Any
from unicodedata import combining, normalize

import numpy as np

from rov_fmu.equation.catalogue import AXES, GRAVITY, HEAVE, PITCH, ROLL, YAW, Axis
from rov_fmu.tank.arrays import Array, Flags

LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "ft": 1.0 / 0.3048}
ANGLES = {"rad": 1.0, "deg": 180.0 / pi, "°": 180.0 / pi}
_SPEEDS, _TURNS = {"kn": 3600.0 / 1852.0}, {"dps": ANGLES["deg"]}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
VOLTAGES = {"V": 1.0, "mV": 1000.0}
PRESSURES = {"Pa": 1.0, "hPa": 0.01, "mbar": 0.01, "kPa": 1e-3, "bar": 1e-5}
"""The units that a file may use, and how many of each make one SI unit."""
ATMOSPHERE, PRESSURE_GRADIENT = 101325.0, 1000.0 * GRAVITY
"""The pressure above the water, Pa, and its gradient in fresh water, Pa/m."""
HULL = 0.02, 0.05
"""A barometer is inside the hull if the depth that follows from it changes by less than the first number, m, and if its
pressure differs from that of the atmosphere by less than the second share."""
LEAST_PRESSURE = 0.01
"""The least share of an atmosphere that a barometer under water shows; less is in another unit."""


_EARTH = "north", "east", "down", "up"
EARTH = NORTH, EAST, DOWN, UP = tuple(f"{to} velocity" for to in _EARTH)
"""Velocities in directions of the earth, which the attitude turns into those of the body."""


@dataclass(frozen=True)
class MeasuredQuantity:
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


def _quantities() -> Iterator[MeasuredQuantity]:
    symbols = {HEAVE: ("z",), ROLL: ("phi", "roll"), PITCH: ("theta", "pitch"), YAW: ("psi",)}
    for axis in AXES.values():
        lengths = ANGLES if axis.is_rotation else LENGTHS
        short = axis.position != "distance"
        also = (*([f"{axis.name} {axis.position}"] if axis in (HEAVE, YAW) else []), *symbols.get(axis, ()))
        name = axis.position if short else f"{axis.name} distance"
        yield MeasuredQuantity(name, lengths, axis, also=also, wraps=axis in (ROLL, YAW))
        word, others = ("rate", _TURNS) if axis.is_rotation else ("speed", _SPEEDS)
        rates = {f"{unit}/s": per for unit, per in lengths.items()} | others
        also = axis.velocity, f"{axis.name} {word}"
        yield MeasuredQuantity(f"{axis.name} velocity", rates, axis, True, also, minimum=-1e3, maximum=1e3)
    speeds = {f"{unit}/s": per for unit, per in LENGTHS.items()} | _SPEEDS
    for to in _EARTH:
        also = (f"velocity {to}", f"velocity_{to}")
        yield MeasuredQuantity(f"{to} velocity", speeds, None, True, also, minimum=-1e3, maximum=1e3)
    yield MeasuredQuantity("distance", LENGTHS)
    yield MeasuredQuantity("pressure", PRESSURES, minimum=0.0, maximum=1e9)
    yield MeasuredQuantity(
        "voltage", VOLTAGES, also=("battery", "battery voltage"), minimum=0.0, maximum=1e4, least=1.0
    )


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
    """The names of the fields; empty for a component that a message does not have."""
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
class ThrusterOutput:
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
    spread: bool = False
    """True if a sender spreads its outputs over several messages, whose fields have the numbers from 1 on."""


def _each(form: str, parts: Iterable[object] = "xyz") -> tuple[str, ...]:
    return tuple(form.format(part) for part in parts)


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
_DVLS = (r"dvl_msgs/.*DVL", r"marine_acoustic_msgs/.*Dvl")
"""The messages of DVLs, whose axes point forward, to starboard and down."""
_NESTED = ("{0}.{0}.{1}.", "{0}.{1}.", "{1}.")
"""How the messages of ROS nest a part of a pose or a twist: with covariance, with a header, alone."""
_HUGE_PLACE, _HUGE = 1e5, 1e3
"""Variances of a position, m2, and of a velocity or an angle, from which on estimators mean that they know nothing."""
_PARTS = (
    ("pose", "position", "xyz", POSITION, _POSE, "xyz", 0, _HUGE_PLACE),
    ("pose", "orientation", "wxyz", QUATERNION, _POSE, "__.", 21, _HUGE),
    ("twist", "linear", "xyz", VELOCITY, _TWIST, "xyz", 0, _HUGE),
    ("twist", "angular", "xyz", RATES, _TWIST, "xyz", 21, _HUGE),
)
"""Whole, part, components, what they give, the type beside odometry; and the components that variances are about, the
index of the variance of the first one, and the huge variance. The variances are on the diagonal of a covariance of
6 x 6. Roll and pitch are not left out without the heading, which stands for a whole orientation."""
_NUMBER = r"std_msgs/.*(Float|Int)\d+(Stamped)?"
_ROS = (
    Message(_NUMBER, ("data",), "depth", topic=r"(?i)(?<![a-z])depth(?![a-z])"),
    Message(_NUMBER, ("data",), "depth", sign=-1.0, topic=r"(?<![a-z])rel_alt(?![a-z])"),
    Message(r"mavros_msgs/.*(VFR_HUD|VfrHud)", ("altitude",), "depth", sign=-1.0),
    *(
        Message(kind, _each(nested.format(whole, part) + "{}", letters), gives)
        for whole, part, letters, gives, alone, *_ in _PARTS
        for kind in (_ODOMETRY, alone)
        for nested in _NESTED
    ),
    Message(_IMU, _each("orientation.{}", "wxyz"), QUATERNION),
    Message(_IMU, _each("angular_velocity.{}"), RATES),
    Message(_NUMBER, ("data",), "heading", "deg", topic=r"(?<![a-z])compass_hdg(?![a-z])"),
    *(Message(kind, _each("velocity.{}"), VELOCITY, frame=FRD) for kind in _DVLS),
    Message(r"sensor_msgs/.*FluidPressure", ("fluid_pressure",), "pressure"),
    Message(r"sensor_msgs/.*BatteryState", ("voltage",), "voltage"),
)
_BLUEYE = "blueye.protocol.{}Tel"
_ESTIMATE = _BLUEYE.format("PositionEstimate")
_OF_BLUEYE = (
    Message(_BLUEYE.format("Depth"), ("depth.value",), "depth"),
    Message(_BLUEYE.format("Attitude"), _each("attitude.{}", ("roll", "pitch", "yaw")), EULER, "deg", NED),
    *(
        Message(_ESTIMATE, (f"position_estimate.{axis}_rate",), f"{axis} velocity", frame=FRD)
        for axis in ("surge", "sway", "yaw")
    ),
    Message(_ESTIMATE, ("position_estimate.heading",), "heading"),
)
COCKPIT = "PVRND"
DVL_VELOCITY, DVL_PLACE, DVL_ANGLES = (f"waterlinked {name}" for name in ("velocity", "position", "attitude"))
"""The kinds of messages of VideoRay Cockpit, and of the DVL A50 of Water Linked."""
_OF_LINES = (
    Message(COCKPIT, ("depth",), "depth"),
    Message(COCKPIT, ("roll", "pitch", "heading"), EULER, "deg", NED),
    Message(DVL_VELOCITY, ("vx", "vy", "vz"), VELOCITY, frame=FRD),
    Message(DVL_PLACE, ("x", "y", "z"), POSITION, frame=NED),
    Message(DVL_ANGLES, ("roll", "pitch", "yaw"), EULER, "deg", NED),
)
MESSAGES = (*_MAVLINK, *_DATAFLASH, *_PX4, *_ROS, *_OF_BLUEYE, *_OF_LINES)
"""What the messages of all formats measure. Of two sources of a quantity, that of the earlier entry is preferred."""


@dataclass(frozen=True)
class ValidityField:
    """A field of a kind of message that tells whether other fields of the same message are measurements."""

    kind: str
    """A regular expression for the whole type of the message."""
    field: str
    """The field that tells it."""
    about: str
    """A regular expression for the whole names of the fields that it is about."""
    least: float = -inf
    below: float = inf
    """They are measurements while the number is at least the first and less than the second one."""
    may_lack: bool = False
    """True for a field that some senders do not fill: it tells nothing if it is 0 in all messages."""

    def denies(self, told: Array) -> Flags:
        """Return True where the numbers say that nothing was measured."""
        if self.may_lack and not np.nan_to_num(told).any():
            return np.zeros(len(told), bool)
        return (told < self.least) | (told >= self.below)


VALIDITIES = (
    # "set element 0 of the associated covariance matrix to -1" (sensor_msgs/Imu), which others do, too
    *(
        ValidityField(_IMU, f"{part}_covariance[0]", rf"{part}\..", least=0.0)
        for part in ("orientation", "angular_velocity")
    ),
    *(
        ValidityField(f"{_ODOMETRY}|{alone}", f"{prefix}covariance[0]", rf"(.*\.)?{part}\..", least=0.0)
        for whole, part, _, _, alone, *_ in _PARTS
        for prefix in (f"{whole}.", "")
    ),
    *(
        ValidityField(
            f"{_ODOMETRY}|{alone}", f"{prefix}covariance[{first + 7 * n}]", rf"(.*\.)?{part}\.{letter}", below=huge
        )
        for whole, part, _, _, alone, letters, first, huge in _PARTS
        for prefix in (f"{whole}.", "")
        for n, letter in enumerate(letters)
    ),
    ValidityField(_DVLS[1], "velocity_mode", r"velocity\..", least=1.0, below=2.0),  # others are through the water
    ValidityField(_DVLS[1], "num_good_beams", r"velocity\..", least=3.0, may_lack=True),
    ValidityField(r"sensor_msgs/.*BatteryState", "present", "voltage", least=1.0, may_lack=True),
    ValidityField("BARO", "Health", "Alt|Press", least=1.0),
    ValidityField("BARO", "H", "Alt|Press", least=1.0),
    ValidityField("vehicle_local_position", "xy_valid", "[xy]", least=1.0),
    ValidityField("vehicle_local_position", "z_valid", "z", least=1.0),
    ValidityField("vehicle_local_position", "v_xy_valid", "v[xy]", least=1.0),
    ValidityField("vehicle_local_position", "v_z_valid", "vz", least=1.0),
    ValidityField("battery_status", "connected", "voltage_v", least=1.0, may_lack=True),
    ValidityField(_ESTIMATE, "position_estimate.is_valid", r"position_estimate\..*", least=1.0),
)
"""The marks of validity inside messages, beside flags that their names tell."""

_ACTUATORS = r"(?i)thruster|motor|actuator|propeller|pwm|command|cmd"
OUTPUTS = (
    ThrusterOutput("SERVO_OUTPUT_RAW", r"servo(\d+)_raw", "us", spread=True),
    ThrusterOutput("RCO[U23]", r"C(\d+)", "us", spread=True),
    ThrusterOutput("actuator_motors", r"control\[(\d+)\]", "1"),
    ThrusterOutput("actuator_outputs", r"output\[(\d+)\]"),
    ThrusterOutput(r"mavros_msgs/.*RCOut", r"channels\[(\d+)\]", "us"),
    ThrusterOutput(r"std_msgs/.*(Float|Int)\d+(Stamped)?", "data", topic=r"(?i)(?:thruster|motor|propeller)s?\D*(\d+)"),
    ThrusterOutput(r"std_msgs/.*MultiArray(Stamped)?", r"data\[(\d+)\]", topic=_ACTUATORS),
)
"""The outputs to thrusters. What an autopilot says that it sends is preferred to topics that only their names tell."""

FORCE, TORQUE = "force", "torque"
_WRENCH = r"geometry_msgs/.*Wrench(Stamped)?"
_CONTROL_FORCE = _BLUEYE.format("ControlForce")
WRENCHES = (
    *(Message(_WRENCH, _each(f"{nested}{part}.{{}}"), part) for nested in ("wrench.", "") for part in (FORCE, TORQUE)),
    Message(_CONTROL_FORCE, _each("control_force.{}", ("surge", "sway", "heave")), FORCE, frame=FRD),
    Message(_CONTROL_FORCE, ("", "", "control_force.yaw"), TORQUE, frame=FRD),
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


def shorts(quantity: MeasuredQuantity) -> tuple[str, ...]:
    """Return the short names of a quantity in a log of its axis, the first one first; none for a condition."""
    if not quantity.axis:
        return ()
    return ("velocity",) if quantity.is_velocity else (quantity.axis.position, "position")


def as_json(axis: Axis) -> list[dict[str, Any]]:
    """Return the quantities of an axis for the page that flies, those that are preferred first.

    In a log of one axis, the short name is enough.
    """
    quantities = [quantity for quantity in QUANTITIES.values() if quantity.axis == axis]
    quantities[1:1] = [QUANTITIES["pressure"]] if axis == HEAVE else []
    return [
        {
            "name": quantity.name,
            "short": shorts(quantity) or (quantity.name,),
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
def is_known_kind(kind: str) -> bool:
    """Return True if messages of this type may be recognised."""
    kinds = [message.kind for message in (*MESSAGES, *WRENCHES)] + [output.kind for output in OUTPUTS]
    return any(re.fullmatch(pattern, kind) for pattern in kinds)


FLAGS = (
    (r"\b(dvl|velocity|velocities|vel|speed|twist|bottom|lock)\b", (*VECTORS[VELOCITY], *EARTH)),
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
_LINEAR, _ANGULAR = "(linear|velocity|vel|twist|dvl|speed)( .*)?", "(angular|gyro|rates?|rotation|omega)( .*)?"
_ATTITUDE = "(orientation|orient|euler|rpy|attitude)( .*)?"
HEADERS = (
    ("time", "time|t|timestamp"),
    ("command", "commands?|cmd|throttle|pwm|duty|setpoint|input|output"),
    ("force", "force|thrust|pull|push|bollard|load"),
    ("velocity", "velocity|vel|speed|rate"),
    ("time constant", "tau|constant|time"),
    ("", "|".join(sorted(NOT_MEASURED))),
    ("", "acceleration|accel|acc|covariance|valid|validity|invalid"),
    ("roll velocity", f"roll|{_ANGULAR} x"),
    ("pitch velocity", f"pitch|{_ANGULAR} y"),
    ("yaw velocity", f"yaw|turn|heading|{_ANGULAR} z"),
    *((f"{to} velocity", f"{to} (velocity|vel|speed)|v ?{to[0]}|{_LINEAR} {to[0]}({to[1:]})?") for to in _EARTH),
    ("surge velocity", f"surge|forward|ahead|v x|{_LINEAR} x"),
    ("sway velocity", f"sway|side|sideways|lateral|v y|{_LINEAR} y"),
    ("heave velocity", f"heave|vertical|v z|{_LINEAR} z"),
    ("", "rate|speed|temperature|temp"),
    ("depth", "depth|(position|pos)( .*)? z"),
    ("heading", f"heading|yaw|compass|hdg|{_ATTITUDE} z"),
    ("roll angle", f"roll|{_ATTITUDE} x"),
    ("pitch angle", f"pitch|{_ATTITUDE} y"),
    ("", "internal|hull|housing|cells?|current|capacity|percent|remaining|power|energy|servos?|esc|motors?|thrusters?"),
    ("pressure", "pressure|baro|barometer"),
    ("voltage", "voltage|battery"),
)
"""The words of unknown headers of CSV files, as regular expressions, and the columns that they seem to mean. A velocity
must have its unit, or be the last component of a vector, and a pressure its unit; other quantities have the likely
unit. What the empty name matches is none of the quantities after it."""
_OTHER_WORDS = {
    "time": "utc zeit uhrzeit zeitstempel temps heure tiempo hora ora tijd tid время 时间 時刻",
    "date": "day datum fecha jour giorno dato dag дата 日期",
    "depth": "tiefe profondeur profundidad profundidade profondita diepte djup dybde глубина 水深 深度",
    "heading": "kurs cap rumbo rota prua koers azimuth azimut курс 航向 方位",
    "compass": "kompass kompas compas brujula bussola boussole kompassi компас 罗盘",
    "voltage": "spannung tension voltaje tensao tensione spanning spenning volts volt vbat напряжение 电压 電圧",
    "battery": "batt bat batterie bateria batteria batterij batteri akku accu батарея 电池",
    "speed": "geschwindigkeit vitesse velocidad velocidade velocita snelheid hastighet hastighed fart скорость 速度",
    "pressure": "druck pression presion pressao pressione tryck trykk tryk paine press давление 压力",
    "temperature": "temperatur temperatura",
    "current": "strom courant corriente corrente stroom strom amps",
    "percent": "pct prozent soc",
    "gyro": "gyroscope gyr gyros gyroskop giroscopio gyroscoop drehrate",
    "roll": "rollwinkel roulis",
    "pitch": "nickwinkel tangage",
    "yaw": "gierwinkel lacet",
    "acceleration": "accelerometer beschleunigung",
}
_SAME = {other: word for word, others in _OTHER_WORDS.items() for other in others.split()}
"""The words of HEADERS by other words for the same, of loggers and of other languages, without accents."""
FALSE_FRIENDS = {"cap", "tension", "press", "rota", "fart", "temps", "hora", "ora", "tid", "utc"}
"""Other words that also mean something else, so that they tell a quantity only together with one of its units."""
_ENDS = [word for word in _SAME if len(word) >= 5 and word not in FALSE_FRIENDS]
_JOINED = re.compile("(v|vel|pos|gyro|gyr|omega|rate|w|a|acc|accel)([xyz])|(roll|pitch|yaw)(rate|speed|vel)")
"""Words that loggers write as one, such as `vx`, `gyroz` and `yawspeed`; the short ones have a longer word."""
_LONG = {"w": "omega", "a": "acc"}


def words_in(text: str) -> list[str]:
    """Return the words and numbers of a header or a unit in small letters, without accents: `yawRate` has two."""
    plain = normalize("NFKD", re.sub("[°º]", " deg ", text))
    spaced = re.sub("([a-z])(?=[A-Z])", r"\1 ", "".join(letter for letter in plain if not combining(letter)))
    words = re.findall(r"[^\W\d_]+|[0-9]+", spaced.casefold())
    joined = ((word, _JOINED.fullmatch(word)) for word in words)
    return [
        part
        for word, match in joined
        for part in ((_LONG.get(one, one) for one in match.groups() if one) if match else [word])
    ]


def meanings(words: Iterable[str]) -> list[str]:
    """Return the words of HEADERS for the words of a header, which may be of another language.

    The last part of a compound counts, as in Batteriespannung.
    """
    return [_SAME.get(word) or next((_SAME[end] for end in _ENDS if word.endswith(end)), word) for word in words]


def words_for(word: str) -> list[str]:
    """Return the other words for a word of HEADERS."""
    return _OTHER_WORDS[word].split()


_SECONDS = ("s", "sec", "secs", "second", "seconds")
_OTHER_UNITS = {
    "m": ("meter", "meters", "metre", "metres"),
    "ft": ("feet", "foot"),
    "rad": ("rads", "radian", "radians"),
    "deg": ("degs", "degree", "degrees"),
    "kn": ("kt", "kts", "knot", "knots"),
    "V": ("volt", "volts"),
    "s": _SECONDS[1:],
    "ms": ("msec", "millis", "milliseconds"),
    "us": ("usec", "micros", "microseconds"),
}
"""Other names of units."""
PLURALS = {"rads", "degs"}
"""Units of angles, and, of the component of a vector, of rates."""


@cache
def unit_names(units: tuple[str, ...]) -> Mapping[str, str]:
    """Return the units of a quantity by all their names, each as the words of it that are separated by blanks.

    A speed in m/s is also `mps`, `ms`, `m_s`, `m per s`, and `m s-1`.
    """
    names: dict[str, str] = {}
    for unit in units:
        length, _, second = unit.partition("/")
        spelled = [length, *_OTHER_UNITS.get(length, ())]
        if second:
            ends = [form for s in _SECONDS for form in (f"/{s}", f"p{s}", f" per {s}", f"/{s}-1")]
            spelled = [f"{length}s", *(f"{name}{end}" for name in spelled for end in ends)]
        for form in spelled:
            for text in (form, form.casefold()):
                names.setdefault(" ".join(words_in(text)), unit)
    return names
