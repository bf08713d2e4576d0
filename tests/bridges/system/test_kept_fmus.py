"""A system takes the FMU of a vehicle from the cache while nothing has changed that it follows from."""

from pathlib import Path
from shutil import copytree
from typing import Any

import pytest

from rov_fmu.bridges.system import system
from rov_fmu.bridges.system.plan import load_system_plan
from rov_fmu.vehicle.shipped import SHIPPED
from tests.bridges.system.fmus import undescribed_build

PLAN = """step = 0.1
stop_time = 1.0
[component.rov]
vehicle = "videoray.toml"
"""


def test_an_fmu_is_built_again_only_for_another_vehicle_or_where_it_is_damaged(
    tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    builds = list[Path]()

    def build(vehicle: Any, path: Path, **options: Any) -> Any:
        builds.append(path)
        return undescribed_build(vehicle, path, **options)

    def content() -> bytes:
        plan = tmp_path / "plan.toml"
        plan.write_text(PLAN)
        return system.made(load_system_plan(plan), plan).parts["rov"].content

    monkeypatch.setattr(system, "build_fmu", build)
    text = SHIPPED["videoray"].read_text()
    copytree(SHIPPED["videoray"].parent, tmp_path, dirs_exist_ok=True)
    rov = tmp_path / "videoray.toml"
    first = content()
    assert content() == first
    assert len(builds) == 1
    rov.write_text(text.replace("value = 6.57", "value = 6.58"))
    assert content() != first
    assert len(builds) == 2
    rov.write_text(text)
    for file in (fmus / "fmu").iterdir():
        file.write_bytes(b"damaged")
    assert content() == first
    assert len(builds) == 3
