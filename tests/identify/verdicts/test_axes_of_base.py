"""Axes that no test shows: they do not decide about the others, and every surface says so."""

from collections.abc import Iterable, Iterator, Mapping
from io import StringIO
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from rov_fmu import load
from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.fmu.card import card_text
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.given import thrusters_along_no_other
from rov_fmu.identify.identify import identify
from rov_fmu.identify.inspection.undetermined import undetermined
from rov_fmu.identify.result import AxisOfBase, Identification
from rov_fmu.report.console import _Console
from rov_fmu.report.console_results import print_identification
from rov_fmu.report.page.fmu_page import documentation_page
from rov_fmu.report.report import report_page
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.description import VERDICT
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from rov_fmu.vehicle.writer import vehicle_text
from tests.folders import HEAD, MASS, PLACE, THRUSTER, TURNS, folder_of, pulled, read, responses
from tests.often import spread
from tests.report.pages import text_of
from tests.report.test_report import leave_plots_out
from tests.vehicles import VIDEORAY

# ---- What a dive concerns --------------------------------------------------------------------------------------------

SENSORS: dict[Axis, str] = {
    SURGE: "surge velocity [m/s]",
    SWAY: "sway velocity [m/s]",
    HEAVE: "depth [m]",
    ROLL: "roll angle [rad]",
    PITCH: "pitch angle [rad]",
    YAW: "heading [rad]",
}
"""A column for each axis that a dive may show."""
NORTH = "surge distance [m]"
DRAG = {"a_d": "N.s2/m2", "b_d": "N.s/m"}
VERTICAL = ("u_5 [1]", "u_6 [1]")
BASES = {"bluerov2": (SURGE, SWAY, HEAVE, YAW), "bluerov2_heavy": tuple(AXES.values())}


def write_dive(path: Path, time: Array, columns: Mapping[str, Array]) -> None:
    rows = np.column_stack([time, *columns.values()]).tolist()
    lines = [",".join(["time [s]", *columns]), *(",".join(f"{x:.6f}" for x in row) for row in rows), ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def drawn(base: str, *columns: str) -> tuple[Array, dict[str, Array]]:
    """Return 10 s in which all commands of a vehicle and some measurements change."""
    time, random = np.arange(0.0, 10.0, 0.1), np.random.default_rng(0)
    thrusters = load_vehicle(SHIPPED[base]).layout.thrusters
    commands = {f"u_{one.name} [1]": np.repeat(random.uniform(-0.5, 0.5, 10), 10) for one in thrusters}
    return time, commands | {name: np.sin((1.0 + 0.1 * n) * time) for n, name in enumerate(columns)}


def without_base(folder: Path, axes: str, sensors: Iterable[Axis], coupling: str = "") -> Path:
    """Write a dive of a vehicle without a base, whose pair of thrusters drives surge and yaw, and the third heave."""
    rov = f"{HEAD}[body]\n{coupling}{MASS}{TURNS}[curves.t200]\n" + THRUSTER.format(name="t", x=0, y=0, z=1)
    for name, y in (("l", -0.15), ("r", 0.15)):
        rov += THRUSTER.format(name=name, x=1, y=0, z=0) + PLACE.format(0, y)
    folder_of(folder, rov + axes, {"thrust_t200.csv": pulled(40.0, 2.0)})
    write_dive(folder / "dive.csv", *drawn("videoray", *(SENSORS[axis] for axis in sensors)))
    return folder


@pytest.mark.parametrize("base", spread(BASES, ["bluerov2"]))
def test_a_dive_that_shows_no_turn_concerns_only_the_axes_that_it_shows(base: str, tmp_path: Path) -> None:
    """With a heading, roll or pitch, the others stay: only their drag and inertia are uncertain beside the tests'."""
    folder = folder_of(tmp_path, f'base = "{base}"\n{HEAD}', {})
    axes = BASES[base]
    shown = [some for count in (1, 2, len(axes) - 1, len(axes)) for some in combinations(axes, count)]
    for some in shown:
        write_dive(folder / f"dive_{''.join(a.velocity for a in some)}.csv", *drawn(base, *(SENSORS[a] for a in some)))
    write_dive(folder / "dive_track.csv", *drawn(base, NORTH, SENSORS[HEAVE]))
    known, logs, _ = begin(load_tests(folder))
    concerned = {one.log.file: {form.axis for form in one.layout.axes} for one in logs}
    assert concerned.pop("dive_track.csv") == {*axes}
    expected = {
        f"dive_{''.join(a.velocity for a in some)}.csv": {*(axes if {ROLL, PITCH, YAW} & {*some} else some)}
        for some in shown
    }
    assert concerned == expected
    assert {*known.fitted} == {*axes}
    assert not known.unseen


@pytest.mark.parametrize("base", BASES)
def test_the_drag_and_the_inertia_of_what_a_dive_with_a_heading_does_not_show_are_uncertain(
    base: str, tmp_path: Path
) -> None:
    folder = folder_of(tmp_path, f'base = "{base}"\n{HEAD}', {})
    write_dive(folder / "dive.csv", *drawn(base, SENSORS[HEAVE], SENSORS[YAW]))
    known, _, _ = begin(load_tests(folder))
    assert {*known.unseen} == {*BASES[base]} - {HEAVE, YAW}
    assert not {a.coefficient(key) for a in known.unseen for key in ("a_d", "b_d", "beta")} & known.exact
    own = "".join(f'{n}_u = {{ value = 9.0, unit = "{u}", source = "s" }}\n' for n, u in DRAG.items())
    exact, _, _ = begin(load_tests(folder_of(tmp_path, f'base = "{base}"\n{HEAD}[known]\n{own}', {})))
    assert {"a_d_u", "b_d_u"} <= exact.exact


def test_what_a_vehicle_without_a_base_lacks_is_told(tmp_path: Path) -> None:
    """Also axes that rov.toml does not declare, and the thrusters that drive nothing else."""
    whole = load_vehicle(SHIPPED["bluerov2"]).layout
    assert thrusters_along_no_other(whole, [HEAVE], [SURGE, SWAY, YAW]) == ["5", "6"]
    assert thrusters_along_no_other(whole, [SURGE], [HEAVE, YAW]) == []
    lacking = AxisOfBase(HEAVE, "", "nothing in the logs shows it", ("5", "6"))
    told = "heave: not identified: nothing in the logs shows it, so the vehicle has no heave and no thrusters 5 and 6."
    assert lacking.verdict.of(HEAVE) == told
    tests = load_tests(without_base(tmp_path, "", [HEAVE, YAW]))
    assert ("axis left out", "surge") in {(one.kind, one.axis) for one in tests.folder.findings}
    sentences = [*undetermined(tests.folder.logs, tests.description, ())]
    assert any("surge cannot be identified, so the vehicle has no surge: " in one for one in sentences)


@pytest.mark.parametrize(
    ("sensors", "coupling", "unseen"),
    [
        ([HEAVE, YAW], "", [SURGE]),
        ([YAW], "", [SURGE]),
        ([HEAVE], "", []),
        ([HEAVE, YAW], "coupling = true\n", []),
    ],
)
def test_an_axis_of_which_nothing_is_known_moves_in_a_dive_that_turns(
    sensors: list[Axis], coupling: str, unseen: list[Axis], tmp_path: Path
) -> None:
    """Its speed takes thrust from the thrusters that turn the vehicle. The file does not have it."""
    tests = load_tests(without_base(tmp_path, "[axes.surge]\n[axes.heave]\n[axes.yaw]\n", sensors, coupling))
    known, logs, _ = begin(tests)
    assert [form.axis for form in tests.layout.axes] == sensors
    assert known.unseen == unseen
    assert all({form.axis for form in one.layout.axes} == {*sensors, *unseen} for one in logs)


@pytest.mark.weekly
def test_it_is_told_why_a_log_identifies_no_axis(tmp_path: Path) -> None:
    """Nobody steers, and the heading is logged; nothing shows surge and sway."""
    rov, time = load("bluerov2"), np.arange(0.0, 20.0, 0.2)
    motion = rov.simulate(time, {"heave": np.repeat([0.3, -0.2, 0.4, -0.4, 0.0], 20)}, start={"z": 5.0})
    noise = 0.003 * np.random.default_rng(0).standard_normal((2, len(time)))
    columns = {f"{name} [1]": values for name, values in motion.commands.items()}
    columns |= {SENSORS[HEAVE]: motion["z"] + noise[0], SENSORS[YAW]: noise[1]}
    folder = folder_of(tmp_path, f'base = "bluerov2"\n{HEAD}', {})
    write_dive(folder / "dive.csv", time, columns)
    assert {one.axis: one.reason for one in identify(load_tests(folder)).axes_of_base} == {
        SURGE: "nothing in the logs shows it",
        SWAY: "nothing in the logs shows it",
        YAW: "nothing in the logs drives it",
    }


# ---- What every surface says -----------------------------------------------------------------------------------------


def surfaces(result: Identification, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, str]]:
    """Yield all texts that an owner reads, by their names."""
    leave_plots_out(monkeypatch)
    file = StringIO()
    monkeypatch.setattr("rov_fmu.report.console_results.console", lambda: _Console(file=file, width=10_000))
    print_identification(result)
    yield "terminal", file.getvalue()
    yield "report", text_of(report_page(result))
    yield "file", vehicle_text(result.vehicle)
    yield "card", card_text(result.vehicle)
    yield "page of the FMU", text_of(documentation_page(result.vehicle))


@pytest.mark.parametrize("tested", spread([(HEAVE, YAW), (YAW,)], [(YAW,)]))
def test_every_surface_has_the_same_word_for_every_axis(
    tested: tuple[Axis, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = {name: text for axis in tested for name, text in responses(VIDEORAY, axis).items()}
    result = identify(read(tmp_path, f'base = "videoray_refit"\n{HEAD}', tables))
    assert {axis for axis, one in result.verdicts.items() if one.word != "not identified"} == {*tested}
    assert result.verdicts.keys() == {form.axis for form in result.vehicle.layout.axes}
    for name, text in surfaces(result, monkeypatch):
        said = " ".join(text.split()).casefold()
        for axis, verdict in result.verdicts.items():
            assert f"{axis.name}: {verdict.word}" in said, (name, axis.name)
            others = {word for word in ("good", "usable", "do not use", "not identified") if word != verdict.word}
            assert not any(f"{axis.name}: {word}" in said for word in others), (name, axis.name)
            if verdict.word == "not identified":
                assert "from videoray_refit (no test shows it)" in said
    made = result.vehicle.provenance
    assert made
    assert made.words == {axis.name: verdict.word for axis, verdict in result.verdicts.items()}
    assert all(map(VERDICT.fullmatch, made.verdicts))


@pytest.mark.parametrize("is_there", [True, False])
def test_an_axis_whose_thrusters_the_log_lacks_asks_for_their_outputs(is_there: bool, tmp_path: Path) -> None:
    """Commands of others do not help where a message has too few outputs."""
    time, columns = drawn("bluerov2", SENSORS[HEAVE], SENSORS[YAW])
    kept = {name: 0.0 * own if name in VERTICAL else own for name, own in columns.items()}
    folder = folder_of(tmp_path, f'base = "bluerov2"\n{HEAD}', {})
    write_dive(folder / "dive.csv", time, {n: v for n, v in kept.items() if is_there or n not in VERTICAL})
    tests = load_tests(folder)
    (heave,) = (one for one in undetermined(tests.folder.logs, tests.description, ()) if one.startswith("heave"))
    assert heave.endswith("Command it both ways") == is_there
    assert ("Log the outputs to all thrusters" in heave) != is_there


@pytest.mark.parametrize("is_same", [True, False])
def test_thrusters_that_always_get_the_same_command_are_told_before_any_fit(is_same: bool, tmp_path: Path) -> None:
    """No log tells which of both has lost force. The thrusters of surge, which turn the vehicle, are told apart."""
    time, columns = drawn("bluerov2", SENSORS[HEAVE], SENSORS[YAW])
    sixth = columns[VERTICAL[0]] if is_same else columns[VERTICAL[1]]
    folder = folder_of(tmp_path, f'base = "bluerov2"\n{HEAD}', {})
    write_dive(folder / "dive.csv", time, {**columns, "u_2 [1]": columns["u_1 [1]"], VERTICAL[1]: sixth})
    tests = load_tests(folder)
    told = [one for one in undetermined(tests.folder.logs, tests.description, ()) if one.startswith("thrusters")]
    assert [one.partition(":")[0] for one in told] == ["thrusters 5 and 6"] * is_same
