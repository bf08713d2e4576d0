"""The example that flies steps in ArduSub's simulator, against a vehicle that answers its messages in closed form."""

from io import BytesIO
from math import atan2, exp, log, pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from examples import ardusub_steps

LAG = 0.5
"""The time constant with which depth and heading follow their targets, s."""


class Vehicle:
    """The other end of the connection: what it gets are the bytes of MAVLink, and what it does follows from them."""

    target_system, target_component = 1, 1

    def __init__(self) -> None:
        self.sent = BytesIO()
        self.mav, self._parser = mavlink.MAVLink(self.sent), mavlink.MAVLink(None)
        self.seen: list[Any] = []
        self.modes: list[int] = []
        self.time, self.depth, self.heading = 60.0, 11.0, 3.0
        self.aim = self.depth, self.heading
        self._turn = False

    def wait_heartbeat(self) -> None:
        self._parser.robust_parsing = True

    def set_mode(self, mode: int) -> None:
        self.modes.append(mode)

    def recv_match(self, **_: Any) -> Any:
        self.seen += self._parser.parse_buffer(self.sent.getvalue()) or []
        self.sent.seek(0)
        self.sent.truncate()
        self._turn = not self._turn
        if self._turn:
            return SimpleNamespace(get_type=lambda: "LOCAL_POSITION_NED", z=self.depth)
        for message in self.seen[-2:]:
            if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
                self.aim = -message.alt, self.aim[1]
            elif message.get_type() == "SET_ATTITUDE_TARGET":
                self.aim = self.aim[0], 2.0 * atan2(message.q[3], message.q[0])
        part = 1.0 - exp(-0.04 / LAG)
        self.time += 0.04
        self.depth += part * (self.aim[0] - self.depth)
        self.heading += part * ((self.aim[1] - self.heading + pi) % (2.0 * pi) - pi)
        yaw = (self.heading + pi) % (2.0 * pi) - pi
        return SimpleNamespace(get_type=lambda: "ATTITUDE", time_boot_ms=round(1e3 * self.time), yaw=yaw)


def test_the_steps_are_asked_for_and_their_figures_are_those_of_the_vehicle(tmp_path: Path) -> None:
    """A lag settles after T ln(step/5 cm) and T ln(step/2 deg), and the target comes a message later."""
    vehicle = Vehicle()
    rows = ardusub_steps.flight(vehicle)
    kinds = [message.get_type() for message in vehicle.seen]
    commands = [(m.command, m.param1, m.param2) for m in vehicle.seen if m.get_type() == "COMMAND_LONG"]
    assert commands[:2] == [(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 40000.0) for number in (30, 32)]
    assert commands[2] == (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 21196.0)
    assert vehicle.modes == [2]
    assert kinds.count("SET_ATTITUDE_TARGET") == kinds.count("SET_POSITION_TARGET_GLOBAL_INT") > 1500
    asked = {m.type_mask for m in vehicle.seen if "TARGET" in m.get_type()}
    free = mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET
    assert asked == {0b111111111111 - free, 0b01000111}
    found = [*ardusub_steps.figures(rows)]
    names = ["depth +0.5 m", "depth -0.5 m", "depth +1.5 m", *(f"heading {d:+} deg" for d in (4, 30, -30, 90, -90))]
    assert [name for name, *_ in found] == names
    for name, over, settled, rest in found:
        size, within = abs(float(name.split()[1])), 2.0
        size, within = (100.0 * size, 5.0) if name.startswith("depth") else (size, within)
        assert settled == pytest.approx(LAG * log(size / within), abs=0.09)
        assert max(over, rest) < 0.01
    ardusub_steps.draw({"firmware": rows, "own": rows}, tmp_path / "steps.svg")
    assert "heading beyond the target" in (tmp_path / "steps.svg").read_text("utf-8")
