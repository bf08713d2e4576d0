"""Where commands and a depth come from: parameters of the autopilot, [logs] and [topics] of rov.toml, and pressures."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.tank.columns import names_of
from rov_fmu.tank.commands import LogKeys
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import checked_log
from rov_fmu.tank.read_log import read_logs
from tests.tank.logs import commanded, measured
from tests.tank.readers.motion import BLUEROV2, TIME
from tests.tank.readers.test_autopilots import N, dive
from tests.tank.readers.writers import Ros, parameter, write_tlog


def one(path: Path, keys: LogKeys = LogKeys(), topics: dict[str, str] | None = None) -> Log:  # noqa: B008 (frozen)
    names, mistakes = names_of(BLUEROV2, RovTables(topics=topics or {}, logs=keys))
    assert not mistakes
    (log,) = map(checked_log, read_logs(path, BLUEROV2, names))
    return log


def told(log: Log) -> str:
    return "\n".join(sentences(log.findings))


def told_at(time: float, **values: float) -> list[tuple[float, Any]]:
    return [(time, parameter(name, value)[1]) for name, value in values.items()]


def test_a_parameter_counts_from_when_it_was_told(tmp_path: Path) -> None:
    values = {"MOT_5_DIRECTION": 1.0, "MOT_6_DIRECTION": 1.0, "MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0}
    told_by = [
        *told_at(1.0, **values),
        *told_at(5.0, MOT_5_DIRECTION=-1.0, MOT_6_DIRECTION=-1.0),
        *told_at(6.0, MOT_PWM_MAX=2000.0),
    ]
    log = one(write_tlog(tmp_path / "a.tlog", [*told_by, *dive(2.0)]))
    assert commanded(log, "5")[29] == pytest.approx(0.5)
    assert commanded(log, "5")[31] == pytest.approx(-0.5)
    assert commanded(log, "5")[41] == pytest.approx(-0.4)
    assert "a.tlog: full thrust is 1100 and 2000 us, and no thrust 1500 us" in told(log)
    assert "MOT_PWM_MAX changed 4 s after the first command" in told(log)
    assert "MOT_5_DIRECTION and MOT_6_DIRECTION changed 3 s after the first command. Each value is used" in told(log)


def test_rov_toml_states_neutral_and_span_of_columns_without_their_own_and_a_pressure_tells_the_depth(
    tmp_path: Path,
) -> None:
    path = tmp_path / "dive.csv"
    rows = (f"{n},1645,1645,{1013.25 + 0.980665 * n}" for n in range(N))
    path.write_text("\n".join(["time [s],u_5 [us],u_6 [us 1500 290],pressure [mbar]", *rows]), encoding="utf-8")
    log = one(path, LogKeys(neutral=1520.0, span=250.0))
    assert [commanded(log, thruster)[-1] for thruster in "56"] == pytest.approx([0.5, 0.5])
    assert measured(log, "depth") == pytest.approx(0.01 * np.arange(N))


def test_clipping_is_told_of_thrusters_and_of_topics(tmp_path: Path) -> None:
    sentence = "50 commands of {} beyond full thrust taken as full thrust"
    log = one(write_tlog(tmp_path / "a.tlog", dive(2.0, 1964)))
    assert commanded(log, "5")[-1] == 1.0
    assert sentence.format("thruster 5") in told(log)
    ros = Ros(2)
    number = ros.store.types["std_msgs/msg/Float64"]
    percent = ros.write(tmp_path / "p", [("/out", time, number(data=120.0 * (time > 4.95))) for time in TIME])
    assert sentence.format("/out.data") in told(one(percent, topics={"/out.data": "u_5 [%]"}))
    assert commanded(one(percent, topics={"/out.data": "u_5 [N 150]"}), "5")[-1] == pytest.approx(0.8)
