"""The output `outside` of an identified vehicle, beside a formula that is written here by hand."""

import math
import random
from collections.abc import Mapping
from pathlib import Path

import fmpy
import numpy as np
import pytest

import rov_fmu
from rov_fmu.equation.dependencies import dependencies_of
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError, load_vehicle
from rov_fmu.vehicle.writer import vehicle_output
from tests.conftest import unzipped

_COMMAND = 0.7
_FLAT = {"u": (0.2, 0.5), "w": (-0.1, 0.3), "r": (-1.0, 2.0), "z": (0.0, 3.0)}
"""The ranges of a vehicle without roll and pitch; that of surge does not begin at 0, and there is one of the depth."""
_TILTED = {"u": (-0.4, 0.4), "v": (-0.2, 0.2), "p": (-0.3, 0.5), "phi": (-0.1, 0.2), "theta": (-0.3, 0.05)}
_UNITS = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "r": "rad/s", "z": "m", "phi": "rad", "theta": "rad"}


def _identified(name: str, ranges: Mapping[str, tuple[float, float]], folder: Path) -> Vehicle:
    """Return a vehicle that ships, with identified ranges, read from a file."""
    vehicle = load_vehicle(SHIPPED[name])
    lines = [f'{key} = {{ range = {[*ends]}, unit = "{_UNITS[key]}" }}' for key, ends in ranges.items()]
    text = SHIPPED[name].read_text(encoding="utf-8").replace("pictures = ", "# ").replace("data = ", "# ")
    table = "\n".join(["[validity.identified]", *lines, "", "[body]"])
    path = folder / f"{name}.toml"
    path.write_text(text.replace(f"command_max = {vehicle.command_range[1]}", f"command_max = {_COMMAND}"), "utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("[body]", table, 1), encoding="utf-8")
    return load_vehicle(path)


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    return _identified("videoray", _FLAT, tmp_path_factory.mktemp("flat"))


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    return _identified("bluerov2_heavy", _TILTED, tmp_path_factory.mktemp("tilted"))


def _expected(values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> float:
    """Return the largest excess over a range, relative to the range from 0 on. The depth does not count."""
    excess = [0.0]
    for name, value in values.items():
        if name.startswith("u_"):
            excess.append((min(abs(value), 1.0) - _COMMAND) / _COMMAND)
        elif name in ranges and name != "z":
            low, high = min(ranges[name][0], 0.0), max(ranges[name][1], 0.0)
            excess += [(value - high) / (high - low), (low - value) / (high - low)]
    return max(excess)


def test_it_is_the_largest_excess_relative_to_its_range(flat: Vehicle) -> None:
    drawn = random.Random(1)
    counted = 0
    for _ in range(300):
        size = drawn.choice((0.3, 1.0, 3.0))
        inputs = {name: drawn.uniform(-size, size) for name in flat.layout.commands}
        motion = {name: drawn.uniform(-size, size) for name in ("u", "w", "r", "z")}
        found = flat.calculated({**flat.layout.usual_inputs, **inputs}, {**flat.layout.at_rest, **motion})["outside"]
        assert found == pytest.approx(_expected({**inputs, **motion}, _FLAT), rel=1e-13, abs=0.0)
        counted += found == 0.0
    assert 10 < counted < 290, "some are inside"


@pytest.mark.parametrize("name", ["u_l", "u", "w", "r"])
def test_exactly_at_an_end_it_is_0_and_beyond_it_is_not(name: str, flat: Vehicle) -> None:
    ends = (-_COMMAND, _COMMAND) if name == "u_l" else (min(_FLAT[name][0], 0.0), _FLAT[name][1])

    def at(value: float) -> float:
        values = {**flat.layout.usual_inputs, **flat.layout.at_rest, name: value}
        return flat.calculated(values, values)["outside"]

    for end, away in zip(ends, (-math.inf, math.inf), strict=True):
        assert at(end) == 0.0
        assert 0.0 < at(math.nextafter(end, away)) < 1e-14 or end == 0.0
    assert at(0.0) == 0.0, "every motion begins at rest"
    assert math.isfinite(at(1e6))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_the_fmu_calculates_it(fmi: int, kind: str, flat: Vehicle, tilted: Vehicle, tmp_path: Path) -> None:
    """In both interfaces and versions of FMI, at the start and at every step, from the other outputs."""
    for vehicle, ranges, axis in ((flat, _FLAT, "surge"), (tilted, _TILTED, "roll")):
        own = vehicle.layout.kinds[axis].axis
        commands = vehicle.layout.driving(own, 0.9)
        names = [*vehicle.layout.velocities, *vehicle.layout.angles]
        result = fmpy.simulate_fmu(
            str(unzipped(vehicle, tmp_path / vehicle.identifier, fmi)),
            fmi_type=kind,
            stop_time=2.0,
            output_interval=0.1,
            start_values={**commands, "u": 0.45},
            output=[*names, "outside"],
        )
        expected = [_expected({**commands, **{n: row[n] for n in names}}, ranges) for row in result]
        np.testing.assert_allclose(result["outside"], expected, rtol=1e-12, atol=1e-15)
        assert result["outside"][0] == pytest.approx(max((0.9 - _COMMAND) / _COMMAND, expected[0]))
        assert len({*result["outside"]}) > 3, "it changes"


def test_python_simulates_it(tilted: Vehicle) -> None:
    assert tilted.path
    run = rov_fmu.load(tilted.path).simulate(0.3, tilted.layout.driving(tilted.layout.kinds["roll"].axis, 0.9))
    for n in range(len(run.time)):
        values = {name: float(run[name][n]) for name in (*tilted.layout.velocities, "phi", "theta")}
        commands = {"u_any": 0.9}
        assert float(run["outside"][n]) == pytest.approx(_expected({**commands, **values}, _TILTED), rel=1e-12)


def test_its_dependencies_are_what_it_is_calculated_from(flat: Vehicle) -> None:
    known = dependencies_of(flat.layout)["outside"]
    assert known == dict.fromkeys(("u_l", "u_r", "u_t", "u", "w", "r"), "dependent")


def test_the_ranges_are_written_and_read(flat: Vehicle, tmp_path: Path) -> None:
    output = vehicle_output(flat, tmp_path / "again.toml")
    output.path.write_bytes(output.content)
    assert load_vehicle(output.path).layout.identified == flat.layout.identified


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('u = { range = [0.0, 0.0], unit = "m/s" }', "must be [low, high], and one of them at least 1e-06 away from 0"),
        ('u = { range = [0.5, 0.2], unit = "m/s" }', "must be [low, high], and one of them at least 1e-06 away from 0"),
        ('u = { range = [nan, 0.2], unit = "m/s" }', "must be a finite number"),
        ('u = { range = [0.0, 0.2], unit = "rad/s" }', "must have the range of u in m/s, and not in rad/s"),
        ('x = { range = [0.0, 0.2], unit = "m" }', "must have ranges of u, v, w, p, q, r, phi, theta, z, and not of x"),
    ],
)
def test_a_range_that_makes_no_sense_is_one_line(line: str, reason: str, flat: Vehicle, tmp_path: Path) -> None:
    assert flat.path
    path = tmp_path / "wrong.toml"
    text = flat.path.read_text(encoding="utf-8")
    path.write_text(text.replace("[validity.identified]", f"[validity.identified]\n{line} #", 1), encoding="utf-8")
    kept = [row for row in path.read_text(encoding="utf-8").splitlines() if not row.startswith("u = { range = [0.2")]
    path.write_text("\n".join(kept), encoding="utf-8")
    with pytest.raises(VehicleFileError) as error:
        load_vehicle(path)
    assert str(error.value).startswith(f"{path}: validity.identified")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_the_vehicles_that_ship_keep_their_variables() -> None:
    assert not [name for name in SHIPPED if load_vehicle(SHIPPED[name]).layout.outside]
