"""What the parameters of an autopilot and [logs] of rov.toml say about commands, and clipping in every format."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.tank.commands import LogKeys
from rov_fmu.tank.log import Log
from tests.tank.logs import commanded
from tests.tank.readers import motion
from tests.tank.readers.motion import TIME
from tests.tank.readers.test_mavlink import N
from tests.tank.readers.test_sources import ROS, numbers, one, pulses, told
from tests.tank.readers.writers import altitude, parameter, servos, write_tlog


def dive(path: Path, pulse: int, *parameters: tuple[float, Any]) -> Log:
    """Write a log in which thrusters 5 and 6 get a pulse from the tenth row on."""
    messages = [*parameters]
    for n in range(N):
        time = 2.0 + 0.1 * n
        messages += [servos(time, *[1500] * 4, *[pulse if n >= 10 else 1500] * 2), altitude(time, -1.0 - 0.01 * n)]
    return one(write_tlog(path, messages))


def told_at(time: float, **values: float) -> list[tuple[float, Any]]:
    return [(time, parameter(name, value)[1]) for name, value in values.items()]


def test_a_parameter_counts_from_when_it_was_told(tmp_path: Path) -> None:
    values = {"MOT_5_DIRECTION": 1.0, "MOT_6_DIRECTION": 1.0, "MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0}
    log = dive(
        tmp_path / "a.tlog",
        1700,
        *told_at(1.0, **values),
        *told_at(5.0, MOT_5_DIRECTION=-1.0, MOT_6_DIRECTION=-1.0),
        *told_at(6.0, MOT_PWM_MAX=2000.0),
    )
    assert commanded(log, "5")[29] == pytest.approx(0.5)
    assert commanded(log, "5")[31] == pytest.approx(-0.5)
    assert commanded(log, "5")[41] == pytest.approx(-0.4)
    assert "a.tlog: full thrust is 1100 and 2000 us, and no thrust 1500 us" in told(log)
    assert "MOT_PWM_MAX changed 4 s after the first command" in told(log)
    assert "MOT_5_DIRECTION and MOT_6_DIRECTION changed 3 s after the first command. Each value is used" in told(log)


def csv(folder: Path, unit: str, values: Iterable[float]) -> Path:
    rows = [f"{n / 10},{value},{0.01 * n}" for n, value in enumerate(values)]
    path = folder / "dive.csv"
    path.write_text("\n".join([f"time [s],u_5 [{unit}],depth [m]", *rows]), encoding="utf-8")
    return path


def test_rov_toml_states_neutral_and_span(tmp_path: Path) -> None:
    keys = LogKeys(neutral=1520.0, span=250.0)
    pulse = np.where(np.arange(N) > 9, 1645, 1520)
    assert commanded(one(csv(tmp_path, "us", pulse), keys), "5")[-1] == pytest.approx(0.5)
    assert commanded(one(csv(tmp_path, "us 1500 290", pulse), keys), "5")[-1] == pytest.approx(0.5), "the header counts"
    bag = one(ROS.write(tmp_path, [*pulses(), *numbers("/depth", motion.DEPTH)]), keys)
    assert commanded(bag, "5")[-1] == pytest.approx((1500.0 + 400.0 * 0.5 - 1520.0) / 250.0)


def test_clipping_is_told_in_every_format(tmp_path: Path) -> None:
    sentence = "50 commands of {} beyond full thrust taken as full thrust"
    log = dive(tmp_path / "a.tlog", 1964)
    assert commanded(log, "5")[-1] == 1.0
    assert sentence.format("thruster 5") in told(log)
    pulses = np.where(np.arange(N) > 9, 1964, 1500)
    assert sentence.format("u_5 [us]") in told(one(csv(tmp_path, "us", pulses)))
    percent = ROS.write(tmp_path / "p", [*numbers("/out", 120.0 * (TIME > 4.95)), *numbers("/depth", motion.DEPTH)])
    assert sentence.format("/out.data") in told(one(percent, topics={"/out.data": "u_5 [%]"}))
