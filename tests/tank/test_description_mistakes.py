"""Mistakes in rov.toml and in the files of tests: all of them are reported at once, with a line each."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

import pytest
from hypothesis import strategies as st

from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.messages import FileError
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.vehicle.geometry import check_layout
from tests.commands import ROOT
from tests.damage import changed_toml, fuzz
from tests.folders import (
    BLUEROV2,
    DOWN,
    FORCE,
    HEAD,
    MASS,
    PLACE,
    RATE,
    SPEED,
    TAU,
    THRUSTER,
    TOP,
    TURNS,
    VECTORED,
    folder_of,
    pulled,
)
from tests.often import often


def given(name: str, value: float, unit: str) -> str:
    """Return a line of rov.toml that gives a coefficient."""
    return f'{name} = {{ value = {value}, unit = "{unit}", source = "s" }}\n'


ABOUT = 'thrust = { about = 14.0, unit = "N" }\n'
HEAVE_ALONE = {"steady_heave.csv": f"{SPEED}\n0.3,0.2\n0.6,0.4\n"}
WITH_THRUST = HEAVE_ALONE | {"thrust_t200.csv": pulled(30.0, 20.0)}
LIMITS = """[windows]
heave = [{}, {}]
surge = [{}, {}]
[priors]
inertia = {}
[logs]
neutral = {}
span = {}
"""
LOGGED = {"a": ",voltage [V]", "b": ",salinity"}
ROWS = "".join(f"{n},{0.1 * n % 1:.1f},{n},{n}\n" for n in range(30))
WRONG: list[tuple[str, Mapping[str, str], str]] = [
    (
        f'base = "bluerov3"\n{HEAD}',
        HEAVE_ALONE,
        "/rov.toml: base = 'bluerov3': must be a vehicle file in this folder, or",
    ),
    (
        'base = "bluerov2"\n' + VECTORED,
        {},
        " | ".join(f"/rov.toml: {name}: is not allowed together with base" for name in ("body", "curves", "thruster")),
    ),
    (f"{HEAD}[geometry]\nangle = 40\n", HEAVE_ALONE, "/rov.toml: geometry: is only allowed with base: write direction"),
    (
        f'base = "bluerov2"\n{HEAD}[geometry]\nangle = 90\nx = 0\n',
        HEAVE_ALONE,
        "/rov.toml: geometry.angle = 90: must be between 0 and 90 deg | /rov.toml: geometry.x = 0: must be from 0.001",
    ),
    (
        f"{HEAD}[curves.t200]\n",
        HEAVE_ALONE,
        "/rov.toml: thruster: this table is missing, and there is curves: write [[t",
    ),
    (
        f"{HEAD}[body]\n{MASS}{THRUSTER.format(name='v', x=0, y=0, z=1)}[curves]\n",
        HEAVE_ALONE,
        "/rov.toml: curves: this table is missing, and there is body: write [curves.<name>]",
    ),
    (
        DOWN.replace("[curves.t200]", "[curves.t200]\nelectric_current = { voltage = 16, table = 'A' }"),
        WITH_THRUST | {"A": "command [1],current [A]\n-1,9\n0,0\n1,10\n"},
        "/rov.toml: curves.t200.electric_current: identification does not use it. Add it to the identified vehicle",
    ),
    (
        f'{HEAD}[surface]\nheight = {{ value = 0.2, unit = "m", source = "a drawing" }}\n',
        HEAVE_ALONE,
        "/rov.toml: surface: identification does not use it. Add it to the identified vehicle file instead",
    ),
    (
        f'current = "passes"\n{HEAD}',
        HEAVE_ALONE,
        "/rov.toml: current: identification does not use it. Add it to the identified vehicle file instead",
    ),
    (
        f"{HEAD}[body]\n{MASS}",
        {},
        "/steady_heave.csv: its commands are of thrusters, and rov.toml has none: write",
    ),
    (DOWN, {"thrust_t200.csv": pulled(30.0, 20.0)}, ": no axis is tested: there is no steady_, time_co"),
    (
        DOWN.replace("[curves.t200]", "[curves.t200]\n" + TOP.replace("_top", "")),
        WITH_THRUST,
        ": rov.toml gives a_t_t200, b_t_t200, but there is thrust_t200.csv too",
    ),
    (
        f"{DOWN}[commands]\npulse = [1100, 1500, 1900]\n",
        WITH_THRUST,
        "/rov.toml: commands.pulse: each log says itself what its commands are. Leave it out here, and add it to the",
    ),
    (
        f'base = "remus100.toml"\n{HEAD}',
        {"remus100.toml": (ROOT / "examples" / "remus100" / "remus100.toml").read_text(encoding="utf-8")},
        ": there is no log and no table in this folder. These formats are read: a CSV file, ",
    ),
    (
        DOWN.replace('curve = "t200"', 'curve = "t100"'),
        WITH_THRUST,
        "/rov.toml: thruster.v.curve = 't100': there is no such curve, only t200 | /rov.toml: curves.t200: no thruster",
    ),
    (
        DOWN + f"[axes.heave]\n{given('a_d_reverse', 1.0, 'N.s2/m2')}",
        WITH_THRUST,
        "/rov.toml: axes.heave.b_d_reverse: this key is missing, and a_d_reverse is there",
    ),
    (
        DOWN.replace("[curves.t200]", f"[curves.t200]\n{given('a_t', 1.0, 'N')}"),
        HEAVE_ALONE,
        "/rov.toml: curves.t200: a_t_t200 is given, but b_t_t200 is not",
    ),
    (
        DOWN.replace("t200", "x") + DOWN[DOWN.index("[curves") :].replace("t200", "x_reverse").replace('"v"', '"w"'),
        {},
        "/rov.toml: curves.x_reverse.a_t: has the name a_t_x_reverse in the FMU, which curves.x.a_t_reverse has too"
        " | : no thrust_x*.csv | : no thrust_x_reverse*.csv",
    ),
    (DOWN + f"[body]\n{MASS}", WITH_THRUST, "/rov.toml: known.m_rov: is given in [body] too"),
    (DOWN.replace(MASS, ""), WITH_THRUST, "/rov.toml: body.m_rov: this key is missing, and the vehicle has he"),
    (
        f"{HEAD}[known]\n{TURNS}",
        {"thrust_rear.csv": pulled(40.0, 2.0), "steady_yaw.csv": f"{RATE}\n0.3,0.2\n"},
        "/rov.toml: known.R: this key is missing, and | /rov.toml: known.gamma: this key is missing, and the vehicle",
    ),
    (
        VECTORED.replace(PLACE.format(0.15, 0.11), ""),
        {"thrust_t200.csv": pulled(1.0, 1.0), "steady_yaw.csv": f"{RATE}\n0.3,0.2\n"},
        "/rov.toml: thruster.1.position: this key, or arm, is missing, and the vehicle has yaw",
    ),
    (
        DOWN,
        HEAVE_ALONE,
        ": no thrust_t200*.csv, and [known] in rov.toml does not give a_t_t200. About will do: "
        'thrust = { about = 14.0, unit = "N" } in [curves.t200]',
    ),
    (
        DOWN.replace("[curves.t200]", '[curves.t200]\nthrust = { about = 0.0, unit = "kg" }'),
        HEAVE_ALONE,
        "/rov.toml: curves.t200.thrust.about = 0.0: must be above 0"
        " | /rov.toml: curves.t200.thrust.unit = 'kg': must be N, kgf, lbf",
    ),
    (
        DOWN.replace("[curves.t200]", f"[curves.t200]\n{ABOUT}{given('a_t', 9.0, 'N')}{given('b_t', 9.0, 'N')}"),
        HEAVE_ALONE,
        "/rov.toml: curves.t200.thrust: leave it out, because a_t_t200, b_t_t200 is given",
    ),
    (
        f'{DOWN}[logs]\nreversed = ["w"]\n',
        WITH_THRUST,
        "/rov.toml: logs.reversed = 'w': there is no such thruster, only v",
    ),
    (
        f'{DOWN}[logs]\nmounted = ["w"]\n',
        WITH_THRUST,
        "/rov.toml: logs.mounted = 'w': there is no such thruster, only v",
    ),
    (
        f'base = "videoray"\n{HEAD}[logs]\nmounted = ["l"]\n',
        {},
        "/rov.toml: logs.mounted = 'l': has an arm, or is a force on the body: name it in reversed"
        " | /rov.toml: thruster.l.arm: must be of a thruster that pushes ahead; give its position instead",
    ),
    (
        DOWN,
        {"thrust_t200.csv": pulled(30.0, 20.0), "time_constant_heave.csv": f"{TAU}\n0.3,2\n"},
        ": no steady_heave*.csv or log of heave that counts, and [known] in rov.toml does not give a_d_w, b_d_w",
    ),
    (
        DOWN + PLACE.format(0.1, 0.0),
        {"a.csv": "day\nMonday\n"},
        "/a.csv: neither a log, which has a column 'time [s]', nor a table, whose name begins with thrust_<curve>, "
        "steady_<axis> or time_constant_<axis>, of t200 or heave",
    ),
    (
        f"{BLUEROV2}[known]\n{given('m_rv', 9.0, 'kg')}",
        HEAVE_ALONE,
        "/rov.toml: known.m_rv: there is no such coefficient of this vehicle; did you mean m_rov?",
    ),
    (
        f"{BLUEROV2}[known]\n{given('m_a_w', -1.0, 'N')}",
        HEAVE_ALONE,
        "/rov.toml: known.m_a_w.unit = 'N': must be 'kg' | /rov.toml: known.m_a_w.value = -1.0: must be within 0 ... 1",
    ),
    (
        f"{BLUEROV2}[axes.heave]\n{given('Z_wdot', -1.0, 'kg')}",
        HEAVE_ALONE,
        "/rov.toml: axes.heave.Z_wdot: there is no such key; give -Z_wdot, which is positive, as m_a of [axes.heave]",
    ),
    (
        f"{BLUEROV2}{LIMITS.format(-1.01, 1, 0.2, 0.2, -0.1, -10001, 10001)}",
        HEAVE_ALONE,
        " | ".join(
            f"/rov.toml: {line}"
            for line in (
                "windows.heave = [-1.01, 1]: must be [low, high] within -1 ... 1, fractions of the full command: 20 %",
                "windows.surge = [0.2, 0.2]: must be [low, high]",
                "priors.inertia = -0.1: must be 0 or above",
                "logs.neutral = -10001: must be greater than or equal to -10000",
                "logs.span = 10001: must be less than or equal to 10000",
            )
        ),
    ),
    (
        f'base = "bluerov2_heavy"\n{HEAD}[fit]\nattitude = true\n',
        HEAVE_ALONE,
        "/rov.toml: fit.attitude: the vehicle has the axis roll, pitch, which is simulated: leave it out",
    ),
    (
        f"{BLUEROV2}[fit]\nvoltage = true\n",
        {f"{name}.csv": f"time [s],u_5 [1],depth [m]{title}\n{ROWS}" for name, title in LOGGED.items()},
        "/rov.toml: fit.voltage: every log must have the column voltage [V], but there is none in b.csv",
    ),
    (
        f'{BLUEROV2}[fit]\nlag = ["rear"]\n',
        HEAVE_ALONE,
        "/rov.toml: fit.lag = 'rear': there is no such curve, only t200",
    ),
    (
        f"{BLUEROV2}[known]\n{given('T_t200', 0.1, 's')}[fit]\nlag = true\n",
        HEAVE_ALONE,
        "/rov.toml: fit.lag = 't200': T_t200 is given, so it cannot be fitted too",
    ),
    (f"{BLUEROV2}[fit]\nadvance = true\n", HEAVE_ALONE, "/rov.toml: fit.advance: "),
    (
        f"{BLUEROV2}[fit]\nvoltage = true\n",
        HEAVE_ALONE,
        "/rov.toml: fit.voltage: every log must have the column voltage [V], but there is no log",
    ),
]
"""rov.toml, the tables, and the beginnings of the lines after the name of the folder."""


@pytest.mark.parametrize("case", range(len(WRONG)))
def test_what_is_wrong_is_told(case: int, tmp_path: Path) -> None:
    rov, tables, lines = WRONG[case]
    check_refused(folder_of(tmp_path / "tests", rov, tables or HEAVE_ALONE), lines.split(" | "))


def check_refused(folder: Path, starts: Sequence[str]) -> None:
    """Check that the refusal of a folder has a line for each mistake, which begins with the folder and these words."""
    with pytest.raises(FileError) as caught:
        load_tests(folder)
    for line, start in zip(str(caught.value).splitlines(), starts, strict=True):
        assert line.startswith(f"{folder}{start}")
    assert str(caught.value).count("there is no such column, but") <= 1, "the list of columns is told once"


def test_all_problems_of_a_folder_in_one_go(tmp_path: Path) -> None:
    """The mistakes are in rov.toml, in rows and in names of files, and files are missing."""
    rov = f"{HEAD}[known]\n{MASS.replace('kg', 'lb')}[windows]\nsway = [0.1, 0.2]\n"
    tables = {
        "log_yaw.csv": "time [s],command [%]\n0,0\n",
        "steady_heave.csv": f"{SPEED}\n0.3,0.2\n0,1\n0.3,-0.2\n",
        "steady_surge.csv": f"{SPEED}\n0.3,fast\n",
        "stedy_surge.csv": f"{SPEED}\n0.3,0.2\n",
        "thrust_left.csv": f"{FORCE}\n0.3,0.2\n",
        "thrust_rear.csv": f"{FORCE}\n0.3,10\n-0.3,7\n",
    }
    starts = [
        "/rov.toml: known.m_rov.unit = 'lb'",
        "/rov.toml: windows.sway",
        "/rov.toml: known.I_r",
        "/rov.toml: known.R",
        "/rov.toml: known.gamma",
        "/log_yaw.csv, line 1",
        "/steady_heave.csv, line 3, column 'command [1]' = 0",
        "/steady_heave.csv, line 4",
        "/steady_surge.csv, line 2",
        "/stedy_surge.csv: neither a log, which has",
        "/thrust_left.csv: left is not a thrust c",
        "/thrust_rear.csv, line 3",
        ": no thrust_top*.csv",
    ]
    check_refused(folder_of(tmp_path / "tests", rov, tables), starts)


HEADERS = """[columns]
"Time (s)" = "time [s]"
"Pull (N)" = "force [N]"
"Command (%)" = "command [%]"
"Depth (m)" = "depth [m]"
thr_pwm = "u_v [us]"
"""
"""What the headers of FILES stand for."""
FILES = {"pool.csv": "Time (s),thr_pwm,Depth (m)\n0,1500,0.5\n", "thrust_t200.csv": "Command (%),Pull (N)\n50,9\n"}


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("m_rov =", "m_rof =", "body.m_rof: there is no such key; did you mean m_rov?"),
        ("value = 6.57", 'value = "?"', "body.m_rov.value = '?': must be a number"),
        (
            '"force [N]"',
            '"force [lb]"\nTiefe = "depth [fathom]"',
            "columns.Pull (N) = 'force [lb]': must be 'force [N]' or 'force [kgf]' or 'force [lbf]' | "
            "/rov.toml: columns.Tiefe = 'depth [fathom]': must be 'depth [m]' or",
        ),
        ("u_v [us]", "u_w [us]", "columns.thr_pwm = 'u_w [us]': there is no such column, but time [s], u_v [%], "),
        (
            "u_v [us]",
            '?"\nTemp = "?',
            "columns.thr_pwm = '?': there is no such column, but time [s], | /rov.toml: columns.Temp = '?': there is",
        ),
        (
            "[columns]",
            '[topics]\n"/f.x" = "time [s]"\n[columns]',
            "topics./f.x = 'time [s]': there is no such column, but ",
        ),
    ],
)
def test_a_mistake_in_rov_toml_is_no_mistake_of_the_files(old: str, new: str, line: str, tmp_path: Path) -> None:
    """The headers are those that [columns] explains, although the vehicle cannot be used."""
    rov = DOWN.replace("[known]", "[body]") + HEADERS
    check_refused(folder_of(tmp_path / "tests", rov.replace(old, new), FILES), f"/rov.toml: {line}".split(" | "))


def check_lines(text: str, folder: Path) -> None:
    """Check that each line can be printed, and begins with a file or the folder."""
    assert all(line.startswith(str(folder)) and line.isprintable() for line in text.splitlines())


@often("examples", 5, 60, 2000)
@pytest.mark.parametrize("rov", [f"{BLUEROV2}[known]\n{given('m_a_w', 1.0, 'kg')}", VECTORED])
def test_any_rov_toml_leads_to_a_vehicle_or_clear_lines(rov: str, examples: int, tmp_path: Path) -> None:
    tables = {"steady_yaw.csv": f"{RATE}\n0.3,0.2\n", "steady_surge.csv": f"{SPEED}\n0.3,0.2\n"}
    folder = folder_of(tmp_path / "tests", rov, tables | {"thrust_t200.csv": pulled(30.0, 20.0)})

    def check(data: st.DataObject) -> None:
        (folder / ROV_FILE).write_bytes(changed_toml(rov.encode(), data))
        try:
            given = load_tests(folder)
        except FileError as error:
            check_lines(str(error), folder)
            return
        layout = given.layout
        assert [*check_layout(layout)] == []
        assert {"surge", "yaw"} <= layout.by_name.keys()
        assert layout.coefficients.keys() >= given.known.keys()
        assert all(isfinite(value) for value in given.base.values())
        assert all(thruster.direction.source for thruster in layout.thrusters)

    fuzz(check, examples)
