"""Tables 6–8: V_ss and Tau from trajectories of the FMU against closed form, printed and measured values."""

import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import product
from math import e, inf, isclose
from pathlib import Path

import fmpy
import pytest
from scipy.optimize import brentq

from rov_fmu.cli import main
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.published import STEP_TESTS, Cell, ResponseTable, load_tables
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import ALONE

DATA = VIDEORAY.parent / "tables"


# ---- The printed values, and their deviations from Table 9 ----------------------------------------------------------


@dataclass(frozen=True)
class Band:
    """The range of the simulated minus the printed value, which is one unit of the last printed digit wide."""

    low: float
    high: float
    reason: str


def off(low: float, reason: str) -> Band:
    """Return the band of a printed value that is smaller than the simulated one by `low` to `low` + 0.01."""
    return Band(low, low + 0.01, reason)


ROUNDED = Band(-0.005, 0.005, "the paper rounds")
TRUNCATED = Band(0.0, 0.01, "the paper cuts digits off")
TAU_W = (
    "Not from Table 9: its α_w, β_w make Tau 1.59 to 1.60 times as long as without them, the printed Tau are 1.68 to "
    "1.79 times as long; the paper does not tell how it read Tau."
)
TAU_R = "Table 9 gives 1 to 4 % more; the paper does not tell how it read Tau, and prints two of heave's here."
V_R = "Not from Table 9: 5 % more at 20 %, 1 to 2 % less at 30 and 50 %, although 70 % agrees; no α_r gives all four."

# For each axis and command in %: V_ss and Tau of the non-linear model, V_ss and Tau of the scaled model; each as the
# printed value and its band.
CELLS: dict[tuple[str, int], tuple[tuple[str, Band], ...]] = {
    ("heave", 20): (("0.10", ROUNDED), ("1.76", off(0.25, TAU_W)), ("0.11", ROUNDED), ("3.08", off(0.13, TAU_W))),
    ("heave", 30): (("0.16", ROUNDED), ("1.33", off(0.05, TAU_W)), ("0.17", ROUNDED), ("2.23", off(-0.03, TAU_W))),
    ("heave", 50): (("0.28", ROUNDED), ("0.80", off(0.05, TAU_W)), ("0.30", ROUNDED), ("1.40", off(-0.05, TAU_W))),
    ("heave", 70): (("0.39", TRUNCATED), ("0.58", off(0.03, TAU_W)), ("0.42", TRUNCATED), ("1.04", off(-0.06, TAU_W))),
    ("yaw", 20): (("0.93", ROUNDED), ("0.39", off(0.01, TAU_R)), ("1.10", off(-0.06, V_R)), ("3.08", off(0.05, TAU_R))),
    ("yaw", 30): (("1.47", ROUNDED), ("0.29", TRUNCATED), ("1.61", off(0.03, V_R)), ("2.23", off(0.07, TAU_R))),
    ("yaw", 50): (("2.57", ROUNDED), ("0.19", TRUNCATED), ("2.82", off(0.03, V_R)), ("1.46", off(0.04, TAU_R))),
    ("yaw", 70): (("3.68", ROUNDED), ("0.14", TRUNCATED), ("4.07", ROUNDED), ("1.10", off(0.01, TAU_R))),
}

# Table 8 is lost, so surge is compared with the V_ss measured in Table 4: command in %, and the relative deviations of
# the non-linear and the scaled model from it. The paper tunes around 30 % by fits that give low commands more weight
# (section 5), and states that surge deviates above. At 20 % the measured velocity needs more thrust than (9) gives.
SURGE: dict[int, tuple[float, float]] = {
    20: (-0.278, -0.211),
    30: (-0.075, +0.006),
    40: (-0.003, +0.080),
    50: (+0.129, +0.218),
    60: (+0.117, +0.202),
    70: (+0.082, +0.161),
}
SURGE_BAND = 0.0005  # half a unit of the last digit of these deviations

MODELS = ("non_linear", "scaled")
ROWS = [*CELLS, *(("surge", command) for command in SURGE)]


# ---- The step tests of the paper, with the FMU -----------------------------------------------------------------------


class Tank:
    """A simulated test tank. It moves the FMU only by fmi2DoStep and does not use the closed form."""

    def __init__(self, folder: Path) -> None:
        description = fmpy.read_model_description(str(folder))
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        self._fmu = fmpy.instantiate_fmu(str(folder), description, fmi_type="CoSimulation")
        self._time = 0.0

    def close(self) -> None:
        self._fmu.freeInstance()

    def start_from_rest(self, values: Mapping[str, float]) -> None:
        self._fmu.reset()
        self._fmu.setupExperiment(startTime=0.0)
        self._fmu.setReal([self._references[name] for name in values], list(values.values()))
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._time = 0.0

    def value(self, name: str) -> float:
        return float(self._fmu.getReal([self._references[name]])[0])

    def step(self, h: float) -> None:
        self._fmu.doStep(currentCommunicationPoint=self._time, communicationStepSize=h)
        self._time += h

    def steady_velocity(self, velocity: str) -> float:
        """Simulate until the velocity no longer changes, and return it."""
        before = inf
        for _ in range(1000):
            self.step(1.0)
            now = self.value(velocity)
            if isclose(now, before, rel_tol=1e-15):
                return now
            before = now
        raise AssertionError(f"{velocity} still changes after {self._time:g} s")

    def time_to_reach(self, velocity: str, target: float) -> float:
        """Return the time at which the velocity reaches the target: a root search in a step of 10 ms."""
        h = 0.01
        for _ in range(10_000):
            before, start = self._fmu.getFMUstate(), self._time
            self.step(h)
            if self.value(velocity) >= target:
                break
            self._fmu.freeFMUstate(before)
        else:
            raise AssertionError(f"{velocity} does not reach {target} in {self._time:g} s")

        def lacking(time: float) -> float:
            self._fmu.setFMUstate(before)
            self._time = start
            if time > 0.0:
                self.step(time)
            return self.value(velocity) - target

        time = start + brentq(lacking, 0.0, h, xtol=1e-15)
        self._fmu.freeFMUstate(before)
        return float(time)


Responses = Callable[[str, int, str], tuple[float, float]]


@pytest.fixture(scope="module")
def simulated(videoray_dir: Path, vehicle: Vehicle) -> Iterator[Responses]:
    """Return a function that simulates V_ss and Tau of an axis at a command in % with one of the models."""
    tank = Tank(videoray_dir)

    def responses(axis: str, command: int, model: str) -> tuple[float, float]:
        experiment = next(x for x in STEP_TESTS if x.axis.name == axis)
        values = {name: sign * command / 100.0 for name, sign in vehicle.layout.signs(experiment.axis).items()}
        if model == "non_linear":
            values |= {f"{tuning}_{velocity}": 1.0 for tuning in ("alpha", "beta") for velocity in "uwr"}
        tank.start_from_rest(values)
        V_ss = tank.steady_velocity(experiment.axis.velocity)
        tank.start_from_rest(values)
        return V_ss, tank.time_to_reach(experiment.axis.velocity, (1.0 - 1.0 / e) * V_ss)

    yield responses
    tank.close()


@pytest.fixture(scope="module")
def tables(vehicle: Vehicle) -> Mapping[str, ResponseTable]:
    return {table.axis.name: table for table in load_tables(vehicle)}


def cells_of(tables: Mapping[str, ResponseTable], axis: str, command: int, model: str) -> tuple[Cell, Cell]:
    row = next(row for row in tables[axis].rows if row.command == command)
    response = getattr(row, model)
    return response.V_ss, response.Tau


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("axis", "command"), ROWS)
def test_trajectory_gives_the_closed_form_and_the_printed_cells(
    axis: str, command: int, model: str, simulated: Responses, tables: Mapping[str, ResponseTable]
) -> None:
    found = simulated(axis, command, model)
    closed_form = [cell.computed for cell in cells_of(tables, axis, command, model)]
    assert found == pytest.approx(closed_form, rel=1e-9, abs=0.0)
    number = MODELS.index(model)
    if axis == "surge":
        deviation = found[0] / float(tables["surge"].steady[Decimal(command)]) - 1.0
        assert deviation == pytest.approx(SURGE[command][number], rel=0.0, abs=SURGE_BAND)
        return
    for value, (printed, band) in zip(found, CELLS[axis, command][2 * number : 2 * number + 2], strict=True):
        assert band.low <= value - float(printed) <= band.high, f"{value} for {printed}: {band}"


# ---- The files ---------------------------------------------------------------------------------------------------


def test_files_hold_the_printed_cells(tables: Mapping[str, ResponseTable]) -> None:
    assert [(axis, int(row.command)) for axis, table in tables.items() for row in table.rows] == ROWS
    assert [(t.number, t.axis.name, t.axis.unit) for t in tables.values()] == [
        (6, "heave", "m/s"),
        (7, "yaw", "rad/s"),
        (8, "surge", "m/s"),
    ]
    for (axis, command), expected in CELLS.items():
        cells = [cell for model in MODELS for cell in cells_of(tables, axis, command, model)]
        assert [str(cell.printed) for cell in cells] == [printed for printed, _ in expected]
        assert [cell.rounds_to_printed for cell in cells] == [band is ROUNDED for _, band in expected]


# ---- rov-fmu tables -------------------------------------------------------------------------------------


def test_command_prints_the_tables_side_by_side(
    tables: Mapping[str, ResponseTable], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["tables"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert max(map(len, out.splitlines()[4:-4])) <= 80, "the tables; paragraphs are not wrapped in a pipe"
    for table in tables.values():
        block = re.search(
            rf"^Table {table.number}\. {table.axis.name.capitalize()}.*?(?=^Table |^non-linear:)", out, re.M | re.S
        )
        assert block
        lines = iter(line.split() for line in block[0].splitlines() if re.match(r"\d+ %", line))
        for quantity, row in product(("V_ss", "Tau"), table.rows):
            words = next(lines)
            assert words[0] == str(row.command)
            cells = [getattr(getattr(row, model), quantity) for model in MODELS]
            assert [words[3], words[6]] == [f"{cell.computed:.4f}" for cell in cells]
            assert [words[2], words[5]] == [str(cell.printed or "-") for cell in cells]
            assert words[8] == str(cells[0].measured or "-")
            for word, deviation in ((words[4], cells[0].from_printed), (words[9], cells[1].from_measured)):
                assert word.rstrip("*") == ("-" if deviation is None else f"{deviation:+.1%}")
        assert next(lines, None) is None


def test_tables_are_of_the_axes_of_the_paper(vehicle: Vehicle) -> None:
    axes = tuple(one for one in vehicle.layout.axes if one.axis.name != "heave")
    without_heave = replace(vehicle, layout=replace(vehicle.layout, axes=axes))
    with pytest.raises(DataFileError, match="VideoRay Pro 4: Tables 6-8 are of surge, heave and yaw, it has no heave"):
        load_tables(without_heave)


def test_vehicle_without_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(ALONE, encoding="utf-8")
    assert main(["tables", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "vehicle.data" in err


HEAVE, YAW, SURGE_STEADY = "table6_heave_response.csv", "table7_yaw_response.csv", "table4_surge_steady.csv"
# The file, the text to replace, its replacement, and what the one line must contain.
BAD_TABLES: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "text for a number": (HEAVE, "1.76", "slow", ("line 2", "'non-linear Tau [s]'", "'slow'", "number")),
    "negative velocity": (SURGE_STEADY, "0.31", "-0.31", ("line 2", "'forward [m/s]'", "= -0.31", "negative")),
    "negative command": (HEAVE, "\n20,", "\n-20,", ("line 2", "'command [%]'", "= -20", "above 0")),
    "command twice": (HEAVE, "\n30,", "\n20.0,", ("line 3", "'command [%]'", "= 20.0", "above")),
    "other unit": (SURGE_STEADY, "m/s", "knot", ("line 1", "column 2", "'forward [knot]'", "'forward [m/s]'")),
    "column too many": (SURGE_STEADY, "[m/s]", "[m/s],backward [m/s]", ("line 1", "column 3", "'backward [m/s]'")),
}


def tables_with(tmp_path: Path, name: str, change: Callable[[str], bytes]) -> tuple[Path, Path]:
    """Copy the VideoRay's vehicle file, change one of its tables, and return the paths of both."""
    shutil.copytree(VIDEORAY.parent, tmp_path, dirs_exist_ok=True)
    vehicle_file, folder = tmp_path / VIDEORAY.name, tmp_path / DATA.name
    (folder / name).write_bytes(change((DATA / name).read_text(encoding="utf-8")))
    return vehicle_file, folder / name


def check_refused(vehicle_file: Path, named: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DataFileError) as caught:
        load_tables(load_vehicle(vehicle_file))
    assert main(["tables", str(vehicle_file)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"rov-fmu: {caught.value}\n"
    assert len(err.splitlines()) == 1
    for word in named:
        assert word in err


@pytest.mark.parametrize("case", BAD_TABLES)
def test_bad_table_is_one_clear_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, old, new, named = BAD_TABLES[case]

    def change(text: str) -> bytes:
        assert old in text
        return text.replace(old, new, 1).encode()

    vehicle_file, table = tables_with(tmp_path, name, change)
    check_refused(vehicle_file, (str(table), *named), capsys)
