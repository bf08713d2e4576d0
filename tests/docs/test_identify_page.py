"""What the page about identification prints as an example works."""

import re
from pathlib import Path

import pytest

from rov_fmu.identify.identify import identify
from tests.folders import FORCE, RATE, SPEED, TAU, read

PAGE = Path(__file__).parents[2] / "docs" / "identify.md"


def test_the_complete_rov_toml_makes_a_vehicle(tmp_path: Path) -> None:
    (example,) = re.findall(r'```toml\n(\[vehicle\]\nname = "Tadpole".*?)```', PAGE.read_text("utf-8"), re.DOTALL)
    levels = (0.2, 0.4, 0.6, 0.8)
    of_level = {
        "thrust_rear": (FORCE, [31.0 * c * c + c for c in levels]),
        "thrust_top": (FORCE, [9.0 * c * c + c for c in levels]),
        "steady_surge": (SPEED, [1.1 * c for c in levels]),
        "steady_heave": (SPEED, [0.4 * c for c in levels]),
        "steady_yaw": (RATE, [1.3 * c for c in levels]),
        "time_constant_surge": (TAU, [0.6 / c for c in levels]),
    }
    tables = {
        f"{name}.csv": "\n".join([header, *(f"{c},{value:.6f}" for c, value in zip(levels, values, strict=True)), ""])
        for name, (header, values) in of_level.items()
    }
    found = identify(read(tmp_path, example, tables))
    assert [result.axis.name for result in found.axes] == ["surge", "heave", "yaw"]
    assert found.vehicle.rov["m_rov"] == 8.2
    assert found.vehicle.layout.drivers(found.axes[2].axis)


def test_the_inertia_of_the_example_is_right() -> None:
    words = (
        r"a vehicle of ([\d.]+) kg gets β = ([\d.]+), it moves like\s+([\d.]+) kg, of which ([\d.]+) kg are added mass"
    )
    (numbers,) = re.findall(words, PAGE.read_text("utf-8"))
    mass, beta, total, added = map(float, numbers)
    assert total == pytest.approx(mass / beta, abs=0.06)
    assert added == pytest.approx(mass * (1.0 / beta - 1.0), abs=0.06)
