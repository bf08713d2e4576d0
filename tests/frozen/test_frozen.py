"""Files of the earlier state 8d6b1e9 load unchanged. README.md has the rule."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.messages import FileError
from tests.commands import ROOT

HERE = Path(__file__).parent
_EXPECTED = HERE / "expected.json"
CHANGED: dict[str, tuple[str, str, str, str]] = {
    "plans/kinds.toml": ("keep.at", "every = 1.0", "at = [1.0, 4.0]", "every = 1.0"),
    "plans/tutorial_wall.toml": ("samples", 'samples = "design.csv"', 'sampler = "saltelli"', 'sampler = "sobol"'),
}
"""The files that no longer load, with the key that the changelog names, the new line that the message shows, and a text
of the file with the one in its place with which the file loads."""


def _vehicle(path: Path) -> Any:
    vehicle = rov_fmu.load(path)
    layout, uncertainty = vehicle.layout, vehicle.uncertainty
    return {
        "coefficients": dict(vehicle.coefficients),
        "inputs": [*layout.inputs],
        "states": [*layout.state],
        "errors": dict(zip(uncertainty.names, map(float, uncertainty.errors), strict=True)) if uncertainty else {},
    }


def _tank_tests(path: Path) -> Any:
    """Return the rows of tables, and of each channel: the number of samples, their duration, the sum of the values,
    and the sums of the commands of the thrusters and of the axis."""
    tests = load_tests(path.parent)
    recordings = {}
    for log in tests.folder.logs:
        assert log.commands is not None
        commands = float(np.abs(log.commands.at(log.commands.rows)).sum())
        for channel in log.channels:
            if (axis := channel.quantity.axis) and not channel.unused:
                kind = "velocity" if channel.quantity.is_velocity else axis.position
                recordings[f"{channel.file or log.file} {axis.name} {kind}"] = [
                    len(channel.time),
                    float(channel.time[-1] - log.commands.rows[0]),
                    float(np.sum(channel.unwrapped[1])),
                    0.0 if log.follows_axis else commands,
                    commands if log.follows_axis else None,
                ]
    tables = {"thrust": "thrust", "steady": "steady", "time constants": "time_constant"}
    return {
        **{
            name: {subject: [[row.command, row.value] for row in rows] for subject, rows in tests.rows(kind)}
            for name, kind in tables.items()
        },
        "recordings": recordings,
    }


def _plan(path: Path) -> Any:
    from rov_fmu.study.plan import load_plan

    return load_plan(path).model_dump(mode="json", exclude={"vehicle_file", "fmu_file"})


KINDS: dict[str, Callable[[Path], Any]] = {
    "vehicles/*/*.toml": _vehicle,
    "tank_tests/*/rov.toml": _tank_tests,
    "plans/*.toml": _plan,
}
"""How the files of each pattern are loaded."""
FILES = {path.relative_to(HERE).as_posix(): load for pattern, load in KINDS.items() for path in HERE.glob(pattern)}


@pytest.mark.parametrize("file", sorted(FILES))
def test_a_file_loads_unchanged(file: str, tmp_path: Path) -> None:
    if FILES[file] is _plan:
        pytest.importorskip("pyarrow")
    path = HERE / file
    if file in CHANGED:
        key, line, before, after = CHANGED[file]
        with pytest.raises(FileError) as error:
            FILES[file](path)
        assert line in str(error.value)
        assert f"`{key}`" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
        text = path.read_text(encoding="utf-8")
        assert before in text
        path = tmp_path / path.name
        path.write_text(text.replace(before, after), encoding="utf-8")
    _check(json.loads(_EXPECTED.read_text(encoding="utf-8"))[file], json.loads(json.dumps(FILES[file](path))))


def _check(expected: Any, loaded: Any, at: str = "") -> None:
    """Check that everything expected is there. Dictionaries may have new keys."""
    if isinstance(expected, dict):
        assert expected.keys() <= loaded.keys(), at
        for key, value in expected.items():
            _check(value, loaded[key], f"{at}.{key}")
    elif isinstance(expected, list):
        assert len(loaded) == len(expected), at
        for n, value in enumerate(expected):
            _check(value, loaded[n], f"{at}[{n}]")
    elif isinstance(expected, float):
        assert loaded == pytest.approx(expected, rel=1e-12, nan_ok=True), at
    else:
        assert loaded == expected, at


def test_every_file_is_loaded() -> None:
    expected = json.loads(_EXPECTED.read_text(encoding="utf-8"))
    assert {*expected} == {*FILES}
    folders = {path.relative_to(HERE).parts[0] for path in HERE.rglob("*.toml")}
    assert folders == {"vehicles", "tank_tests", "plans", "logs"}


@pytest.mark.parametrize("file", ["plans/commands.csv", "csv/manoeuvre.csv"])
def test_a_table_of_commands_is_simulated(file: str, tmp_path: Path) -> None:
    output = tmp_path / "motion.csv"
    assert main(["simulate", "videoray", "--input", str(HERE / file), "--stop", "1", "-o", str(output)]) == 0
    assert output.read_text(encoding="utf-8").count("\n") > 10


def test_a_table_of_points_is_fitted(tmp_path: Path) -> None:
    output = tmp_path / "tuned.toml"
    points = str(HERE / "csv" / "points.csv")
    vehicle = str(HERE / "vehicles" / "of_docs" / "vehicle.toml")
    assert main(["tune", vehicle, "--axis", "surge", "--points", points, "-o", str(output)]) == 0
    assert output.exists()
