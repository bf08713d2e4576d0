"""Which outputs are the commands of the thrusters, from the topics of a log; and what ArduSub sent is read back.

What a pulse means is held to the law by which ArduSub makes it (`AP_Motors6DOF::calc_thrust_to_pwm`,
`AP_Motors::rc_write`), for drawn parameters. Which outputs are used is held to known results.
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import AXES
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.commands import AutopilotParameters, Commanded, LogKeys, commands_of, wrench_of
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Source

Rows = Sequence[float]
Numbers = Mapping[str, float]
LOG, SERVOS = Path("log"), "SERVO_OUTPUT_RAW"


def topic(name: str, kind: str, fields: Mapping[str, Rows], vehicle: str = "", part: str = "") -> Topic:
    """Return messages of one kind, one in each second."""
    columns = {field: np.array(rows, float) for field, rows in fields.items()}
    return Topic(Source(name, kind, vehicle, part), np.arange(float(len(next(iter(columns.values()))))), columns)


def array(name: str, *outputs: Rows, vehicle: str = "") -> Topic:
    fields = {f"data[{n}]": rows for n, rows in enumerate(outputs)}
    return topic(name, "std_msgs/msg/Float64MultiArray", fields, vehicle)


def number(name: str, rows: Rows) -> Topic:
    return topic(name, "std_msgs/msg/Float64", {"data": rows})


def servos(*outputs: Rows, name: str = SERVOS, system: str = "1") -> Topic:
    return topic(name, SERVOS, {f"servo{n}_raw": rows for n, rows in enumerate(outputs, start=1)}, system)


def servo_log(name: str, first: int, *outputs: Rows) -> Topic:
    """Return messages that come a little later the higher the number of their first output is."""
    own = topic(name, name, {f"C{n}": rows for n, rows in enumerate(outputs, start=first)})
    return replace(own, time=own.time + 1e-3 * first)


def commanded(topics: Sequence[Topic], names: str = "a", told: Numbers | None = None, **keys: object) -> Commanded:
    """Return the commands of thrusters, whose names are letters, with the parameters that were told at first."""
    parameters = AutopilotParameters.of_pairs({name: [(0.0, value)] for name, value in (told or {}).items()})
    return commands_of(LOG, topics, [*names], parameters, LogKeys.model_validate(keys))


def series(commands: Commanded) -> dict[str, list[float]]:
    return {name: [round(value, 6) for value in values] for name, (_, values) in commands.series.items()}


# ---- Which outputs ---------------------------------------------------------------------------------------------------

TWO = [servos([1500, 1700], [1500, 1400])]
MAIN, AUX = "actuator_outputs", "actuator_outputs_1"
PULSES = {"output[0]": [1500, 1600], "output[1]": [1500, 1700]}
PX4 = [topic(name, MAIN, PULSES, "1", f"instance {n}") for n, name in enumerate((MAIN, AUX))]
FLEET = [array("/rov_a/cmd", [0, 1], vehicle="rov_a"), array("/rov_b/cmd", [0, -1], vehicle="rov_b")]
USED: Mapping[str, tuple[list[Topic], str, Numbers, str, Mapping[str, Rows]]] = {
    "an autopilot before a topic that only its name tells": (
        [array("/cmd", [-1, 1]), topic("/rc/out", "mavros_msgs/msg/RCOut", {"channels[0]": [1500, 1600]})],
        "a",
        {},
        "/rc/out",
        {"a": [0, 0.25]},
    ),
    "those that change most": (
        [array("/a/cmd", [0, 0.5]), array("/b/cmd", [-1, 1]), array("/c/cmd", [0, 0])],
        "a",
        {},
        "/b/cmd",
        {"a": [-1, 1]},
    ),
    "as many outputs as thrusters before changes": (
        [array("/a/cmd", [-1, 1], [0, np.nan], [65535, 0]), array("/b/cmd", [-1, 1], [1, 1])],
        "ab",
        {},
        "/b/cmd",
        {"a": [-1, 1], "b": [1, 1]},
    ),
    "no telemetry": ([number(f"/motor_1/{word}", [0, 0.5]) for word in ("duty", "rpm", "force")], "a", {}, "", {}),
    "the first of two vehicles": (FLEET, "a", {}, "/rov_a/cmd", {"a": [0, 1]}),
    "the vehicle with most messages": (
        [servos([1500, 1600], name="a", system="7"), servos([1500, 1600, 1700], name="b", system="8")],
        "a",
        {},
        "b",
        {"a": [0, 0.25, 0.5]},
    ),
    "a topic for each thruster": (
        [number("/thruster_2/x", [0, 0.2]), number("/thruster_0/x", [0, 0.1])],
        "",
        {},
        "/thruster_0/x",
        {"1": [0, 0.1], "2": [0, 0.2]},
    ),
    "those that ever work": ([array("/cmd", [0, 1], [0, -1], [0, 0])], "", {}, "/cmd", {"1": [0, 1], "2": [0, -1]}),
    "by the motors of servos": (
        TWO,
        "ab",
        {"SERVO1_FUNCTION": 34, "SERVO2_FUNCTION": 33},
        SERVOS,
        {"a": [0, -0.25], "b": [0, 0.5]},
    ),
    "as many as motors": (TWO, "", {"SERVO2_FUNCTION": 33}, SERVOS, {"1": [0, -0.25]}),
    "servos of other things": (TWO, "", {"SERVO2_FUNCTION": 45}, SERVOS, {"1": [0, 0.5], "2": [0, -0.25]}),
    "AUX by its last motor": (PX4, "a", {"PWM_MAIN_FUNC1": 113, "PWM_AUX_FUNC1": 112}, AUX, {"a": [0, 0]}),
    "AUX by its first motor": (PX4, "a", {"PWM_MAIN_FUNC1": 100, "PWM_AUX_FUNC2": 101}, AUX, {"a": [0, 0.5]}),
    "AUX alone": (PX4, "a", {"PWM_MAIN_FUNC1": 0, "PWM_AUX_FUNC2": 101}, MAIN, {"a": [0, 0.5]}),
    "MAIN": (PX4, "a", {"PWM_MAIN_FUNC1": 101, "PWM_AUX_FUNC1": 420}, MAIN, {"a": [0, 0.25]}),
    "MAIN and AUX": (
        PX4,
        "ab",
        {"PWM_MAIN_FUNC1": 102, "PWM_AUX_FUNC2": 101},
        MAIN,
        {"a": [0, 0.5], "b": [0, 0.25]},
    ),
    "servos of three messages": (
        [servo_log("RCOU", 1, [1500, 1600]), servo_log("RCO2", 15, [1500, 1700]), servo_log("RCO3", 19, [1500, 1400])],
        "abc",
        {"SERVO1_FUNCTION": 35, "SERVO15_FUNCTION": 33, "SERVO19_FUNCTION": 34},
        "RCOU",
        {"a": [0, 0.5], "b": [0, -0.25], "c": [0, 0.25]},
    ),
    "servos of messages without those between": (
        [servo_log("RCOU", 1, [1500, 1600]), servo_log("RCO3", 32, [1500, 1400])],
        "a",
        {"SERVO32_FUNCTION": 33},
        "RCOU",
        {"a": [0, -0.25]},
    ),
}


@pytest.mark.parametrize("case", USED)
def test_the_outputs_that_are_used(case: str) -> None:
    topics, names, told, source, expected = USED[case]
    commands = commanded(topics, names, told)
    assert (commands.sender.topic if commands.sender else "") == source
    assert series(commands) == expected


def test_rov_toml_names_the_vehicle_and_the_outputs() -> None:
    assert series(commanded(FLEET, vehicle="rov_b")) == {"a": [0, -1]}
    assert series(commanded([array("/a/cmd", [1, 0]), array("/b/cmd", [1, 1])], outputs="/b/cmd")) == {"a": [1, 1]}
    with pytest.raises(DataFileError, match=r"^log: \[logs\] names the vehicle 'rov_c', but the log has 'rov_a' and '"):
        commanded(FLEET, vehicle="rov_c")
    with pytest.raises(DataFileError, match=r"^log: \[logs\] names the outputs '/b', but the log has 'SERVO_OUTPUT_RA"):
        commanded(TWO, outputs="/b")


def test_several_vehicles_are_told() -> None:
    """Another one has commands, or tells its place by a topic of the same name."""
    odometry = [topic(f"/{name}/odom", "nav_msgs/msg/Odometry", {"x": [1]}, name[0]) for name in ("b", "a", "c/z")]
    for topics, words in (
        (FLEET, "rov_a and rov_b. rov_a"),
        ([*odometry, array("/a/cmd", [0, 1], vehicle="a")], "a and b. a"),
    ):
        said = sentences(commanded(topics).findings)[0]
        assert said.startswith(f"log: the log has the vehicles {words} is used; `vehicle` in [logs] of rov.toml names")


def test_outputs_beside_those_of_the_thrusters() -> None:
    """A thruster whose fraction is never a number has no output; one that is always 0 has. Rare changes are a light."""
    rows: list[Rows] = [[0, 1, 0, 1, 0], [np.nan] * 5, [0] * 5, [1, 0, 1, 0, 1], [0, 0, 0, 0, 1]]
    commands = commanded([array("/cmd", *rows)], "abc")
    assert (commands.without_pulse, [*commands.without_thruster]) == (["b"], ["output 4"])
    assert commanded([servos([0, 0])]).without_pulse == [], "no pulse at all is no thrust at all"


# ---- What the numbers mean -------------------------------------------------------------------------------------------


def sent(rng: random.Random) -> tuple[dict[str, float], dict[str, float], dict[str, list[float]], list[list[float]]]:
    """Draw parameters, keys of [logs], commands of some thrusters, and the pulses that ArduSub makes of them.

    Parameters of the motors, of each servo, or keys of [logs] say what a pulse means. Where none tells it, all may rest
    elsewhere. In every third row they rest, and no other pulse is 1500 us by chance.
    """
    kind, low, high = rng.choice([None, 0.0, 8.0, 9.0]), rng.uniform(1000.0, 1200.0), rng.uniform(1800.0, 2000.0)
    has_range, has_servos = rng.random() < 0.5, kind in (8.0, 9.0) or rng.random() < 0.5
    by_servo = kind in (8.0, 9.0) or (kind is None and has_servos and (not has_range or rng.random() < 0.5))
    keys: dict[str, float] = rng.choice([{}, {}, {"neutral": 1520.0}, {"span": 300.0}])
    told = {"MOT_PWM_MIN": low if has_range else 0.0, "MOT_PWM_MAX": high if has_range else 0.0}
    told |= {} if kind is None else {"MOT_PWM_TYPE": kind}
    low, high = (low, high) if has_range else (1100.0, 1900.0)
    moved = 0.0 if has_servos else rng.choice([-1, 0, 1]) * rng.uniform(40.0, 60.0)
    commands: dict[str, list[float]] = {}
    pulses = []
    for n, name in enumerate("abc"[: rng.randint(1, 3)], start=1):
        ends = low + moved, 1500.0 + moved, high + moved
        if has_servos:
            servo = rng.uniform(1000.0, 1200.0), rng.uniform(1503.0, 1560.0), rng.uniform(1800.0, 2000.0)
            told |= zip([f"SERVO{n}_{end}" for end in ("MIN", "TRIM", "MAX")], servo, strict=True)
            ends = servo if by_servo else ends
        if keys:
            middle, span = keys.get("neutral", 1500.0 + moved), keys.get("span", 400.0)
            ends = middle - span, middle, middle + span
        first, neutral, last = ends if kind != 8.0 or keys else (ends[0], 0.5 * (ends[0] + ends[2]), ends[2])
        motor, turned = rng.choice([1.0, -1.0]), rng.random() < 0.5
        told |= {f"MOT_{n}_DIRECTION": motor, f"SERVO{n}_REVERSED": float(turned)}
        sign = motor * (-1.0 if turned and kind != 0.0 else 1.0)
        levels = [0.9, -0.9, *(rng.choice([-1.0, 1.0]) * rng.uniform(0.25, 1.0) for _ in range(4))]
        commands[name] = [c for level in levels for c in (level, 0.9 * level, 0.0)]
        follow = [sign * c for c in commands[name]]
        pulses.append([neutral + c * (last - neutral if c > 0.0 else neutral - first) for c in follow])
    return told, keys, commands, pulses


def test_what_ardusub_sent_is_read_back() -> None:
    """No pulse, 0 or 65535, is no thrust."""
    for seed in range(200):
        told, keys, commands, pulses = sent(random.Random(seed))
        read = commanded([servos(*([*rows, 0.0, 65535.0] for rows in pulses))], "".join(commands), told, **keys)
        for name, (_, values) in read.series.items():
            np.testing.assert_allclose(values, [*commands[name], 0.0, 0.0], atol=1e-9, err_msg=f"{seed} {name}")


RESTS: Mapping[str, tuple[list[Rows], Numbers, Rows, str]] = {
    "all elsewhere": (
        [[1530, 1530, 1730, 1330], [1530] * 4, [1530] * 4],
        {},
        [0, 0, 0.5, -0.5],
        "no thrust is 1530 us, because the outputs rest there and never at 1500 us. If that is wrong, write neutral = "
        "1500 into [logs] of rov.toml",
    ),
    "each at its own pulse": (
        [[1530, 1530, 1730, 1630], [1470] * 4, [1470] * 4],
        {},
        [0, 0, 0.5, 0.25],
        "no thrust is 1470 and 1530 us",
    ),
    "one that works all the time where the others do": (
        [[1640, 1650, 1660, 1420], [1530] * 4, [1530] * 4, [1530] * 4],
        {},
        [0.275, 0.3, 0.325, -0.275],
        "full thrust is 1130 and 1930 us, and no thrust 1530 us",
    ),
    "the others at 1500 us": (
        [[1530, 1530, 1730, 1330], [1500] * 4, [1500] * 4],
        {"SERVO2_TRIM": 1530.0},
        [0.075, 0.075, 0.575, -0.425],
        "",
    ),
    "one at its trim": (
        [[1530, 1530, 1730, 1330], [1500] * 4, [1500] * 4],
        {"SERVO1_TRIM": 1530.0},
        [0, 0, 0.5, -0.5],
        "no thrust is 1530 us",
    ),
    "perhaps where one departs to one side": (
        [[1540, 1540, 1640, 1740]],
        {},
        [0.1, 0.1, 0.35, 0.6],
        "the outputs hardly rest at 1500 us, which is taken as no thrust, and most stay at 1540 us. If that is no "
        "thrust, write neutral = 1540 into [logs] of rov.toml",
    ),
    "perhaps where one stays that passes 1500 us": (
        [[1540] * 48 + [1500, 1740]],
        {},
        [0.1] * 48 + [0, 0.6],
        "the outputs hardly rest at 1500 us, which is taken as no thrust",
    ),
}


@pytest.mark.parametrize("case", RESTS)
def test_where_the_outputs_rest(case: str) -> None:
    """The first output has the expected commands, and the others have none."""
    outputs, told, expected, words = RESTS[case]
    commands = commanded([servos(*outputs)], "abcd"[: len(outputs)], told)
    first, *others = series(commands).values()
    assert first == expected
    assert not np.any(others)
    said = " ".join(sentences(commands.findings))
    assert words in said
    assert ("rest" in said or "range" in said) == bool(words)


def test_what_parameters_say_is_told() -> None:
    turned = {"MOT_1_DIRECTION": -1.0}
    assert sentences(commanded([servos([1720, 1240])], told=turned).findings) == (
        "log: parameters of the autopilot reverse the thrusters a",
    )
    assert not commanded([servos([1720, 1240])], told=turned | {"SERVO1_REVERSED": 1.0}).findings
    assert "the log does not tell the directions of the motors" in sentences(commanded(TWO, "ab").findings)[0]
    with pytest.raises(DataFileError, match="no output of thruster 3, 4, 5, 6, 7, 8, 9, 10 and 11: 'SERVO_OUTPUT_RAW'"):
        commanded(TWO, "", {"SERVO2_FUNCTION": 85.0})


def test_pulses_and_fractions_are_told_apart() -> None:
    assert series(commanded([array("/cmd", [800, 2200, 65535, 0])])) == {"a": [-1.75, 1.75, 0, 0]}
    assert series(commanded([array("/cmd", [-1, 1, np.nan])])) == {"a": [-1, 1, 0]}
    for low, high in ((799, 1500), (0, 2201), (0.2, 1.01), (-1.01, 0.2)):
        words = rf"outputs between {low} and {high} are neither fractions within -1 \.\.\. 1 nor pulses in us"
        with pytest.raises(DataFileError, match=f"^log, '/cmd': {words}"):
            commanded([array("/cmd", [low, high])])


# ---- Forces on the body ----------------------------------------------------------------------------------------------

FORCES = [*AXES.values()]


def wrench(name: str, **parts: Sequence[Rows]) -> Topic:
    fields = {f"{part}.{axis}": rows for part, of in parts.items() for axis, rows in zip("xyz", of, strict=True)}
    return topic(name, "geometry_msgs/msg/Wrench", fields)


def test_the_wrench_that_changes_most_or_is_named_is_used() -> None:
    """The body of ROS has the axes forward, left, up."""
    two = [
        wrench("/a", force=[[5, 9], [1, 1], [1, 1]]),
        wrench("/b", force=[[1, 2], [3, -4], [1, 1]], torque=[[5, 5], [6, 7], [8, 9]]),
    ]
    moved = {
        "X_ext": [1, 2],
        "Y_ext": [-3, 4],
        "Z_ext": [-1, -1],
        "K_ext": [5, 5],
        "M_ext": [-6, -7],
        "N_ext": [-8, -9],
    }
    for named, source, expected, others in (
        ("", "/b", moved, "; not used: /a"),
        ("/a", "/a", {"X_ext": [5, 9], "Y_ext": [-1, -1], "Z_ext": [-1, -1]}, ""),
    ):
        commands = wrench_of(LOG, two, FORCES, LogKeys(outputs=named))
        assert series(commands) == expected
        told = f"log: the forces and moments on the body are those of {source}{others}"
        assert sentences(commands.findings) == (told,)
    with pytest.raises(DataFileError, match=r"^log: \[logs\] names the outputs '/c', but the log has '/a' and '/b'$"):
        wrench_of(LOG, two, FORCES, LogKeys(outputs="/c"))
