"""CSV logs from loggers and spreadsheets: what is read, what is left out with a finding, and what is refused."""

from collections.abc import Sequence
from math import radians
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, VehicleAxis
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.columns import COMMAND
from rov_fmu.tank.findings import sentences
from tests.tank.logs import Read, commanded, measured, read_log, used
from tests.vehicles import VIDEORAY, thruster

N = 40
STEP = [0.3 * (n >= 10) for n in range(N)]
MIXED = Layout(
    axes=(VehicleAxis(SURGE), VehicleAxis(YAW)),
    curves=(Curve("rear"),),
    thrusters=(
        thruster("l", "rear", (1.0, 0.0, 0.0), (-0.2, -0.1, 0.0)),
        thruster("r", "rear", (1.0, 0.0, 0.0), (-0.2, 0.1, 0.0)),
    ),
    mix={"ahead": {"l": 1.0, "r": 1.0}, "turn": {"l": 0.5, "r": -0.5}},
)


def read(
    folder: Path, header: str, rows: Sequence[str], axis: Axis | None = None, layout: Layout = VIDEORAY.layout
) -> Read:
    path = folder / "log.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return read_log(path, layout, axis)


# ---- Rows that cannot be used ----------------------------------------------------------------------------------------


def test_rows_that_cannot_be_used_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = [f"{n / 10},{100 * STEP[n]},{n}" for n in range(N)]
    rows[5], rows[6] = rows[6], rows[5]  # 0.6 before 0.5
    rows[21:21] = ["2.05,,5", "2.06,on,5", "2.07,-,5", "2.08,30,x", "2.09,3,4,5", "2.04,nan,-"]
    rows[20:20] = ["1.9,30,", "1.9,25,77", ",30,5", "nan,30,5"]
    log = read(tmp_path, "time [s],command [%],depth [cm]", rows, HEAVE)
    assert [(finding.kind, finding.words["count"]) for finding in log.findings] == [
        ("rows sorted", 1),
        ("time stamps merged", 2),
        ("rows without time", 2),
        ("rows without numbers", 1),
        ("torn rows", 1),
        ("unread cells", 1),
        ("unread cells", 1),
    ]
    assert {finding.file for finding in log.findings} == {"log.csv"}
    assert [one.words["column"] for one in log.findings[-2:]] == ["command [%]", "depth [cm]"]
    depth = used(log.log, "depth")
    in_order = 0.01 * np.arange(N)
    in_order[19] = 0.77
    held = [0.25 if n == 19 else STEP[n] for n in range(N)]
    assert depth.time[depth.there] == pytest.approx([*0.1 * np.arange(21), 2.05, 2.06, 2.07, *0.1 * np.arange(21, N)])
    assert measured(log.log, "depth") == pytest.approx([*in_order[:21], *[0.05] * 3, *in_order[21:]])
    assert commanded(log.log, COMMAND, depth.time[depth.there]) == pytest.approx([*held[:21], *[0.3] * 3, *held[21:]])


def test_a_measurement_without_a_unit_is_told(tmp_path: Path) -> None:
    log = read(
        tmp_path,
        "time [s],command [%],depth [m],heave speed,remark",
        [f"{n / 10},30,{n},1,2" for n in range(40)],
        HEAVE,
    )
    (finding,) = log.findings
    assert finding.kind == "column without unit"
    assert sentences([finding]) == (
        "log.csv: 'heave speed' is not read, because its header has no unit. Write for example 'heave speed [m/s]'",
    )


def test_a_clock_that_is_set_back_splits_the_log(tmp_path: Path) -> None:
    """After 30 s the clock is set back by 5 s, so the times of a twelfth of the rows come again."""
    times = [*np.arange(0.0, 30.0, 0.05), *np.arange(25.0, 55.0, 0.05)]
    rows = [f"{time:.2f},{30 * (n > 9)},{n}" for n, time in enumerate(times)]
    log = read(tmp_path, "time [s],command [%],depth [cm]", rows, HEAVE)
    depths = [measured(one, "depth") for one in log.logs]
    assert [len(depth) for depth in depths] == [600, 600]
    assert depths[1][0] == pytest.approx(6.0)
    assert [one.file for one in log.logs] == ["log.csv", "log.csv (from 29.95 s)"]
    assert [finding.words for finding in log.findings] == [{"at": "29.95"}]


@pytest.mark.parametrize("late", ["depth [cm]", "voltage [V]"])
def test_rows_that_arrive_late_are_sorted(late: str, tmp_path: Path) -> None:
    """They fill a hole in the rows before them, here in those of one sensor, which has rows of its own. Commands act
    at the times of their own rows."""
    times = [n / 10 for n in range(300)]
    arriving = [*times[:20], *times[60:140], *times[20:60], *times[140:]]
    prompt = ({"depth [cm]", "voltage [V]"} - {late}).pop()
    rows = [
        row
        for time, sent in zip(times, arriving, strict=True)
        for row in (f"{time},{30 * (time > 1)},{10 + time},", f"{sent + 0.05:.2f},,,{10 + sent}")
    ]
    log = read(tmp_path, f"time [s],command [%],{prompt},{late}", rows, HEAVE)
    assert [(found.kind, found.words["count"]) for found in log.findings] == [("rows sorted", 40)]
    assert commanded(log.log, COMMAND, np.array(times)) == pytest.approx([0.3 * (time > 1) for time in times])


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([f"{n},,1" for n in range(N)], "no row has both a time and a command"),
        ([f"{59 - n},30,{n}" for n in range(60)], r"line 3, column 'time \[s\]' = 58: the time goes back and does not"),
        (
            [f"12.5.2026,30,{n}" for n in range(N)],
            r"line 2, column 'time \[s\]' = 12.5.2026: is no time, and no row",
        ),
        (
            ["0,,1", "1,none,1"],
            r"line 3, column 'command \[%\]' = none: is no number, and no row has both a time and",
        ),
        ([f"{n / 10:.1f},30,1".replace(".", ",") for n in range(N)], "line 2, column 4 = '1': .* decimal commas"),
        (
            [f"{10.1 * n},30,1" for n in range(N)],
            r"column time \[s\] gives 0\.099 rows a second\. Is its unit another one",
        ),
        ([f"{9e-6 * n},30,1" for n in range(N)], r"column time \[s\] gives 1\.11e\+05 rows a second"),
    ],
)
def test_logs_of_which_nothing_is_left_are_refused(rows: list[str], told: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=told):
        read(tmp_path, "time [s],command [%],depth [cm]", rows, HEAVE)


# ---- Several commands ------------------------------------------------------------------------------------------------


def test_inputs_are_mixed_and_saturated_and_thrusters_are_not(tmp_path: Path) -> None:
    rows = [f"{n / 10},{0.8 * (n > 9)},{STEP[n]},{n}" for n in range(N)]

    def ends(header: str, rows: Sequence[str]) -> list[float]:
        log = read(tmp_path, header, rows, layout=MIXED).log
        return [commanded(log, thruster)[-1] for thruster in "lr"]

    assert ends("time [s],u_ahead [1],u_turn [1],heading [deg]", rows) == pytest.approx([0.95, 0.65])
    assert ends("time [s],l [1],R [1],heading [deg]", rows) == pytest.approx([0.8, 0.3])
    rows = [f"{n / 10},{0.9 * (n > 9)},{0.9 * (n > 9)},{n}" for n in range(N)]
    assert ends("time [s],u_ahead [1],u_turn [1],heading [deg]", rows) == pytest.approx([1.0, 0.45])


def test_a_command_that_differs_by_rounding_is_held(tmp_path: Path) -> None:
    half = [0.5 + (-1) ** n * 1e-16 for n in range(N - 20)]
    rows = [f"{n / 10},{value!r},{n}" for n, value in enumerate([0.0] * 20 + half)]
    found = read(tmp_path, "time [s],u_t [1],depth [m]", rows).log.commands
    assert found is not None
    assert found.time[found.thruster == found.thrusters.index("t")] == pytest.approx([0.0, 2.0])


# ---- Pulses ----------------------------------------------------------------------------------------------------------


def test_pulses_that_are_none_or_too_wide_are_told(tmp_path: Path) -> None:
    pulses = [0, 65535, *[1500] * 8, 2000, 900, *[1700] * 26, 1900, 1100]
    log = read(tmp_path, "time [s],u_t [us],depth [m]", [f"{n},{p},{n}" for n, p in enumerate(pulses)])
    assert commanded(log.log, "t")[[0, 1, 2, 10, 11, 12]] == pytest.approx([0, 0, 0, 1, -1, 0.5])
    assert sentences(log.findings) == (
        "log.csv: 2 pulses of u_t [us] of 0 or 65535 us taken as no command",
        "log.csv: 2 commands of u_t [us] beyond full thrust taken as full thrust",
        "log.csv: there is no column of u_l. Its command is taken as 0. Add the column if this is wrong",
        "log.csv: there is no column of u_r. Its command is taken as 0. Add the column if this is wrong",
    )


OFFSETS = {
    "us 0 400": [-0.5, 0.0, 1.0],
    "us 0 -400": [0.5, 0.0, -1.0],
    "us 100 400": [-0.75, -0.25, 0.75],
    "us -100 250": [-0.4, 0.4, 1.0],
}
"""Units of pulses, and the commands that -200, 0 and 400 are."""


@pytest.mark.parametrize("unit", OFFSETS)
def test_pulses_about_any_neutral(unit: str, tmp_path: Path) -> None:
    rows = [f"{n},{pulse},{n}" for n, pulse in enumerate((-200, 0, 400))]
    log = read(tmp_path, f"time [s],command [{unit}],depth [m]", rows, HEAVE)
    assert commanded(log.log, COMMAND) == pytest.approx(OFFSETS[unit])
    kinds = [finding.kind for finding in log.findings]
    assert kinds == (["beyond full thrust"] if "-100" in unit else [])


SLIPS = {
    "% 1": "no command exceeds 1 %. Are they fractions? Then write [1]",
    "% 1.01": "",
    "us -1": "no pulse beyond 1 us: fractions under [us]? Write [1]",
    "us 1.01": "no pulse beyond 100 us: percent under [us]? Write [%]",
    "us 100": "no pulse beyond 100 us: percent under [us]? Write [%]",
    "us 100.1": "",
    "us 0": "",
    "us_0_400 50": "",
}
"""The unit and the largest number of a command, and why they cannot belong together."""


@pytest.mark.parametrize("case", SLIPS)
def test_commands_that_cannot_be_in_their_unit_are_refused(case: str, tmp_path: Path) -> None:
    unit, number = case.split()
    unit = unit.replace("_", " ")
    try:
        read(tmp_path, f"time [s],command [{unit}],depth [m]", ["0,0,1", f"1,{number},2"], HEAVE)
        found = ""
    except DataFileError as error:
        found = str(error).removeprefix(f"{tmp_path / 'log.csv'}, column 'command [{unit}]': ")
    assert found == SLIPS[case]


# ---- What is refused -------------------------------------------------------------------------------------------------

REFUSED = {
    "no commands": "time [s],depth [m] | 0,1 | line 1: there is no column of commands. Possible columns: u_l, u_r, "
    "u_t, each in",
    "a pulse under another name": "time [s],PWM (us),depth [m] | 0,1500,1 | each in [%], [1] or [us]; is it the column "
    "'PWM (us)'? Units stand in square brackets.",
    "no motion": "time [s],u_t [%] | 0,1 | line 1: column 'surge distance [m]' or 'surge velocity [m/s]' or 'depth",
    "no such unit": "time [s],u_t [V],depth [m] | 0,1,1 | 'u_t [V]': must be 'u_t [%]' or 'u_t [1]' or 'u_t [us]'",
    "span of none": "time [s],u_t [us 1500 0],depth [m] | 0,1,1 | must be [us], or [us NEUTRAL SPAN] with a span",
    "two kinds": "time [s],command [%],u_t [%],depth [m] | 0,0,0,0 | columns 'command [%]', 'u_t [%]'",
    "twice": "time [s],u_t [%],t [1],depth [m] | 0,1,1,1 | this column occurs twice",
    "percent as fractions": "time [s],u_t [1],depth [m] | 0,30,1 | line 2, column 'u_t [1]' = '30': must be at",
    "neutral alone": "time [s],u_t [us 1500],depth [m] | 0,1,1 | must be [us], or [us NEUTRAL SPAN] with a span",
    "words in a unit": "time [s],u_t [us 1500 x],depth [m] | 0,1,1 | column 2 = 'u_t [us 1500 x]': only numbers may "
    "follow us",
    "a number in a unit": "time [s],u_t [% 5],depth [m] | 0,1,1 | column 2 = 'u_t [% 5]': must be [%] alone",
    "no force at full command": "time [s],u_t [N 0],depth [m] | 0,1,1 | must be a unit of force with the force at full "
    "com",
}
"""Headers, a row, and a part of the line about them."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_one_clear_line(case: str, tmp_path: Path) -> None:
    header, row, told = REFUSED[case].split(" | ")
    with pytest.raises(DataFileError) as error:
        read(tmp_path, header, [row], HEAVE if case == "two kinds" else None)
    (line,) = str(error.value).splitlines()
    assert line.startswith(str(tmp_path / "log.csv"))
    assert told in line


def test_a_log_of_one_axis_tells_of_the_conditions(tmp_path: Path) -> None:
    rows = [f"{n / 10},{STEP[n]},{0.1 * n},{15000 - n},{n},-5,3" for n in range(N)]
    header = "time [s],command [1],surge velocity [m/s],Battery [mV],roll [deg],theta [deg],depth [m]"
    log = read(tmp_path, header, rows, SURGE).log
    assert log.axis is SURGE
    names = {"surge velocity", "voltage", "roll angle", "pitch angle", "depth"}
    assert {c.quantity.name for c in log.channels} == names
    assert measured(log, "voltage") == pytest.approx(15.0 - 0.001 * np.arange(N))
    assert measured(log, "roll angle") == pytest.approx(np.radians(np.arange(N)))
    assert measured(log, "pitch angle") == pytest.approx(radians(-5) * np.ones(N))
