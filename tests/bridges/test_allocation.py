"""The allocation of thrust: what is asked of the files, the C code of the FMU does.

A wrench is asked, the commands are computed from the files alone, as a thruster manager does, and the engine moves the
vehicle with these commands and the opposite loads from outside: it must not accelerate.
"""

import csv
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rov_fmu
from rov_fmu.bridges.allocation import allocation_files
from rov_fmu.c.simulation import Array, simulate
from rov_fmu.cli import main
from rov_fmu.interface.model import VehicleModel
from rov_fmu.vehicle.shipped import SHIPPED
from tests.commands import BARE, ROOT, Capsys
from tests.vehicles import FINNED, a_vehicle

VEHICLES = {
    **SHIPPED,
    "six_axes": ROOT / "tests" / "vehicle" / "six_axes.toml",
    "thrust_effects": ROOT / "tests" / "vehicle" / "thrust_effects.toml",
    "every_option": ROOT / "verification" / "references" / "vehicles" / "every_option.toml",
}
OPTIONS = VEHICLES["every_option"]
USUAL = ("videoray", "bluerov2", "every_option")
"""The vehicles of the default tests. The last one has tables, a dead band, voltage, pulse widths and a dead time."""


def exported(path: Path, folder: Path) -> tuple[VehicleModel, Any, dict[str, Array]]:
    """Return a vehicle, and what its files say: the YAML, and the rows of the CSV (voltage, force, command) by curve.

    The inputs of `every_option` drive several thrusters. Without them, each thruster has its own.
    """
    vehicle = rov_fmu.load(path)
    if path == OPTIONS:
        text = path.read_text(encoding="utf-8")
        begin = text.index("[inputs]")
        end = text.find("\n[", begin + 1)
        path = folder / "own_inputs.toml"
        path.write_text(text[:begin] + (text[end + 1 :] if end > 0 else ""), encoding="utf-8")
        for table in OPTIONS.parent.glob("*.csv"):
            (folder / table.name).write_bytes(table.read_bytes())
        vehicle = rov_fmu.load(path)
    assert main(["export", str(path), "--to", "allocation", "-o", str(folder / "allocation")]) == 0
    rows: dict[str, list[list[float]]] = {}
    with (folder / "allocation" / "force_to_command.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            values = [float(row[name] or "nan") for name in ("voltage_V", "force_N", "command")]
            rows.setdefault(row["curve"], []).append(values)
    text = (folder / "allocation" / "allocation.yaml").read_text(encoding="utf-8")
    content = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # in C where it is there: ten times faster
    return vehicle, content, {name: np.array(values) for name, values in rows.items()}


def command(content: Any, curve: str, voltage: float | None, force: float) -> float:
    """Return the command for a force, interpolated in the tables of a curve."""
    tables = content["curves"][curve]
    commands = [np.interp(force, table["force"], table["command"]) for table in tables]
    if voltage is None or len(tables) == 1:
        return float(commands[0])
    return float(np.interp(voltage, [table["voltage"] for table in tables], commands))


def accelerations(vehicle: VehicleModel, inputs: dict[str, float]) -> Array:
    """Return the accelerations at rest by the engine of the FMU, with all thrust arrived."""
    layout = vehicle.layout
    values = {**layout.usual_inputs, **inputs, **layout.at_rest}

    def engine(seconds: float, record: Sequence[str]) -> Array:
        at = {name: np.array([[value]]) for name, value in values.items()}
        return simulate(vehicle, [0.0, seconds], at, record).values[:, 0]

    values |= dict(zip(layout.lagging, engine(6.0, [*layout.lagging])[:, -1].tolist(), strict=True))
    return engine(1e-3, [f"der({v})" for v in layout.velocities])[:, 0]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in USUAL else pytest.mark.long) for name in VEHICLES]
)
def test_the_wrench_that_is_asked_is_the_wrench_that_acts(name: str, tmp_path: Path) -> None:
    """Commands accelerate the vehicle as the wrench does if it comes from outside."""
    vehicle, content, _ = exported(VEHICLES[name], tmp_path)
    vehicle = vehicle.with_(replace(vehicle.layout, has_dead_time=False))
    layout, random = vehicle.layout, np.random.default_rng(1)
    matrix, inverse = np.array(content["matrix"]), np.array(content["pseudo_inverse"])
    thrusters, axes = content["thrusters"], [part.axis for part in layout.axes]
    assert content["axes"] == [axis.name for axis in axes]
    neutral = {name: layout.command_of(0.0) for name in layout.commands}
    usual = layout.voltage
    worst = 0.0
    for voltage, share in product((None,) if usual is None else (usual, 0.91 * usual, 1.07 * usual), (0.02, 0.1, 0.6)):
        others = neutral if voltage is None else {**neutral, "voltage": voltage}
        rest = accelerations(vehicle, others)
        strongest = []
        for one in thrusters:
            full = command(content, one["curve"], voltage, 1e9)
            strongest.append(vehicle.curve_force(layout.curve_of[one["name"]], layout.fraction_of(full), voltage))
        wrench = matrix @ (share * np.array(strongest) * random.uniform(-1.0, 1.0, len(thrusters)))
        forces = (inverse @ wrench).tolist()
        commands = {
            one["command"]: command(content, one["curve"], voltage, force)
            for one, force in zip(thrusters, forces, strict=True)
        }
        loads = [
            dict(zip([axis.external for axis in axes], load.tolist(), strict=True))
            for load in (wrench, np.abs(matrix) @ np.abs(forces))
        ]
        by_wrench, scale = (accelerations(vehicle, {**others, **load}) - rest for load in loads)
        off = np.abs(accelerations(vehicle, {**others, **commands}) - rest - by_wrench)
        worst = max(worst, float((off / (np.abs(scale) + 1e-9)).max()))
    assert worst < 1e-3


def test_what_the_files_lack_is_told_from_what_they_have() -> None:
    text = allocation_files(a_vehicle(FINNED))["allocation.yaml"]
    assert "# Left out: the fins.\n" in text
    assert "drag" not in text, "the hull has its drag whatever the thrusters do"


@pytest.mark.long
def test_the_table_has_the_rows_of_the_yaml_and_both_rise(tmp_path: Path) -> None:
    vehicle, content, rows = exported(VEHICLES["thrust_effects"], tmp_path)
    assert content["vehicle"] == vehicle.identifier
    for name, tables in content["curves"].items():
        curve = vehicle.layout.curves_by_name[name]
        depends = "V_0" in curve.keys or len(curve.tables) > 1
        assert (len(tables) > 10) == depends
        for table in tables:
            own = rows[name][np.isclose(rows[name][:, 0], table["voltage"])] if depends else rows[name]
            assert own[:, 1] == pytest.approx(table["force"], rel=1e-8)
            assert own[:, 2] == pytest.approx(table["command"], rel=1e-8)
            assert (np.diff(table["force"]) > 0.0).all()
            assert (np.diff(table["command"]) > 0.0).all()


def test_a_vehicle_whose_thrusters_cannot_be_commanded_is_one_line(tmp_path: Path, capsys: Capsys) -> None:
    text, without = BARE.read_text(encoding="utf-8"), tmp_path / "without.toml"
    without.write_text(text[: text.index("[curves")] + text[text.index("[axes") :], encoding="utf-8")
    for path, reason in (
        (OPTIONS, "every_option: [inputs] drives several thrusters with one command"),
        (without, "bare: has no thrusters, so there is nothing to allocate"),
    ):
        assert main(["export", str(path), "--to", "allocation", "-o", str(tmp_path / "a")]) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"rov-fmu: {reason}")
        assert error.count("\n") == 1
        assert not (tmp_path / "a").exists()
