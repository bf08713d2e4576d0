"""Which tests can be used: just below and just above the limits."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify import usable
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.usable import UnusableError, check_push, check_recording, check_slips, is_pushed
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.model.layout import HEAVE, SURGE, YAW
from rov_fmu.tank.findings import Finding
from tests.folders import FORCE, HEAD, MASS, SPEED, read
from tests.vehicles import VIDEORAY

FOLDER = Path("tests of mine")
WEAK = VIDEORAY.replaced({"a_t_top": 0.0, "b_t_top": 1e-6})
"""A vehicle with the least push that counts at full command in heave."""


@pytest.mark.parametrize(
    ("command", "is_enough"), [(1.0, True), (-1.0, True), (0.99, False), (-0.99, False), (0.0, False)]
)
def test_a_push_of_a_micronewton_in_the_direction_of_the_command_counts(command: float, is_enough: bool) -> None:
    assert is_pushed(HEAVE, WEAK, command) == is_enough
    assert not is_pushed(HEAVE, WEAK.replaced({"b_t_top": -1.0}), command)


def test_one_command_with_a_push_is_enough() -> None:
    check_push(FOLDER, HEAVE, WEAK, [0.5, 1.0])
    check_push(FOLDER, HEAVE, WEAK, [])
    with pytest.raises(UnusableError, match="gives 5e-07 N at a command of 50%, where heave needs a push") as error:
        check_push(FOLDER, HEAVE, WEAK, [0.5, 0.9])
    assert error.value.finding.numbers == {"force": pytest.approx(5e-7), "command": 0.5}
    assert error.value.finding.names == {"curves": "top", "unit": "N"}


def sinking(speed: float, command: float = 0.3) -> Recording:
    time = np.arange(200.0)
    return Recording("log.csv", HEAVE, "depth", time, np.full(200, command), speed * time)


@pytest.mark.parametrize("speed", [1.01e-5, 0.99e3])
def test_a_constant_command_and_any_possible_speed_can_be_used(speed: float) -> None:
    check_recording(FOLDER, sinking(speed), VIDEORAY)


@pytest.mark.parametrize(
    ("recording", "kind", "line"),
    [
        (
            sinking(0.99e-5),
            "impossible velocity",
            "depth gives a velocity of 9.9e-06 m/s: must be 1e-05 at least and",
        ),
        (sinking(1.01e3), "impossible velocity", "1.01e+03 m/s: must be 1e-05 at least and 1000 at most"),
        (sinking(0.0), "constant motion", "log.csv: depth never changes: nothing is identifiable"),
        (sinking(0.1, 0.0), "constant push", "log.csv: the command is always 0, so nothing can be identified"),
    ],
)
def test_a_recording_without_content_is_refused(recording: Recording, kind: str, line: str) -> None:
    with pytest.raises(UnusableError, match=re.escape(line)) as error:
        check_recording(FOLDER, recording, VIDEORAY)
    assert error.value.finding.kind == kind
    assert error.value.recordings == [recording]


STEADY = ("steady_heave_1.csv", "steady_heave_2.csv")
TABLES = {
    "thrust_top.csv": f"{FORCE}\n0.3,0.6\n0.5,1.65\n",
    **{name: f"{SPEED}\n0.3,{V}\n0.5,0.28\n" for name, V in zip(STEADY, (0.163, 0.164), strict=True)},
}


@pytest.mark.parametrize(
    ("wrong", "others"), [(STEADY, "thrust_top.csv"), (STEADY[:1], ""), ((*STEADY, "log.csv"), "")]
)
def test_forces_are_doubtful_where_all_files_of_an_axis_seem_wrong(
    wrong: tuple[str, ...], others: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = tuple(Finding("wrong scale", "heave", file=file, names={"others": ""}) for file in wrong)
    other = Finding("wrong scale", "surge", names={"others": ""})
    monkeypatch.setattr(usable, "slips", lambda *_: (*found, other))
    tests = read(tmp_path, f"{HEAD}[known]\n{MASS}", TABLES)
    doubts = check_slips(tests, [HEAVE], VIDEORAY)
    assert [doubt.names["others"] for doubt in doubts] == [*[others] * len(wrong), ""]
    assert [*doubts] == [*(replace(f, names={"others": others}) for f in found), other]


def test_what_is_certainly_wrong_is_refused_with_a_line_for_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = {"percent": 0.9}
    found = [
        Finding("fractions as percent", "heave", file=f, numbers=numbers, certain=f != "c.csv")
        for f in ("a.csv", "b.csv", "c.csv")
    ]
    monkeypatch.setattr(usable, "slips", lambda *_: tuple(found))
    tests = read(tmp_path, f"{HEAD}[known]\n{MASS}", TABLES)
    with pytest.raises(DataFileError) as error:
        check_slips(tests, [HEAVE], VIDEORAY)
    assert [line.split(":")[0] for line in str(error.value).splitlines()] == [
        str(tmp_path / f) for f in ("a.csv", "b.csv")
    ]


def test_units_of_axes_that_nothing_pushes_are_not_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def asking(recordings: dict[str, object], *_: object) -> tuple[Finding, ...]:
        asked.append([*recordings])
        return ()

    monkeypatch.setattr(usable, "slips", asking)
    tests = read(tmp_path, f"{HEAD}[known]\n{MASS}", TABLES)
    still = VIDEORAY.replaced({"a_t_top": 0.0, "b_t_top": 0.99e-6})
    for rov, axes in ((WEAK, ["surge", "heave", "yaw"]), (still, ["surge", "yaw"])):
        check_slips(tests, [SURGE, HEAVE, YAW], rov)
        assert asked.pop() == axes
