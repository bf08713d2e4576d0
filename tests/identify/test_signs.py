"""What contradicts rov.toml is named before the fit: thrusters, commands and sensors of simulated dives."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.search import comparison, rough
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.vehicle.vehicle import Vehicle
from tests.folders import HEAD, folder_of
from tests.identify.likelihood.test_hypotheses import TURNS, Fault, dive

UPWARDS = ["5 [1]", "6 [1]"]
VEHICLES = {name: dive(name, Fault(""), np.random.default_rng(3)) for name in ("bluerov2", "videoray")}
ROV = 'base = "{}"\n' + HEAD


def changed(text: str, signs: Sequence[str] = (), names: dict[str, str] | None = None) -> str:
    """Return a log in which some columns have the other sign, and some have the names of others."""
    header, *rows = (line.split(",") for line in text.splitlines())
    factors = [-1.0 if title in signs else 1.0 for title in header]
    titles = [(names or {}).get(title, title) for title in header]
    values = [",".join(f"{k * float(cell):g}" for k, cell in zip(factors, row, strict=True)) for row in rows]
    return "\n".join([",".join(titles), *values]) + "\n"


def told(folder: Path) -> list[Finding]:
    return [one for one in load_tests(folder).folder.findings if one.kind in ("signs", "doubtful signs")]


FAULTS = {
    "one thruster": ("bluerov2", {"signs": ["3 [1]"]}, 'reversed = ["3"]'),
    "two thrusters": ("bluerov2", {"signs": ["1 [1]", "5 [1]"]}, 'mounted = ["1", "5"]'),
    "all thrusters": (
        "bluerov2",
        {"signs": [f"{n} [1]" for n in range(1, 7)]},
        'reversed = ["1", "2", "3", "4", "5", "6"]',
    ),
    "commands along different axes": (
        "bluerov2",
        {"names": {"2 [1]": "5 [1]", "5 [1]": "2 [1]"}},
        "the commands of 2 and 5 are exchanged",
    ),
    "a thruster with an arm": ("videoray", {"signs": ["r [1]"]}, 'reversed = ["r"]'),
    "a sensor": ("videoray", {"signs": ["surge velocity [m/s]"]}, "surge (forward is positive): the sensor has the"),
    "a frame": (
        "bluerov2",
        {"signs": ["sway velocity [m/s]", "depth [m]", "heading [deg]"]},
        "north-east-down is not east-north-up",
    ),
}


@pytest.mark.parametrize(("vehicle", "fault", "words"), FAULTS.values(), ids=FAULTS)
def test_what_contradicts_rov_toml_is_named(vehicle: str, fault: dict[str, Any], words: str, tmp_path: Path) -> None:
    log = changed(VEHICLES[vehicle], **fault)
    (found,) = told(folder_of(tmp_path, ROV.format(vehicle), {"right.csv": VEHICLES[vehicle], "dive.csv": log}))
    assert found.kind == "signs"
    assert found.file == "dive.csv"
    assert words in sentences([found])[0]


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_nothing_is_said_about_a_right_log(vehicle: str, tmp_path: Path) -> None:
    assert not told(folder_of(tmp_path, ROV.format(vehicle), {"dive.csv": VEHICLES[vehicle]}))


def test_a_sensor_that_tells_no_motion_says_nothing(tmp_path: Path) -> None:
    """A DVL of a vehicle that keeps its depth tells a speed of exactly 0, and no error is left of any signs."""
    header, *rows = VEHICLES["bluerov2"].splitlines()
    log = "\n".join(
        [header.replace("depth [m]", "heave velocity [m/s]"), *(row.rpartition(",")[0] + ",0" for row in rows)]
    )
    assert not told(folder_of(tmp_path, ROV.format("bluerov2"), {"dive.csv": log}))


@pytest.mark.parametrize("turned", TURNS)
def test_a_turned_velocity_sensor_is_left_to_the_fit(turned: float, tmp_path: Path) -> None:
    """It finds the angle, and turns the values back."""
    log = dive("bluerov2", Fault("", turned=np.radians(turned)), np.random.default_rng(4))
    assert not told(folder_of(tmp_path, ROV.format("bluerov2"), {"dive.csv": log}))


def test_a_positive_depth_has_the_right_sign(tmp_path: Path) -> None:
    """Vertical thrusters that push the other way, or a depth that is positive upwards: a depth of 20 m tells which."""
    header, *rows = (line.split(",") for line in changed(VEHICLES["bluerov2"], UPWARDS).splitlines())
    for offset, has_two in ((-20.0, True), (20.0, False)):
        shifted = [[*row[:-1], f"{float(row[-1]) + offset:g}"] for row in rows]
        log = "\n".join(",".join(row) for row in [header, *shifted]) + "\n"
        assert header[-1] == "depth [m]"
        (found,) = told(folder_of(tmp_path, ROV.format("bluerov2"), {"dive.csv": log}))
        assert ("heave (down is positive): the sensor" in sentences([found])[0]) == has_two


def test_neither_inspect_nor_identify_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`identify` ends before any fit, and `inspect` says why."""
    folder = folder_of(tmp_path, ROV.format("bluerov2"), {"dive.csv": changed(VEHICLES["bluerov2"], UPWARDS)})
    assert main(["inspect", str(folder)]) == 0
    printed = capsys.readouterr()
    assert 'mounted = ["5", "6"]' in printed.err
    assert "Next: correct this" in printed.out
    assert main(["identify", str(folder)]) == 2
    error = capsys.readouterr().err
    assert f"{folder}: dive.csv: the log contradicts rov.toml by " in error
    assert 'reversed = ["5", "6"]' in error


def test_a_short_log_without_pushes_both_ways_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also by `inspect`, in the same words; with a push both ways it is tried."""
    rows = VEHICLES["videoray"].splitlines()
    short = folder_of(tmp_path, ROV.format("videoray"), {"dive.csv": "\n".join(rows[:40])})
    words = "nothing is pushed both ways for a second"
    assert main(["inspect", str(short)]) == 0
    assert words in capsys.readouterr().err
    assert main(["identify", str(short)]) == 2
    assert words in capsys.readouterr().err
    (tmp_path / "dive.csv").write_text("\n".join(rows[:290]), encoding="utf-8")
    assert all(finding.kind != "too short" for finding in load_tests(short).folder.findings)


def test_a_thruster_that_is_mounted_the_other_way_pushes_to_the_other_side(tmp_path: Path) -> None:
    """The commands stay as they are; those of reversed thrusters change their sign."""
    log = changed(VEHICLES["bluerov2"], UPWARDS)
    given = {}
    for key in ("mounted", "reversed"):
        rov = f'{ROV.format("bluerov2")}[logs]\n{key} = ["5", "6"]\n'
        tests = load_tests(folder_of(tmp_path / key, rov, {"dive.csv": log}))
        assert all(one.kind != "signs" for one in tests.folder.findings)
        given[key] = tests
    base = {t.name: t for t in rov_fmu.load("bluerov2").layout.thrusters}
    for thruster in given["mounted"].layout.thrusters:
        sign = -1.0 if thruster.name in ("5", "6") else 1.0
        x, y, z = base[thruster.name].direction.value
        assert thruster.direction.value == (sign * x, sign * y, sign * z)
    assert {t.name: t.direction for t in given["reversed"].layout.thrusters} == {
        n: t.direction for n, t in base.items()
    }


@pytest.mark.parametrize("right", ["mounted", "reversed"])
def test_j_tells_swapped_wires_from_thrusters_mounted_the_other_way(right: str, tmp_path: Path) -> None:
    """Both push to the other side. Only one works astern, where the thrusters of the BlueROV2 push less."""
    log = changed(VEHICLES["bluerov2"], UPWARDS)
    if right == "mounted":
        whole = rov_fmu.load("bluerov2")
        turned = tuple(t.opposite if t.name in ("5", "6") else t for t in whole.layout.thrusters)
        own = replace(Vehicle(whole.layout, whole.coefficients), layout=replace(whole.layout, thrusters=turned))
        log = dive(own, Fault(""), np.random.default_rng(3))
    for key in ("mounted", "reversed"):
        rov = f'{ROV.format("bluerov2")}[logs]\n{key} = ["5", "6"]\n'
        objective = Objective.of_known(*begin(load_tests(folder_of(tmp_path, rov, {"dive.csv": log}))))
        J = comparison(objective, {}, rough(objective.table))
        other = J({("turned round", ("5", "6")): None}) - J({})
        assert (other > 10.0) if key == right else (other < -10.0)
