"""Which outputs are the commands of the thrusters, and what their numbers mean, from the topics of a log."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import BodyForce, VehicleAxis
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.commands import Commanded, LogKeys, Parameters, commands_of, wrench_of
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Source

SERVOS = "SERVO_OUTPUT_RAW SERVO_OUTPUT_RAW"
ARRAY = "std_msgs/msg/Float64MultiArray"
NUMBER = "std_msgs/msg/Float64"
ODOMETRY = "nav_msgs/msg/Odometry"
WRENCH = "geometry_msgs/msg/Wrench . ."
WRENCHES = f"/a {WRENCH} force.x=5,9 force.y=1,1 force.z=1,1; /b {WRENCH} force.x=1,2 force.y=3,-4 force.z=1,1 "
WRENCHES += "torque.x=5,5 torque.y=6,7 torque.z=8,9"
PX4 = "actuator_outputs actuator_outputs 1 instance_0 {0}; actuator_outputs_1 actuator_outputs 1 instance_1 {0}"
PX4 = PX4.format("output[0]=1500,1600 output[1]=1500,1700")
SERVO1 = "MOT_1_DIRECTION=1 SERVO1_MIN=1000 SERVO1_TRIM=1480 SERVO1_MAX=2000"
TWO = f"{SERVOS} 1 . servo1_raw=1500,1700 servo2_raw=1500,1400"
ONE = f"{SERVOS} 1 . servo1_raw=1720,1240"
IDLE = f"{SERVOS} 1 . servo2_raw={{0}},{{0}},{{0}},{{0}} servo3_raw={{0}},{{0}},{{0}},{{0}} servo1_raw="
VEHICLES = f"/rov_a/cmd {ARRAY} rov_a . data[0]=0,1; /rov_b/cmd {ARRAY} rov_b . data[0]=0,-1"
COMMANDS: dict[str, tuple[str, str, str, str]] = {
    "of two rules the first": (
        f"/cmd {ARRAY} . . data[0]=-1,1; /rc/out mavros_msgs/msg/RCOut . . channels[0]=1500,1600",
        "a",
        "",
        "/rc/out: a 0 0.25",
    ),
    "of equal outputs those that change most": (
        f"/a/cmd {ARRAY} . . data[0]=0,0.5; /b/cmd {ARRAY} . . data[0]=-1,1; /c/cmd {ARRAY} . . data[0]=0,0",
        "a",
        "",
        "/b/cmd: a -1 1",
    ),
    "as many outputs as thrusters before changes": (
        f"/a/cmd {ARRAY} . . data[0]=-1,1 data[1]=0,nan data[2]=65535,0; /b/cmd {ARRAY} . . data[0]=-1,1 data[1]=1,1",
        "a b",
        "",
        "/b/cmd: a -1 1, b 1 1",
    ),
    **{
        f"no commands of {word}": (f"/esc/motor_1/{word} {NUMBER} . . data=0,0.5", "a", "", "None: : ()")
        for word in ("duty", "rpm", "force")
    },
    "of two vehicles the first": (
        VEHICLES,
        "a",
        "",
        "/rov_a/cmd: a 0 1: ('log: the log has the vehicles rov_a and rov_b. rov_a is used; `vehicle` in "
        "[logs] of rov.toml names another', 'log: the commands of the thrusters are those of /rov_a/cmd', ",
    ),
    "another vehicle without commands": (
        f"/b/odom {ODOMETRY} b . x=1; /a/odom {ODOMETRY} a . x=1; /a/cmd {ARRAY} a . data[0]=0,1; "
        f"/c/z/odom {ODOMETRY} c . x=1",
        "a",
        "",
        "/a/cmd: a 0 1: | log: the log has the vehicles a and b. a is used; `vehicle` in [logs] of rov.toml names",
    ),
    "a named vehicle": (VEHICLES, "a", "vehicle=rov_b", "/rov_b/cmd: a 0 -1: | rov_b is used"),
    "an unknown vehicle": (
        VEHICLES,
        "a",
        "vehicle=rov_c",
        "log: [logs] names the vehicle 'rov_c', but the log has 'rov_a' and 'rov_b'",
    ),
    "the vehicle with most messages": (
        f"a {SERVOS.split()[1]} 7 . servo1_raw=1500,1600; b SERVO_OUTPUT_RAW 8 . servo1_raw=1500,1600,1700",
        "a",
        "",
        "b: a 0 0.25 0.5",
    ),
    "a topic for each thruster": (
        f"/thruster_2/x {NUMBER} . . data=0,0.2; /thruster_0/x {NUMBER} . . data=0,0.1",
        "",
        "",
        "/thruster_0/x: 1 0 0.1, 2 0 0.2",
    ),
    "outputs that are used": (f"/cmd {ARRAY} . . data[0]=0,1 data[1]=0,-1 data[2]=0,0", "", "", "/cmd: 1 0 1, 2 0 -1"),
    "the servos of motors": (TWO, "a b", "SERVO1_FUNCTION=34 SERVO2_FUNCTION=33", "a 0 -0.25, b 0 0.5"),
    "motors are counted": (TWO, "", "SERVO2_FUNCTION=33", "1 0 -0.25"),
    "servos without motors": (TWO, "", "SERVO9_FUNCTION=0 SERVO2_FUNCTION=45", "1 0 0.5, 2 0 -0.25"),
    "the twelfth motor": (
        TWO,
        "",
        "SERVO2_FUNCTION=85",
        "log: no output of thruster 3, 4, 5, 6, 7, 8, 9, 10 and 11: 'SERVO_OUTPUT_RAW' has 2 outputs",
    ),
    "AUX, by its twelfth motor": (PX4, "a", "PWM_MAIN_FUNC1=113 PWM_AUX_FUNC1=112", "(instance 1)"),
    "AUX, by its first motor": (PX4, "a", "PWM_MAIN_FUNC1=100 PWM_AUX_FUNC2=101", "(instance 1): a 0 0.5"),
    "AUX alone": (PX4, "a", "PWM_MAIN_FUNC1=0 PWM_AUX_FUNC2=101", "(instance 0): a 0 0.5"),
    "MAIN": (PX4, "a", "PWM_MAIN_FUNC1=101 PWM_MAIN_FUNC2=420 PWM_AUX_FUNC1=420", "(instance 0): a 0 0.25"),
    "no parameters": (ONE, "a", "", "0.55 -0.65"),
    "a range": (ONE, "a", "MOT_PWM_MIN=1000 MOT_PWM_MAX=2000", "0.44 -0.52 | full thrust is 1000 and 2000 us, and no"),
    "a range of zeros": (ONE, "a", "MOT_PWM_MIN=0 MOT_PWM_MAX=0 SERVO1_MIN=1000", "0.55 -0.65"),
    "a servo with trim": (ONE, "a", SERVO1, "0.461538 -0.5"),
    "a servo of type 9": (ONE, "a", f"{SERVO1} MOT_PWM_TYPE=9 MOT_PWM_MIN=1 MOT_PWM_MAX=9", "0.461538 -0.5"),
    "a servo without trim": (ONE, "a", f"{SERVO1} MOT_PWM_TYPE=8", "0.44 -0.52"),
    "a motor alone": (ONE, "a", f"{SERVO1} SERVO1_REVERSED=1 MOT_PWM_TYPE=0", "0.55 -0.65"),
    "a reversed servo": (ONE, "a", f"{SERVO1} SERVO1_REVERSED=1", "-0.461538 0.5"),
    "a reversed motor": (
        ONE,
        "a",
        "MOT_1_DIRECTION=-1",
        "-0.55 0.65: ('log: parameters of the autopilot reverse the thrusters a',)",
    ),
    "reversed twice": (ONE, "a", "MOT_1_DIRECTION=-1 SERVO1_REVERSED=1", "0.55 -0.65: ()"),
    "outputs that rest elsewhere": (
        IDLE.format(1530) + "1530,1530,1730,1330",
        "a",
        "",
        "a 0 0 0.5 -0.5: | no thrust is 1530 us, because the outputs rest there and never at 1500 us. If that is wrong"
        ", write neutral = 1500 into [logs] of rov.toml | full thrust is 1130 and 1930 us, and no thrust 1530 us",
    ),
    "the range of the motors about outputs that rest elsewhere": (
        IDLE.format(1470) + "1470,1470,1720,1220",
        "a b c",
        "MOT_PWM_MIN=1000 MOT_PWM_MAX=2000",
        "a 0 0 0.5 -0.5, b 0 0 0 0, c 0 0 0 0: | full thrust is 970 and 1970 us, and no thrust 1470 us",
    ),
    "the range of servos whose trim is where they rest": (
        IDLE.format(1500) + "1470,1470,1685,1285",
        "a",
        "MOT_PWM_MIN=1000 MOT_PWM_MAX=2000 SERVO1_TRIM=1470 SERVO1_MIN=1100 SERVO1_MAX=1900",
        "a 0 0 0.5 -0.5: | full thrust is 1100 and 1900 us, and no thrust 1470 us",
    ),
    "each output rests at its own pulse": (
        IDLE.format(1470) + "1530,1530,1730,1630",
        "a b c",
        "",
        "a 0 0 0.5 0.25, b 0 0 0 0, c 0 0 0 0: | no thrust is 1470 and 1530 us",
    ),
    "an output that works all the time has the neutral pulse of those that rest": (
        IDLE.format(1530) + "1640,1650,1660,1420 servo4_raw=1530,1530,1530,1530",
        "a b c d",
        "",
        "a 0.275 0.3 0.325 -0.275, b 0 0 0 0, c 0 0 0 0, d 0 0 0 0",
    ),
    "outputs that rest at 1500 us": (
        IDLE.format(1500) + "1530,1530,1730,1330",
        "a b c",
        "SERVO2_TRIM=1530 MOT_PWM_MIN=1100 MOT_PWM_MAX=1900",
        "a 0.075 0.075 0.575 -0.425, b 0 0 0 0, c 0 0 0 0: ('log: the log does not tell the directions of the motors",
    ),
    "the trim at which an output rests": (
        IDLE.format(1500) + "1530,1530,1730,1330",
        "a b c",
        "SERVO1_TRIM=1530",
        "a 0 0 0.5 -0.5, b 0 0 0 0, c 0 0 0 0: | no thrust is 1530 us",
    ),
    "a stated neutral pulse": (
        IDLE.format(1530) + "1530,1530,1730,1330",
        "a",
        "neutral=1500",
        "0.075 0.075 0.575 -0.425",
    ),
    "one thruster that may rest": (
        f"{SERVOS} 1 . servo1_raw=1540,1540,1640,1740",
        "a",
        "",
        "a 0.1 0.1 0.35 0.6: | the outputs hardly rest at 1500 us, which is taken as no thrust, and most stay at 1540 "
        "us. If that is no thrust, write neutral = 1540 into [logs] of rov.toml",
    ),
    "one thruster that passes 1500 us and may rest elsewhere": (
        f"{SERVOS} 1 . servo1_raw={'1540,' * 48}1500,1740",
        "a",
        "",
        f"{'0.1 ' * 48}0 0.6: | the outputs hardly rest at 1500 us, which is taken as no thrust",
    ),
    "neutral alone": (ONE, "a", f"neutral=1520 {SERVO1}", "0.5 -0.7"),
    "span alone": (ONE, "a", f"span=200 {SERVO1}", "1.1 -1.3"),
    "pulses": (f"/cmd {ARRAY} . . data[0]=800,2200,65535,0", "a", "", "-1.75 1.75 0 0"),
    "fractions": (f"/cmd {ARRAY} . . data[0]=-1,1,nan", "a", "", "-1 1 0"),
    "named outputs": (f"/a/cmd {ARRAY} . . data[0]=1,0; /b/cmd {ARRAY} . . data[0]=1,1", "a", "outputs=/b/cmd", "1 1"),
    "unknown outputs": (TWO, "a", "outputs=/b", "log: [logs] names the outputs '/b', but the log has 'SERVO_OUTPUT_R"),
    "of several wrenches the one that changes most": (
        WRENCHES,
        "wrench",
        "",
        "/b: X_ext 1 2, Y_ext -3 4, Z_ext -1 -1, K_ext 5 5, M_ext -6 -7, N_ext -8 -9: ('log: the forces and moments "
        "on the body are those of /b; not used: /a',)",
    ),
    "a named wrench": (
        WRENCHES,
        "wrench",
        "outputs=/a",
        "/a: X_ext 5 9, Y_ext -1 -1, Z_ext -1 -1: ('log: the forces and moments on the body are those of /a',)",
    ),
    "an unknown wrench": (
        WRENCHES,
        "wrench",
        "outputs=/c",
        "log: [logs] names the outputs '/c', but the log has '/a' and",
    ),
    **{
        f"{low} and {high}": (
            f"/cmd {ARRAY} . . data[0]={low},{high}",
            "a",
            "",
            f"log, '/cmd': outputs between {low} and {high} are neither fractions within -1 ... 1 nor pulses in us",
        )
        for low, high in ((799, 1500), (0, 2201), (0.2, 1.01), (-1.01, 0.2))
    },
}
"""Topics, each with its name, type, vehicle, part and fields; the names of the thrusters; parameters and keys of
[logs]; and what is found: the source, the commands and the findings, or parts of these."""


FORCES = [one for one in Layout.of_wrench(map(VehicleAxis, AXES.values())).thrusters if isinstance(one, BodyForce)]


def topics(text: str) -> Iterable[Topic]:
    for line in text.split(";"):
        name, kind, vehicle, part, *pairs = line.split()
        fields = {key: np.array(values.split(","), float) for key, _, values in (pair.partition("=") for pair in pairs)}
        time = np.arange(float(len(next(iter(fields.values())))))
        yield Topic(Source(name, kind, vehicle.strip("."), part.strip(".").replace("_", " ")), time, fields)


def test_outputs_beside_those_of_the_thrusters() -> None:
    """A thruster whose fraction is never a number has no output; one that is always 0 has. Rare changes are a light."""
    fractions = f"/cmd {ARRAY} . . data[0]=0,1,0,1,0 data[1]=nan,nan,nan,nan,nan data[2]=0,0,0,0,0 data[3]=1,0,1,0,1"
    found = commands_of(Path("log"), [*topics(f"{fractions} data[4]=0,0,0,0,1")], [*"abc"], Parameters(), LogKeys())
    assert (found.without_pulse, [*found.without_thruster]) == (["b"], ["output 4"])
    none = commands_of(Path("log"), [*topics(f"{SERVOS} 1 . servo1_raw=0,0")], ["a"], Parameters(), LogKeys())
    assert none.without_pulse == [], "no pulse at all is no thrust at all"


def told(found: Commanded) -> str:
    """Return the source, the commands and the findings in words."""
    series = (" ".join([name, *(f"{value:g}" for value in values)]) for name, (_, values) in found.series.items())
    return f"{found.sender}: {', '.join(series)}: {sentences(found.findings)}"


@pytest.mark.parametrize("case", COMMANDS)
def test_commands(case: str) -> None:
    given, thrusters, words, expected = COMMANDS[case]
    pairs = dict(word.split("=") for word in words.split())
    keys = {
        key: value if key in ("outputs", "vehicle") else float(value) for key, value in pairs.items() if key.islower()
    }
    parameters = Parameters.of_pairs({key: [(0.0, float(value))] for key, value in pairs.items() if key.isupper()})
    log = Path("log"), [*topics(given)]
    try:
        if thrusters == "wrench":
            found = told(wrench_of(*log, FORCES, LogKeys.model_validate(keys)))
        else:
            found = told(commands_of(*log, thrusters.split(), parameters, LogKeys.model_validate(keys)))
    except DataFileError as error:
        found = str(error)
    assert all(part in found for part in expected.split(" | "))
